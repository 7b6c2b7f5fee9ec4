//! Quotas of a tenant on stored bytes and waiting jobs.
//!
//! A request that would add to them is counted here until it is answered; from then on the
//! database counts what it added. The request is counted first and the database is read after, so
//! requests that come together cannot exceed a quota together. At the limit they may be refused
//! although one of them would have fitted.
//!
//! An upload of unknown length counts as the largest upload while it is under way. A request that
//! waits for its job counts as a waiting job.

use super::reservations::Reservation;
use crate::access::{Quota, Usage};
use crate::http::app::App;
use crate::http::idempotency;
use crate::http::problem::{Answer, Problem};
use crate::jobs::Tenant;
use axum::http::request::Parts;
use axum::http::{Method, StatusCode, header};

/// Reserves what the request may add, if the tenant has quotas.
///
/// # Errors
/// 429 if too many jobs wait, 507 if the upload has no room.
pub async fn reserve(
    app: &App,
    request: &Parts,
    tenant: &Tenant,
    quota: Quota,
) -> Answer<Option<Reservation>> {
    let amount = amount(app, request);
    let wanted =
        (amount.jobs > 0 && quota.jobs.is_some()) || (amount.bytes > 0 && quota.bytes.is_some());
    if !wanted {
        return Ok(None);
    }
    let (reservation, reserved) = app.guard.reservations.add(tenant, amount);
    let used = app.access.usage(tenant).await?;
    let over = |used: u64, reserved: u64, quota: Option<u64>| {
        quota.is_some_and(|quota| used.saturating_add(reserved) > quota)
    };
    if amount.bytes > 0 && over(used.bytes, reserved.bytes, quota.bytes) {
        return Err(storage_full(used.bytes, quota.bytes.unwrap_or_default()));
    }
    if amount.jobs > 0 && over(used.jobs, reserved.jobs, quota.jobs) {
        // A retry of an accepted request files nothing.
        let key = idempotency::key(&request.headers)?;
        let accepted = match key {
            Some(key) => app.access.is_filed(tenant, &key).await?,
            None => false,
        };
        if !accepted {
            return Err(too_many_jobs(quota.jobs.unwrap_or_default()));
        }
    }
    Ok(Some(reservation))
}

/// What the request may add.
fn amount(app: &App, request: &Parts) -> Usage {
    if request.method != Method::POST {
        return Usage::default();
    }
    let length = request.headers.get(header::CONTENT_LENGTH);
    let length = length.and_then(|length| length.to_str().ok()?.parse().ok());
    let largest = app.settings.body_limit.0;
    let bytes = length.unwrap_or(largest).min(largest);
    match request.uri.path() {
        "/v1/volumes" => Usage { bytes, jobs: 0 },
        "/v1/models" | "/v1/segmentations" => Usage { bytes, jobs: 1 },
        "/v1/jobs" => Usage { bytes: 0, jobs: 1 },
        path if path.starts_with("/dicom-web/studies") => Usage { bytes, jobs: 0 },
        _ => Usage::default(),
    }
}

fn storage_full(used: u64, quota: u64) -> Problem {
    Problem::new(
        StatusCode::INSUFFICIENT_STORAGE,
        "storage-quota",
        format!("This tenant stores {used} of the {quota} bytes that it may store, and the upload does not fit."),
    )
    .fix("DELETE volumes that are no longer needed, or ask the operator for more.")
}

fn too_many_jobs(quota: u64) -> Problem {
    Problem::new(
        StatusCode::TOO_MANY_REQUESTS,
        "job-quota",
        format!("This tenant has as many waiting jobs as it may have ({quota})."),
    )
    .fix("Try again after the number of seconds in Retry-After.")
    .header(header::RETRY_AFTER, "5")
}
