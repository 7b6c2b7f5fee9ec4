//! Decoding files outside of jobs: inspecting uploads, drawing previews and pages.
//!
//! A small file can be costly to decode (half a mebibyte of gzip may hold half a gibibyte), so the
//! cost is bounded and shared out:
//!
//! 1. Admission. Each piece of work states the memory that it needs at most. It is admitted when
//!    that much of the budget is free (setting `decoding_memory`). What waits is admitted tenant by tenant in turn (or
//!    anonymous client), that of a tenant client by client ([`crate::limits::places`]). A client holds at most half of the
//!    budget, a tenant three quarters; work that needs more than half of it holds half, one piece at a time in turn. So
//!    one's queue does not delay another's work, whatever their addresses. What needs more than a quarter of the memory
//!    that the process may have, and more than the budget, is refused. The queue is bounded (setting `decoding_queue`);
//!    beyond that the answer is `busy`, except for a requester that has less than its equal share of the queue.
//! 2. Turns. As many pieces of work as the machine has cores compute at the same time, on blocking
//!    threads. Each gives up its turn after [`TURN_SLICE`] if other work goes before it, that of tenants and clients
//!    that have computed less ([`Turns`]), and queues again: short work does not wait until long work ends, nor that of
//!    one client for that of another. Work that has not reported for [`STALL_TIME`], and work whose client hung up,
//!    loses its turn without being asked; it goes on beside the others until it reports, as one of at
//!    most [`OVERRUNS_PER_CORE`] per core.
//! 3. Time. Work computes for at most `decoding_time`, and one second more for every `decoding_rate`
//!    bytes of its file; it is then ended with `decoding-time`. For how long a thread waits for a processor
//!    does not count ([`ThreadClock`]). While other work has waited for [`ADMISSION_PATIENCE`] for memory, work that
//!    has used a [`COSTLY_SHARE`] of its time is ended with `busy`.
//!
//! Memory and turn belong to the computation and not to the request that waits for it: the memory is
//! free when the computation has ended. If the client hangs up, the computation is cancelled and
//! ends at its next report.

mod process_memory;
mod thread_clock;
mod turns;

use crate::base::error::{Refusal, ServiceError};
use crate::base::memory::Requester;
use crate::base::records::{Failure, Fault};
use crate::limits::places::{Place, Places, Rounds};
use process_memory::process_memory;
use prometheus::Histogram;
use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::{Duration, Instant};
use thread_clock::{Moment, ThreadClock};
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};
use tokio_util::sync::CancellationToken;
use turns::{Turn, Turns};
use ventriform::base::progress::{CancelToken, Monitor, Observer, Stage};

/// Time for which work computes before others that wait get their turn.
const TURN_SLICE: Duration = Duration::from_millis(10);

/// How long work keeps its turn without a report, and how often that is looked at.
const STALL_TIME: Duration = Duration::from_millis(50);

/// Pieces of work for each core that go on after they lost their turn. The more there are, the slower is the work
/// that has the turn.
const OVERRUNS_PER_CORE: usize = 2;

/// Time for which work waits for memory before costly work is ended for it.
const ADMISSION_PATIENCE: Duration = Duration::from_secs(1);

/// The part of its time after which work is costly: one in so many.
const COSTLY_SHARE: u32 = 20;

/// Pause before work is tried again that found the queue full.
const BUSY_RETRY: Duration = Duration::from_secs(5);

/// Memory of work that needs little, bytes. It bounds the number of threads.
pub const LITTLE_MEMORY: u64 = 8 << 20;

/// The limits of decoding.
#[derive(Debug, Clone, Copy)]
pub struct DecodingLimits {
    /// Most memory of all work, bytes.
    pub memory: u64,
    /// Most pieces of work that wait.
    pub queue: usize,
    /// Longest time of a piece of work.
    pub time: Duration,
    /// Bytes of a file for which a second is added.
    pub rate: u64,
}

/// The queue and the limits of decoding.
pub struct Decoding {
    admission: Arc<Admission>,
    turns: Arc<Turns>,
    overruns: Arc<Semaphore>,
    /// Most memory that a piece of work may need, bytes.
    largest: u64,
    /// Time of any piece of work.
    time: Duration,
    /// Bytes of a file for which a second is added.
    rate: u64,
    waits: Histogram,
}

