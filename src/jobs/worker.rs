//! The workers: each claims a job, has it computed, commits, and claims the next.

use super::runner::Runner;
use super::{Engine, Queue};
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// A worker that nobody woke looks for work this often: leases run out in silence.
const POLL: Duration = Duration::from_secs(1);

/// Deep enough for recursion over large meshes.
const STACK_BYTES: usize = 16 << 20;

/// How jobs are computed.
#[derive(Debug, Clone, Copy)]
pub struct WorkerSettings {
    /// Jobs at the same time.
    pub workers: usize,
    /// Threads of each.
    pub threads: usize,
    /// How long a worker holds a job without a sign of life.
    pub lease: Duration,
    /// Starts of one job before it is given up.
    pub attempt_limit: u32,
    /// Longest computation of one job.
    pub time_limit: Duration,
}

/// The running workers.
pub struct Workers {
    tasks: JoinSet<()>,
    drain: CancellationToken,
    halt: CancellationToken,
}

impl Workers {
    /// Starts the workers.
    ///
    /// # Errors
    /// If the system refuses threads.
    pub fn start(
        queue: &Arc<Queue>,
        engine: &Engine,
        settings: WorkerSettings,
    ) -> std::io::Result<Self> {
        let (drain, halt) = (CancellationToken::new(), CancellationToken::new());
        let mut tasks = JoinSet::new();
        for number in 0..settings.workers {
            let threads = rayon::ThreadPoolBuilder::new()
                .num_threads(settings.threads)
                .thread_name(move |thread| format!("worker-{number}-{thread}"))
                .stack_size(STACK_BYTES)
                .build()
                .map_err(std::io::Error::other)?;
            let runner = Runner {
                queue: queue.clone(),
                engine: engine.clone(),
                settings,
                threads: Arc::new(threads),
                halt: halt.clone(),
            };
            tasks.spawn(work(runner, drain.clone()));
        }
        Ok(Self { tasks, drain, halt })
    }

    /// Takes no new jobs; gives running ones `grace` to end; hands the rest back to the
    /// queue.
    pub async fn stop(mut self, grace: Duration) {
        self.drain.cancel();
        let drained = async { while self.tasks.join_next().await.is_some() {} };
        if tokio::time::timeout(grace, drained).await.is_err() {
            self.halt.cancel();
            while self.tasks.join_next().await.is_some() {}
        }
    }
}

async fn work(runner: Runner, drain: CancellationToken) {
    while !drain.is_cancelled() {
        match runner.run_next_job().await {
            Ok(true) => continue,
            Ok(false) => {}
            Err(error) => tracing::error!(%error, "no job could be claimed"),
        }
        tokio::select! {
            () = runner.queue.woken() => {}
            () = tokio::time::sleep(POLL) => {}
            () = drain.cancelled() => {}
        }
    }
}
