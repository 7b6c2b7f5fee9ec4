//! The memory that requests hold, shared out between clients.
//!
//! In: how many bytes a request is about to hold. Out: leave to do so, now or within [`MEMORY_WAIT`], or the error `busy`.
//!
//! Whatever a client can make the service keep for it is charged here before it is taken: the part of a body
//! that is gathered, what is made of it, the rows of a page, the answer until it is read. What is decoded has a
//! budget of its own ([`super::decoding`]).
//!
//! **Shares.** Of the budget (setting `request_memory`), a client gets no more than it leaves free. So one client
//! alone has at most half of it, two have a third each, and there is always something left for a client
//! that holds little. (The rule is that of dynamic thresholds for shared buffers: A. K. Choudhury and
//! E. L. Hahne, IEEE/ACM Transactions on Networking 6, 1998.)
//!
//! A request charges by [`charge`], which notes what it holds in a [`Ledger`] of the request. When the handler
//! has ended, the ledger goes with the body of the answer, and ends with it.

use crate::client::ClientAddress;
use crate::error::{Refusal, ServiceError};
use crate::records::{Failure, Fault};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::{Instant, timeout_at};

/// Longest time for which a request waits for memory.
const MEMORY_WAIT: Duration = Duration::from_secs(2);

/// Pause before a request is sent again that found no memory.
const BUSY_RETRY: Duration = Duration::from_secs(1);

/// The budget that all requests share.
#[derive(Clone)]
pub struct MemoryBudget(Arc<Shared>);

struct Shared {
    limit: u64,
    used: Mutex<Used>,
    freed: Notify,
}

#[derive(Default)]
struct Used {
    total: u64,
    by_client: BTreeMap<ClientAddress, u64>,
}

/// Memory that a client holds until this is dropped.
pub struct HeldMemory {
    budget: MemoryBudget,
    client: ClientAddress,
    bytes: u64,
}

impl MemoryBudget {
    /// A budget of `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self(Arc::new(Shared {
            limit,
            used: Mutex::default(),
            freed: Notify::new(),
        }))
    }

    /// Nothing yet, for the client of the current request.
    pub fn hold(&self) -> HeldMemory {
        HeldMemory {
            budget: self.clone(),
            client: ClientAddress::current(),
            bytes: 0,
        }
    }

    fn used(&self) -> MutexGuard<'_, Used> {
        // A panic cannot leave it half changed: each change is a few plain statements.
        self.0.used.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes `bytes` for a client if it leaves `share` times as much free as it then has.
    fn take(&self, client: ClientAddress, bytes: u64, share: u64) -> bool {
        let mut used = self.used();
        let free = self.0.limit.saturating_sub(used.total);
        let own = used.by_client.get(&client).copied().unwrap_or(0);
        let all = own.saturating_add(bytes);
        if all.saturating_mul(share) > free.saturating_sub(bytes) {
            return false;
        }
        used.total += bytes;
        used.by_client.insert(client, all);
        true
    }

    fn give_back(&self, client: ClientAddress, bytes: u64) {
        if bytes == 0 {
            return;
        }
        let mut used = self.used();
        used.total = used.total.saturating_sub(bytes);
        if let Some(own) = used.by_client.get_mut(&client) {
            *own = own.saturating_sub(bytes);
            if *own == 0 {
                used.by_client.remove(&client);
            }
        }
        drop(used);
        self.0.freed.notify_waiters();
    }
}

impl HeldMemory {
    /// Holds `bytes` more, if the client's share has them now.
    pub fn try_grow(&mut self, bytes: u64) -> bool {
        // What is larger than any share takes the largest one.
        let bytes = bytes.min((self.budget.0.limit / 2).saturating_sub(self.bytes));
        self.take(bytes, 1)
    }

    /// Holds `bytes` more, if that leaves something of the client's share to what cannot do without.
    pub fn try_extend(&mut self, bytes: u64) -> bool {
        self.take(bytes, 2)
    }

    fn take(&mut self, bytes: u64, share: u64) -> bool {
        let taken = self.budget.take(self.client, bytes, share);
        if taken {
            self.bytes += bytes;
        }
        taken
    }

    /// Holds `bytes` more, as soon as the client's share has them.
    ///
    /// # Errors
    /// `busy` if it has not within [`MEMORY_WAIT`].
    pub async fn grow(&mut self, bytes: u64) -> Result<(), ServiceError> {
        let late = Instant::now() + MEMORY_WAIT;
        loop {
            // Before looking, so that nothing is missed in between.
            let budget = self.budget.clone();
            let freed = budget.0.freed.notified();
            tokio::pin!(freed);
            freed.as_mut().enable();
            if self.try_grow(bytes) {
                return Ok(());
            }
            if timeout_at(late, freed).await.is_err() {
                return Err(busy());
            }
        }
    }

    /// Holds no more than `bytes`.
    fn shrink(&mut self, bytes: u64) {
        let surplus = self.bytes.saturating_sub(bytes);
        self.bytes -= surplus;
        self.budget.give_back(self.client, surplus);
    }

    /// Bytes that are held.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Drop for HeldMemory {
    fn drop(&mut self) {
        self.budget.give_back(self.client, self.bytes);
    }
}

