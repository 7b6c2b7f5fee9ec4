//! What handlers need of webhooks.

use crate::hooks::{DeliveryStore, Dispatcher, UrlGuard};
use std::sync::Arc;

/// What handlers need of webhooks.
pub struct Hooks {
    /// The tables.
    pub store: Arc<dyn DeliveryStore>,
    /// Which URLs may be told.
    pub guard: UrlGuard,
    /// Sends deliveries.
    pub dispatcher: Arc<Dispatcher>,
}
