//! Work beside the interpreter.
//!
//! In: work that takes a [`Monitor`]. Out: its result, or an exception.
//!
//! 1. The work runs on a thread of its own, in a pool of threads that belongs to this process: a process that was
//!    forked has none of its parent's threads and makes its own.
//! 2. The calling thread lets go of the interpreter and looks every [`LOOK_EVERY`] for signals (Ctrl-C) and for
//!    progress, which it tells the caller's function.
//! 3. A signal, or an exception of that function, cancels the work. Its exception is raised when the work has ended,
//!    which takes a stage at most 50 ms.
//!
//! Guaranteed: a panic becomes an exception.

use crate::errors::{Stopped, broken, exception, internal};
use numpy::PyArray1;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use ventriform::base::progress::{CancelToken, Monitor, Observer, Plan, Stage, TotalProgress};

/// Time between two looks for signals and progress.
const LOOK_EVERY: Duration = Duration::from_millis(25);

/// The pools of this process, by its number and by that of their threads: 0 for as many as there are processors.
static PROCESS_POOLS: Mutex<Vec<(u32, usize, Arc<ThreadPool>)>> = Mutex::new(Vec::new());

/// Most threads that a call may ask for.
const MOST_THREADS: usize = 1024;

/// How a call works: whom it tells of its progress, and on how many threads.
#[derive(FromPyObject, Default)]
pub struct How<'py>(Option<Bound<'py, PyAny>>, Option<usize>);

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Imports NumPy, which the first array does otherwise: a signal that arrives then would be a panic.
fn import_numpy(py: Python<'_>) -> PyResult<()> {
    static NUMPY_IMPORTED: AtomicBool = AtomicBool::new(false);
    if !NUMPY_IMPORTED.load(Ordering::Relaxed) {
        py.import("numpy")?;
        PyArray1::<f64>::zeros(py, 0, false);
        NUMPY_IMPORTED.store(true, Ordering::Relaxed);
    }
    Ok(())
}

/// The pool of this process with so many threads. It is asked for with the interpreter held, so that no other thread holds
/// the lock while a process is forked.
fn pool(py: Python<'_>, threads: Option<usize>) -> PyResult<Arc<ThreadPool>> {
    let threads = threads.unwrap_or(0).min(MOST_THREADS);
    let mut kept = lock(&PROCESS_POOLS);
    let process = std::process::id();
    let own = (kept.iter()).find(|(owner, size, _)| (*owner, *size) == (process, threads));
    if let Some((_, _, pool)) = own {
        return Ok(Arc::clone(pool));
    }
    let made = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|n| format!("ventriform-{n}"))
        .build()
        .map_err(|error| exception(py, &broken(error)))?;
    let made = Arc::new(made);
    // The threads of a parent's pools are not here to be told to end.
    let (own, parents) = (kept.drain(..)).partition(|(owner, _, _)| *owner == process);
    *kept = own;
    std::mem::forget::<Vec<_>>(parents);
    kept.push((process, threads, Arc::clone(&made)));
    Ok(made)
}

type Outcome<T> = Result<Result<T, Stopped>, Box<dyn Any + Send>>;

/// The state that the working thread shares with the calling one: outcome, stage, progress.
struct Watch<T> {
    outcome: Mutex<Option<Outcome<T>>>,
    ended: Condvar,
    latest: Mutex<Option<(&'static str, f64)>>,
    stage: Mutex<&'static str>,
    total: TotalProgress,
    cancel: CancelToken,
    begin: Instant,
}

impl<T: Send> Watch<T> {
    fn new(plan: Plan) -> Self {
        Self {
            outcome: Mutex::new(None),
            ended: Condvar::new(),
            latest: Mutex::new(None),
            stage: Mutex::new(""),
            total: TotalProgress::new(plan),
            cancel: CancelToken::new(),
            begin: Instant::now(),
        }
    }

    fn tell(&self, stage: &'static str, fraction: f64) {
        *lock(&self.stage) = stage;
        let mut latest = lock(&self.latest);
        let before = latest.map_or(0.0, |(_, before)| before);
        *latest = Some((stage, fraction.max(before)));
    }

    /// As [`Watch::tell`], of steps whose fractions each begin at 0.
    fn tell_step(&self, step: &'static str, fraction: f64) {
        *lock(&self.stage) = step;
        *lock(&self.latest) = Some((step, fraction));
    }

