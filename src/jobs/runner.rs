//! One job from claim to commit.

use super::progress::{Notes, Step, Teller};
use super::worker::WorkerSettings;
use super::{
    Engine, Failure, Fault, Job, Lease, Outcome, Output, Queue, StoreError, WorkError, random_id,
};
use crate::progress::{CancelToken, Monitor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

/// How long work that was told to stop may take before the job is ended without it.
const STOP_PATIENCE: Duration = Duration::from_secs(5);

/// One worker's means.
pub(super) struct Runner {
    pub queue: Arc<Queue>,
    pub engine: Engine,
    pub settings: WorkerSettings,
    pub threads: Arc<rayon::ThreadPool>,
    pub halt: CancellationToken,
}

/// What the work came to.
type Computed = std::thread::Result<Result<Output, WorkError>>;

/// Why the work was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    Asked,
    TimeLimit,
    Shutdown,
    LeaseLost,
}

impl Runner {
    /// Claims a job and sees it to its end. `false` if there was none.
    pub async fn run_next_job(&self) -> Result<bool, StoreError> {
        let now = self.queue.clock.now();
        let token = random_id("");
        let claimed = self
            .queue
            .jobs
            .claim(&token, self.settings.attempt_limit, now, self.lease_end())
            .await?;
        let Some(job) = claimed else {
            return Ok(false);
        };
        tracing::info!(job = %job.id, kind = %job.kind, attempt = job.attempts, "job started");
        self.queue.announce(&job);
        let lease = Lease {
            job: job.id.clone(),
            token,
        };
        let cancel = CancelToken::new();
        self.queue.enter(&job.id, cancel.clone());
        let ended = self.compute_and_commit(&job, &lease, &cancel).await;
        self.queue.leave(&job.id);
        if let Some(job) = ended? {
            tracing::info!(job = %job.id, state = job.state.as_str(), "job left its worker");
            self.queue.announce(&job);
        }
        Ok(true)
    }

    async fn compute_and_commit(
        &self,
        job: &Job,
        lease: &Lease,
        cancel: &CancelToken,
    ) -> Result<Option<Job>, StoreError> {
        let (mut result, progress) = self.start(job, cancel).await?;
        let (computed, stop) = self.watch(lease, cancel, &mut result, progress).await;
        let abandoned = computed.is_none();
        let ended = self.commit(job, lease, computed, stop).await;
        if abandoned && !result.is_terminated() {
            // Its threads are not free before the work looks up.
            tokio::select! {
                _ = result => {}
                () = self.halt.cancelled() => {}
            }
        }
        ended
    }

    async fn commit(
        &self,
        job: &Job,
        lease: &Lease,
        computed: Option<Computed>,
        stop: Option<Stop>,
    ) -> Result<Option<Job>, StoreError> {
        let outcome = match (computed, stop) {
            (_, Some(Stop::LeaseLost)) => return Ok(None),
            (Some(Ok(Ok(output))), _) => return self.commit_output(job, lease, output).await,
            (Some(Ok(Err(WorkError::Failed(failure)))), _) => Outcome::Failed(failure),
            (_, Some(Stop::Shutdown)) => return self.queue.jobs.hand_back(lease).await,
            (_, Some(Stop::TimeLimit)) => Outcome::Failed(self.too_long()),
            (Some(Err(_)), _) => Outcome::Failed(panicked()),
            (Some(Ok(Err(WorkError::Cancelled))) | None, _) => Outcome::Cancelled,
        };
        let now = self.queue.clock.now();
        self.queue.jobs.finish(lease, &outcome, now).await
    }

    /// Files first, then the row: what a crash leaves in between is swept at the next start.
    async fn commit_output(
        &self,
        job: &Job,
        lease: &Lease,
        output: Output,
    ) -> Result<Option<Job>, StoreError> {
        let _shelving = self.queue.shelving.lock().await;
        let outcome = match self.engine.work(&job.kind) {
            Some(work) => self.queue.publish(work.makes(), job, output).await,
            None => Outcome::Failed(unknown_kind()),
        };
        let now = self.queue.clock.now();
        self.queue.jobs.finish(lease, &outcome, now).await
    }

