//! The queue: filing, watching and cancelling jobs.

mod finish;
mod input;
mod peers;

use super::JobObserver;
use crate::base::records::{
    Clock, DeathLimit, Deleted, ErasureAgent, Filed, Interrupted, Job, JobState, JobStore, Lease,
    NewJob, QueueLoad, Resource, StoreError, Tenant, Timestamp, random_id,
};
use crate::items::{ExpiredPages, Items};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;
use tokio::sync::{Notify, broadcast};
use ventriform::base::progress::CancelToken;

/// How many changes are buffered for a slow subscriber. One that falls further behind misses
/// changes and has to read the table.
const CHANGES_BUFFERED: usize = 256;

/// Limits of the queue.
#[derive(Debug, Clone, Copy)]
pub struct QueueSettings {
    /// Largest number of waiting jobs.
    pub limit: usize,
    /// Number of jobs computed at the same time.
    pub workers: usize,
}

/// The position of a waiting job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QueuePosition {
    /// Position, the next job being 1.
    pub position: u64,
    /// Estimated milliseconds until it starts; `None` before any job has succeeded.
    pub starts_in_ms: Option<f64>,
}

/// The jobs of one service.
pub struct Queue {
    jobs: Arc<dyn JobStore>,
    items: Arc<Items>,
    clock: Arc<dyn Clock>,
    settings: QueueSettings,
    filed: Notify,
    sourced: Arc<Notify>,
    changes: broadcast::Sender<Arc<Job>>,
    /// Cancel tokens of the running jobs by lease token, with the ids of the jobs.
    running: Mutex<BTreeMap<String, (String, CancelToken)>>,
    observer: OnceLock<Arc<dyn JobObserver>>,
    /// Names this run of the service in the leases of its workers.
    pub(super) run: String,
}

impl Queue {
    /// A queue over a jobs table, whose jobs work on these items.
    pub fn new(
        jobs: Arc<dyn JobStore>,
        items: Arc<Items>,
        clock: Arc<dyn Clock>,
        settings: QueueSettings,
    ) -> Self {
        let run = items
            .peers()
            .map_or_else(|| random_id("run_"), |peers| peers.run().to_owned());
        Self {
            jobs,
            items,
            clock,
            settings,
            filed: Notify::new(),
            sourced: Arc::default(),
            changes: broadcast::Sender::new(CHANGES_BUFFERED),
            running: Mutex::default(),
            observer: OnceLock::new(),
            run,
        }
    }

    /// The jobs table.
    pub(crate) fn table(&self) -> &dyn JobStore {
        &*self.jobs
    }

    /// The items on which its jobs work.
    pub fn items(&self) -> &Arc<Items> {
        &self.items
    }

    /// The time of day.
    pub fn clock(&self) -> &Arc<dyn Clock> {
        &self.clock
    }

    /// The time now.
    pub fn now(&self) -> Timestamp {
        self.clock.now()
    }

    /// Accepts a job and wakes a worker. See [`JobStore::file`].
    ///
    /// # Errors
    /// If the database fails.
    pub async fn file(&self, job: &NewJob) -> Result<Filed, StoreError> {
        let filed = self
            .jobs
            .file(job, self.settings.limit, self.clock.now())
            .await?;
        if let Filed::New(job) = &filed {
            if let Some(observer) = self.observer.get() {
                observer.filed(job);
            }
            match job.volume {
                Some(_) => self.filed.notify_one(),
                None => self.sourced.notify_one(),
            }
        }
        Ok(filed)
    }

