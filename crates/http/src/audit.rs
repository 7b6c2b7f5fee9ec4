//! `GET /v1/audit`: the audit trail of the caller's tenant, for callers with the scope `admin`.

use super::app::App;
use super::caller::Caller;
use super::openapi::{ListProblems, PageParameters};
use super::pagination::{list_query, next_cursor};
use super::problem::{Answer, Problem};
use axum::Json;
use axum::extract::{RawQuery, State};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;
use ventriform_service::access::{AuditFilter, fhir};
use ventriform_service::records::{Timestamp, parse_rfc3339};

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

/// Read the audit trail
///
/// Who did what to which item, and when. Reads of the same item by the same caller within one
/// second are one event with a count.
#[utoipa::path(get, path = "/v1/audit", tag = "access", operation_id = "list_audit_events",
    params(PageParameters,
        ("agent" = Option<String>, Query, description = "Only what this caller did"),
        ("object" = Option<String>, Query, description = "Only what concerns the item with this id"),
        ("since" = Option<String>, Query, description = "Only from this time on (RFC 3339)"),
        ("until" = Option<String>, Query, description = "Only before this time (RFC 3339)")),
    responses((status = 200, description = "A page, newest first", body = AuditPage), ListProblems))]
pub async fn list_audit_events(
    State(app): State<App>,
    caller: Caller,
    RawQuery(query): RawQuery,
) -> Answer<Json<AuditPage>> {
    let names = ["agent", "object", "since", "until"];
    let (page, [agent, object, since, until]) = list_query(query.as_deref(), names).await?;
    let filter = AuditFilter {
        tenant: Some(caller.tenant),
        agent,
        object,
        since: since.map(|text| time("since", &text)).transpose()?,
        until: until.map(|text| time("until", &text)).transpose()?,
    };
    // What was noted within the last second belongs to the answer.
    app.service.recorder.flush().await;
    let page = app.service.access.audit(&filter, page).await?;
    let next_cursor = next_cursor(&page);
    let events = page.items.iter().map(fhir).collect();
    Ok(Json(AuditPage {
        events,
        next_cursor,
    }))
}

fn time(field: &str, text: &str) -> Answer<Timestamp> {
    parse_rfc3339(text).ok_or_else(|| {
        Problem::bad_request("invalid-parameter", format!("`{field}` is no time."))
            .at(field)
            .fix("Give a time such as 2026-11-22T00:00:00Z.")
    })
}
