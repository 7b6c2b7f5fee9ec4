//! Running one job: claim, compute, commit.
//!
//! A job is computed on the threads of the service. One that was running when the service died is
//! computed in a process of its own from then on ([`super::isolation`]).
//!
//! The lease is renewed from the claim to the end of the commit. If the storage fails, the worker
//! keeps the job and what it has computed, and tries again until the storage works or the service
//! stops: a job of a living run is never without a worker.

use super::WorkerSettings;
use super::lease::{self, Renewal};
use super::progress::{ProgressReport, ProgressSender, WriteLimiter};
use crate::base::records::{
    DeathLimit, Failure, Fault, Job, JobOutcome, Lease, LocalFile, StoreError, StoreFault,
};
use crate::items::WorkOutput;
use crate::jobs::{Isolation, Queue, WorkError, Works};
use std::convert::Infallible;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio_util::sync::CancellationToken;
use ventriform::base::progress::{CancelToken, Monitor};

/// Voxels of a volume up to which a job is computed on the threads of the service: 128 x 128 x 128, or 8 gates of
/// 64 x 64 x 64.
pub(super) const IN_PROCESS_VOXELS: u64 = 1 << 21;

/// Time for which a computation that was told to stop may go on before its job is ended anyway.
const STOP_LIMIT: Duration = Duration::from_secs(5);

/// First and longest pause before the storage is tried again.
const STORAGE_PAUSES: (Duration, Duration) = (Duration::from_secs(1), Duration::from_secs(30));

/// Pause before a job waits again whose files cannot be had because their store is away.
const AWAY_PAUSE: Duration = Duration::from_secs(10);

/// The parts that one worker needs to run jobs.
pub(super) struct JobRunner {
    pub queue: Arc<Queue>,
    pub works: Works,
    pub settings: WorkerSettings,
    pub threads: Arc<rayon::ThreadPool>,
    pub halt: CancellationToken,
}

/// The result of the computation; the outer error is a panic.
type Computed = std::thread::Result<Result<WorkOutput, Ended>>;

/// The end of a computation without an output.
#[derive(Debug)]
pub(super) enum Ended {
    /// The work says why.
    Work(WorkError),
    /// Its own process died; this is the process's status.
    Crashed(String),
    /// Its own process was ended from outside, or could not be started.
    Interrupted,
}

impl From<WorkError> for Ended {
    fn from(error: WorkError) -> Self {
        Ended::Work(error)
    }
}

impl From<Failure> for Ended {
    fn from(failure: Failure) -> Self {
        Ended::Work(failure.into())
    }
}

/// A computation that was started.
struct Computation {
    /// The files that it reads.
    files: Vec<LocalFile>,
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

/// The record of a job when it leaves its worker.
enum Resolution {
    /// Nothing: another run of the service has the job.
    Nothing,
    /// The output.
    Output(WorkOutput),
    /// The outcome.
    Outcome(JobOutcome),
    /// That it waits again.
    HandBack,
    /// That its own process died with this status.
    Crashed(String),
}

impl JobRunner {
    /// Claims a job and runs it to its end. `false` if there was none.
    pub async fn run_next_job(&self) -> Result<bool, StoreError> {
        let by = lease::claimant(&self.queue, &self.settings);
        let lease = |job: &str| Lease {
            job: job.to_owned(),
            token: by.token.clone(),
        };
        let job = match self.queue.table().claim(&by, self.queue.now()).await {
            Ok(Some(job)) => job,
            Ok(None) => return Ok(false),
            Err(error) => {
                // It may have been written all the same; then nobody else will take the job.
                let unknown = lease("");
                self.retry_until_written(&unknown, || self.queue.table().abandon(&unknown.token))
                    .await?;
                return Err(error);
            }
        };
        let lease = lease(&job.id);
        tracing::info!(job = %job.id, kind = %job.kind, attempt = job.attempts, "job started");
        self.queue.announce(&job);
        let cancel = CancelToken::new();
        self.queue.enter(&lease, cancel.clone());
        let ended = self.compute_and_commit(&job, &lease, &cancel).await;
        self.queue.leave(&lease);
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
        // Whoever cancelled the job after it was claimed may not have found its token yet.
        if let Ok(Some(now)) = self.queue.table().job(&job.id).await
            && now.cancel_requested
        {
            cancel.cancel();
        }
        let started = self.start(job, cancel);
        let mut computation = match self.while_renewing(lease, started).await {
            Ok(computation) => computation,
            Err(error) if error.cause() == StoreFault::Away => {
                tracing::error!(job = %job.id, %error, "the job waits for the store of its files");
                self.pause(AWAY_PAUSE).await;
                let jobs = self.queue.table();
                let hand_back = || jobs.hand_back(lease, self.queue.now());
                return self.retry_until_written(lease, hand_back).await;
            }
            Err(error) => {
                tracing::error!(job = %job.id, %error, "the job's input could not be read");
                self.pause(STORAGE_PAUSES.0).await;
                let limit = self.limit(unreadable);
                return self
                    .retry_until_written(lease, || {
                        self.queue.table().crashed(lease, &limit, self.queue.now())
                    })
                    .await;
            }
        };
        let (computed, stop) = self.watch(lease, cancel, &mut computation).await;
        let computed = without_files(computed, &computation.files);
        let abandoned = computed.is_none();
        self.queue.computed(job);
        if matches!(&computed, Some(Ok(Err(Ended::Interrupted)))) && stop.is_none() {
            self.pause(STORAGE_PAUSES.0).await;
        }
        let resolution = self.resolve(computed, stop);
        let ended = self
            .retry_until_written(lease, || self.commit(job, lease, &resolution))
            .await;
        if abandoned && !computation.result.is_terminated() {
            // The threads are busy until the computation notices the cancel token.
            tokio::select! {
                _ = computation.result => {}
                () = self.halt.cancelled() => {}
            }
        }
        ended
    }