    fn end(&self, outcome: Outcome<T>) {
        if let Ok(Ok(_)) = &outcome {
            let stage = *lock(&self.stage);
            self.tell(stage, 1.0);
        }
        *lock(&self.outcome) = Some(outcome);
        self.ended.notify_one();
    }

    /// The outcome, if there is one within [`LOOK_EVERY`].
    fn wait(&self) -> Option<Outcome<T>> {
        let outcome = lock(&self.outcome);
        let waited = self
            .ended
            .wait_timeout_while(outcome, LOOK_EVERY, |outcome| outcome.is_none());
        let (mut outcome, _) = waited.unwrap_or_else(PoisonError::into_inner);
        outcome.take()
    }

    /// Looks for signals, and tells `progress` what is new.
    fn look(&self, py: Python<'_>, progress: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        py.check_signals()?;
        let latest = lock(&self.latest).take();
        if let (Some(progress), Some((stage, fraction))) = (progress, latest) {
            progress.call1((stage, fraction))?;
        }
        Ok(())
    }
}

impl<T: Send> Observer for Watch<T> {
    fn progress(&self, stage: Stage, fraction: f64) {
        self.tell(stage.as_str(), self.total.advance(stage, fraction));
    }

    fn now_ms(&self) -> f64 {
        self.begin.elapsed().as_secs_f64() * 1e3
    }
}

fn raise<T>(py: Python<'_>, outcome: Outcome<T>) -> PyResult<T> {
    match outcome {
        Ok(Ok(made)) => Ok(made),
        Ok(Err(Stopped::Failed(failure))) => Err(exception(py, &failure)),
        Ok(Err(Stopped::Cancelled)) => Err(internal(
            py,
            "the work ended as cancelled without a request",
        )),
        Err(panic) => {
            let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
            let text = text.or_else(|| panic.downcast_ref::<String>().cloned());
            Err(internal(py, &text.unwrap_or_default()))
        }
    }
}

/// Does `work`, whose stages are those of `plan`.
pub fn run<T: Send>(
    py: Python<'_>,
    plan: Plan,
    how: &How<'_>,
    work: impl FnOnce(&Monitor<'_>) -> Result<T, Stopped> + Send,
) -> PyResult<T> {
    watched(py, plan, how, |_, monitor| work(monitor))
}

/// Tells a step of work and its completed fraction.
pub type Tell<'a> = &'a (dyn Fn(&'static str, f64) + Sync);

/// Does `work` of many scans, which tells its steps itself and not the stages of each scan.
pub fn run_steps<T: Send>(
    py: Python<'_>,
    how: &How<'_>,
    work: impl FnOnce(Tell<'_>, &Monitor<'_>) -> Result<T, Stopped> + Send,
) -> PyResult<T> {
    watched(py, Plan::SEGMENTATION, how, |watch, monitor| {
        let tell = |step, fraction| watch.tell_step(step, fraction);
        work(&tell, &monitor.without_observer())
    })
}

fn watched<T: Send>(
    py: Python<'_>,
    plan: Plan,
    How(progress, threads): &How<'_>,
    work: impl FnOnce(&Watch<T>, &Monitor<'_>) -> Result<T, Stopped> + Send,
) -> PyResult<T> {
    import_numpy(py)?;
    let progress = progress.as_ref();
    let pool = pool(py, *threads)?;
    let watch = Watch::new(plan);
    let watched = &watch;
    std::thread::scope(|scope| {
        let act = move || {
            let monitor = Monitor::new(watched, watched.cancel.clone());
            let act = AssertUnwindSafe(|| pool.install(|| work(watched, &monitor)));
            watched.end(catch_unwind(act));
        };
        let thread = std::thread::Builder::new().spawn_scoped(scope, act);
        thread.map_err(|error| exception(py, &broken(error)))?;
        let mut raised = None;
        let outcome = loop {
            if let Some(outcome) = py.detach(|| watched.wait()) {
                break outcome;
            }
            if raised.is_none()
                && let Err(error) = watched.look(py, progress)
            {
                watched.cancel.cancel();
                raised = Some(error);
            }
        };
        match raised {
            Some(error) => Err(error),
            None => {
                let made = raise(py, outcome)?;
                watched.look(py, progress)?;
                Ok(made)
            }
        }
    })
}
