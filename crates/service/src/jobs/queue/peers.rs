//! The queue of a process that shares its store with others.
//!
//! - **Living.** The process says every [`BEAT`] that it lives.
//! - **News.** What others change is announced here as if it had happened here: idle workers wake,
//!   streams and waiting requests go on, a running job is told of its cancellation, and local copies
//!   of erased files are deleted. News can be lost, so all of these look for themselves from time to
//!   time: workers each second, waiting requests and streams every [`LOOK`], a running job with each
//!   renewal of its lease, copies every [`FORGET_EVERY`].
//! - **Duties.** What one process does for all it does under a lease of [`TERM`] by the clock of the
//!   database, which it renews; see [`Queue::on_duty`].
//!
//! A process alone on its store has no peers: it is on duty for ever, and waits for nobody.

use super::Queue;
use crate::jobs::{JobState, News, Peers, StoreError};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Time between two signs of life.
const BEAT: Duration = Duration::from_secs(10);
/// How long a sign of life counts.
const LIFE: Duration = Duration::from_secs(45);
/// How long a duty is had without being renewed; it is renewed three times as often.
const TERM: Duration = Duration::from_secs(15);
/// How often those look who wait for what another process may do.
const LOOK: Duration = Duration::from_secs(2);
/// Time between two comparisons of local copies with the records.
const FORGET_EVERY: Duration = Duration::from_secs(600);
/// Records looked up at a time.
const BATCH: usize = 500;
/// The one duty: all that is done for all.
const DUTY: &str = "upkeep";
/// How long an erasure waits for holds of other processes, and between two looks. They release an item
/// a moment after they have answered.
const HOLDS_END: (Duration, Duration) = (Duration::from_secs(2), Duration::from_millis(50));

impl Queue {
    /// The same queue in a process that shares its store with these.
    #[must_use]
    pub fn among(mut self, peers: Option<Arc<dyn Peers>>) -> Self {
        if let Some(peers) = &peers {
            peers.run().clone_into(&mut self.run);
        }
        self.peers = peers;
        self
    }

    /// Whether other processes may use the store.
    pub fn is_shared(&self) -> bool {
        self.peers.is_some()
    }

    /// Says that this process lives. To be called before it claims jobs or holds items.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn join(&self) -> Result<(), StoreError> {
        match &self.peers {
            Some(peers) => peers.live(self.settings.workers, LIFE).await,
            None => Ok(()),
        }
    }

    /// Says so again and again until it is dropped.
    pub async fn stay(self: Arc<Self>) {
        if self.peers.is_none() {
            return;
        }
        let mut beat = tokio::time::interval(BEAT);
        loop {
            beat.tick().await;
            if let Err(error) = self.join().await {
                tracing::warn!(%error, "a sign of life could not be written");
            }
        }
    }

    /// Says that this process ends.
    pub async fn leave_peers(&self) {
        if let Some(peers) = &self.peers
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
        match &self.peers {
            Some(peers) => peers.workers().await,
            None => Ok(self.settings.workers as u64),
        }
    }

    /// The same, at least 1.
    pub(super) async fn all_workers(&self) -> Result<u64, StoreError> {
        Ok(self.workers().await?.max(1))
    }

    /// Ends when it is time to look for what another process may have done. Never for a process that
    /// is alone.
    pub async fn time_to_look(&self) {
        match &self.peers {
            Some(_) => tokio::time::sleep(LOOK).await,
            None => std::future::pending().await,
        }
    }

    /// Waits a while for other processes that hold one of the items.
    pub(super) async fn wait_for_holds(&self, items: &[String]) -> Result<(), StoreError> {
        let Some(peers) = &self.peers else {
            return Ok(());
        };
        let begun = Instant::now();
        while peers.held_by_others(items).await? && begun.elapsed() < HOLDS_END.0 {
            tokio::time::sleep(HOLDS_END.1).await;
        }
        Ok(())
    }

    /// Announces here what other processes do, until `end`; calls `scheduled` when a work item was
    /// scheduled.
    pub async fn follow_peers(self: Arc<Self>, scheduled: impl Fn(), end: CancellationToken) {
        let Some(peers) = &self.peers else {
            return;
        };
        let follow = async {
            let mut feed = peers.news();
            loop {
                let news = feed.next().await;
                if let Err(error) = self.follow(&news, &scheduled).await {
                    tracing::warn!(%error, "news of another process could not be followed");
                }
            }
        };
        let forget = async {
            let mut round = tokio::time::interval(FORGET_EVERY);
            loop {
                round.tick().await;
                if let Err(error) = self.forget_erased().await {
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

    async fn follow(&self, news: &News, scheduled: &impl Fn()) -> Result<(), StoreError> {
        match news {
            News::Job(id) => return self.learn(id).await,
            News::Erased(id) => self.blobs.forget(&BTreeSet::from([id.clone()]))?,
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
    async fn learn(&self, id: &str) -> Result<(), StoreError> {
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

    /// Deletes the local copies of files whose items are gone.
    async fn forget_erased(&self) -> Result<(), StoreError> {
        let copied: Vec<String> = self.blobs.copied().into_iter().collect();
        for batch in copied.chunks(BATCH) {
            let known = self.catalogue.known(batch).await?;
            let gone = batch.iter().filter(|id| !known.contains(*id));
            let gone: BTreeSet<String> = gone.cloned().collect();
            if !gone.is_empty() {
                self.blobs.forget(&gone)?;
            }
        }
        Ok(())
    }

    /// Does `duties` until `end`, in one process on the store at a time. They end when the token is
    /// cancelled that they are given, which is when this process has lost the duty, or at `end`.
    pub async fn on_duty<F>(&self, end: CancellationToken, duties: impl Fn(CancellationToken) -> F)
    where
        F: Future<Output = ()>,
    {
        let Some(peers) = &self.peers else {
            return duties(end).await;
        };
        while !end.is_cancelled() {
            let since = Instant::now();
            match peers.take_duty(DUTY, TERM).await {
                Ok(true) => {
                    tracing::info!("this process does from now on what one does for all");
                    let term = end.child_token();
                    let work = duties(term.clone());
                    tokio::pin!(work);
                    tokio::select! {
                        () = &mut work => {}
                        () = keep_duty(&**peers, since) => {
                            tracing::warn!("another process does from now on what one does for all");
                            term.cancel();
                            work.await;
                        }
                    }
                }
                Ok(false) => {}
                Err(error) => tracing::warn!(%error, "who is on duty could not be read"),
            }
            end.run_until_cancelled(tokio::time::sleep(TERM / 3)).await;
        }
    }
}

/// Renews the duty; returns when it is lost.
async fn keep_duty(peers: &dyn Peers, mut since: Instant) {
    loop {
        tokio::time::sleep(TERM / 3).await;
        let now = Instant::now();
        match peers.take_duty(DUTY, TERM).await {
            Ok(true) => since = now,
            Ok(false) => return,
            Err(error) if since.elapsed() < TERM => {
                tracing::warn!(%error, "the duty could not be renewed");
            }
            Err(_) => return,
        }
    }
}
