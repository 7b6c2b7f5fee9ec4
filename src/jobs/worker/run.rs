//! Running one job: claim, compute, commit.

use super::WorkerSettings;
use super::lease::{self, Renewal};
use super::progress::{ProgressReport, ProgressSender, WriteLimiter};
use crate::jobs::{
    Failure, Fault, Job, JobOutcome, Lease, Queue, StoreError, WorkError, WorkOutput, Works,
};
use crate::progress::{CancelToken, Monitor};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;

/// How long a computation that was told to stop may go on before its job is ended anyway.
const STOP_LIMIT: Duration = Duration::from_secs(5);

/// What one worker needs to run jobs.
pub(super) struct JobRunner {
    pub queue: Arc<Queue>,
    pub works: Works,
    pub settings: WorkerSettings,
    pub threads: Arc<rayon::ThreadPool>,
    pub halt: CancellationToken,
}

/// What the computation returned; the outer error is a panic.
type Computed = std::thread::Result<Result<WorkOutput, WorkError>>;

/// A computation that was started.
struct Computation {
    result: oneshot::Receiver<Computed>,
    progress: mpsc::UnboundedReceiver<ProgressReport>,
}

/// Why a computation was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stop {
    Requested,
    TimeLimit,
    Shutdown,
    LeaseLost,
}

impl JobRunner {
    /// Claims a job and runs it to its end. `false` if there was none.
    pub async fn run_next_job(&self) -> Result<bool, StoreError> {
        let Some((job, lease)) = lease::claim(&self.queue, &self.settings).await? else {
            return Ok(false);
        };
        tracing::info!(job = %job.id, kind = %job.kind, attempt = job.attempts, "job started");
        self.queue.announce(&job);
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
        let mut computation = self.start(job, cancel).await?;
        let (computed, stop) = self.watch(lease, cancel, &mut computation).await;
        let abandoned = computed.is_none();
        self.queue.computed(job);
        let ended = self.commit(job, lease, computed, stop).await;
        if abandoned && !computation.result.is_terminated() {
            // The threads are busy until the computation notices the cancel token.
            tokio::select! {
                _ = computation.result => {}
                () = self.halt.cancelled() => {}
            }
        }
        ended
    }

    /// Starts the computation on this worker's threads.
    async fn start(&self, job: &Job, cancel: &CancelToken) -> Result<Computation, StoreError> {
        let prepared = match self.works.of_kind(&job.kind) {
            Some(work) => {
                let input = self.queue.input(job, &**work).await?;
                input.map(|input| (work.clone(), input))
            }
            None => Err(unknown_kind()),
        };
        let (sender, result) = oneshot::channel();
        let (reports, progress) = mpsc::unbounded_channel();
        let cancel = cancel.clone();
        self.threads.spawn(move || {
            let computed = catch_unwind(AssertUnwindSafe(|| {
                let (work, input) = prepared?;
                let observer = ProgressSender::new(work.plan(), reports);
                work.run(&input, &Monitor::new(&observer, cancel))
            }));
            // The receiver is gone only if the job was ended without the computation.
            let _ = sender.send(computed);
        });
        Ok(Computation { result, progress })
    }

    /// Renews the lease and writes progress until the computation ends, or has to be abandoned.
    async fn watch(
        &self,
        lease: &Lease,
        cancel: &CancelToken,
        computation: &mut Computation,
    ) -> (Option<Computed>, Option<Stop>) {
        let mut stop = None;
        let mut renewal = tokio::time::interval(lease::renewal_interval(&self.settings));
        let mut limiter = WriteLimiter::default();
        let deadline = tokio::time::sleep(self.settings.time_limit);
        let stop_limit = tokio::time::sleep(STOP_LIMIT);
        tokio::pin!(deadline, stop_limit);
        loop {
            let stop_now = tokio::select! {
                biased;
                result = &mut computation.result => return (result.ok(), stop),
                () = &mut stop_limit, if stop.is_some() => {
                    tracing::error!(
                        job = %lease.job, ?stop,
                        "the computation does not stop; its worker waits for it"
                    );
                    break;
                }
                () = &mut deadline, if stop.is_none() => Some(Stop::TimeLimit),
                () = self.halt.cancelled(), if stop.is_none() => Some(Stop::Shutdown),
                _ = renewal.tick() => match lease::renew(&self.queue, &self.settings, lease).await {
                    Renewal::Held => None,
                    Renewal::CancelRequested => Some(Stop::Requested),
                    Renewal::Lost => Some(Stop::LeaseLost),
                },
                Some(report) = computation.progress.recv() => {
                    if limiter.admits(&report) {
                        self.write_progress(lease, &report).await;
                    }
                    None
                }
            };
            let requested = cancel.is_cancelled().then_some(Stop::Requested);
            if let (None, Some(reason)) = (stop, stop_now.or(requested)) {
                stop = Some(reason);
                cancel.cancel();
                stop_limit
                    .as_mut()
                    .reset(tokio::time::Instant::now() + STOP_LIMIT);
            }
        }
        (None, stop)
    }

    async fn write_progress(&self, lease: &Lease, report: &ProgressReport) {
        match self
            .queue
            .jobs
            .progress(lease, report.stage.as_str(), report.overall)
            .await
        {
            Ok(Some(job)) => self.queue.announce(&job),
            Ok(None) => {}
            Err(error) => tracing::warn!(job = %lease.job, %error, "progress was not written"),
        }
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
            (Some(Ok(Err(WorkError::Failed(failure)))), _) => JobOutcome::Failed(failure),
            (_, Some(Stop::Shutdown)) => return self.queue.jobs.hand_back(lease).await,
            (_, Some(Stop::TimeLimit)) => JobOutcome::Failed(self.too_long()),
            (Some(Err(_)), _) => JobOutcome::Failed(panicked()),
            (Some(Ok(Err(WorkError::Cancelled))) | None, _) => JobOutcome::Cancelled,
        };
        let now = self.queue.clock.now();
        self.queue.jobs.finish(lease, &outcome, now).await
    }

    /// Stores the files, then commits the row. If the process ends in between, the next start
    /// deletes the files and computes the job again.
    async fn commit_output(
        &self,
        job: &Job,
        lease: &Lease,
        output: WorkOutput,
    ) -> Result<Option<Job>, StoreError> {
        let Some(work) = self.works.of_kind(&job.kind) else {
            let outcome = JobOutcome::Failed(unknown_kind());
            let now = self.queue.clock.now();
            return self.queue.jobs.finish(lease, &outcome, now).await;
        };
        let made = work.makes();
        self.queue.finish_with(made, job, lease, &output).await
    }

    fn too_long(&self) -> Failure {
        let limit = self.settings.time_limit;
        Failure::new(
            Fault::Content,
            "job-time-limit",
            format!("The computation was stopped after {limit:?}, the longest time allowed."),
        )
        .fix(
            "Ask for fewer points or crop the volume, or ask the operator to raise \
             `job_time_limit`.",
        )
    }
}

fn panicked() -> Failure {
    Failure::new(
        Fault::Service,
        "internal",
        "The computation failed because of a defect in this program; it has been logged.",
    )
    .fix("Report it with the job's id.")
}

fn unknown_kind() -> Failure {
    Failure::new(
        Fault::Service,
        "unknown-kind",
        "This version of the program cannot compute jobs of this kind.",
    )
}