impl Decoding {
    /// With these limits. `waits` takes the time until each piece of work begins, seconds.
    pub fn new(limits: DecodingLimits, waits: Histogram) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        Self {
            admission: Arc::new(Admission {
                large: Places::new(1),
                longest: limits.queue,
                queue: Mutex::new(AdmissionQueue {
                    free: limits.memory,
                    share: limits.memory / 2,
                    group_share: limits.memory / 4 * 3,
                    ..AdmissionQueue::default()
                }),
            }),
            turns: Turns::new(cores),
            overruns: Arc::new(Semaphore::new(cores * OVERRUNS_PER_CORE)),
            largest: largest_work(limits.memory, process_memory()),
            time: limits.time,
            rate: limits.rate.max(1),
            waits,
        }
    }

    /// Runs `work`, which reads no file and needs at most `memory` bytes, on a blocking thread when it is its turn.
    /// Dropping the future cancels the work. Its memory gives it no time: a small file may need much.
    ///
    /// # Errors
    /// `too-large` if the work needs more memory than the process can spare, `busy` if too much waits, `decoding-time`
    /// if the work takes too long, `internal` if it panics.
    pub async fn run<T: Send + 'static>(
        &self,
        memory: u64,
        work: impl FnOnce(&Monitor<'_>) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        self.run_on(0, memory, work).await
    }

    /// As [`Decoding::run`], for work on files of `bytes` bytes as they are stored.
    ///
    /// # Errors
    /// As [`Decoding::run`].
    pub async fn run_on<T: Send + 'static>(
        &self,
        bytes: u64,
        memory: u64,
        work: impl FnOnce(&Monitor<'_>) -> T + Send + 'static,
    ) -> Result<T, ServiceError> {
        if memory > self.largest {
            return Err(too_large(memory, self.largest));
        }
        let (asked, requester) = (Instant::now(), Requester::current());
        let admitted = self.admission.enter(requester.clone(), memory).await?;
        let turn = self.turns.take(requester.clone()).await;
        self.waits.observe(asked.elapsed().as_secs_f64());
        let extra = Duration::from_secs_f64(bytes as f64 / self.rate as f64);
        let task = Arc::new(Task {
            requester,
            turns: self.turns.clone(),
            overruns: self.overruns.clone(),
            cancel: CancelToken::new(),
            stopped: CancellationToken::new(),
            limit: self.time.saturating_add(extra),
            state: Mutex::new(TaskState {
                turn,
                ..TaskState::default()
            }),
        });
        admitted.begins(&task);
        let _ended = StopOnDrop(task.clone());
        let observer = TurnTaker {
            task: task.clone(),
            runtime: Handle::current(),
        };
        let run = move || {
            observer.task.begin();
            let result = work(&Monitor::new(&observer, observer.task.cancel.clone()));
            observer.task.pause();
            drop((observer, admitted));
            result
        };
        let mut running = tokio::task::spawn_blocking(run);
        let mut look = tokio::time::interval(STALL_TIME);
        let result = loop {
            tokio::select! {
                result = &mut running => break result,
                _ = look.tick() => task.look(),
                // The work goes on until its next report; its client is answered at once.
                () = task.stopped.cancelled() => return Err(task.error()),
            }
        };
        if task.stopped.is_cancelled() {
            Err(task.error())
        } else {
            result.map_err(ServiceError::internal)
        }
    }
}

/// A piece of work that computes.
struct Task {
    requester: Requester,
    turns: Arc<Turns>,
    overruns: Arc<Semaphore>,
    cancel: CancelToken,
    /// Cancelled together with `cancel`, for what waits.
    stopped: CancellationToken,
    /// Longest time that it may compute.
    limit: Duration,
    state: Mutex<TaskState>,
}

