//! `/v1/volumes/{id}/hold`: legal holds. A volume on hold, and what was made of it, is erased
//! neither by request nor by age.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, LookupProblems};
use crate::resources::collection::find;
use crate::resources::volumes::{LegalHoldBody, Volumes};
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::NoQuery;
use crate::wire::request::{PathSegments, json_object, unknown};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::StatusCode;
use serde_json::Value;
use ventriform::base::text::is_printable;
use ventriform_service::base::records::LegalHold;

/// Put a volume on legal hold
///
/// Neither the volume nor what was made of it can be erased from then on, by request or by age.
/// Needs the scope `admin`. A second hold replaces the first one.
#[utoipa::path(put, path = "/v1/volumes/{id}/hold", tag = "volumes", operation_id = "hold_volume",
    params(("id" = String, Path, description = "The volume's id")),
    request_body(content = openapi::HoldRequest, content_type = "application/json"),
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
    let object = json_object(&app, request).await?;
    if let Some(name) = object.keys().find(|name| *name != "reason") {
        return Err(unknown("field", name, &["reason"]));
    }
    let hold = LegalHold {
        reason: reason(object.get("reason"))?,
        since: app.service.now(),
        by: caller.name.clone(),
    };
    set(&app, &caller, &id, Some(hold.clone())).await?;
    Ok(Json(LegalHoldBody::new(hold, caller.scope)))
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
    set(&app, &caller, &id, None).await?;
    Ok(StatusCode::NO_CONTENT)
}

async fn set(app: &App, caller: &Caller, id: &str, hold: Option<LegalHold>) -> Answer<()> {
    let (items, tenant) = (app.service.items().clone(), caller.tenant.clone());
    let volume = id.to_owned();
    let set = async move {
        let catalogue = items.catalogue();
        catalogue
            .set_legal_hold(&tenant, &volume, hold.as_ref())
            .await
    };
    if caller.by.change(set).await? {
        Ok(())
    } else {
        find::<Volumes>(app, &caller.tenant, id).await.map(|_| ())
    }
}

fn reason(value: Option<&Value>) -> Answer<String> {
    let text = value.and_then(Value::as_str).unwrap_or_default().trim();
    let control = |c: char| !is_printable(c) && c != '\n';
    if (1..=LegalHold::REASON_LENGTH).contains(&text.chars().count()) && !text.contains(control) {
        Ok(text.to_owned())
    } else {
        Err(Problem::invalid_field(
            "reason",
            format!(
                "`reason` must be a text of 1 to {} printable characters.",
                LegalHold::REASON_LENGTH
            ),
        )
        .fix("Say why the volume must be kept, such as the number of a case."))
    }
}
