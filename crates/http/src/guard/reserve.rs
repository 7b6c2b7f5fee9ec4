//! Quotas of a tenant on stored bytes and waiting jobs.
//!
//! A request that would add to them is counted here until it is answered; from then on the
//! database counts what it added. The request is counted first and the database is read after, so
//! requests that come together cannot exceed a quota together. At the limit they may be refused
//! although one of them would have fitted.
//!
//! The announced length of an upload counts from its beginning; what comes without being announced
//! counts as it comes ([`Counting::arrived`]), so uploads of unknown length have room under any quota. A
//! request that waits for its job counts as a waiting job.

use super::reservations::Reservation;
use crate::app::App;
use crate::caller::Caller;
use crate::idempotency;
use crate::problem::{Answer, Problem};
use axum::extract::Request;
use axum::http::request::Parts;
use axum::http::{Method, StatusCode, header};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use ventriform_service::access::Usage;
use ventriform_service::records::Tenant;

/// Bytes that the record of a job counts at least; see the migrations of the jobs table.
const JOB_RECORD: u64 = 2048;

/// What a request adds, as it comes.
#[derive(Clone, Default)]
pub struct Counting(Option<Arc<Counted>>);

struct Counted {
    app: App,
    quota: u64,
    state: Mutex<State>,
}

struct State {
    reservation: Reservation,
    /// Bytes that have come, and of those the ones that were announced.
    arrived: u64,
    announced: u64,
    /// What the tenant stored when that was asked last.
    used: u64,
}

impl Counting {
    /// That of a request.
    pub fn of(request: &Request) -> Self {
        request.extensions().get().cloned().unwrap_or_default()
    }

    /// Counts bytes that have come, or that are about to be stored.
    ///
    /// # Errors
    /// 507 if the tenant's quota has no room for them.
    pub async fn arrived(&self, bytes: u64) -> Answer<()> {
        let Some(counted) = &self.0 else {
            return Ok(());
        };
        let exceeded = {
            let mut state = counted.state();
            state.arrived = state.arrived.saturating_add(bytes);
            let beyond = state.arrived.saturating_sub(state.announced);
            if beyond == 0 {
                return Ok(());
            }
            state.announced += beyond;
            let reserved = state.reservation.grow(beyond);
            state.used.saturating_add(reserved.bytes) > counted.quota
        };
        match exceeded {
            // Something may have been erased meanwhile.
            true => self.settle().await,
            false => Ok(()),
        }
    }

    /// Compares what has come with what the tenant stores now; to be called before it is stored.
    ///
    /// # Errors
    /// 507 if the tenant's quota has no room for it.
    pub async fn settle(&self) -> Answer<()> {
        let Some(counted) = &self.0 else {
            return Ok(());
        };
        let tenant = counted.state().reservation.tenant().clone();
        let used = counted.app.access.usage(&tenant).await?.bytes;
        let mut state = counted.state();
        state.used = used;
        let reserved = state.reservation.sum();
        match used.saturating_add(reserved.bytes) > counted.quota {
            true => Err(storage_full(used, counted.quota)),
            false => Ok(()),
        }
    }

    /// What has come is stored: the database counts it from now on.
    pub fn stored(&self) {
        if let Some(counted) = &self.0 {
            counted.state().reservation.stored();
        }
    }
}

impl Counted {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave it half changed: each change is a few plain statements.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Reserves what the request may add, if the tenant has quotas.
///
/// # Errors
/// 429 if too many jobs wait, 507 if the upload has no room.
pub async fn reserve(app: &App, request: &Parts, caller: &Caller) -> Answer<Counting> {
    let (tenant, quota) = (&caller.tenant, caller.quota);
    let adds = Adds::of(app, request);
    let wanted = (adds.jobs > 0 && quota.jobs.is_some()) || (adds.stores && quota.bytes.is_some());
    if !wanted {
        return Ok(Counting::default());
    }
    let amount = Usage {
        bytes: adds.announced + adds.jobs * JOB_RECORD,
        jobs: adds.jobs,
    };
    let (reservation, reserved) = app.guard.reservations.add(tenant, amount);
    let used = app.access.usage(tenant).await?;
    let bytes = quota.bytes.filter(|_| adds.stores);
    let is_full = bytes.is_some_and(|quota| used.bytes.saturating_add(reserved.bytes) > quota);
    let too_many = quota
        .jobs
        .is_some_and(|quota| adds.jobs > 0 && used.jobs.saturating_add(reserved.jobs) > quota);
    if (is_full || too_many) && !is_retry(app, request, tenant).await? {
        return Err(match (too_many, quota.jobs) {
            (true, Some(quota)) => too_many_jobs(quota),
            _ => storage_full(used.bytes, bytes.unwrap_or_default()),
        });
    }
    let state = State {
        reservation,
        arrived: 0,
        announced: adds.announced,
        used: used.bytes,
    };
    Ok(Counting(Some(Arc::new(Counted {
        app: app.clone(),
        quota: bytes.unwrap_or(u64::MAX),
        state: Mutex::new(state),
    }))))
}

/// Whether it is a retry of an accepted request, which adds nothing.
async fn is_retry(app: &App, request: &Parts, tenant: &Tenant) -> Answer<bool> {
    match idempotency::key(&request.headers)? {
        Some(key) => Ok(app.access.is_filed(tenant, &key).await?),
        None => Ok(false),
    }
}

/// What a request may add.
struct Adds {
    jobs: u64,
    /// Whether it may add bytes.
    stores: bool,
    /// How many it announces.
    announced: u64,
}

impl Adds {
    fn of(app: &App, request: &Parts) -> Self {
        let length = request.headers.get(header::CONTENT_LENGTH);
        let length: Option<u64> = length.and_then(|length| length.to_str().ok()?.parse().ok());
        // A longer one is refused anyway.
        let announced = length.unwrap_or(0).min(app.settings.body_limit.0);
        let adds = |jobs, stores, announced| Self {
            jobs,
            stores,
            announced,
        };
        match (&request.method, request.uri.path()) {
            (&Method::POST, "/v1/volumes") => adds(0, true, announced),
            (&Method::POST, "/v1/models" | "/v1/segmentations") => adds(1, true, announced),
            (&Method::POST, "/v1/jobs") => adds(1, true, 0),
            // What is stored of these has another size than the body.
            (&Method::POST, "/v1/templates" | "/v1/readers") => adds(0, true, 0),
            (&Method::POST, path) if path.starts_with("/dicom-web/studies") => {
                adds(0, true, announced)
            }
            (&Method::POST | &Method::PUT, path) if path.starts_with("/dicom-web/workitems") => {
                adds(0, true, 0)
            }
            _ => adds(0, false, 0),
        }
    }
}

fn storage_full(used: u64, quota: u64) -> Problem {
    Problem::new(
        StatusCode::INSUFFICIENT_STORAGE,
        "storage-quota",
        format!("This tenant stores {used} of the {quota} bytes that it may store, and what is sent does not fit."),
    )
    .fix("DELETE items that are no longer needed, or ask the operator for more.")
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
