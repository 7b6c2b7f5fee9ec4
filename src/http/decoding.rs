//! Decoding files outside of jobs: inspecting uploads, drawing previews and pages.
//!
//! A small file can be costly to decode (half a mebibyte of gzip may hold half a gibibyte), so the
//! cost is bounded and shared out:
//!
//! 1. Admission. Each piece of work states the memory that it needs at most. It is admitted when
//!    that much of the budget is free (setting `decoding_memory`). What waits is admitted client by
//!    client in turn, so that one client's queue does not delay another's work. The queue is
//!    bounded (setting `decoding_queue`); beyond that the answer is 503, except for a client that has less
//!    than its equal share of the queue.
//! 2. Turns. As many pieces of work as the machine has cores compute at the same time, on blocking
//!    threads. Each gives its turn to the next one after [`SLICE`] and queues again, so that short
//!    work does not wait until long work ends.
//!
//! Memory and turn belong to the computation and not to the request that waits for it: they are
//! free when the computation has ended. If the client hangs up, the computation is cancelled and
//! ends at its next report.

use super::client::ClientAddress;
use super::problem::{Answer, Problem};
use crate::config::Settings;
use crate::progress::{CancelToken, Monitor, Observer, Stage};
use axum::http::{StatusCode, header};
use prometheus::Histogram;
use std::collections::{BTreeMap, VecDeque};
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::runtime::Handle;
use tokio::sync::{OwnedSemaphorePermit, Semaphore, oneshot};

/// How long work computes before others that wait get their turn.
const SLICE: Duration = Duration::from_millis(10);

/// Memory of work that needs little, bytes. It bounds the number of threads.
pub const LITTLE_MEMORY: u64 = 8 << 20;

/// The queue and the limits of decoding.
pub struct Decoding {
    admission: Arc<Admission>,
    turns: Arc<Semaphore>,
    waits: Histogram,
}

impl Decoding {
    /// With the operator's limits. `waits` takes the time until each piece of work begins, seconds.
    pub fn new(settings: &Settings, waits: Histogram) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        Self {
            admission: Arc::new(Admission {
                budget: settings.decoding_memory.0,
                longest: settings.decoding_queue,
                queue: Mutex::new(AdmissionQueue {
                    free: settings.decoding_memory.0,
                    ..AdmissionQueue::default()
                }),
            }),
            turns: Arc::new(Semaphore::new(cores)),
            waits,
        }
    }

    /// Runs `work`, which needs at most `memory` bytes, on a blocking thread when it is its turn.
    /// Dropping the future cancels the work.
    ///
    /// # Errors
    /// 503 if too much waits, 500 if the work panics.
    pub async fn run<T: Send + 'static>(
        &self,
        memory: u64,
        work: impl FnOnce(&Monitor<'_>) -> T + Send + 'static,
    ) -> Answer<T> {
        let asked = Instant::now();
        let admitted = self
            .admission
            .enter(ClientAddress::current(), memory)
            .await?;
        let turn = self.turns.clone().acquire_owned().await;
        self.waits.observe(asked.elapsed().as_secs_f64());
        let turns = TurnTaker {
            turns: self.turns.clone(),
            runtime: Handle::current(),
            current: Mutex::new((turn.ok(), Instant::now())),
        };
        let cancel = CancelToken::new();
        let _ended = CancelOnDrop(cancel.clone());
        let run = move || {
            let result = work(&Monitor::new(&turns, cancel));
            drop((turns, admitted));
            result
        };
        tokio::task::spawn_blocking(run)
            .await
            .map_err(Problem::internal)
    }
}

struct CancelOnDrop(CancelToken);

impl Drop for CancelOnDrop {
    fn drop(&mut self) {
        self.0.cancel();
    }
}

/// Gives up the turn at the first report after [`SLICE`], and waits for the next one.
struct TurnTaker {
    turns: Arc<Semaphore>,
    runtime: Handle,
    current: Mutex<(Option<OwnedSemaphorePermit>, Instant)>,
}

impl Observer for TurnTaker {
    fn progress(&self, _: Stage, _: f64) {
        let mut current = self.current.lock().unwrap_or_else(PoisonError::into_inner);
        if current.1.elapsed() > SLICE {
            // The semaphore is fair: whoever waits goes first.
            current.0 = None;
            let next = self.runtime.block_on(self.turns.clone().acquire_owned());
            *current = (next.ok(), Instant::now());
        }
    }
}

/// Who may begin.
struct Admission {
    /// Memory of all work together, bytes.
    budget: u64,
    /// Most waiting pieces of work.
    longest: usize,
    queue: Mutex<AdmissionQueue>,
}

#[derive(Default)]
struct AdmissionQueue {
    /// Bytes of the budget that nobody holds.
    free: u64,
    /// Waiting work by client, in order of arrival; no list is empty.
    waiting: BTreeMap<ClientAddress, VecDeque<Waiting>>,
    /// The clients in `waiting`; the first is next.
    order: VecDeque<ClientAddress>,
}

struct Waiting {
    memory: u64,
    admit: oneshot::Sender<Admitted>,
}

/// The memory that admitted work holds.
struct Admitted {
    admission: Arc<Admission>,
    memory: u64,
}

impl Drop for Admitted {
    fn drop(&mut self) {
        self.admission.queue().free += self.memory;
        self.admission.advance();
    }
}