fn busy() -> ServiceError {
    let failure = Failure::new(
        Fault::Service,
        "busy",
        "The requests of this client hold as much memory as one client may.",
    );
    let advice = "Send fewer requests at the same time, and read their answers.";
    ServiceError::new(Refusal::Unavailable, failure.fix(advice)).after(BUSY_RETRY)
}

/// The memory that a request holds.
#[derive(Clone)]
pub struct Ledger(Arc<tokio::sync::Mutex<HeldMemory>>);

tokio::task_local! {
    static REQUEST_LEDGER: Ledger;
}

impl Ledger {
    /// An empty ledger for the current request.
    pub fn new(budget: &MemoryBudget) -> Self {
        Self(Arc::new(tokio::sync::Mutex::new(budget.hold())))
    }

    /// Runs the answering of the request.
    pub async fn scope<T>(self, answer: impl Future<Output = T>) -> T {
        REQUEST_LEDGER.scope(self, answer).await
    }

    /// Holds `bytes` and no more: all that an answer needs which is in memory as a whole.
    ///
    /// # Errors
    /// `busy` if there is no memory for it.
    pub async fn settle(&self, bytes: u64) -> Result<(), ServiceError> {
        let held = &mut *self.0.lock().await;
        held.shrink(bytes);
        held.grow(bytes - held.bytes.min(bytes)).await
    }

    /// Bytes that the request holds.
    pub async fn bytes(&self) -> u64 {
        self.0.lock().await.bytes
    }
}

/// Charges the current request for memory that it is about to hold. Work that belongs to no request holds
/// what it needs.
///
/// # Errors
/// `busy` if the client's share has not as much within two seconds.
pub async fn charge(bytes: u64) -> Result<(), ServiceError> {
    match REQUEST_LEDGER.try_with(Ledger::clone) {
        Ok(ledger) => ledger.0.lock().await.grow(bytes).await,
        Err(_) => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::IpAddr;

    fn client(n: u8) -> ClientAddress {
        ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]))
    }

    /// Takes as much as it can for a client, in pieces.
    fn greedy(budget: &MemoryBudget, n: u8) -> Vec<HeldMemory> {
        let mut all = Vec::new();
        loop {
            let mut held = HeldMemory {
                budget: budget.clone(),
                client: client(n),
                bytes: 0,
            };
            if !held.try_grow(10) {
                return all;
            }
            all.push(held);
        }
    }

    #[test]
    fn however_many_are_greedy_another_client_gets_something() {
        let budget = MemoryBudget::new(100_000);
        let mut greedy_ones = Vec::new();
        for n in 1..20_u8 {
            let own = greedy(&budget, n);
            let got: u64 = own.iter().map(HeldMemory::bytes).sum();
            assert!(got > 0, "client {n} got nothing");
            if n == 1 {
                assert!((49_000..=50_000).contains(&got), "{got}");
            }
            assert!(greedy(&budget, n).is_empty());
            if n < 8 {
                greedy_ones.push(own);
            }
        }
        assert!(budget.used().total < 100_000);
        drop(greedy_ones);
        assert_eq!(budget.used().total, 0);
        // What is only faster with memory leaves some of the share to what needs it.
        let mut fast = greedy(&budget, 1);
        fast.truncate(1);
        while fast[0].try_extend(10) {}
        assert!((33_000..=33_400).contains(&fast[0].bytes()));
        assert!(fast[0].try_grow(10_000));
        drop(fast);
        assert!(budget.used().by_client.is_empty());
    }

    #[tokio::test]
    async fn what_waits_gets_what_is_freed_and_does_not_wait_for_ever() {
        let budget = MemoryBudget::new(1000);
        let mut first = client(1).scope(async { budget.hold() }).await;
        first.grow(500).await.unwrap();
        let mut second = client(1).scope(async { budget.hold() }).await;
        let waits = second.grow(100);
        let frees = async {
            tokio::time::sleep(Duration::from_millis(50)).await;
            drop(first);
        };
        let (got, ()) = tokio::join!(waits, frees);
        got.unwrap();
        assert_eq!(budget.used().total, 100);
        // More than any share is the whole share.
        let mut large = client(2).scope(async { budget.hold() }).await;
        let began = Instant::now();
        let late = large.grow(10_000).await;
        assert!(late.is_err() && began.elapsed() >= MEMORY_WAIT);
        drop(second);
        large.grow(10_000).await.unwrap();
        assert_eq!(large.bytes(), 500);
    }

    #[tokio::test]
    async fn a_ledger_holds_what_it_is_settled_to_until_it_is_dropped() {
        let budget = MemoryBudget::new(1 << 20);
        let ledger = Ledger::new(&budget);
        let charged = ledger.clone().scope(charge(300_000));
        charged.await.unwrap();
        assert_eq!(ledger.bytes().await, 300_000);
        ledger.settle(200_000).await.unwrap();
        assert_eq!(budget.used().total, 200_000);
        ledger.settle(250_000).await.unwrap();
        assert_eq!(budget.used().total, 250_000);
        drop(ledger);
        assert_eq!(budget.used().total, 0);
    }
}
