//! `GET /v1/audit`: the audit trail of the caller's tenant, for callers with the scope `admin`.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::ListProblems;
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::Answer;
use crate::wire::query::{Moment, Query};
use axum::Json;
use axum::extract::State;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::{IntoParams, ToSchema};
use ventriform_service::callers::{AuditFilter, fhir};

/// A page of the audit trail.
#[derive(Serialize, ToSchema)]
pub struct AuditPage {
    /// The events, newest first: AuditEvent resources of FHIR R4.
    #[schema(value_type = Vec<Object>)]
    events: Vec<Value>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

/// A search of the audit trail.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct AuditQuery {
    /// Only what this caller did
    agent: Option<String>,
    /// Only what concerns the item with this id
    object: Option<String>,
    /// Only from this time on (RFC 3339)
    #[param(value_type = Option<String>)]
    since: Option<Moment>,
    /// Only before this time (RFC 3339)
    #[param(value_type = Option<String>)]
    until: Option<Moment>,
}

/// Read the audit trail
///
/// Who did what to which item, and when. Reads of the same item by the same caller within one
/// second are one event with a count.
#[utoipa::path(get, path = "/v1/audit", tag = "access", operation_id = "list_audit_events",
    params(PageQuery, AuditQuery),
    responses((status = 200, description = "A page, newest first", body = AuditPage), ListProblems))]
pub async fn list_audit_events(
    State(app): State<App>,
    caller: Caller,
    Query((page, search)): Query<(PageQuery, AuditQuery)>,
) -> Answer<Json<AuditPage>> {
    let page = page.charged().await?;
    let filter = AuditFilter {
        tenant: Some(caller.tenant),
        agent: search.agent,
        object: search.object,
        since: search.since.map(|moment| moment.0),
        until: search.until.map(|moment| moment.0),
    };
    let page = app.service.audit_trail(&filter, page).await?;
    let next_cursor = next_cursor(&page);
    let events = page.items.iter().map(fhir).collect();
    Ok(Json(AuditPage {
        events,
        next_cursor,
    }))
}
