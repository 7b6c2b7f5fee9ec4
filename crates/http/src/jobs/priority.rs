//! `priority` of a request for a job, and of a search for jobs.

use crate::problem::{Answer, Problem, shorten};
use crate::request::text;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use ventriform_service::records::Priority;

/// The parameter of a query string or form, and the field of a JSON object.
pub const FIELD: &str = "priority";

/// How urgent a job is.
#[derive(Serialize, ToSchema)]
#[schema(as = Priority)]
#[serde(rename_all = "snake_case")]
pub enum PriorityName {
    /// It starts before every job of another priority.
    Urgent,
    /// The usual one.
    Routine,
    /// It starts when nothing else waits.
    Bulk,
}

impl From<Priority> for PriorityName {
    fn from(priority: Priority) -> Self {
        match priority {
            Priority::Urgent => PriorityName::Urgent,
            Priority::Routine => PriorityName::Routine,
            Priority::Bulk => PriorityName::Bulk,
        }
    }
}

/// Takes the priority out of the pairs of a query string or form; the last one counts.
///
/// # Errors
/// 422 if there is no such priority.
pub fn take(pairs: &mut Vec<(String, String)>) -> Answer<Priority> {
    let mut given = Ok(Priority::default());
    pairs.retain(|(name, value)| {
        let own = name == FIELD;
        if own && given.is_ok() {
            given = parse(value);
        }
        !own
    });
    given
}

/// The priority of a JSON object that may have other fields.
///
/// # Errors
/// 422 if there is no such priority.
pub fn of_object(object: &Map<String, Value>) -> Answer<Priority> {
    text(object, FIELD)?.map_or(Ok(Priority::default()), parse)
}

/// # Errors
/// 422 if there is no such priority.
pub fn parse(name: &str) -> Answer<Priority> {
    Priority::parse(name).ok_or_else(|| {
        let known = Priority::ALL.map(Priority::as_str).join(", ");
        let what = format!("There is no priority `{}`.", shorten(name));
        Problem::invalid_field(FIELD, what).fix(format!("Give one of {known}."))
    })
}
