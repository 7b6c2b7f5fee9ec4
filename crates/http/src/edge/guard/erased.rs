//! Reads beside an erasure.
//!
//! Rows are erased before files, so a request that has found the row may not find the files, wherever it looks for
//! them. Its answer then says that the item is gone, as it would have a moment later.

use crate::app::App;
use crate::wire::problem::Problem;
use crate::wire::problem::not_found::missing;
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use serde_json::Value;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{Resource, Tenant};
use ventriform_service::use_cases::results::volume_erased;

/// The answer of a request on the item `id`, or why the service could not answer: 410 if the item was erased meanwhile,
/// 409 if a volume was that it is made of.
pub async fn settled(app: &App, tenant: &Tenant, id: Option<&str>, response: Response) -> Response {
    if response.status() != StatusCode::INTERNAL_SERVER_ERROR {
        return response;
    }
    let Some((id, kind)) = id.and_then(|id| Some((id, Resource::from_id(id)?))) else {
        return response;
    };
    match instead(app, tenant, id, kind).await {
        Ok(Some(problem)) => {
            tracing::info!(
                item = id,
                "the internal error is that of a read beside an erasure"
            );
            problem.into_response()
        }
        // It failed for another reason.
        Ok(None) | Err(_) => response,
    }
}

async fn instead(
    app: &App,
    tenant: &Tenant,
    id: &str,
    kind: Resource,
) -> Result<Option<Problem>, ServiceError> {
    let service = &app.service;
    if service.erased_at(tenant, id).await?.is_some() {
        return Ok(Some(missing(app, tenant, kind, id).await));
    }
    let Some(product) = service.product(tenant, id).await? else {
        return Ok(None);
    };
    let given = product.parameters.values().filter_map(Value::as_str);
    let volumes = product.volume.as_deref().into_iter().chain(given);
    for volume in volumes.filter(|id| Resource::from_id(id) == Some(Resource::Volume)) {
        if service.erased_at(tenant, volume).await?.is_some() {
            return Ok(Some(volume_erased(id).into()));
        }
    }
    Ok(None)
}
