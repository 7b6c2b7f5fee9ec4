//! Workers: each claims a job, computes it, commits the result, and claims the next.

mod isolation;
mod lease;
mod priority;
mod progress;
mod run;
mod settings;

pub use isolation::serve_isolated;
pub use settings::WorkerSettings;

use super::{Queue, Works};
use run::JobRunner;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// An idle worker looks for jobs at least this often, because nothing wakes it when another
/// process files a job.
const POLL_EVERY: Duration = Duration::from_secs(1);

/// Stack of the computing threads; recursion over large meshes needs it.
const STACK_BYTES: usize = 16 << 20;

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
    /// If the system cannot start the threads.
    pub fn start(
        queue: &Arc<Queue>,
        works: &Works,
        settings: WorkerSettings,
    ) -> std::io::Result<Self> {
        let (drain, halt) = (CancellationToken::new(), CancellationToken::new());
        let mut tasks = JoinSet::new();
        for number in 0..settings.workers {
            let threads = thread_pool(&format!("worker-{number}"), settings.threads)?;
            let runner = JobRunner {
                queue: queue.clone(),
                works: works.clone(),
                settings,
                threads: Arc::new(threads),
                halt: halt.clone(),
            };
            tasks.spawn(run_jobs(runner, drain.clone()));
        }
        Ok(Self { tasks, drain, halt })
    }

    /// Claims no new jobs, gives the running ones `grace` to end, and then returns those still
    /// running to the queue.
    pub async fn stop(mut self, grace: Duration) {
        self.drain.cancel();
        let drained = async { while self.tasks.join_next().await.is_some() {} };
        if tokio::time::timeout(grace, drained).await.is_err() {
            self.halt.cancel();
            while self.tasks.join_next().await.is_some() {}
        }
    }
}

/// Threads for computing, with enough stack.
fn thread_pool(name: &str, threads: usize) -> std::io::Result<rayon::ThreadPool> {
    let name = name.to_owned();
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(move |thread| format!("{name}-{thread}"))
        .stack_size(STACK_BYTES)
        .start_handler(|_| priority::yield_to_requests())
        .build()
        .map_err(std::io::Error::other)
}

async fn run_jobs(runner: JobRunner, drain: CancellationToken) {
    while !drain.is_cancelled() {
        match runner.run_next_job().await {
            Ok(true) => continue,
            Ok(false) => {}
            Err(error) => tracing::error!(%error, "the storage failed while a job was run"),
        }
        tokio::select! {
            () = runner.queue.woken() => {}
            () = tokio::time::sleep(POLL_EVERY) => {}
            () = drain.cancelled() => {}
        }
    }
}
