//! The state that all handlers share: the service, and what belongs to answering requests.

use crate::edge::guard::state::Guard;
use crate::wire::links::rfc3339;
use crate::wire::response_cache::ResponseCache;
use crate::wire::streams::EventStreams;
use crate::wire::validators::ValidatedJson;
use std::sync::Arc;
use ventriform_service::base::records::{Ownership, Product, Resource};
use ventriform_service::use_cases::service::Service;

/// The shared state of handlers.
#[derive(Clone)]
pub struct App(Arc<Shared>);

/// See [`App`].
pub struct Shared {
    /// The service.
    pub service: Arc<Service>,
    /// Tells and limits callers.
    pub guard: Guard,
    /// Answers about items that are still current.
    pub answers: ResponseCache<ValidatedJson>,
    /// Products that are still current.
    pub products: ResponseCache<Arc<Product>>,
    /// The open streams of events.
    pub streams: EventStreams,
}

impl App {
    /// The state of handlers that have answered nothing yet.
    pub fn new(service: Arc<Service>, guard: Guard) -> Self {
        let settings = service.settings();
        let memory = settings.answer_memory.0;
        let answer_memory = usize::try_from(memory).unwrap_or(usize::MAX);
        Self(Arc::new(Shared {
            guard,
            answers: ResponseCache::new(answer_memory / 2),
            products: ResponseCache::new(answer_memory / 2),
            streams: EventStreams::new(
                settings.event_stream_limit,
                settings.client_event_stream_limit,
            ),
            service,
        }))
    }

    /// When an item of that kind will be erased (RFC 3339); `None` if it is kept.
    pub fn expires_at(&self, kind: Resource, ownership: &Ownership) -> Option<String> {
        self.service.expires_at(kind, ownership).map(rfc3339)
    }
}

impl std::ops::Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
