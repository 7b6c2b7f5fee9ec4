//! `priority` of an upload.

use crate::wire::job_fields::PriorityField;
use crate::wire::problem::{Answer, Problem, shorten};
use serde::Deserialize;
use utoipa::IntoParams;
use ventriform_service::base::records::Priority;

/// The priority of a job that is filed with an upload.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct PriorityQuery {
    /// How urgent the job is
    #[param(value_type = Option<PriorityField>, inline)]
    priority: Option<String>,
}

impl PriorityQuery {
    /// The priority of the job.
    ///
    /// # Errors
    /// 422 if there is no such priority.
    pub fn priority(&self) -> Answer<Priority> {
        let given = self.priority.as_deref();
        given.map_or(Ok(Priority::default()), parse)
    }
}

/// # Errors
/// 422 if there is no such priority.
fn parse(name: &str) -> Answer<Priority> {
    Priority::parse(name).ok_or_else(|| {
        let known = Priority::ALL.map(Priority::as_str).join(", ");
        let what = format!("There is no priority `{}`.", shorten(name));
        Problem::invalid_field("priority", what).fix(format!("Give one of {known}."))
    })
}
