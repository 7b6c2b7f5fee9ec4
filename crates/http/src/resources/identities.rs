//! `/v1/volumes/{id}/identity`: whose scan a volume is, read, stated and erased.
//!
//! A caller states it in a body, so that it is in no path and no log.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, LookupProblems};
use crate::resources::collection::find;
use crate::resources::erasures::on_hold;
use crate::resources::volumes::Volumes;
use crate::wire::problem::Answer;
use crate::wire::query::NoQuery;
use crate::wire::request::{PathSegments, json_object};
use crate::wire::validators::json;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use serde_json::{Map, Value};

/// Whose scan a volume is
///
/// All that its file says of patient, study, series, instances and acquisition, completed by what
/// was stated. Needs the scope `submit`.
#[utoipa::path(get, path = "/v1/volumes/{id}/identity", tag = "volumes",
    operation_id = "get_volume_identity",
    params(("id" = String, Path, description = "The volume's id"), openapi::CachedHeaders),
    responses((status = 200, description = "What is known", body = ventriform::image::volume::Provenance),
        openapi::UnchangedAnswer, openapi::ScopeProblems, LookupProblems))]
pub async fn get_identity(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    json(&headers, &volume.ownership.scan.whole())
}

/// State whose scan a volume is
///
/// For a volume whose file does not say it, such as NIfTI: its results can then be had as DICOM
/// objects. Of a DICOM file, what its header lacks can be stated; a value that differs from the
/// header is refused. What was stated before is replaced. Needs the scope `submit`.
#[utoipa::path(put, path = "/v1/volumes/{id}/identity", tag = "volumes",
    operation_id = "state_volume_identity",
    params(("id" = String, Path, description = "The volume's id")),
    request_body(content = openapi::StatedScanSchema, content_type = "application/json"),
    responses((status = 200, description = "What is known now", body = ventriform::image::volume::Provenance),
        openapi::IdentityProblems, LookupProblems))]
pub async fn state_identity(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer<Json<Map<String, Value>>> {
    let stated = json_object(&app, request).await?;
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    let service = &app.service;
    let state = service.state_scan(&caller.by, &id, &volume.files, stated);
    state.await?;
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    Ok(Json(volume.ownership.scan.whole()))
}

/// Erase whose scan a volume is
///
/// The volume and what was made of it stay; so does the uploaded file, whatever its header says.
/// It is not read again until the file is uploaded again. Refused while a legal hold keeps the
/// volume. Needs the scope `submit`.
#[utoipa::path(delete, path = "/v1/volumes/{id}/identity", tag = "volumes",
    operation_id = "delete_volume_identity",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 204, description = "Nothing is known any more"),
        openapi::ScopeProblems, openapi::EraseProblems, LookupProblems))]
pub async fn erase_identity(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
) -> Answer<StatusCode> {
    find::<Volumes>(&app, &caller.tenant, &id).await?;
    if app.service.erase_scan(&caller.by, &id).await? {
        return Ok(StatusCode::NO_CONTENT);
    }
    // It was erased after it was looked up, or it is on hold.
    find::<Volumes>(&app, &caller.tenant, &id).await?;
    Err(on_hold(&id, "identity"))
}
