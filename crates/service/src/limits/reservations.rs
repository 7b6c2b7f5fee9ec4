//! Reservations of the uses under way on what their tenants may store and queue.

use crate::base::records::Tenant;
use crate::callers::Usage;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

/// Additions that the uses under way may make, for each tenant.
#[derive(Clone, Default)]
pub struct Reservations(Arc<Mutex<HashMap<Tenant, Usage>>>);

/// The addition that one use may make. Dropping it ends the reservation.
pub struct Reservation {
    all: Reservations,
    tenant: Tenant,
    amount: Usage,
}

impl Reservations {
    /// Reserves `amount`; returns what is reserved in all.
    pub fn add(&self, tenant: &Tenant, amount: Usage) -> (Reservation, Usage) {
        // A panic cannot leave the map half changed: each use is a few plain statements.
        let mut all = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let sum = all.entry(tenant.clone()).or_default();
        sum.bytes = sum.bytes.saturating_add(amount.bytes);
        sum.jobs += amount.jobs;
        let reservation = Reservation {
            all: self.clone(),
            tenant: tenant.clone(),
            amount,
        };
        (reservation, *sum)
    }
}

impl Reservation {
    /// Adds `bytes` to it; returns what is reserved in all.
    pub fn grow(&mut self, bytes: u64) -> Usage {
        let mut all = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        let sum = all.entry(self.tenant.clone()).or_default();
        sum.bytes = sum.bytes.saturating_add(bytes);
        self.amount.bytes = self.amount.bytes.saturating_add(bytes);
        *sum
    }

    /// Ends the reservation of bytes: the database counts them now.
    pub fn stored(&mut self) {
        let mut all = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sum) = all.get_mut(&self.tenant) {
            sum.bytes = sum.bytes.saturating_sub(self.amount.bytes);
        }
        self.amount.bytes = 0;
    }

    /// All that is reserved.
    pub fn sum(&self) -> Usage {
        let all = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        all.get(&self.tenant).copied().unwrap_or_default()
    }

    /// The tenant.
    pub fn tenant(&self) -> &Tenant {
        &self.tenant
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        let mut all = self.all.0.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(sum) = all.get_mut(&self.tenant) {
            sum.bytes = sum.bytes.saturating_sub(self.amount.bytes);
            sum.jobs = sum.jobs.saturating_sub(self.amount.jobs);
            if *sum == Usage::default() {
                all.remove(&self.tenant);
            }
        }
    }
}
