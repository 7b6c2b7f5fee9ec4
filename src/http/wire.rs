//! Shapes that several resources share.

use super::problem::Problem;
use crate::jobs::{Catalogue, Resource, Timestamp};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;

/// A time as RFC 3339 in UTC, with milliseconds.
pub fn rfc3339(at: Timestamp) -> String {
    OffsetDateTime::from_unix_timestamp_nanos(i128::from(at) * 1_000_000)
        .ok()
        .and_then(|time| time.format(&Rfc3339).ok())
        .unwrap_or_default()
}

/// The path of the thing of that id.
pub fn path_of(id: &str) -> String {
    let resource = Resource::of(id).unwrap_or(Resource::Job);
    format!("/v1/{}/{id}", resource.plural())
}

/// 410 for what was erased, 404 for what never was.
pub async fn missing(catalogue: &dyn Catalogue, resource: Resource, id: &str) -> Problem {
    let what = resource.noun();
    match catalogue.erased_at(id).await {
        _ if Resource::of(id) != Some(resource) => Problem::not_found(what, id),
        Ok(None) => Problem::not_found(what, id),
        Ok(Some(at)) => Problem::new(
            axum::http::StatusCode::GONE,
            "gone",
            format!("The {what} `{id}` was erased at {}.", rfc3339(at)),
        )
        .fix("The same volume and parameters make it again."),
        Err(error) => error.into(),
    }
}
