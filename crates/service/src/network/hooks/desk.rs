//! The webhooks of a service.

use super::{DeliveryStore, Dispatcher, UrlGuard};
use std::sync::Arc;

/// The webhooks of a service.
pub struct Hooks {
    /// The tables.
    pub store: Arc<dyn DeliveryStore>,
    /// Which URLs may be told.
    pub guard: UrlGuard,
    /// Sends deliveries.
    pub dispatcher: Arc<Dispatcher>,
}
