//! The queue of a process that shares its store with others.
//!
//! - **Heartbeat.** The process writes every [`HEARTBEAT_EVERY`] that it lives.
//! - **News.** Changes by others are announced here as if they had happened here: idle workers wake,
//!   streams and waiting requests go on, a running job is told of its cancellation, and local copies
//!   of erased files are deleted. News can be lost, so all of these also poll: workers each second,
//!   waiting requests and streams every [`POLL_EVERY`], a running job with each renewal of its lease,
//!   copies every [`FORGET_EVERY`].
//! - **Leader.** Work that one process does for all runs under a lease of [`LEADER_LEASE`] by the clock of the
//!   database, which the leader renews; see [`Queue::while_leader`].
//!
//! A process alone on its store has no peers: it is the leader, and never polls.

use super::Queue;
use crate::base::records::{JobState, News, Peers, StoreError};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Time between two heartbeats.
const HEARTBEAT_EVERY: Duration = Duration::from_secs(10);
/// A process whose last heartbeat is older is dead.
const HEARTBEAT_TTL: Duration = Duration::from_secs(45);
/// Length of the leader's lease; it is renewed three times as often.
const LEADER_LEASE: Duration = Duration::from_secs(15);
/// Time between two polls for changes by other processes.
const POLL_EVERY: Duration = Duration::from_secs(2);
/// Time between two comparisons of local copies with the records.
const FORGET_EVERY: Duration = Duration::from_secs(600);
/// The name of the leader's lease in the database.
const LEASE_NAME: &str = "upkeep";

impl Queue {
    /// Whether other processes may use the store.
    pub fn is_shared(&self) -> bool {
        self.items.is_shared()
    }

    /// Writes that this process lives. To be called before it claims jobs or pins items.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn heartbeat(&self) -> Result<(), StoreError> {
        match self.items.peers() {
            Some(peers) => peers.heartbeat(self.settings.workers, HEARTBEAT_TTL).await,
            None => Ok(()),
        }
    }

    /// Writes heartbeats until it is dropped.
    pub async fn run_heartbeat(self: Arc<Self>) {
        if !self.is_shared() {
            return;
        }
        let mut beat = tokio::time::interval(HEARTBEAT_EVERY);
        loop {
            beat.tick().await;
            if let Err(error) = self.heartbeat().await {
                tracing::warn!(%error, "a heartbeat could not be written");
            }
        }
    }

    /// Writes that this process ends.
    pub async fn leave_peers(&self) {
        if let Some(peers) = self.items.peers()
            && let Err(error) = peers.leave().await
        {
            tracing::warn!(%error, "the others will notice the end of this process in a while");
        }
    }

    /// Number of jobs that all processes that live compute at the same time.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn workers(&self) -> Result<u64, StoreError> {
        match self.items.peers() {
            Some(peers) => peers.workers().await,
            None => Ok(self.settings.workers as u64),
        }
    }

    /// [`Queue::workers`], at least 1.
    pub(super) async fn all_workers(&self) -> Result<u64, StoreError> {
        Ok(self.workers().await?.max(1))
    }

    /// Waits for the next poll for changes by other processes. Never ends for a process that is alone.
    pub async fn next_poll(&self) {
        match self.items.peers() {
            Some(_) => tokio::time::sleep(POLL_EVERY).await,
            None => std::future::pending().await,
        }
    }

    /// Announces changes by other processes until `end`; calls `scheduled` when a work item was
    /// scheduled.
    pub async fn follow_peers(self: Arc<Self>, scheduled: impl Fn(), end: CancellationToken) {
        let Some(peers) = self.items.peers() else {
            return;
        };
        let follow = async {
            let mut feed = peers.news();
            loop {
                let news = feed.next().await;
                if let Err(error) = self.take(&news, &scheduled).await {
                    tracing::warn!(%error, "news of another process could not be followed");
                }
            }
        };
        let forget = async {
            let mut round = tokio::time::interval(FORGET_EVERY);
            loop {
                round.tick().await;
                if let Err(error) = self.items.forget_erased().await {
                    tracing::warn!(%error, "copies of erased files could not be deleted; tried again");
                }
            }
        };
        tokio::select! {
            () = end.cancelled() => {}
            () = follow => {}
            () = forget => {}
        }
    }

    async fn take(&self, news: &News, scheduled: &impl Fn()) -> Result<(), StoreError> {
        match news {
            News::Job(id) => return self.announce_change(id).await,
            News::Erased(id) => self.items.blobs().forget(&BTreeSet::from([id.clone()]))?,
            News::Scheduled => scheduled(),
            News::Missed => {
                scheduled();
                self.filed.notify_one();
                self.sourced.notify_one();
            }
        }
        Ok(())
    }

    /// Announces a job that another process has filed or changed.
    async fn announce_change(&self, id: &str) -> Result<(), StoreError> {
        let Some(job) = self.jobs.job(id).await? else {
            return Ok(());
        };
        match (job.state, &job.volume) {
            (JobState::Queued, Some(_)) => self.filed.notify_one(),
            (JobState::Queued, None) => self.sourced.notify_one(),
            (JobState::Running, _) if job.cancel_requested => self.stop_computing(id),
            _ => {}
        }
        // Sending fails if there is no subscriber.
        let _ = self.changes.send(Arc::new(job));
        Ok(())
    }

    /// Runs `tasks` until `end` while this process is the leader; one process on the store is, at a time.
    /// The token given to them is cancelled when this process has lost the lease, or at `end`.
    pub async fn while_leader<F>(
        &self,
        end: CancellationToken,
        tasks: impl Fn(CancellationToken) -> F,
    ) where
        F: Future<Output = ()>,
    {
        let Some(peers) = self.items.peers() else {
            return tasks(end).await;
        };
        while !end.is_cancelled() {
            let since = Instant::now();
            match peers.lead(LEASE_NAME, LEADER_LEASE).await {
                Ok(true) => {
                    tracing::info!("this process is the leader from now on");
                    let term = end.child_token();
                    let work = tasks(term.clone());
                    tokio::pin!(work);
                    tokio::select! {
                        () = &mut work => {}
                        () = keep_leadership(&**peers, since) => {
                            tracing::warn!("another process is the leader from now on");
                            term.cancel();
                            work.await;
                        }
                    }
                }
                Ok(false) => {}
                Err(error) => tracing::warn!(%error, "the leader's lease could not be read"),
            }
            end.run_until_cancelled(tokio::time::sleep(LEADER_LEASE / 3))
                .await;
        }
    }
}

/// Renews the leader's lease; returns when it is lost.
async fn keep_leadership(peers: &dyn Peers, mut since: Instant) {
    loop {
        tokio::time::sleep(LEADER_LEASE / 3).await;
        let now = Instant::now();
        match peers.lead(LEASE_NAME, LEADER_LEASE).await {
            Ok(true) => since = now,
            Ok(false) => return,
            Err(error) if since.elapsed() < LEADER_LEASE => {
                tracing::warn!(%error, "the leader's lease could not be renewed");
            }
            Err(_) => return,
        }
    }
}
