//! How ids and times are written in answers.

use crate::jobs::Resource;
pub use crate::jobs::rfc3339;

/// The path of the thing that has that id.
pub fn path_of(id: &str) -> String {
    let resource = Resource::of(id).unwrap_or(Resource::Job);
    format!("/v1/{}/{id}", resource.plural())
}
