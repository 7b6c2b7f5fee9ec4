//! Connections to the database, shared out in turn.

use super::health::Health;
use std::sync::Arc;
use std::time::Duration;
use ventriform_service::base::records::{StoreError, StoreFault, StoreResult};
use ventriform_service::limits::places::{Place, Places};

/// Connections whose use is shared out in turn between tenants and their clients.
pub(super) struct Shared<P> {
    /// The connections.
    pub pool: P,
    /// What their statements tell.
    pub health: Arc<Health>,
    places: Arc<Places>,
    /// Longest time for which a place is waited for.
    wait: Duration,
}

impl<P> Shared<P> {
    /// Connections of which at most `places` are used at the same time, and for one of which nobody waits longer than
    /// `wait`.
    pub fn new(pool: P, health: Arc<Health>, places: usize, wait: Duration) -> Self {
        Self {
            pool,
            health,
            places: Places::new(places),
            wait,
        }
    }

    /// Waits for its turn to use a connection.
    ///
    /// # Errors
    /// If that is not within the set time.
    pub async fn turn(&self) -> StoreResult<Place> {
        let place = tokio::time::timeout(self.wait, self.places.take()).await;
        place.map_err(|_| StoreError::Database {
            cause: StoreFault::Busy,
            message: "other work takes too long".into(),
        })
    }
}
