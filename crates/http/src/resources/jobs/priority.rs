//! `priority` of a request for a job.

use crate::openapi::PriorityField;
use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::request::text;
use serde::Deserialize;
use serde_json::{Map, Value};
use utoipa::IntoParams;
use ventriform_service::base::records::Priority;

/// The field of a JSON object.
pub const PRIORITY_FIELD: &str = "priority";

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

/// The priority of a JSON object that may have other fields.
///
/// # Errors
/// 422 if there is no such priority.
pub fn of_object(object: &Map<String, Value>) -> Answer<Priority> {
    text(object, PRIORITY_FIELD)?.map_or(Ok(Priority::default()), parse)
}

/// # Errors
/// 422 if there is no such priority.
fn parse(name: &str) -> Answer<Priority> {
    Priority::parse(name).ok_or_else(|| {
        let known = Priority::ALL.map(Priority::as_str).join(", ");
        let what = format!("There is no priority `{}`.", shorten(name));
        Problem::invalid_field(PRIORITY_FIELD, what).fix(format!("Give one of {known}."))
    })
}
