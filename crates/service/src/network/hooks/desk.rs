//! The webhooks of a service.

use super::{DeliveryStore, Dispatcher, UrlGuard};
use std::sync::Arc;

/// The webhooks of a service.
pub struct Hooks {
    /// The tables.
    pub(crate) store: Arc<dyn DeliveryStore>,
    /// Which URLs may be told.
    pub(crate) guard: UrlGuard,
    /// Sends deliveries.
    pub(crate) dispatcher: Arc<Dispatcher>,
}
