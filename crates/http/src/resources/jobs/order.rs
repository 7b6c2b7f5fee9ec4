//! The order of a job, from the fields that every request for one may have.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::wire::idempotency;
use crate::wire::job_fields::{OrderFields, TagFields};
use crate::wire::problem::Answer;
use crate::wire::webhook_request::WebhookRequest;
use axum::http::HeaderMap;
use ventriform_service::base::records::Tags;
use ventriform_service::use_cases::filing::JobOrder;

impl OrderFields {
    /// The order of a job, and its webhook, which is to be checked last: looking up the name of its host may take
    /// seconds.
    ///
    /// # Errors
    /// 400 for an unusable idempotency key, 422 for an unusable name.
    pub fn order(
        self,
        app: &App,
        caller: &Caller,
        headers: &HeaderMap,
        trace_parent: Option<String>,
    ) -> Answer<(JobOrder, Option<WebhookRequest>)> {
        let tags = TagFields {
            external_id: self.external_id,
            labels: self.labels,
        };
        let order = JobOrder {
            tags: tags.merged(app, Tags::default())?,
            priority: self.priority.map(|word| word.0).unwrap_or_default(),
            key: idempotency::key(headers)?,
            trace_parent,
            ..JobOrder::new(caller.by.clone(), caller.tenant.clone(), caller.quota)
        };
        Ok((order, self.webhook))
    }
}
