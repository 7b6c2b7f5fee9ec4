//! The counter: where jobs are filed, watched and ended.

use super::{
    BlobStore, Catalogue, Clock, Filed, Interrupted, Job, JobStore, Load, NewJob, StoreError,
};
use crate::progress::CancelToken;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, broadcast};

/// How many changes a slow listener may miss before it must look at the table again.
const CHANGES_KEPT: usize = 256;

/// Limits of the queue.
#[derive(Debug, Clone, Copy)]
pub struct QueueSettings {
    /// Jobs that may wait.
    pub limit: usize,
    /// Jobs computed at the same time.
    pub workers: usize,
}

/// Where a waiting job stands.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Standing {
    /// Jobs ahead of it, plus one.
    pub position: u64,
    /// Milliseconds until it probably starts; absent before any job has ended.
    pub starts_in_ms: Option<f64>,
}

/// The service's one door to its jobs and things.
pub struct Queue {
    /// The jobs.
    pub jobs: Arc<dyn JobStore>,
    /// The volumes and what was made.
    pub catalogue: Arc<dyn Catalogue>,
    /// Their files.
    pub blobs: Arc<dyn BlobStore>,
    /// The time of day.
    pub clock: Arc<dyn Clock>,
    /// Held while files and rows of one thing are made or erased, so that both agree.
    pub shelving: tokio::sync::Mutex<()>,
    settings: QueueSettings,
    filed: Notify,
    changes: broadcast::Sender<Arc<Job>>,
    running: Mutex<BTreeMap<String, CancelToken>>,
}

impl Queue {
    /// A queue over the given stores.
    pub fn new(
        jobs: Arc<dyn JobStore>,
        catalogue: Arc<dyn Catalogue>,
        blobs: Arc<dyn BlobStore>,
        clock: Arc<dyn Clock>,
        settings: QueueSettings,
    ) -> Self {
        Self {
            jobs,
            catalogue,
            blobs,
            clock,
            shelving: tokio::sync::Mutex::new(()),
            settings,
            filed: Notify::new(),
            changes: broadcast::Sender::new(CHANGES_KEPT),
            running: Mutex::default(),
        }
    }

    /// Accepts a job and wakes a worker. See [`JobStore::file`].
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn file(&self, job: &NewJob) -> Result<Filed, StoreError> {
        let filed = self
            .jobs
            .file(job, self.settings.limit, self.clock.now())
            .await?;
        if let Filed::New(_) = filed {
            self.filed.notify_one();
        }
        Ok(filed)
    }

    /// Whether one job more would be refused.
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn is_full(&self) -> Result<bool, StoreError> {
        Ok(self.jobs.load().await?.queued >= self.settings.limit as u64)
    }

    /// Ends a job that waits, asks one that runs to stop.
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn interrupt(&self, id: &str) -> Result<Interrupted, StoreError> {
        let outcome = self.jobs.interrupt(id, self.clock.now()).await?;
        match &outcome {
            Interrupted::Cancelled(job) => self.announce(job),
            Interrupted::Asked(job) => {
                if let Some(token) = self.running().get(id) {
                    token.cancel();
                }
                self.announce(job);
            }
            Interrupted::Finished(_) | Interrupted::Unknown => {}
        }
        Ok(outcome)
    }

    /// Changes of all jobs from now on.
    pub fn changes(&self) -> broadcast::Receiver<Arc<Job>> {
        self.changes.subscribe()
    }

    /// Waits until the job has ended, at most `patience`. Returns the job as it then is.
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn wait(&self, id: &str, patience: Duration) -> Result<Option<Job>, StoreError> {
        let mut changes = self.changes();
        let ended = async {
            loop {
                match self.jobs.job(id).await? {
                    Some(job) if !job.state.is_final() => {}
                    other => return Ok(other),
                }
                while let Ok(job) = changes.recv().await {
                    if job.id == id && job.state.is_final() {
                        break;
                    }
                }
            }
        };
        match tokio::time::timeout(patience, ended).await {
            Ok(job) => job,
            Err(_) => self.jobs.job(id).await,
        }
    }

    /// Where a waiting job stands.
    ///
    /// # Errors
    /// If the database cannot.
    pub async fn standing(&self, job: &Job) -> Result<Standing, StoreError> {
        let ahead = self.jobs.ahead_of(job).await?;
        let Load {
            running,
            mean_duration_ms,
            ..
        } = self.jobs.load().await?;
        let workers = self.settings.workers as f64;
        // Those that run are half done on average; each worker then takes its share.
        let work_ahead = (ahead as f64 + running as f64 / 2.0) / workers;
        Ok(Standing {
            position: ahead + 1,
            starts_in_ms: mean_duration_ms.map(|mean| mean * work_ahead),
        })
    }

    /// Waits for a job to be filed.
    pub(super) async fn woken(&self) {
        self.filed.notified().await;
    }

    pub(super) fn announce(&self, job: &Job) {
        // Nobody listening is no failure.
        let _ = self.changes.send(Arc::new(job.clone()));
    }

    pub(super) fn enter(&self, id: &str, token: CancelToken) {
        self.running().insert(id.to_owned(), token);
    }

    pub(super) fn leave(&self, id: &str) {
        self.running().remove(id);
    }

    fn running(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, CancelToken>> {
        // The map is whole after any panic: each use of it is one call.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
