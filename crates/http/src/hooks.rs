//! What handlers need of webhooks.

use std::sync::Arc;
use ventriform_service::hooks::{DeliveryStore, Dispatcher, UrlGuard};

/// What handlers need of webhooks.
pub struct Hooks {
    /// The tables.
    pub store: Arc<dyn DeliveryStore>,
    /// Which URLs may be told.
    pub guard: UrlGuard,
    /// Sends deliveries.
    pub dispatcher: Arc<Dispatcher>,
}