#[derive(Default)]
struct TaskState {
    /// Its turn.
    turn: Option<Turn>,
    /// Its place among those that go on without a turn.
    overrun: Option<OwnedSemaphorePermit>,
    /// The clock of its thread, once it has begun.
    clock: Option<ThreadClock>,
    /// Since when it computes; `None` while it waits.
    since: Option<(Instant, Moment)>,
    /// The time that it computed before.
    before: Duration,
    /// The part of that with which its client was charged.
    counted: Duration,
    /// Whether it was ended for others that wait.
    displaced: bool,
}

impl TaskState {
    /// The time that it has computed.
    fn computed(&self) -> Duration {
        let now = match (&self.clock, self.since) {
            (Some(clock), Some((_, then))) => clock.since(then),
            _ => Duration::ZERO,
        };
        self.before + now
    }

    /// How much time has passed since it got its turn, or the last one ended.
    fn passed(&self) -> Option<Duration> {
        self.since.map(|(since, _)| since.elapsed())
    }
}

impl Task {
    fn state(&self) -> MutexGuard<'_, TaskState> {
        // A panic cannot leave the state half changed: each change is a few plain statements.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// It begins, on the thread that calls.
    fn begin(&self) {
        let clock = ThreadClock::of_this_thread();
        let mut state = self.state();
        state.since = Some((Instant::now(), clock.now()));
        state.clock = Some(clock);
    }

    /// Charges its client with what it has computed.
    fn count(&self, state: &mut TaskState) {
        let computed = state.computed();
        let new = computed.saturating_sub(state.counted);
        state.counted = computed;
        self.turns.count(&self.requester, new);
    }

    fn stop(&self) {
        self.cancel.cancel();
        self.stopped.cancel();
    }

    /// Gives up its turn: it waits, or has ended.
    fn pause(&self) {
        let mut state = self.state();
        self.count(&mut state);
        state.before = state.computed();
        let left = (state.turn.take(), state.overrun.take());
        state.since = None;
        drop(state);
        // The next one begins with the state free.
        drop(left);
    }

    /// Takes its turn away if it has not reported for too long, and ends it after its time.
    fn look(&self) {
        let mut state = self.state();
        self.count(&mut state);
        if state.passed().is_some_and(|passed| passed >= STALL_TIME) {
            self.take_turn(&mut state);
        }
        if state.computed() > self.limit {
            drop(state);
            self.stop();
        }
    }

    /// Gives its turn to the next one while it computes on, if few do so.
    fn take_turn(&self, state: &mut TaskState) {
        if state.turn.is_some()
            && let Ok(place) = self.overruns.clone().try_acquire_owned()
        {
            (state.turn, state.overrun) = (None, Some(place));
        }
    }

    /// Why it was stopped.
    fn error(&self) -> ServiceError {
        if self.state().displaced {
            return busy();
        }
        let seconds = self.limit.as_secs_f64();
        let detail = format!(
            "Reading the file takes longer than the {seconds:.1} s that are allowed for its size."
        );
        Failure::new(Fault::Content, "decoding-time", detail)
            .fix("Send the image uncompressed, or ask the operator to raise `decoding_time`.")
            .into()
    }
}

/// Stops the work of a request that has ended, for example because its client hung up.
struct StopOnDrop(Arc<Task>);

impl Drop for StopOnDrop {
    fn drop(&mut self) {
        self.0.stop();
        let mut state = self.0.state();
        self.0.take_turn(&mut state);
    }
}

/// Gives up the turn at the first report after [`TURN_SLICE`], and waits for the next one.
struct TurnTaker {
    task: Arc<Task>,
    runtime: Handle,
}

impl Observer for TurnTaker {
    fn progress(&self, _: Stage, _: f64) {
        let task = &self.task;
        {
            let mut state = task.state();
            if state.passed().is_some_and(|passed| passed <= TURN_SLICE)
                || task.cancel.is_cancelled()
            {
                return;
            }
            task.count(&mut state);
            // It goes on where nobody goes before it.
            if state.turn.is_some() && !task.turns.others_wait(&task.requester) {
                state.before = state.computed();
                state.since = state
                    .clock
                    .as_ref()
                    .map(|clock| (Instant::now(), clock.now()));
                return;
            }
        }
        task.pause();
        let next = self.runtime.block_on(async {
            tokio::select! {
                turn = task.turns.take(task.requester.clone()) => turn,
                () = task.stopped.cancelled() => None,
            }
        });
        let mut state = task.state();
        state.turn = next;
        state.since = state
            .clock
            .as_ref()
            .map(|clock| (Instant::now(), clock.now()));
    }
}