impl Admission {
    fn queue(&self) -> MutexGuard<'_, AdmissionQueue> {
        // A panic cannot leave the queue half changed: nothing between its changes can panic.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for its turn to begin.
    async fn enter(self: &Arc<Self>, client: ClientAddress, memory: u64) -> Answer<Admitted> {
        let (admit, admitted) = oneshot::channel();
        {
            let mut queue = self.queue();
            if !queue.has_room(client, self.longest) {
                // Some of them may belong to clients that have gone.
                queue.forget_gone();
                if !queue.has_room(client, self.longest) {
                    return Err(busy());
                }
            }
            // Work that needs more than the budget runs alone.
            let memory = memory.min(self.budget);
            queue.add(client, Waiting { memory, admit });
        }
        self.advance();
        admitted.await.map_err(Problem::internal)
    }

    /// Admits what fits.
    fn advance(self: &Arc<Self>) {
        while let Some(next) = self.queue().next() {
            let admitted = Admitted {
                admission: self.clone(),
                memory: next.memory,
            };
            // Without a receiver, `admitted` is dropped and the memory is free again.
            let _ = next.admit.send(admitted);
        }
    }
}

impl AdmissionQueue {
    /// Whether a queue of `longest` has room for one more of this client. One that has less than its equal
    /// share has room also where others have filled the queue.
    fn has_room(&self, client: ClientAddress, longest: usize) -> bool {
        let own = self.waiting.get(&client).map_or(0, VecDeque::len);
        let clients = self.waiting.len() + usize::from(own == 0);
        let all: usize = self.waiting.values().map(VecDeque::len).sum();
        all < longest || own * clients < longest
    }

    fn add(&mut self, client: ClientAddress, work: Waiting) {
        let list = self.waiting.entry(client).or_default();
        if list.is_empty() {
            self.order.push_back(client);
        }
        list.push_back(work);
    }

    /// Takes the next piece of work if its memory is free. Nothing overtakes it, or large work
    /// would wait for ever.
    fn next(&mut self) -> Option<Waiting> {
        self.forget_gone();
        let client = *self.order.front()?;
        let list = self.waiting.get_mut(&client)?;
        if list.front()?.memory > self.free {
            return None;
        }
        let work = list.pop_front()?;
        self.free -= work.memory;
        self.order.pop_front();
        match list.is_empty() {
            true => drop(self.waiting.remove(&client)),
            false => self.order.push_back(client),
        }
        Some(work)
    }

    /// Drops the work that no client waits for any more.
    fn forget_gone(&mut self) {
        self.waiting.retain(|_, list| {
            list.retain(|work| !work.admit.is_closed());
            !list.is_empty()
        });
        let waiting = &self.waiting;
        self.order.retain(|client| waiting.contains_key(client));
    }
}

fn busy() -> Problem {
    Problem::new(
        StatusCode::SERVICE_UNAVAILABLE,
        "busy",
        "Too many files are waiting to be read.",
    )
    .header(header::RETRY_AFTER, "5")
    .fix("Send the request again later.")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::http::metrics::Metrics;
    use std::net::IpAddr;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::sync::mpsc;

    fn decoding(memory: &str, queue: usize) -> Arc<Decoding> {
        let settings = Settings {
            decoding_memory: memory.parse().unwrap(),
            decoding_queue: queue,
            ..Settings::default()
        };
        let mut decoding = Decoding::new(&settings, Metrics::new().requests.decoding_waits);
        decoding.turns = Arc::new(Semaphore::new(2));
        Arc::new(decoding)
    }

    fn client(n: u8) -> ClientAddress {
        ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]))
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
        let admission = decoding("1MiB", 7).admission.clone();
        let first = admission.enter(client(1), 9 << 20).await.unwrap();
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut tasks = Vec::new();
        // Client 1 has four pieces waiting when the others come.
        for (n, who) in [1, 1, 1, 1, 2, 2, 3].into_iter().enumerate() {
            let (waiting, order) = (admission.clone(), order.clone());
            tasks.push(tokio::spawn(async move {
                let admitted = waiting.enter(client(who), 1 << 20).await.unwrap();
                order.lock().unwrap().push(who);
                drop(admitted);
            }));
            until(|| {
                admission
                    .queue()
                    .waiting
                    .values()
                    .map(VecDeque::len)
                    .sum::<usize>()
                    > n
            })
            .await;
        }
        // The queue is full for the client that has filled it, and not for one that has nothing in it.
        assert!(admission.enter(client(1), 1).await.is_err());
        let (waiting, order_of_4) = (admission.clone(), order.clone());
        tasks.push(tokio::spawn(async move {
            let admitted = waiting.enter(client(4), 1 << 20).await.unwrap();
            order_of_4.lock().unwrap().push(4);
            drop(admitted);
        }));
        until(|| admission.queue().waiting.len() == 4).await;
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(*order.lock().unwrap(), [1, 2, 3, 4, 1, 2, 1, 1]);
        assert!(admission.queue().order.is_empty());
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
        until(|| decoding.turns.available_permits() == 0).await;
        // The long work would never end before this.
        decoding.run(1, |_| ()).await.unwrap();
        done.cancel();
        for task in long {
            task.await.unwrap();
        }
    }
}
