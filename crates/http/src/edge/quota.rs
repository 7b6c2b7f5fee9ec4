//! Reservations of requests under their tenant's quotas, before their bodies are read.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::wire::idempotency;
use crate::wire::problem::Answer;
use crate::wire::upload::announced_length;
use axum::http::HeaderMap;
use ventriform_service::limits::quotas::{Addition, Counting};

/// Reserves a request that stores its body, and files `jobs` jobs.
///
/// # Errors
/// 429 if too many jobs wait, 507 if the announced length of the body has no room.
pub async fn reserve_upload(
    app: &App,
    caller: &Caller,
    headers: &HeaderMap,
    jobs: u64,
) -> Answer<Counting> {
    // A longer one is refused anyway.
    let announced = announced_length(headers).min(app.service.settings().body_limit.0);
    let addition = Addition {
        jobs,
        ..Addition::bytes(announced)
    };
    reserve(app, caller, headers, addition).await
}

/// Reserves a request that stores something of another size than its body.
///
/// # Errors
/// 507 if the tenant's quota is full.
pub async fn reserve_item(app: &App, caller: &Caller, headers: &HeaderMap) -> Answer<Counting> {
    reserve(app, caller, headers, Addition::bytes(0)).await
}

/// Reserves a request that files a job on what is stored.
///
/// # Errors
/// 429 if too many jobs wait, 507 if the tenant's quota of bytes is full.
pub async fn reserve_job(app: &App, caller: &Caller, headers: &HeaderMap) -> Answer<Counting> {
    reserve(app, caller, headers, Addition::ONE_JOB).await
}

async fn reserve(
    app: &App,
    caller: &Caller,
    headers: &HeaderMap,
    addition: Addition,
) -> Answer<Counting> {
    let key = idempotency::key(headers)?;
    let quotas = app.service.quotas();
    let reserved = quotas.reserve(&caller.tenant, caller.quota, addition, key.as_deref());
    Ok(reserved.await?)
}
