//! How ids and times are written in answers.

use crate::jobs::{Resource, Timestamp};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

/// A time in UTC as RFC 3339 writes it, with milliseconds.
pub fn rfc3339(at: Timestamp) -> String {
    OffsetDateTime::from_unix_timestamp_nanos(i128::from(at) * 1_000_000)
        .ok()
        .and_then(|time| time.format(&Rfc3339).ok())
        .unwrap_or_default()
}

/// The path of the thing that has that id.
pub fn path_of(id: &str) -> String {
    let resource = Resource::of(id).unwrap_or(Resource::Job);
    format!("/v1/{}/{id}", resource.plural())
}
