//! What every handler can reach.

use crate::config::Settings;
use crate::jobs::Queue;
use crate::work::Engine;
use std::sync::Arc;
use std::sync::atomic::AtomicU64;
use std::time::Instant;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// Volumes decoded at the same time for a look at their header: each may take as much memory
/// as the decompressed limit allows.
const INSPECTIONS: usize = 2;

/// The service's shared state.
#[derive(Clone)]
pub struct App(Arc<Shared>);

/// See [`App`].
pub struct Shared {
    /// Jobs, volumes, models.
    pub queue: Arc<Queue>,
    /// What can be done with volumes.
    pub engine: Engine,
    /// The limits.
    pub settings: Settings,
    /// Raised when the service is about to end: long answers end too.
    pub closing: CancellationToken,
    /// Permits to decode a volume.
    pub inspections: Semaphore,
    /// Answers so far, by class of status: 1xx to 5xx.
    pub answers: [AtomicU64; 5],
    /// When the service started.
    pub started: Instant,
}

impl App {
    /// The state over a queue.
    pub fn new(
        queue: Arc<Queue>,
        engine: Engine,
        settings: Settings,
        closing: CancellationToken,
    ) -> Self {
        Self(Arc::new(Shared {
            queue,
            engine,
            settings,
            closing,
            inspections: Semaphore::new(INSPECTIONS),
            answers: Default::default(),
            started: Instant::now(),
        }))
    }
}

impl std::ops::Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
