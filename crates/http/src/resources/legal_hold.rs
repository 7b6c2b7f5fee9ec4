//! `/v1/volumes/{id}/hold`: legal holds. A volume on hold, and what was made of it, is erased
//! neither by request nor by age.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, LookupProblems};
use crate::resources::collection::find;
use crate::resources::volumes::{LegalHoldBody, Volumes};
use crate::wire::fields::{FieldReader, given};
use crate::wire::problem::Answer;
use crate::wire::problem::not_found::missing;
use crate::wire::query::NoQuery;
use crate::wire::request::PathSegments;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::ToSchema;
use ventriform_service::base::records::{LegalHold, Resource};

/// Why a volume is put on legal hold.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct HoldRequest {
    /// Why the volume must be kept
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        min_length = 1,
        max_length = 1000,
        examples("Case 17/2026")
    )]
    reason: Option<String>,
}

const _: () = assert!(LegalHold::REASON_LENGTH == 1000, "the document says 1000");

/// Put a volume on legal hold
///
/// Neither the volume nor what was made of it can be erased from then on, by request or by age.
/// Needs the scope `admin`. A second hold replaces the first one.
#[utoipa::path(put, path = "/v1/volumes/{id}/hold", tag = "volumes", operation_id = "hold_volume",
    params(("id" = String, Path, description = "The volume's id")),
    request_body(content = HoldRequest, content_type = "application/json"),
    responses((status = 200, description = "The hold", body = LegalHoldBody),
        openapi::HoldProblems, LookupProblems))]
pub async fn hold_volume(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer<Json<LegalHoldBody>> {
    find::<Volumes>(&app, &caller.tenant, &id).await?;
    let reason = FieldReader::read(&app, request)
        .await?
        .all::<HoldRequest>()?
        .reason;
    let reason = reason.as_deref().unwrap_or_default();
    match app.service.hold_volume(&caller.by, &id, reason).await? {
        Some(hold) => Ok(Json(LegalHoldBody::new(hold, caller.scope))),
        None => Err(missing(&app, &caller.tenant, Resource::Volume, &id).await),
    }
}

/// Lift the legal hold of a volume
///
/// Needs the scope `admin`. Succeeds also if there is no hold.
#[utoipa::path(delete, path = "/v1/volumes/{id}/hold", tag = "volumes",
    operation_id = "release_volume",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 204, description = "There is no hold any more"),
        openapi::ScopeProblems, LookupProblems))]
pub async fn release_volume(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
) -> Answer<StatusCode> {
    find::<Volumes>(&app, &caller.tenant, &id).await?;
    match app.service.release_volume(&caller.by, &id).await? {
        true => Ok(StatusCode::NO_CONTENT),
        false => Err(missing(&app, &caller.tenant, Resource::Volume, &id).await),
    }
}
