//! Quotas of a tenant on stored bytes and waiting jobs.
//!
//! Every use case that stores or files takes a [`Counting`], which only [`Quotas`] makes: no way into the service goes
//! round the quotas.
//!
//! The addition of a use case is counted here until it has ended; from then on the database counts what it
//! added. It is counted first and the database is read after, so uses that come together cannot exceed a quota
//! together. At the limit they may be refused although one of them would have fitted.
//!
//! The announced length of an upload counts from its beginning; what comes without being announced
//! counts as it comes ([`Counting::arrived`]), so uploads of unknown length have room under any quota. A
//! request that waits for its job counts as a waiting job.

use crate::base::error::{Refusal, ServiceError};
use crate::base::records::{Failure, Fault, Tenant};
use crate::callers::{AccessStore, Quota, Usage};
use crate::limits::reservations::{Reservation, Reservations};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Bytes that the record of a job counts at least; see the column `bytes` of the jobs table.
const JOB_RECORD_BYTES: u64 = 2048;

/// Pause before a job is filed again that found the tenant's jobs full.
const JOB_RETRY: Duration = Duration::from_secs(5);

/// The addition that a use case may make.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Addition {
    /// Bytes that are known before; `None` if it stores nothing.
    pub announced_bytes: Option<u64>,
    /// Jobs.
    pub jobs: u64,
}

impl Addition {
    /// A job on what is stored already.
    pub const ONE_JOB: Self = Self {
        announced_bytes: Some(0),
        jobs: 1,
    };

    /// Bytes, `announced` of which are known before.
    pub fn bytes(announced: u64) -> Self {
        Self {
            announced_bytes: Some(announced),
            jobs: 0,
        }
    }
}

/// The quotas of all tenants.
pub struct Quotas {
    access: Arc<dyn AccessStore>,
    reservations: Reservations,
    /// The limits of every caller that has none of its own.
    pub general: Quota,
}

/// The count of what a use case adds, as it comes.
#[derive(Clone)]
pub struct Counting(Option<Arc<Counted>>);

struct Counted {
    access: Arc<dyn AccessStore>,
    /// Bytes that the tenant may store.
    quota: u64,
    state: Mutex<State>,
}

struct State {
    reservation: Reservation,
    /// Bytes that have come, and of those the ones that were announced.
    arrived: u64,
    announced: u64,
    /// Bytes that the tenant stored when that was asked last.
    used: u64,
}

impl Quotas {
    /// Quotas over what the database counts.
    pub fn new(access: Arc<dyn AccessStore>, general: Quota) -> Self {
        Self {
            access,
            reservations: Reservations::default(),
            general,
        }
    }

    /// Reserves what a use case may add under `quota`. A retry of an accepted request, told by its idempotency
    /// `key`, adds nothing.
    ///
    /// # Errors
    /// `job-quota` if too many jobs wait, `storage-quota` if the bytes have no room.
    pub async fn reserve(
        &self,
        tenant: &Tenant,
        quota: Quota,
        addition: Addition,
        key: Option<&str>,
    ) -> Result<Counting, ServiceError> {
        let Addition {
            announced_bytes,
            jobs,
        } = addition;
        let byte_quota = quota.bytes.filter(|_| announced_bytes.is_some());
        let job_quota = quota.jobs.filter(|_| jobs > 0);
        if byte_quota.is_none() && job_quota.is_none() {
            return Ok(Counting(None));
        }
        let announced = announced_bytes.unwrap_or(0);
        let amount = Usage {
            bytes: announced + jobs * JOB_RECORD_BYTES,
            jobs,
        };
        let (reservation, reserved) = self.reservations.add(tenant, amount);
        let used = self.access.usage(tenant).await?;
        let beyond = |quota: u64, used: u64, reserved: u64| used.saturating_add(reserved) > quota;
        let job_quota = job_quota.filter(|quota| beyond(*quota, used.jobs, reserved.jobs));
        let full = byte_quota.filter(|quota| beyond(*quota, used.bytes, reserved.bytes));
        let refused = match (job_quota, full) {
            (Some(quota), _) => Some(too_many_jobs(quota)),
            (None, Some(quota)) => Some(storage_full(used.bytes, quota)),
            (None, None) => None,
        };
        if let Some(refused) = refused
            && !self.is_retry(tenant, key).await?
        {
            return Err(refused);
        }
        let state = State {
            reservation,
            arrived: 0,
            announced,
            used: used.bytes,
        };
        Ok(Counting(Some(Arc::new(Counted {
            access: self.access.clone(),
            quota: byte_quota.unwrap_or(u64::MAX),
            state: Mutex::new(state),
        }))))
    }

    /// Counts what is stored already, such as received objects whose volume is made of them.
    pub fn counted_before(&self) -> Counting {
        Counting(None)
    }

    async fn is_retry(&self, tenant: &Tenant, key: Option<&str>) -> Result<bool, ServiceError> {
        match key {
            Some(key) => Ok(self.access.is_filed(tenant, key).await?),
            None => Ok(false),
        }
    }
}

impl Counting {
    /// Counts bytes that have come, or that are about to be stored.
    ///
    /// # Errors
    /// `storage-quota` if the tenant's quota has no room for them.
    pub async fn arrived(&self, bytes: u64) -> Result<(), ServiceError> {
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
        if exceeded {
            // Something may have been erased meanwhile.
            self.settle().await
        } else {
            Ok(())
        }
    }

    /// Compares what has come with what the tenant stores now; to be called before it is stored.
    ///
    /// # Errors
    /// `storage-quota` if the tenant's quota has no room for it.
    pub async fn settle(&self) -> Result<(), ServiceError> {
        let Some(counted) = &self.0 else {
            return Ok(());
        };
        let tenant = counted.state().reservation.tenant().clone();
        let used = counted.access.usage(&tenant).await?.bytes;
        let mut state = counted.state();
        state.used = used;
        let reserved = state.reservation.sum();
        if used.saturating_add(reserved.bytes) > counted.quota {
            Err(storage_full(used, counted.quota))
        } else {
            Ok(())
        }
    }

    /// The bytes that have come are stored: the database counts it from now on.
    pub fn stored(&self) {
        if let Some(counted) = &self.0 {
            let mut state = counted.state();
            state.reservation.stored();
            // What comes after it is not part of what was announced.
            state.announced = state.arrived;
            state.used = state.used.saturating_add(state.arrived);
        }
    }
}

impl Counted {
    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave it half changed: each change is a few plain statements.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

fn storage_full(used: u64, quota: u64) -> ServiceError {
    let detail = format!(
        "This tenant stores {used} of the {quota} bytes that it may store, and what is sent does not fit."
    );
    let failure = Failure::new(Fault::TooLarge, "storage-quota", detail)
        .fix("DELETE items that are no longer needed, or ask the operator for more.");
    ServiceError::new(Refusal::NoRoom, failure)
}

fn too_many_jobs(quota: u64) -> ServiceError {
    let detail = format!("This tenant has as many waiting jobs as it may have ({quota}).");
    let failure = Failure::new(Fault::Request, "job-quota", detail)
        .fix("Try again after the number of seconds in Retry-After.");
    ServiceError::new(Refusal::TooMany, failure).after(JOB_RETRY)
}