    /// Writes to the storage until that succeeds or the service stops, and renews the lease
    /// meanwhile.
    async fn retry_until_written<F>(
        &self,
        lease: &Lease,
        write: impl Fn() -> F,
    ) -> Result<Option<Job>, StoreError>
    where
        F: Future<Output = Result<Option<Job>, StoreError>>,
    {
        let writing = async {
            let mut pause = STORAGE_PAUSES.0;
            loop {
                match write().await {
                    Err(error) if !self.halt.is_cancelled() => {
                        tracing::error!(
                            job = %lease.job, %error,
                            "the end of the job could not be written; trying again"
                        );
                        self.pause(pause).await;
                        pause = (2 * pause).min(STORAGE_PAUSES.1);
                    }
                    written => return written,
                }
            }
        };
        self.while_renewing(lease, writing).await
    }

    /// Does something and renews the lease meanwhile. Whether the lease is still held is found out
    /// by the next write, which names it.
    async fn while_renewing<T>(&self, lease: &Lease, work: impl Future<Output = T>) -> T {
        tokio::select! {
            biased;
            done = work => done,
            never = self.renew_for_ever(lease) => match never {},
        }
    }

    async fn renew_for_ever(&self, lease: &Lease) -> Infallible {
        let mut renewal = self.renewals();
        loop {
            renewal.tick().await;
            lease::renew(&self.queue, &self.settings, lease).await;
        }
    }

    fn renewals(&self) -> tokio::time::Interval {
        let every = lease::renewal_interval(&self.settings);
        tokio::time::interval_at(tokio::time::Instant::now() + every, every)
    }

    async fn pause(&self, pause: Duration) {
        tokio::select! {
            () = tokio::time::sleep(pause) => {}
            () = self.halt.cancelled() => {}
        }
    }

    fn limit(&self, reason: impl Fn(u32) -> Failure) -> DeathLimit {
        DeathLimit {
            deaths: self.settings.attempt_limit,
            reason: reason(self.settings.attempt_limit),
        }
    }

    /// How to compute the job on volumes of at most `voxels` in a process of its own, if it has to be.
    fn isolation(&self, job: &Job, voxels: u64) -> Option<Isolation> {
        let suspected = job.interruptions > 0 || job.crashes > 0;
        let isolation = self.works.isolation();
        if !suspected {
            return isolation.filter(|_| voxels > IN_PROCESS_VOXELS).cloned();
        }
        let isolation = isolation?;
        tracing::warn!(
            job = %job.id, interruptions = job.interruptions, crashes = job.crashes,
            "the service died while this job was running: it is computed in a process of its own"
        );
        Some(isolation.clone())
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
        let files = match &prepared {
            Ok((_, input)) => input.all_files(),
            Err(_) => Vec::new(),
        };
        let (sender, result) = oneshot::channel();
        let (reports, progress) = mpsc::unbounded_channel();
        let cancel = cancel.clone();
        let voxels = prepared.as_ref().map_or(0, |(_, input)| input.voxels);
        let (isolation, kind) = (self.isolation(job, voxels), job.kind.clone());
        let threads = self.settings.threads;
        self.threads.spawn(move || {
            let computed = catch_unwind(AssertUnwindSafe(|| -> Result<WorkOutput, Ended> {
                let (work, input) = prepared?;
                let observer = ProgressSender::new(work.plan(), reports);
                let monitor = Monitor::new(&observer, cancel);
                let made = match isolation {
                    Some(isolation) => isolation.compute(&kind, &input, threads, &monitor),
                    None => Ok(work.run(&input, &monitor)?),
                };
                made.map(WorkOutput::without_header_text)
            }));
            // The receiver is gone only if the job was ended without the computation.
            let _ = sender.send(computed);
        });
        Ok(Computation {
            files,
            result,
            progress,
        })
    }

    /// Renews the lease and writes progress until the computation ends, or has to be abandoned.
    async fn watch(
        &self,
        lease: &Lease,
        cancel: &CancelToken,
        computation: &mut Computation,
    ) -> (Option<Computed>, Option<Stop>) {
        let mut stop = None;
        let mut renewal = self.renewals();
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
                    Renewal::Owned => None,
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
            .table()
            .progress(lease, report.stage.as_str(), report.overall)
            .await
        {
            Ok(Some(job)) => self.queue.announce(&job),
            Ok(None) => {}
            Err(error) => tracing::warn!(job = %lease.job, %error, "progress was not written"),
        }
    }

