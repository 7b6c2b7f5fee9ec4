//! What processes that share a database and a file store know of each other.
//!
//! Each process is a *run*, whose row says until when it lives by the clock of the database. It renews
//! the row; if it does not, what it held is free.
//!
//! - A **hold** keeps an item from being erased by another process; see
//!   [`Queue::hold`](crate::jobs::Queue::hold).
//! - A **duty** is what one process does for all, such as sending webhooks. Whoever takes it has it
//!   until the time set, unless it renews it. What is done under a duty must be right also if two do it
//!   for a moment: a process that stood still finds out that it has lost the duty only afterwards.
//! - **News** tell the others at once of a change that this one has committed. They may be lost, so
//!   whoever waits for them looks from time to time too.

use super::StoreResult;
use async_trait::async_trait;
use std::time::Duration;

/// What another process has changed.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum News {
    /// A job was filed or changed.
    Job(String),
    /// An item was erased for a tenant.
    Erased(String),
    /// A work item was scheduled, or may be performed now.
    Scheduled,
    /// What was changed is not known: news were lost.
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

    /// Says that this process lives for `length` from now, and has that many workers.
    async fn live(&self, workers: usize, length: Duration) -> StoreResult<()>;

    /// Says that it ends: what it has is free.
    async fn leave(&self) -> StoreResult<()>;

    /// Number of workers of all processes that live.
    async fn workers(&self) -> StoreResult<u64>;

    /// Holds an item, which need not exist, until [`Peers::release`] with that token. An erasure that
    /// has begun is over when this returns.
    async fn hold(&self, token: &str, item: &str) -> StoreResult<()>;

    /// Ends a hold.
    async fn release(&self, token: &str) -> StoreResult<()>;

    /// Whether another process holds one of the items.
    async fn held_by_others(&self, items: &[String]) -> StoreResult<bool>;

    /// Takes a duty, or keeps it, for `length` from now. `false` if another process has it.
    async fn take_duty(&self, duty: &str, length: Duration) -> StoreResult<bool>;

    /// Deletes what ended processes have left, and what was remembered for processes that stood
    /// still.
    async fn tidy(&self) -> StoreResult<()>;

    /// The news from now on. To be called in a runtime.
    fn news(&self) -> Box<dyn NewsFeed>;
}
