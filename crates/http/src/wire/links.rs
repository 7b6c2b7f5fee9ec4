//! Ids and times as answers write them, and the answer that something was added.

use crate::wire::public_base::public_path;
use axum::Json;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use ventriform_service::base::records::Resource;
pub use ventriform_service::base::records::rfc3339;

/// The path of the thing that has that id.
pub fn path_of(id: &str) -> String {
    let resource = Resource::from_id(id).unwrap_or(Resource::Job);
    public_path(&format!("/v1/{}/{id}", resource.plural()))
}

/// 201 if the thing of that id is new, 200 if it was there already; with its path.
pub fn added(new: bool, id: &str, body: impl Serialize) -> Response {
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    (status, [(header::LOCATION, path_of(id))], Json(body)).into_response()
}