/// Who may begin.
struct Admission {
    /// The place for work that needs more than half of the budget.
    large: Arc<Places>,
    /// Most waiting pieces of work.
    longest: usize,
    queue: Mutex<AdmissionQueue>,
}

#[derive(Default)]
struct AdmissionQueue {
    /// Bytes of the budget that nobody holds.
    free: u64,
    /// Most bytes that one requester holds.
    share: u64,
    /// Most bytes that one tenant holds.
    group_share: u64,
    /// Bytes that each requester holds; none is 0.
    held: BTreeMap<Requester, u64>,
    /// The work that computes.
    running: Vec<Weak<Task>>,
    /// When work was last ended for others that wait.
    displaced: Option<Instant>,
    /// Waiting work.
    waiting: Rounds<Waiting>,
}

struct Waiting {
    memory: u64,
    admit: oneshot::Sender<Admitted>,
}

/// The memory that admitted work holds.
struct Admitted {
    admission: Arc<Admission>,
    requester: Requester,
    memory: u64,
    /// The place of large work.
    _large: Option<Place>,
}

impl Admitted {
    /// Enters its work as that which computes.
    fn begins(&self, task: &Arc<Task>) {
        let mut queue = self.admission.queue();
        queue.running.retain(|task| task.strong_count() > 0);
        queue.running.push(Arc::downgrade(task));
    }
}

impl Drop for Admitted {
    fn drop(&mut self) {
        let mut queue = self.admission.queue();
        queue.free += self.memory;
        if let Some(held) = queue.held.get_mut(&self.requester) {
            *held -= self.memory;
            if *held == 0 {
                queue.held.remove(&self.requester);
            }
        }
        drop(queue);
        self.admission.advance();
    }
}

impl Admission {
    fn take_next(&self) -> Option<(Requester, Waiting)> {
        self.queue().next()
    }

    fn queue(&self) -> MutexGuard<'_, AdmissionQueue> {
        // A panic cannot leave the queue half changed: nothing between its changes can panic.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for its turn to begin.
    async fn enter(
        self: &Arc<Self>,
        requester: Requester,
        memory: u64,
    ) -> Result<Admitted, ServiceError> {
        let share = self.queue().share;
        let mut large = if memory > share {
            Some(self.enter_large(&requester).await?)
        } else {
            None
        };
        let (admit, admitted) = oneshot::channel();
        {
            let mut queue = self.queue();
            if !queue.waiting.has_room(&requester, self.longest) {
                // Some of them may belong to clients that have gone.
                queue.forget_gone();
                if !queue.waiting.has_room(&requester, self.longest) {
                    return Err(busy());
                }
            }
            let memory = memory.min(share);
            queue.waiting.push(requester, Waiting { memory, admit });
        }
        self.advance();
        let mut admitted = std::pin::pin!(admitted);
        loop {
            tokio::select! {
                admitted = &mut admitted => {
                    let mut admitted = admitted.map_err(ServiceError::internal)?;
                    admitted._large = large.take();
                    return Ok(admitted);
                }
                () = tokio::time::sleep(ADMISSION_PATIENCE) => self.displace(),
            }
        }
    }

    /// Waits for the place of large work.
    async fn enter_large(&self, requester: &Requester) -> Result<Place, ServiceError> {
        if !self.large.has_room(requester, self.longest) {
            return Err(busy());
        }
        let mut place = std::pin::pin!(self.large.take_for(requester.clone()));
        loop {
            tokio::select! {
                place = &mut place => return Ok(place),
                () = tokio::time::sleep(ADMISSION_PATIENCE) => self.displace(),
            }
        }
    }

