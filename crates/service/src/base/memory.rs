//! The memory that requests hold, shared out between tenants, and between the clients of each.
//!
//! In: how many bytes a request is about to hold. Out: leave to do so, now or within [`MEMORY_WAIT`], or the error
//! `busy`.
//!
//! Whatever a client can make the service keep for it is charged here before it is taken: the part of a body
//! that is gathered, what is made of it, the rows of a page, the answer until it is read. What is decoded has a
//! budget of its own ([`crate::limits::decoding`]).
//!
//! **Shares.** Of the budget (setting `request_memory`), a tenant gets no more than twice what it leaves free, and of
//! that a client (an address) no more than it leaves to the tenant's other clients. So one tenant alone has at most two
//! thirds of the budget and one client of it a third, and there is always something left for a tenant that holds
//! little, and for a client of it, whatever their addresses. An anonymous caller gets no more than it leaves free: one
//! alone has at most half. (The rule is that of dynamic thresholds for shared buffers: A. K. Choudhury and E. L. Hahne,
//! IEEE/ACM Transactions on Networking 6, 1998.)
//!
//! A request charges by [`charge`], which notes what it holds in a [`Ledger`] of the request. When the handler
//! has ended, the ledger goes with the body of the answer, and ends with it. Single rows are read by [`read_row`]; what
//! is charged for them ends with the handler.

use crate::base::client::ClientAddress;
use crate::base::error::{Refusal, ServiceError};
use crate::base::records::{Bounded, Failure, Fault, ListRequest, PagePlan, StoreResult, Tenant};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::{Instant, timeout_at};

/// Longest time for which a request waits for memory.
const MEMORY_WAIT: Duration = Duration::from_secs(2);

/// Memory for a stored byte of a row: the row, its JSON parsed (a job of 1000 cases takes nine times as much as its
/// text), and the JSON of the answer.
pub const MEMORY_PER_ROW_BYTE: u64 = 12;

/// Memory for one entry of a page: its row, what is made of it, and its JSON. Labels of 16 KiB are the largest part,
/// unless a page is charged by its bytes ([`charge_plan`]).
const ENTRY_MEMORY: u64 = 64 << 10;

/// Stored bytes of a single row that are not charged.
const UNCHARGED_ROW_BYTES: u64 = 8 << 10;

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
    by_group: BTreeMap<Group, GroupUse>,
}

/// What a group of clients holds.
#[derive(Default)]
struct GroupUse {
    total: u64,
    by_client: BTreeMap<ClientAddress, u64>,
}

/// Clients that have a share together.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Group {
    /// An anonymous caller, or work that belongs to no request.
    Address(ClientAddress),
    /// The callers of a tenant.
    Tenant(Tenant),
}

impl Group {
    /// Limit on what the group holds and what its client leaves to the group's other clients, together, where other
    /// groups leave so much. Who is alone in a group leaves as much to other groups.
    fn limit(&self, left_by_others: u64) -> u64 {
        match self {
            Self::Address(_) => left_by_others,
            Self::Tenant(_) => left_by_others - left_by_others.div_ceil(3),
        }
    }

    /// The most that one piece of memory may be.
    fn largest_share(&self, limit: u64) -> u64 {
        self.limit(limit) / 2
    }
}

/// A client as one of its group: whoever asks for memory or for computing.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Requester {
    group: Group,
    client: ClientAddress,
}

impl Requester {
    fn new(tenant: Option<&Tenant>) -> Self {
        let client = ClientAddress::current();
        Self {
            group: tenant.map_or(Group::Address(client), |t| Group::Tenant(t.clone())),
            client,
        }
    }

    /// The one that the current request is answered for, or the current task works for.
    pub fn current() -> Self {
        let of_request = REQUEST_LEDGER.try_with(|ledger| ledger.holder.clone());
        let of_task = of_request.or_else(|_| TASK_REQUESTER.try_with(Self::clone));
        of_task.unwrap_or_else(|_| Self::new(None))
    }

