//! Progress reports, from the computing threads to the jobs table.

use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;
use ventriform::base::progress::{Observer, Plan, Stage, TotalProgress};

/// Shortest time between two writes within a stage. A new stage is written at once.
const WRITE_INTERVAL: Duration = Duration::from_millis(200);

/// One report of progress.
pub(super) struct ProgressReport {
    /// The current stage.
    pub stage: Stage,
    /// The completed fraction of the whole job, 0..=1.
    pub overall: f64,
}

/// Limits how many reports are written to the table.
#[derive(Default)]
pub(super) struct WriteLimiter {
    last: Option<(Stage, Instant)>,
}

impl WriteLimiter {
    /// Whether to write this report.
    pub fn admits(&mut self, report: &ProgressReport) -> bool {
        let admitted = match self.last {
            Some((stage, at)) => stage != report.stage || at.elapsed() >= WRITE_INTERVAL,
            None => true,
        };
        if admitted {
            self.last = Some((report.stage, Instant::now()));
        }
        admitted
    }
}

/// Sends the progress of the computing threads to the worker: at most one report per percent of
/// a stage.
pub(super) struct ProgressSender {
    reports: mpsc::UnboundedSender<ProgressReport>,
    gauge: TotalProgress,
    /// Stage and percentage of the last report, as one number.
    last_sent: AtomicU32,
    started: Instant,
}

impl ProgressSender {
    /// A sender for work with these stages.
    pub fn new(plan: Plan, reports: mpsc::UnboundedSender<ProgressReport>) -> Self {
        Self {
            reports,
            gauge: TotalProgress::new(plan),
            last_sent: AtomicU32::new(u32::MAX),
            started: Instant::now(),
        }
    }
}

impl Observer for ProgressSender {
    fn progress(&self, stage: Stage, fraction: f64) {
        let now = (stage as u32) * 1000 + (fraction * 100.0) as u32;
        if self.last_sent.swap(now, Ordering::Relaxed) != now {
            let overall = self.gauge.advance(stage, fraction);
            let _ = self.reports.send(ProgressReport { stage, overall });
        }
    }

    fn now_ms(&self) -> f64 {
        self.started.elapsed().as_secs_f64() * 1000.0
    }
}
