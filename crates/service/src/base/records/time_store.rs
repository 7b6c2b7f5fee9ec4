//! What a store knows of the time.

use super::{StoreResult, Timestamp, TrustedNow};
use async_trait::async_trait;

/// The times that outlive a process. Every method fails only if the database does.
#[async_trait]
pub trait TimeStore: Send + Sync + 'static {
    /// The time by the clock of the database's server; `None` if it is a file.
    async fn server_time(&self) -> StoreResult<Option<Timestamp>>;

    /// The last time that was [noted](Self::note_trusted). If none was, when something was last stored; `None` if
    /// nothing was.
    async fn last_trusted(&self) -> StoreResult<Option<Timestamp>>;

    /// Notes a time that is trusted, for the next start.
    async fn note_trusted(&self, now: TrustedNow) -> StoreResult<()>;
}
