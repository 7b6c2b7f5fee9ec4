//! Settings of the workers.

use std::time::Duration;

/// The settings of the workers.
#[derive(Debug, Clone, Copy)]
pub struct WorkerSettings {
    /// Number of jobs computed at the same time.
    pub workers: usize,
    /// Threads per job.
    pub threads: usize,
    /// Time for which other runs of the service respect a claim that is not renewed.
    pub lease: Duration,
    /// Crashes of its own process after which a job fails.
    pub attempt_limit: u32,
    /// Longest computation of one job.
    pub time_limit: Duration,
}
