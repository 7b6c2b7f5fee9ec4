//! The state that all handlers share.

use super::metrics::Metrics;
use super::problem::{Answer, Problem};
use crate::config::Settings;
use crate::jobs::Queue;
use crate::work::Engine;
use std::sync::Arc;
use tokio::sync::Semaphore;
use tokio_util::sync::CancellationToken;

/// Files decoded at the same time outside of jobs: each may take as much memory as the limit on
/// decompressed volumes allows.
const DECODING: usize = 2;

/// The service's shared state.
#[derive(Clone)]
pub struct App(Arc<Shared>);

/// See [`App`].
pub struct Shared {
    /// Jobs, volumes and products.
    pub queue: Arc<Queue>,
    /// The kinds of work, and the reader of uploads.
    pub engine: Engine,
    /// The operator's settings.
    pub settings: Settings,
    /// Cancelled when the service shuts down, so that long answers end.
    pub closing: CancellationToken,
    decoding: Semaphore,
    /// Figures for operators.
    pub metrics: Metrics,
}

impl App {
    /// The state of a service that has just started.
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
            decoding: Semaphore::new(DECODING),
            metrics: Metrics::new(),
        }))
    }

    /// Runs work that decodes files on a blocking thread, after waiting for its turn: only a few
    /// run at the same time.
    ///
    /// # Errors
    /// 500 if the work panics.
    pub async fn decode<T: Send + 'static>(
        &self,
        work: impl FnOnce() -> T + Send + 'static,
    ) -> Answer<T> {
        let _turn = self.decoding.acquire().await.map_err(Problem::internal)?;
        tokio::task::spawn_blocking(work)
            .await
            .map_err(Problem::internal)
    }
}

impl std::ops::Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