    /// Ends the costliest piece of work for others that wait, one at a time.
    fn displace(&self) {
        let mut queue = self.queue();
        if queue
            .displaced
            .is_some_and(|last| last.elapsed() < ADMISSION_PATIENCE)
        {
            return;
        }
        let running: Vec<Arc<Task>> = queue.running.iter().filter_map(Weak::upgrade).collect();
        let used = |task: &Task| {
            let computed = task.state().computed();
            computed.as_secs_f64() / task.limit.as_secs_f64().max(f64::MIN_POSITIVE)
        };
        let going = running.iter().filter(|task| !task.cancel.is_cancelled());
        let costliest = going.max_by(|a, b| used(a).total_cmp(&used(b)));
        if let Some(task) = costliest.filter(|task| used(task) * f64::from(COSTLY_SHARE) >= 1.0) {
            queue.displaced = Some(Instant::now());
            task.state().displaced = true;
            task.stop();
        }
    }

    /// Admits what fits.
    fn advance(self: &Arc<Self>) {
        while let Some((requester, next)) = self.take_next() {
            let admitted = Admitted {
                admission: self.clone(),
                requester,
                memory: next.memory,
                _large: None,
            };
            // Without a receiver, `admitted` is dropped and the memory is free again.
            let _ = next.admit.send(admitted);
        }
    }
}

impl AdmissionQueue {
    /// Takes the next piece of work if its memory is free. Nothing overtakes it, or large work
    /// would wait for ever; only requesters that hold their share are passed over.
    fn next(&mut self) -> Option<(Requester, Waiting)> {
        self.forget_gone();
        let fits = |requester: &Requester, work: &Waiting| {
            let held = self.held.get(requester).copied().unwrap_or(0);
            let fits_group = || {
                let of_group = |(other, _): &(&Requester, &u64)| other.group() == requester.group();
                let together: u64 = self
                    .held
                    .iter()
                    .filter(of_group)
                    .map(|(_, held)| held)
                    .sum();
                together == 0 || together + work.memory <= self.group_share
            };
            let fits_client = held == 0 || held + work.memory <= self.share;
            requester.is_service() || fits_client && fits_group()
        };
        let (requester, work) = self.waiting.next(fits)?;
        if work.memory > self.free {
            return None;
        }
        let requester = requester.clone();
        let work = self.waiting.take(&requester)?;
        self.free -= work.memory;
        if work.memory > 0 {
            *self.held.entry(requester.clone()).or_default() += work.memory;
        }
        Some((requester, work))
    }

    /// Drops the work that nobody waits for any more.
    fn forget_gone(&mut self) {
        self.waiting.retain(|work| !work.admit.is_closed());
    }
}

/// Most memory that one piece of work may need: the budget, or a quarter of what the process may have where that is
/// more.
fn largest_work(budget: u64, process: Option<u64>) -> u64 {
    process.map_or(u64::MAX, |bytes| budget.max(bytes / 4))
}

fn too_large(memory: u64, most: u64) -> ServiceError {
    let mebibytes = |bytes: u64| bytes.div_ceil(1 << 20);
    let detail = format!(
        "This takes {} MiB of memory at once, more than the {} MiB that the service has for it.",
        mebibytes(memory),
        mebibytes(most)
    );
    Failure::new(Fault::Content, "too-large", detail)
        .fix("Download the upload itself (`content`), or ask the operator for more memory or a larger \
            `decoding_memory`.")
        .into()
}