    /// Does work as that of this requester: what a request begins in a task of its own is not the service's.
    pub async fn scope<T>(self, work: impl Future<Output = T>) -> T {
        TASK_REQUESTER.scope(self, work).await
    }

    /// An anonymous client.
    #[cfg(test)]
    pub fn anonymous(client: ClientAddress) -> Self {
        Self {
            group: Group::Address(client),
            client,
        }
    }

    /// A client of a tenant.
    #[cfg(test)]
    pub fn of_tenant(tenant: Tenant, client: ClientAddress) -> Self {
        Self {
            group: Group::Tenant(tenant),
            client,
        }
    }

    /// Whom it shares with: its tenant, or for an anonymous one its address.
    pub fn group(&self) -> &Group {
        &self.group
    }

    /// Whether it is work of the service's own, which belongs to no request.
    pub fn is_service(&self) -> bool {
        self.group == Group::Address(ClientAddress::NONE)
    }
}

/// Memory that a client holds until this is dropped.
pub struct HeldMemory {
    budget: MemoryBudget,
    holder: Requester,
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

    /// Nothing yet, for the caller of the current request.
    pub fn hold(&self) -> HeldMemory {
        self.hold_for(Requester::current())
    }

    fn hold_for(&self, holder: Requester) -> HeldMemory {
        HeldMemory {
            budget: self.clone(),
            holder,
            bytes: 0,
        }
    }

    fn used(&self) -> MutexGuard<'_, Used> {
        // A panic cannot leave it half changed: each change is a few plain statements.
        self.0.used.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Takes `bytes` for a holder if it leaves `share` times as much to the others of its group as it then has, and its
    /// group enough to other groups.
    fn take(&self, holder: &Requester, bytes: u64, share: u64) -> bool {
        if bytes == 0 {
            return true;
        }
        let mut used = self.used();
        let of_group = used.by_group.get(&holder.group);
        let together = of_group.map_or(0, |group| group.total);
        let own = of_group.and_then(|group| group.by_client.get(&holder.client));
        let own = own.copied().unwrap_or(0).saturating_add(bytes);
        let others = used.total.saturating_sub(together);
        let limit = (holder.group).limit(self.0.limit.saturating_sub(others));
        let together = together.saturating_add(bytes);
        if own.saturating_mul(share).saturating_add(together) > limit {
            return false;
        }
        used.total += bytes;
        let of_group = used.by_group.entry(holder.group.clone()).or_default();
        of_group.total = together;
        of_group.by_client.insert(holder.client, own);
        true
    }