    /// The record of a computation that has ended, or was told to stop.
    fn resolve(&self, computed: Option<Computed>, stop: Option<Stop>) -> Resolution {
        match (computed, stop) {
            (_, Some(Stop::LeaseLost)) => Resolution::Nothing,
            (Some(Ok(Ok(output))), _) => Resolution::Output(output),
            (Some(Ok(Err(Ended::Work(WorkError::Failed(failure))))), _) => {
                Resolution::Outcome(JobOutcome::Failed(failure))
            }
            (_, Some(Stop::Shutdown)) => Resolution::HandBack,
            (_, Some(Stop::TimeLimit)) => Resolution::Outcome(JobOutcome::Failed(self.too_long())),
            (_, Some(Stop::Requested)) => Resolution::Outcome(JobOutcome::Cancelled),
            (Some(Ok(Err(Ended::Crashed(status)))), None) => Resolution::Crashed(status),
            (Some(Ok(Err(Ended::Interrupted))), None) => Resolution::HandBack,
            (Some(Err(_)), None) => Resolution::Outcome(JobOutcome::Failed(panicked())),
            (Some(Ok(Err(Ended::Work(WorkError::Cancelled)))) | None, None) => {
                Resolution::Outcome(JobOutcome::Cancelled)
            }
        }
    }

    async fn commit(
        &self,
        job: &Job,
        lease: &Lease,
        resolution: &Resolution,
    ) -> Result<Option<Job>, StoreError> {
        let (jobs, now) = (self.queue.table(), self.queue.now());
        match resolution {
            Resolution::Nothing => Ok(None),
            Resolution::Output(output) => self.commit_output(job, lease, output).await,
            Resolution::Outcome(outcome) => jobs.finish(lease, outcome, now).await,
            Resolution::HandBack => jobs.hand_back(lease, now).await,
            Resolution::Crashed(status) => {
                tracing::error!(job = %job.id, status, "the job has ended its own process");
                jobs.crashed(lease, &self.limit(crashes), now).await
            }
        }
    }

    /// Stores the files, then commits the row. If the process ends in between, the next start
    /// deletes the files and computes the job again.
    async fn commit_output(
        &self,
        job: &Job,
        lease: &Lease,
        output: &WorkOutput,
    ) -> Result<Option<Job>, StoreError> {
        let Some(work) = self.works.of_kind(&job.kind) else {
            let outcome = JobOutcome::Failed(unknown_kind());
            let now = self.queue.now();
            return self.queue.table().finish(lease, &outcome, now).await;
        };
        let made = work.makes();
        self.queue.finish_with(made, job, lease, output).await
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

/// The outcome of a computation that read those files. If it failed and one of them is no longer
/// there, it was not the job's fault: somebody has deleted local copies of files that are stored
/// elsewhere.
fn without_files(computed: Option<Computed>, files: &[LocalFile]) -> Option<Computed> {
    match computed {
        Some(Ok(Err(Ended::Work(WorkError::Failed(failure)))))
            if files.iter().any(|file| !file.exists()) =>
        {
            tracing::error!(code = failure.code, "files of a running job were deleted");
            Some(Ok(Err(Ended::Interrupted)))
        }
        computed => computed,
    }
}

pub(super) fn panicked() -> Failure {
    Failure::new(
        Fault::Service,
        "internal",
        "The computation failed because of a defect in this program; it has been logged.",
    )
    .fix("Report it with the job's id.")
}

pub(super) fn unknown_kind() -> Failure {
    Failure::new(
        Fault::Service,
        "unknown-kind",
        "This version of the program cannot compute jobs of this kind.",
    )
}

fn crashes(times: u32) -> Failure {
    Failure::new(
        Fault::Service,
        "attempt-limit",
        format!("The computation ended its process {times} times."),
    )
    .fix("Report it with the job's id. Other parameters may work, or a machine with more memory.")
}

fn unreadable(times: u32) -> Failure {
    Failure::new(
        Fault::Service,
        "storage",
        format!("What the job needs could not be read; that was tried {times} times."),
    )
    .fix("Ask the operator to look at the log, then file the job again.")
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    #[test]
    fn a_job_is_not_at_fault_if_the_files_that_it_read_were_deleted() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("volume.nii");
        std::fs::write(&path, "content").unwrap();
        let files = [LocalFile::in_place(&path)];
        let failed = || Some(Ok(Err(Ended::from(unknown_kind()))));
        let ended = without_files(failed(), &files);
        assert!(matches!(ended, Some(Ok(Err(Ended::Work(_))))));
        std::fs::remove_file(&path).unwrap();
        let ended = without_files(failed(), &files);
        assert!(matches!(ended, Some(Ok(Err(Ended::Interrupted)))));
        let succeeded = without_files(Some(Ok(Ok(WorkOutput::default()))), &files);
        assert!(matches!(succeeded, Some(Ok(Ok(_)))));
    }
}