fn busy() -> ServiceError {
    let failure = Failure::new(
        Fault::Service,
        "busy",
        "Too many files are waiting to be read.",
    );
    ServiceError::new(
        Refusal::Unavailable,
        failure.fix("Send the request again later."),
    )
    .after(BUSY_RETRY)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::client::ClientAddress;
    use crate::config::Size;
    use crate::telemetry::Metrics;
    use std::net::IpAddr;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc;

    /// The defaults of the settings.
    const LIMITS: DecodingLimits = DecodingLimits {
        memory: 256 << 20,
        queue: 256,
        time: Duration::from_secs(10),
        rate: 1 << 20,
    };

    fn decoding(memory: &str, queue: usize) -> Arc<Decoding> {
        let limits = DecodingLimits {
            memory: memory.parse::<Size>().unwrap().0,
            queue,
            ..LIMITS
        };
        let mut decoding = Decoding::new(limits, Metrics::new().requests.decoding_waits);
        decoding.turns = Turns::new(2);
        Arc::new(decoding)
    }

    fn client(n: u8) -> Requester {
        Requester::anonymous(ClientAddress::of_peer(IpAddr::from([10, 0, 0, n])))
    }

    async fn until(condition: impl Fn() -> bool) {
        let limit = Instant::now() + Duration::from_secs(20);
        while !condition() {
            assert!(Instant::now() < limit);
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn work_of_clients_that_hung_up_still_counts() {
        let decoding = decoding("2MiB", 100);
        let most = Arc::new((AtomicUsize::new(0), AtomicUsize::new(0)));
        let (release, hold) = mpsc::channel::<()>();
        let hold = Arc::new(Mutex::new(hold));
        let mut tasks = Vec::new();
        for _ in 0..8 {
            let (decoding, most, hold) = (decoding.clone(), most.clone(), hold.clone());
            tasks.push(tokio::spawn(async move {
                let work = move |_: &Monitor<'_>| {
                    let now = most.0.fetch_add(1, Ordering::SeqCst) + 1;
                    most.1.fetch_max(now, Ordering::SeqCst);
                    // Deaf to cancelling, as between two reports.
                    let _ = hold.lock().unwrap().recv();
                    most.0.fetch_sub(1, Ordering::SeqCst);
                };
                let _ = decoding.run(1 << 20, work).await;
            }));
        }
        until(|| most.0.load(Ordering::SeqCst) == 2).await;
        for task in &tasks[..6] {
            task.abort();
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
        drop(release);
        until(|| decoding.admission.queue().free == 2 << 20).await;
        assert_eq!(most.1.load(Ordering::SeqCst), 2);
    }

    /// A small file that is costly to decode states much memory.
    #[tokio::test(flavor = "multi_thread")]
    async fn time_is_given_for_the_bytes_of_a_file_and_not_for_memory() {
        let limits = DecodingLimits {
            memory: 1 << 30,
            time: Duration::from_millis(100),
            ..LIMITS
        };
        let decoding = Decoding::new(limits, Metrics::new().requests.decoding_waits);
        let compute = |monitor: &Monitor<'_>| {
            let end = Instant::now() + Duration::from_secs(20);
            while monitor.report(Stage::Read, 0.0).is_ok() && Instant::now() < end {
                std::hint::spin_loop();
            }
        };
        for (bytes, memory, least) in [(0, 512 << 20, 0), (1, 512 << 20, 0), (1 << 20, 1, 1000)] {
            let begun = Instant::now();
            let ended = decoding.run_on(bytes, memory, compute).await;
            assert_eq!(ended.unwrap_err().failure.code, "decoding-time");
            let took = begun.elapsed();
            assert!(took >= Duration::from_millis(least), "{bytes}: {took:?}");
            assert!(took < Duration::from_secs(15), "{bytes}: {took:?}");
        }
        let ended = decoding.run(512 << 20, compute).await;
        assert_eq!(ended.unwrap_err().failure.code, "decoding-time");
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn work_that_needs_more_than_the_process_can_spare_is_refused() {
        assert_eq!(largest_work(5, Some(8)), 5);
        assert_eq!(largest_work(5, Some(40)), 10);
        let mut decoding = decoding("1MiB", 100);
        Arc::get_mut(&mut decoding).unwrap().largest = largest_work(1 << 20, Some(16 << 20));
        decoding.run(4 << 20, |_| ()).await.unwrap();
        let refused = decoding.run((4 << 20) + 1, |_| ()).await.unwrap_err();
        assert_eq!(refused.failure.code, "too-large");
        assert_eq!(decoding.admission.queue().free, 1 << 20);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn large_work_leaves_half_of_the_memory_to_other_work() {
        let admission = decoding("4MiB", 100).admission.clone();
        let large = admission.enter(client(1), 100 << 20).await.unwrap();
        drop(admission.enter(client(2), 2 << 20).await.unwrap());
        // Other large work waits.
        let waiting = admission.clone();
        let other = tokio::spawn(async move { waiting.enter(client(3), 3 << 20).await.map(drop) });
        tokio::time::sleep(Duration::from_millis(50)).await;
        assert!(!other.is_finished());
        drop(large);
        other.await.unwrap().unwrap();
        assert_eq!(admission.queue().free, 4 << 20);
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_tenant_leaves_memory_to_others_whatever_its_addresses() {
        let admission = decoding("8MiB", 100).admission.clone();
        let caller = |tenant: &str, n: u8| {
            let address = ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]));
            Requester::of_tenant(tenant.parse().unwrap(), address)
        };
        let mut held = Vec::new();
        for n in 0..6 {
            held.push(admission.enter(caller("a", n), 1 << 20).await.unwrap());
        }
        // It holds three quarters; from another address it waits, and another tenant does not.
        let (waiting, seventh) = (admission.clone(), caller("a", 7));
        let waits = tokio::spawn(async move { waiting.enter(seventh, 1 << 20).await.map(drop) });
        until(|| admission.queue().waiting.len() == 1).await;
        drop(admission.enter(caller("b", 1), 2 << 20).await.unwrap());
        assert!(!waits.is_finished());
        held.pop();
        waits.await.unwrap().unwrap();
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn hanging_up_cancels_the_work() {
        let decoding = decoding("1MiB", 100);
        let (tell, told) = mpsc::channel();
        let task = tokio::spawn({
            let decoding = decoding.clone();
            async move {
                let work = move |monitor: &Monitor<'_>| {
                    tell.send("begun").unwrap();
                    while monitor.report(Stage::Read, 0.0).is_ok() {
                        std::thread::sleep(Duration::from_millis(1));
                    }
                    tell.send("cancelled").unwrap();
                };
                decoding.run(1, work).await
            }
        });
        let told = tokio::task::spawn_blocking(move || {
            assert_eq!(told.recv().unwrap(), "begun");
            task.abort();
            told.recv_timeout(Duration::from_secs(20))
        });
        assert_eq!(told.await.unwrap(), Ok("cancelled"));
        until(|| decoding.admission.queue().free == 1 << 20).await;
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn clients_are_admitted_in_turn_and_the_queue_is_bounded() {
        let admission = decoding("4MiB", 7).admission.clone();
        let _kept = admission.enter(client(9), 2 << 20).await.unwrap();
        let first = admission.enter(client(8), 2 << 20).await.unwrap();
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut tasks = Vec::new();
        // Client 1 has four pieces waiting when the others come.
        for (n, who) in [1, 1, 1, 1, 2, 2, 3].into_iter().enumerate() {
            let (waiting, order) = (admission.clone(), order.clone());
            tasks.push(tokio::spawn(async move {
                let admitted = waiting.enter(client(who), 2 << 20).await.unwrap();
                order.lock().unwrap().push(who);
                drop(admitted);
            }));
            until(|| admission.queue().waiting.len() > n).await;
        }
        // The queue is full for the client that has filled it, and not for one that has nothing in it.
        assert!(admission.enter(client(1), 1).await.is_err());
        let (waiting, order_of_4) = (admission.clone(), order.clone());
        tasks.push(tokio::spawn(async move {
            let admitted = waiting.enter(client(4), 2 << 20).await.unwrap();
            order_of_4.lock().unwrap().push(4);
            drop(admitted);
        }));
        until(|| admission.queue().waiting.len() == 8).await;
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(*order.lock().unwrap(), [1, 2, 3, 4, 1, 2, 1, 1]);
        assert!(admission.queue().waiting.is_empty());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn short_work_does_not_wait_until_long_work_ends() {
        let decoding = decoding("1GiB", 100);
        let done = CancelToken::new();
        let mut long = Vec::new();
        for _ in 0..4 {
            let (decoding, done) = (decoding.clone(), done.clone());
            long.push(tokio::spawn(async move {
                let work = move |monitor: &Monitor<'_>| {
                    while !done.is_cancelled() {
                        monitor.report(Stage::Read, 0.0).unwrap();
                        std::thread::sleep(Duration::from_millis(1));
                    }
                };
                decoding.run(1, work).await.unwrap();
            }));
        }
        until(|| decoding.turns.free() == 0).await;
        // The long work would never end before this.
        decoding.run(1, |_| ()).await.unwrap();
        done.cancel();
        for task in long {
            task.await.unwrap();
        }
    }
}
