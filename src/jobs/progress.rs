//! How far the work is, on its way from the work's threads to the table.

use crate::progress::{Gauge, Observer, Plan, Stage};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tokio::sync::mpsc;

/// Progress within a stage is written at most this often; a new stage at once.
const PROGRESS_PAUSE: Duration = Duration::from_millis(200);

/// One report of progress.
pub(super) struct Step {
    /// The stage at work.
    pub stage: Stage,
    /// How much of the whole is done, 0..=1.
    pub overall: f64,
}

/// Decides which reports reach the table.
#[derive(Default)]
pub(super) struct Notes {
    last: Option<(Stage, Instant)>,
}

impl Notes {
    /// Whether this report is to be written.
    pub fn worth_writing(&mut self, step: &Step) -> bool {
        let worth = match self.last {
            Some((stage, at)) => stage != step.stage || at.elapsed() >= PROGRESS_PAUSE,
            None => true,
        };
        if worth {
            self.last = Some((step.stage, Instant::now()));
        }
        worth
    }
}

/// Carries progress from the work's threads, at most a hundred reports a stage.
pub(super) struct Teller {
    steps: mpsc::UnboundedSender<Step>,
    gauge: Gauge,
    /// Stage and per cent last told, packed.
    told: AtomicU32,
    started: Instant,
}

impl Teller {
    /// A teller of work with these stages.
    pub fn new(plan: Plan, steps: mpsc::UnboundedSender<Step>) -> Self {
        Self {
            steps,
            gauge: Gauge::new(plan),
            told: AtomicU32::new(u32::MAX),
            started: Instant::now(),
        }
    }
}

impl Observer for Teller {
    fn progress(&self, stage: Stage, fraction: f64) {
        let now = (stage as u32) * 1000 + (fraction * 100.0) as u32;
        if self.told.swap(now, Ordering::Relaxed) != now {
            let overall = self.gauge.advance(stage, fraction);
            let _ = self.steps.send(Step { stage, overall });
        }
    }

    fn now_ms(&self) -> f64 {
        self.started.elapsed().as_secs_f64() * 1000.0
    }
}