    /// Sets the work going on this worker's threads.
    async fn start(
        &self,
        job: &Job,
        cancel: &CancelToken,
    ) -> Result<(oneshot::Receiver<Computed>, mpsc::UnboundedReceiver<Step>), StoreError> {
        let work = self.engine.work(&job.kind).cloned();
        let input = self.queue.input(job, work.as_deref()).await?;
        let (sender, receiver) = oneshot::channel();
        let (steps, progress) = mpsc::unbounded_channel();
        let cancel = cancel.clone();
        self.threads.spawn(move || {
            let computed = catch_unwind(AssertUnwindSafe(|| match work {
                Some(work) => {
                    let teller = Teller::new(work.plan(), steps);
                    work.run(&input, &Monitor::new(&teller, cancel))
                }
                None => Err(WorkError::Failed(unknown_kind())),
            }));
            // The receiver is gone only when the job was ended without us.
            let _ = sender.send(computed);
        });
        Ok((receiver, progress))
    }

    /// Keeps the lease alive and the row up to date until the work ends or has to be left.
    async fn watch(
        &self,
        lease: &Lease,
        cancel: &CancelToken,
        computed: &mut oneshot::Receiver<Computed>,
        mut progress: mpsc::UnboundedReceiver<Step>,
    ) -> (Option<Computed>, Option<Stop>) {
        let mut stop = None;
        let mut heartbeat = tokio::time::interval(self.settings.lease / 3);
        let mut notes = Notes::default();
        let deadline = tokio::time::sleep(self.settings.time_limit);
        let patience = tokio::time::sleep(STOP_PATIENCE);
        tokio::pin!(deadline, patience);
        loop {
            let stop_now = tokio::select! {
                biased;
                result = &mut *computed => return (result.ok(), stop),
                () = &mut patience, if stop.is_some() => {
                    tracing::error!(job = %lease.job, ?stop, "the work does not stop; its worker waits for it");
                    break;
                }
                () = &mut deadline, if stop.is_none() => Some(Stop::TimeLimit),
                () = self.halt.cancelled(), if stop.is_none() => Some(Stop::Shutdown),
                _ = heartbeat.tick() => self.beat(lease).await,
                Some(step) = progress.recv() => {
                    if notes.worth_writing(&step) {
                        self.note(lease, &step).await;
                    }
                    None
                }
            };
            let asked = cancel.is_cancelled().then_some(Stop::Asked);
            if let (None, Some(reason)) = (stop, stop_now.or(asked)) {
                stop = Some(reason);
                cancel.cancel();
                patience
                    .as_mut()
                    .reset(tokio::time::Instant::now() + STOP_PATIENCE);
            }
        }
        (None, stop)
    }

    /// Prolongs the lease. Tells if the work should stop.
    async fn beat(&self, lease: &Lease) -> Option<Stop> {
        match self.queue.jobs.heartbeat(lease, self.lease_end()).await {
            Ok(Some(false)) => None,
            Ok(Some(true)) => Some(Stop::Asked),
            Ok(None) => Some(Stop::LeaseLost),
            Err(error) => {
                // The lease outlives two missed beats; the commit will tell.
                tracing::warn!(job = %lease.job, %error, "no sign of life could be given");
                None
            }
        }
    }

    async fn note(&self, lease: &Lease, step: &Step) {
        match self
            .queue
            .jobs
            .progress(lease, step.stage.as_str(), step.overall)
            .await
        {
            Ok(Some(job)) => self.queue.announce(&job),
            Ok(None) => {}
            Err(error) => tracing::warn!(job = %lease.job, %error, "progress was not written"),
        }
    }

    fn lease_end(&self) -> super::Timestamp {
        let lease = i64::try_from(self.settings.lease.as_millis()).unwrap_or(i64::MAX / 2);
        self.queue.clock.now().saturating_add(lease)
    }

    fn too_long(&self) -> Failure {
        let limit = self.settings.time_limit;
        Failure::new(
            Fault::Content,
            "job-time-limit",
            format!("The computation was ended after {limit:?}."),
        )
        .fix("Ask for fewer points or a smaller part of the volume, or have the operator raise `job_time_limit`.")
    }
}

fn panicked() -> Failure {
    Failure::new(
        Fault::Service,
        "internal",
        "The computation met a defect of this program; it has been logged.",
    )
    .fix("Please report it with the job's id.")
}

fn unknown_kind() -> Failure {
    Failure::new(
        Fault::Service,
        "unknown-kind",
        "This version of the program does not know this kind of job.",
    )
}
