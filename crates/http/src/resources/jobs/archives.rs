//! The fields `source`, `send` and `to` of a job: the series that its volume comes from, and the objects of its result
//! that are sent to an archive.

use crate::app::App;
use crate::wire::job_fields::{SendFields, SourceRequest};
use crate::wire::problem::Answer;
use ventriform_service::base::records::{SendOrder, SeriesSource, Tenant};
use ventriform_service::use_cases::series::GivenSeries;

impl SourceRequest {
    /// The series, which can be fetched.
    ///
    /// # Errors
    /// 422 that names the part which cannot be used.
    pub async fn checked(&self, app: &App, tenant: &Tenant) -> Answer<SeriesSource> {
        let given = GivenSeries {
            archive: self.archive.as_deref(),
            dicomweb: self.dicomweb.as_deref(),
            study: self.study.as_deref(),
            series: self.series.as_deref(),
        };
        let source = app.service.series_source(tenant, given).await;
        Ok(source.map_err(|failure| failure.within("source"))?)
    }
}

impl SendFields {
    /// The order of a job of that kind, from `source`.
    ///
    /// # Errors
    /// 422 that names the field which cannot be used.
    pub fn order(
        self,
        app: &App,
        tenant: &Tenant,
        kind: &str,
        source: Option<&SeriesSource>,
    ) -> Answer<Option<SendOrder>> {
        let to = self.to.as_deref();
        let order = app.service.send_order(tenant, kind, self.send, to, source);
        Ok(order?)
    }
}
