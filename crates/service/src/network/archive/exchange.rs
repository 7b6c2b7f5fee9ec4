//! The common parts of fetching and delivering.

use super::web::WebClients;
use super::{Archive, ArchiveStore, Archives, ExchangeHost};
use crate::base::error::AttemptError;
use crate::base::http_client::ClientFactory;
use crate::base::records::{Clock, Tenant, Timestamp};
use crate::jobs::Queue;
use crate::network::hooks::{
    AttemptEnd, Lanes, NextAttempt, RetrySchedule, UrlGuard, random_share,
};
use std::sync::Arc;
use std::time::Duration;

/// The settings of the exchange with archives.
#[derive(Debug, Clone)]
pub struct ExchangeSettings {
    /// The configured archives.
    pub archives: Archives,
    /// When failed attempts are repeated.
    pub retries: RetrySchedule,
    /// Longest pause in an answer.
    pub timeout: Duration,
    /// Longest attempt.
    pub time_limit: Duration,
    /// Most attempts at the same time.
    pub places: usize,
    /// Most bytes of a series.
    pub bytes: u64,
    /// Most files of a series.
    pub parts: usize,
}

/// The state that [`Puller`](super::Puller) and [`Deliverer`](super::Deliverer) share.
pub struct Exchange {
    pub(super) store: Arc<dyn ArchiveStore>,
    pub(super) host: Arc<dyn ExchangeHost>,
    pub(super) queue: Arc<Queue>,
    pub(super) web: WebClients,
    pub(super) settings: ExchangeSettings,
}

impl Exchange {
    /// The exchange with the archives of the settings, and with those that `guard` lets pass.
    pub fn new(
        store: Arc<dyn ArchiveStore>,
        host: Arc<dyn ExchangeHost>,
        queue: Arc<Queue>,
        clients: Arc<dyn ClientFactory>,
        guard: UrlGuard,
        settings: ExchangeSettings,
    ) -> Self {
        Self {
            store,
            host,
            queue,
            web: WebClients::new(clients, guard, settings.timeout, settings.parts),
            settings,
        }
    }

    pub(super) fn clock(&self) -> &Arc<dyn Clock> {
        self.queue.clock()
    }

    pub(super) fn lanes(&self) -> Lanes {
        let places = self.settings.places.max(2);
        Lanes::new(places, places / 2, self.settings.retries)
    }

    /// The configured archive of that name.
    pub(super) fn archive(&self, name: &str, tenant: &Tenant) -> Result<&Archive, AttemptError> {
        let archive = self.settings.archives.named(name, tenant);
        archive.ok_or_else(|| {
            AttemptError::retry(format!("The settings have no archive `{name}` any more."))
        })
    }

    /// When to try again after attempt number `attempts` failed; `None` if that was the last.
    pub(super) fn again(
        &self,
        attempts: u32,
        since: Timestamp,
        asked: Option<Duration>,
    ) -> Option<NextAttempt> {
        let now = (self.clock().now(), self.clock().trusted());
        let retries = self.settings.retries;
        retries.next(attempts, since, now, asked, random_share())
    }

    /// Limits the time of an attempt.
    pub(super) async fn in_time<T>(
        &self,
        attempt: impl Future<Output = Result<T, AttemptError>> + Send,
    ) -> Result<T, AttemptError> {
        let ended = tokio::time::timeout(self.settings.time_limit, attempt).await;
        ended.unwrap_or_else(|_| Err(AttemptError::retry("The transfer took too long.")))
    }
}

/// Consequences of an attempt that failed so for others to the same archive.
pub(super) fn means(trouble: &AttemptError) -> AttemptEnd {
    match trouble {
        AttemptError::Retry { asked, .. } => AttemptEnd::Failing(*asked),
        // The archive works; it does not have or take this one thing.
        AttemptError::Permanent(_) => AttemptEnd::Fine,
    }
}