    /// Whether the queue would reject another job of that tenant.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn is_full(&self, tenant: &Tenant) -> Result<bool, StoreError> {
        Ok(!self.jobs.has_room(tenant, self.settings.limit).await?)
    }

    /// Deletes the record of a job that has ended.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn delete_job(&self, id: &str) -> Result<Deleted, StoreError> {
        self.jobs.delete_job(id, None, self.clock.now()).await
    }

    /// Deletes the records of jobs that ended at least `age` ago, none while no ages count; each leaves a row of the
    /// audit trail.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn delete_expired(&self, age: Duration) -> Result<(), StoreError> {
        let Some(trusted) = self.clock.trusted() else {
            return Ok(());
        };
        let mut pages = ExpiredPages::new(Resource::Job, trusted.older_than(age));
        while let Some(page) = pages.next(self.items.catalogue()).await? {
            for found in page {
                let by = Some(ErasureAgent::retention());
                let now = self.clock.now();
                self.jobs.delete_job(&found.id, by.as_ref(), now).await?;
            }
        }
        Ok(())
    }

    /// Makes the table consistent after the previous process ended at any moment: returns its running
    /// jobs to the queue. To be called before the first worker starts. If other processes may use the store,
    /// only jobs whose leases have expired are returned. With a `limit`, jobs that were running when that many
    /// processes died are failed; a program that can compute them in a process of their own needs none. Files
    /// without a record are left to [`Custodian`](crate::items::Custodian).
    ///
    /// # Errors
    /// If the storage fails.
    pub async fn recover_after_crash(&self, limit: Option<&DeathLimit>) -> Result<(), StoreError> {
        let alive = Some(self.run.as_str()).filter(|_| self.jobs.is_shared());
        let released = self
            .jobs
            .release_dead(alive, limit, self.clock.now())
            .await?;
        if !released.is_empty() {
            tracing::warn!(
                released = released.len(),
                "recovered after the previous process did not stop in order"
            );
        }
        Ok(())
    }

    /// Returns the jobs of other runs that died to the queue.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn release_dead(&self) -> Result<(), StoreError> {
        let run = Some(self.run.as_str());
        let released = self.jobs.release_dead(run, None, self.clock.now());
        for job in released.await? {
            tracing::warn!(job = %job.id, "the lease of another run of the service has expired");
            self.announce(&job);
        }
        Ok(())
    }

    /// Cancels a waiting job; asks a running one to stop.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn interrupt(&self, id: &str) -> Result<Interrupted, StoreError> {
        let outcome = self.jobs.interrupt(id, self.clock.now()).await?;
        match &outcome {
            Interrupted::Cancelled(job) => self.announce(job),
            Interrupted::Asked(job) => {
                // A worker that has claimed the job but is not in the list yet reads the request
                // from the table, after it has entered the list.
                self.stop_computing(id);
                self.announce(job);
            }
            Interrupted::Finished(_) | Interrupted::Unknown => {}
        }
        Ok(outcome)
    }

    /// Cancels the computation of a job, if it runs in this process.
    fn stop_computing(&self, id: &str) {
        for (_, token) in self.running().values().filter(|(job, _)| job == id) {
            token.cancel();
        }
    }

    /// Subscribes to the changes of all jobs. Some of another process may be missed; see
    /// [`Queue::next_poll`].
    pub fn changes(&self) -> broadcast::Receiver<Arc<Job>> {
        self.changes.subscribe()
    }

    /// Waits until the job has ended, for at most `limit`. Returns the job in its state then.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn wait(&self, id: &str, limit: Duration) -> Result<Option<Job>, StoreError> {
        let mut changes = self.changes();
        let ended = async {
            loop {
                match self.jobs.job(id).await? {
                    Some(job) if !job.state.is_final() => {}
                    other => return Ok(other),
                }
                let ended = async {
                    while let Ok(job) = changes.recv().await {
                        if job.id == id && job.state.is_final() {
                            break;
                        }
                    }
                };
                tokio::select! {
                    () = ended => {}
                    () = self.next_poll() => {}
                }
            }
        };
        match tokio::time::timeout(limit, ended).await {
            Ok(job) => job,
            Err(_) => self.jobs.job(id).await,
        }
    }

    /// The positions of those jobs that wait, by their place in the order of filing. Takes two
    /// queries, however many jobs there are.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn positions(
        &self,
        jobs: &[Job],
    ) -> Result<BTreeMap<i64, QueuePosition>, StoreError> {
        let waiting = jobs.iter().filter(|job| job.state == JobState::Queued);
        let sequences: Vec<i64> = waiting.map(|job| job.sequence).collect();
        if sequences.is_empty() {
            return Ok(BTreeMap::new());
        }
        let ahead = self.jobs.ahead_of(&sequences).await?;
        let QueueLoad {
            running,
            mean_duration_ms,
            ..
        } = self.jobs.load().await?;
        let workers = self.all_workers().await? as f64;
        // Running jobs are half done on average, and the workers share what is ahead.
        let position = |ahead: u64| {
            let work_ahead = (ahead as f64 + running as f64 / 2.0) / workers;
            QueuePosition {
                position: ahead + 1,
                starts_in_ms: mean_duration_ms.map(|mean| mean.max(0.0) * work_ahead),
            }
        };
        let ahead = ahead.into_iter();
        Ok(ahead.map(|(job, ahead)| (job, position(ahead))).collect())
    }

    /// Told when a job is filed whose volume is to be fetched from its source.
    pub fn sourced(&self) -> Arc<Notify> {
        self.sourced.clone()
    }

    /// Tells everybody of a waiting job that has got its volume from its source, or has failed
    /// because it cannot.
    pub fn supplied(&self, job: &Job) {
        self.announce(job);
        self.filed.notify_one();
    }

    /// Tells the observer that the computation of a job has ended.
    pub(super) fn computed(&self, job: &Job) {
        if let Some(observer) = self.observer.get() {
            observer.computed(job);
        }
    }

    /// Tells an observer of every change from now on. To be called once, before jobs run.
    pub fn observe(&self, observer: Arc<dyn JobObserver>) {
        // There is an observer already: it stays the only one.
        let _ = self.observer.set(observer);
    }

    /// Waits until a job is filed.
    pub(super) async fn woken(&self) {
        self.filed.notified().await;
    }

    /// Sends a changed job to all subscribers.
    pub(super) fn announce(&self, job: &Job) {
        if let Some(observer) = self.observer.get() {
            observer.changed(job);
        }
        // Sending fails if there is no subscriber.
        let _ = self.changes.send(Arc::new(job.clone()));
    }

    /// Registers a running job, so that [`Queue::interrupt`] can stop it.
    pub(super) fn enter(&self, lease: &Lease, cancel: CancelToken) {
        let job = (lease.job.clone(), cancel);
        self.running().insert(lease.token.clone(), job);
    }

    /// Removes a job registered by [`Queue::enter`].
    pub(super) fn leave(&self, lease: &Lease) {
        self.running().remove(&lease.token);
    }

    fn running(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, (String, CancelToken)>> {
        // A panic cannot leave the map half changed: each use is a single call.
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
