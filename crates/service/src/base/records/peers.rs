//! Peers: the processes that share a database and a file store.
//!
//! Each process is a *run*, whose row says until when it lives by the clock of the database. It renews
//! the row; if it does not, its pins and leases are free.
//!
//! - A **pin** keeps an item from being erased by another process; see
//!   [`Items::pin`](crate::items::Items::pin).
//! - The **leader** does what one process does for all, such as sending webhooks, until its lease expires or
//!   it renews it. Its work must be right also if two do it for a moment: a process that stood still finds out
//!   that it has lost the lease only afterwards.
//! - **News** tell the others at once of a change that this one has committed. They may be lost, so
//!   whoever waits for them looks from time to time too.

use super::{StoreResult, TrustedNow};
use async_trait::async_trait;
use std::time::Duration;

/// A change by another process.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum News {
    /// A job was filed or changed.
    Job(String),
    /// An item was erased for a tenant.
    Erased(String),
    /// A work item was scheduled, or may be performed now.
    Scheduled,
    /// The change is not known: news were lost.
    Missed,
}

/// The news since it was made.
#[async_trait]
pub trait NewsFeed: Send {
    /// Waits for the next news. Waits for a database that is away, too.
    async fn next(&mut self) -> News;
}

/// The processes on one store, as one of them sees them. Every method fails only if the database does.
#[async_trait]
pub trait Peers: Send + Sync + 'static {
    /// Names the run of this process.
    fn run(&self) -> &str;

    /// Writes that this process lives for `length` from now, and has that many workers.
    async fn heartbeat(&self, workers: usize, length: Duration) -> StoreResult<()>;

    /// Writes that it ends: its pins and leases are free.
    async fn leave(&self) -> StoreResult<()>;

    /// Number of workers of all processes that live.
    async fn workers(&self) -> StoreResult<u64>;

    /// Pins an item, which need not exist, until [`Peers::unpin`] with that token. An erasure that
    /// has begun is over when this returns.
    async fn pin(&self, token: &str, item: &str) -> StoreResult<()>;

    /// Ends a pin.
    async fn unpin(&self, token: &str) -> StoreResult<()>;

    /// Whether another process has pinned one of the items.
    async fn pinned_by_others(&self, items: &[String]) -> StoreResult<bool>;

    /// Takes the lease of that name, or renews it, for `length` from now. `false` if another process has it.
    async fn lead(&self, lease: &str, length: Duration) -> StoreResult<bool>;

    /// Deletes what ended processes have left, and what was remembered for processes that stood still for as long
    /// as none stands still. To be called while the time is trusted.
    async fn tidy(&self, now: TrustedNow) -> StoreResult<()>;

    /// The news from now on. To be called in a runtime.
    fn news(&self) -> Box<dyn NewsFeed>;
}