    fn give_back(&self, holder: &Requester, bytes: u64) {
        if bytes == 0 {
            return;
        }
        let mut used = self.used();
        used.total = used.total.saturating_sub(bytes);
        if let Some(group) = used.by_group.get_mut(&holder.group) {
            group.total = group.total.saturating_sub(bytes);
            if let Some(own) = group.by_client.get_mut(&holder.client) {
                *own = own.saturating_sub(bytes);
                if *own == 0 {
                    group.by_client.remove(&holder.client);
                }
            }
            if group.by_client.is_empty() {
                used.by_group.remove(&holder.group);
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
        let largest = self.holder.group.largest_share(self.budget.0.limit);
        let bytes = bytes.min(largest.saturating_sub(self.bytes));
        self.take(bytes, 1)
    }

    /// Holds `bytes` more, if that leaves something of the client's share to what cannot do without.
    pub fn try_extend(&mut self, bytes: u64) -> bool {
        self.take(bytes, 2)
    }

    fn take(&mut self, bytes: u64, share: u64) -> bool {
        let taken = self.budget.take(&self.holder, bytes, share);
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
        self.budget.give_back(&self.holder, surplus);
    }

    /// Bytes that are held.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }
}

impl Drop for HeldMemory {
    fn drop(&mut self) {
        self.budget.give_back(&self.holder, self.bytes);
    }
}

fn busy() -> ServiceError {
    let failure = Failure::new(
        Fault::Service,
        "busy",
        "The requests of this client, or of its tenant, hold as much memory as they may.",
    );
    let advice = "Send fewer requests at the same time, and read their answers.";
    ServiceError::new(Refusal::Unavailable, failure.fix(advice)).after(BUSY_RETRY)
}

/// The memory that a request holds.
#[derive(Clone)]
pub struct Ledger {
    holder: Requester,
    charges: Arc<tokio::sync::Mutex<Charges>>,
}

struct Charges {
    held: HeldMemory,
    /// The part of it that is for rows that the handler has read.
    for_rows: u64,
}

impl Charges {
    async fn grow_for_row(&mut self, bytes: u64) -> Result<(), ServiceError> {
        let before = self.held.bytes;
        self.held.grow(bytes).await?;
        self.for_rows += self.held.bytes - before;
        Ok(())
    }

    /// Gives back what is held for rows but `kept` bytes, which are held for good.
    fn end_rows(&mut self, kept: u64) {
        let ended = std::mem::take(&mut self.for_rows).saturating_sub(kept);
        self.held.shrink(self.held.bytes - ended);
    }
}

tokio::task_local! {
    static REQUEST_LEDGER: Ledger;
    static TASK_REQUESTER: Requester;
}

impl Ledger {
    /// An empty ledger for the current request, which is a tenant's or an anonymous caller's.
    pub fn new(budget: &MemoryBudget, tenant: Option<&Tenant>) -> Self {
        let holder = Requester::new(tenant);
        let held = budget.hold_for(holder.clone());
        Self {
            holder,
            charges: Arc::new(tokio::sync::Mutex::new(Charges { held, for_rows: 0 })),
        }
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
        let charges = &mut *self.charges.lock().await;
        charges.for_rows = 0;
        charges.held.shrink(bytes);
        let held = charges.held.bytes;
        charges.held.grow(bytes - held.min(bytes)).await
    }

    /// Gives back what was charged for rows: the handler has ended.
    pub async fn end_rows(&self) {
        self.charges.lock().await.end_rows(0);
    }

    /// Bytes that the request holds.
    pub async fn bytes(&self) -> u64 {
        self.charges.lock().await.held.bytes
    }
}

/// Charges the current request for memory that it is about to hold. Work that belongs to no request holds
/// what it needs.
///
/// # Errors
/// `busy` if the client's share has not as much within two seconds.
pub async fn charge(bytes: u64) -> Result<(), ServiceError> {
    match REQUEST_LEDGER.try_with(Ledger::clone) {
        Ok(ledger) => ledger.charges.lock().await.held.grow(bytes).await,
        Err(_) => Ok(()),
    }
}

/// A row whose size a client chose, for which the current request is charged before it is read if it is large: `read`
/// is given the most bytes that the row may have.
///
/// # Errors
/// Those of `read`, and `busy` as of [`charge`].
pub async fn read_row<T, F>(read: impl Fn(u64) -> F) -> Result<Option<T>, ServiceError>
where
    F: Future<Output = StoreResult<Bounded<T>>>,
{
    let (mut limit, mut charged) = (UNCHARGED_ROW_BYTES, 0);
    loop {
        match read(limit).await? {
            Bounded::Read(row) => return Ok(Some(row)),
            Bounded::Missing => return Ok(None),
            // It may have grown in between.
            Bounded::Larger(bytes) => {
                charge_row(MEMORY_PER_ROW_BYTE * bytes.saturating_sub(charged)).await?;
                (limit, charged) = (limit.max(bytes), charged.max(bytes));
            }
        }
    }
}

/// Charges for a page of at most `limit` entries.
///
/// # Errors
/// As [`charge`].
pub async fn charge_page(limit: u32) -> Result<(), ServiceError> {
    charge(ENTRY_MEMORY * u64::from(limit)).await
}

/// The page as it is planned, for which the request is charged beyond what [`charge_page`] has charged for the one that
/// was `asked`.
///
/// # Errors
/// As [`charge`].
pub async fn charge_plan(asked: ListRequest, plan: PagePlan) -> Result<ListRequest, ServiceError> {
    let charged = ENTRY_MEMORY * u64::from(asked.limit);
    charge((MEMORY_PER_ROW_BYTE * plan.bytes).saturating_sub(charged)).await?;
    Ok(plan.page)
}

async fn charge_row(bytes: u64) -> Result<(), ServiceError> {
    match REQUEST_LEDGER.try_with(Ledger::clone) {
        Ok(ledger) => ledger.charges.lock().await.grow_for_row(bytes).await,
        Err(_) => Ok(()),
    }
}

/// Gives back what the current request was charged for rows that it holds no more, but what `copies` of them take,
/// which it holds until its answer has been read.
pub async fn end_rows(copies: u64) {
    if let Ok(ledger) = REQUEST_LEDGER.try_with(Ledger::clone) {
        let mut charges = ledger.charges.lock().await;
        let kept = charges.for_rows / MEMORY_PER_ROW_BYTE * copies;
        charges.end_rows(kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::IpAddr;

    fn client(n: u8) -> ClientAddress {
        ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]))
    }

    /// An anonymous caller.
    fn anonymous(n: u8) -> Requester {
        Requester {
            group: Group::Address(client(n)),
            client: client(n),
        }
    }

    /// A caller of a tenant.
    fn caller(tenant: &str, n: u8) -> Requester {
        Requester {
            group: Group::Tenant(tenant.parse().unwrap()),
            client: client(n),
        }
    }

    /// Takes as much as it can for a holder, in pieces.
    fn greedy(budget: &MemoryBudget, holder: &Requester) -> Vec<HeldMemory> {
        let mut all = Vec::new();
        loop {
            let mut held = budget.hold_for(holder.clone());
            if !held.try_grow(10) {
                return all;
            }
            all.push(held);
        }
    }

    fn bytes(held: &[HeldMemory]) -> u64 {
        held.iter().map(HeldMemory::bytes).sum()
    }

    #[test]
    fn however_many_are_greedy_another_client_gets_something() {
        let budget = MemoryBudget::new(100_000);
        let mut greedy_ones = Vec::new();
        for n in 1..20_u8 {
            let own = greedy(&budget, &anonymous(n));
            let got = bytes(&own);
            assert!(got > 0, "client {n} got nothing");
            if n == 1 {
                assert!((49_000..=50_000).contains(&got), "{got}");
            }
            assert!(greedy(&budget, &anonymous(n)).is_empty());
            if n < 8 {
                greedy_ones.push(own);
            }
        }
        assert!(budget.used().total < 100_000);
        drop(greedy_ones);
        assert_eq!(budget.used().total, 0);
        // What is only faster with memory leaves some of the share to what needs it.
        let mut fast = greedy(&budget, &anonymous(1));
        fast.truncate(1);
        while fast[0].try_extend(10) {}
        assert!((33_000..=33_400).contains(&fast[0].bytes()));
        assert!(fast[0].try_grow(10_000));
        drop(fast);
        assert!(budget.used().by_group.is_empty());
    }

    #[test]
    fn tenants_behind_one_address_have_shares_of_their_own() {
        let budget = MemoryBudget::new(90_000);
        let first = greedy(&budget, &caller("a", 1));
        assert!((29_000..=30_000).contains(&bytes(&first)), "a third");
        // Of the 60,000 that are left, 40,000 are for the second tenant, half of them for one client.
        let second = greedy(&budget, &caller("b", 1));
        assert!((19_000..=20_500).contains(&bytes(&second)));
        drop((first, second));
        assert!(budget.used().by_group.is_empty());
    }

    #[test]
    fn a_tenant_gets_no_more_by_many_addresses() {
        let budget = MemoryBudget::new(90_000);
        let many: Vec<_> = (0..100).map(|n| greedy(&budget, &caller("a", n))).collect();
        let got: u64 = many.iter().map(|held| bytes(held)).sum();
        assert!((59_000..=60_000).contains(&got), "two thirds: {got}");
        assert!(
            many[..8].iter().all(|held| !held.is_empty()),
            "each client has some"
        );
        let calm = greedy(&budget, &caller("b", 1));
        assert!((9_000..=10_500).contains(&bytes(&calm)));
        assert!(!greedy(&budget, &anonymous(1)).is_empty());
        drop((many, calm));
        assert_eq!(budget.used().total, 0);
    }

    #[tokio::test]
    async fn a_request_holds_for_its_tenant() {
        let budget = MemoryBudget::new(90_000);
        let tenant = Tenant::default();
        let ledger = Ledger::new(&budget, Some(&tenant));
        let held = ledger.clone().scope(async {
            charge(10_000).await.unwrap();
            let mut held = budget.hold();
            assert!(held.try_grow(5_000));
            held
        });
        let held = held.await;
        let total = || {
            let used = budget.used();
            let group = used.by_group.get(&Group::Tenant(Tenant::default()));
            group.map_or(0, |group| group.total)
        };
        assert_eq!(total(), 15_000);
        drop((held, ledger));
        assert_eq!(total(), 0);
        // More than any share is the whole share.
        let ledger = Ledger::new(&budget, Some(&tenant));
        ledger.clone().scope(charge(1 << 30)).await.unwrap();
        assert_eq!(total(), 30_000);
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
    async fn a_large_row_is_charged_before_it_is_read_and_until_the_handler_ends() {
        const ROW_BYTES: u64 = 100_000;
        let budget = MemoryBudget::new(10 << 20);
        let tenant = Tenant::default();
        let total = || budget.used().total;
        let read = |bytes: u64| {
            let held = total();
            async move {
                Ok(if bytes < ROW_BYTES {
                    Bounded::Larger(ROW_BYTES)
                } else {
                    Bounded::Read(held)
                })
            }
        };
        let ledger = Ledger::new(&budget, Some(&tenant));
        let row = ledger.clone().scope(async {
            charge(500).await.unwrap();
            read_row(read).await.unwrap()
        });
        let charged = 500 + MEMORY_PER_ROW_BYTE * ROW_BYTES;
        assert_eq!((row.await, total()), (Some(charged), charged));
        ledger.end_rows().await;
        assert_eq!(total(), 500);
        // What is held on, of rows that are read one after the other.
        let rows = ledger.clone().scope(async {
            for _ in 0..10 {
                read_row(read).await.unwrap();
                end_rows(0).await;
                assert_eq!(total(), 500);
            }
            read_row(read).await.unwrap();
            end_rows(2).await;
        });
        rows.await;
        ledger.end_rows().await;
        assert_eq!(total(), 500 + 2 * ROW_BYTES);
        // Small ones and those that there are not are not charged, nor work of no request.
        let small = async |_| Ok(Bounded::Read(()));
        let missing = async |_| Ok(Bounded::<()>::Missing);
        let none = ledger.clone().scope(async {
            assert_eq!(read_row(small).await.unwrap(), Some(()));
            assert_eq!(read_row(missing).await.unwrap(), None);
        });
        none.await;
        assert_eq!(total(), 500 + 2 * ROW_BYTES);
        drop(ledger);
        assert_eq!(read_row(read).await.unwrap(), Some(0));
        // More at the same time than the share of one client has is refused.
        let many: Vec<_> = (0..3)
            .map(|_| Ledger::new(&budget, Some(&tenant)))
            .collect();
        let mut refused = 0;
        for ledger in &many {
            let row = ledger.clone().scope(read_row(read)).await;
            refused += usize::from(row.is_err());
        }
        assert_eq!(refused, 1, "a third of 10 MiB has two rows");
    }

    #[tokio::test]
    async fn a_ledger_holds_what_it_is_settled_to_until_it_is_dropped() {
        let budget = MemoryBudget::new(1 << 20);
        let ledger = Ledger::new(&budget, None);
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

    #[tokio::test]
    async fn a_task_of_its_own_works_for_who_began_it() {
        let tenant: Tenant = "a".parse().unwrap();
        let ledger = Ledger::new(&MemoryBudget::new(100), Some(&tenant));
        let begun = ledger.scope(async {
            let work = Requester::current().scope(async { Requester::current() });
            tokio::spawn(work).await.unwrap()
        });
        let requester = begun.await;
        assert_eq!(requester.group(), &Group::Tenant(tenant));
        assert!(Requester::current().is_service());
    }
}
