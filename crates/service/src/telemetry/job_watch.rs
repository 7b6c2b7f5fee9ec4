//! Follows jobs for operators: counts them, times their stages, and makes their spans.
//!
//! The queue reports each change of a job. A job that runs has one entry here, which is removed
//! when it leaves its worker, so there are no more entries than workers.

use super::metrics::JobMetrics;
use super::spans::{JobSpan, Spans};
use crate::base::records::{Job, JobState};
use crate::jobs::JobObserver;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use std::time::Instant;

/// The stage in which a result is stored.
const COMMIT_STAGE: &str = "commit";

/// Follows jobs.
pub struct JobWatch {
    metrics: JobMetrics,
    spans: Spans,
    running: Mutex<BTreeMap<String, Run>>,
}

/// One attempt of a job.
struct Run {
    attempt: u32,
    stage: Option<(String, Instant)>,
    span: Option<JobSpan>,
}

impl JobWatch {
    /// Counts into these metrics and makes these spans.
    pub fn new(metrics: JobMetrics, spans: Spans) -> Self {
        Self {
            metrics,
            spans,
            running: Mutex::default(),
        }
    }

    fn runs(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, Run>> {
        self.running.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn start(&self, job: &Job) -> Run {
        let kind = [job.kind.as_str()];
        self.metrics.attempts.with_label_values(&kind).inc();
        if job.attempts > 1 {
            self.metrics.retries.with_label_values(&kind).inc();
        } else if let Some(started) = job.started_at {
            let waited = (started - job.created_at).max(0) as f64 / 1000.0;
            self.metrics.waits.with_label_values(&kind).observe(waited);
        }
        Run {
            attempt: job.attempts,
            stage: None,
            span: self.spans.job(job),
        }
    }

    /// Ends the stage of a run, if there is one, and begins the next.
    fn enter(&self, kind: &str, run: &mut Run, next: Option<&str>) {
        if run.stage.as_ref().map(|(stage, _)| stage.as_str()) == next {
            return;
        }
        if let Some((stage, since)) = run.stage.take() {
            let stages = self.metrics.stages.with_label_values(&[kind, &stage]);
            stages.observe(since.elapsed().as_secs_f64());
        }
        if let Some(span) = &mut run.span {
            span.enter(next);
        }
        run.stage = next.map(|stage| (stage.to_owned(), Instant::now()));
    }

    fn end(&self, job: &Job) {
        let state = job.state.as_str();
        let run = self.runs().remove(&job.id);
        if let Some(mut run) = run {
            self.enter(&job.kind, &mut run, None);
            if let Some(span) = run.span {
                span.end(job);
            }
        }
        if !job.state.is_final() {
            return;
        }
        let labels = [job.kind.as_str(), state];
        self.metrics.finished.with_label_values(&labels).inc();
        if let (Some(from), Some(to)) = (job.started_at, job.finished_at) {
            let seconds = (to - from).max(0) as f64 / 1000.0;
            self.metrics
                .durations
                .with_label_values(&labels)
                .observe(seconds);
        }
        if let Some(failure) = &job.failure {
            let labels = [job.kind.as_str(), failure.code.as_str()];
            self.metrics.failures.with_label_values(&labels).inc();
        }
    }
}

impl JobObserver for JobWatch {
    fn filed(&self, job: &Job) {
        self.metrics.filed.with_label_values(&[&job.kind]).inc();
    }

    fn changed(&self, job: &Job) {
        if job.state != JobState::Running {
            return self.end(job);
        }
        let mut runs = self.runs();
        let run = match runs.remove(&job.id) {
            Some(run) if run.attempt == job.attempts => Some(run),
            _ => None,
        };
        let mut run = run.unwrap_or_else(|| self.start(job));
        let committing = run
            .stage
            .as_ref()
            .is_some_and(|(stage, _)| stage == COMMIT_STAGE);
        if !committing {
            self.enter(&job.kind, &mut run, job.stage.as_deref());
        }
        runs.insert(job.id.clone(), run);
    }

    fn computed(&self, job: &Job) {
        let mut runs = self.runs();
        if let Some(run) = runs.get_mut(&job.id) {
            self.enter(&job.kind, run, Some(COMMIT_STAGE));
        }
    }
}
