//! The loop that works off a table of what is to be done at other machines.
//!
//! The table is the queue, so nothing is lost with the process: what was on the way when it ended
//! is done again. In memory there are only the errands on the way, whose number is limited.

use super::{Lane, Lanes};
use crate::base::records::{Clock, Job, StoreResult, Timestamp, milliseconds};
use async_trait::async_trait;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Notify;
use tokio::sync::broadcast::{self, error::RecvError};
use tokio::task::JoinSet;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// The table is read at least this often.
pub(super) const IDLE_WAIT: Duration = Duration::from_secs(5);

/// Interval at which deliveries that are too old are given up or deleted.
const EXPIRE_EVERY: Duration = Duration::from_secs(30);

/// Tasks at other machines, as rows of a table.
#[async_trait]
pub trait Errands: Send + Sync + 'static {
    /// A row whose time has come.
    type Due: Send + 'static;

    /// The lanes that have pending rows, each with the time when the first is due.
    async fn lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>>;

    /// The rows of a lane that are due, the longest due first.
    async fn due(&self, lane: &Lane, now: Timestamp, limit: usize) -> StoreResult<Vec<Self::Due>>;

    /// The id of a row.
    fn id(due: &Self::Due) -> &str;

    /// Makes one attempt and writes down how it ended.
    async fn attempt(&self, due: Self::Due) -> AttemptEnd;

    /// Makes the rows due that a clock which was ahead has put off: those that were tried last, or began, later than
    /// `now`. Returns how many these are.
    async fn recall(&self, now: Timestamp) -> StoreResult<u64>;

    /// Gives up what is too old, deletes what ended long ago.
    async fn expire(&self);

    /// Whether a change of a job may have made rows.
    fn concerns(&self, job: &Job) -> bool;
}

/// Consequences of an attempt for others in the same lane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttemptEnd {
    /// The destination works.
    Fine,
    /// It does not, and asks for a pause of that length.
    Failing(Option<Duration>),
    /// The attempt could not be made or written down because the database failed.
    NotWritten,
}

/// Does errands until it is told to end.
pub struct Rounds<E> {
    /// The errands.
    pub errands: Arc<E>,
    /// The time of day.
    pub clock: Arc<dyn Clock>,
    /// Whose turn it is.
    pub lanes: Lanes,
    /// Told when to look for due rows at once.
    pub woken: Arc<Notify>,
}

/// An attempt that has ended.
struct Ended {
    lane: Lane,
    id: String,
    end: AttemptEnd,
}

impl<E: Errands> Rounds<E> {
    /// Does what is due until `end`; then attempts on the way get `grace`.
    pub async fn run(
        mut self,
        mut changes: broadcast::Receiver<Arc<Job>>,
        end: CancellationToken,
        grace: Duration,
    ) {
        let mut on_the_way = JoinSet::new();
        let mut expiry = tokio::time::interval_at(Instant::now() + EXPIRE_EVERY, EXPIRE_EVERY);
        self.recall().await;
        loop {
            let pause = match self.start_due(&mut on_the_way).await {
                Ok(pause) => pause,
                Err(error) => {
                    tracing::error!(%error, "what is due could not be read; tried again");
                    IDLE_WAIT
                }
            };
            let idle = tokio::time::sleep(pause);
            tokio::pin!(idle);
            loop {
                tokio::select! {
                    () = end.cancelled() => {
                        let drained = async { while on_the_way.join_next().await.is_some() {} };
                        // What is still on the way is done again after the next start.
                        let _ = tokio::time::timeout(grace, drained).await;
                        return;
                    }
                    Some(ended) = on_the_way.join_next() => {
                        if let Ok(ended) = ended {
                            self.leave(&ended);
                        }
                    }
                    change = changes.recv() => match change {
                        Ok(job) if !self.errands.concerns(&job) => continue,
                        Ok(_) | Err(RecvError::Lagged(_)) => {}
                        Err(RecvError::Closed) => return,
                    },
                    _ = expiry.tick() => {
                        self.recall().await;
                        self.errands.expire().await;
                    }
                    () = self.woken.notified() => {}
                    () = &mut idle => {}
                }
                break;
            }
        }
    }

    async fn recall(&self) {
        match self.errands.recall(self.clock.now()).await {
            Ok(0) => {}
            Ok(recalled) => tracing::warn!(
                recalled,
                "what a clock that was ahead had put off is tried now"
            ),
            Err(error) => tracing::error!(%error, "what was put off could not be read"),
        }
    }

    /// Starts the attempts that are due and have a place. Returns when to look again.
    async fn start_due(&mut self, on_the_way: &mut JoinSet<Ended>) -> StoreResult<Duration> {
        let pending = self.errands.lanes().await?;
        let now = self.clock.now();
        self.lanes.begin_round(&pending, now);
        let mut next = now.saturating_add(milliseconds(IDLE_WAIT));
        for (lane, due_at) in self.lanes.in_turn(pending) {
            let room = self.lanes.room(&lane, now);
            if due_at > now || room == 0 {
                let rest = self.lanes.rests_until(&lane);
                let when = due_at.max(rest);
                if when > now {
                    next = next.min(when);
                }
                continue;
            }
            let limit = room + self.lanes.busy(&lane);
            let mut started = 0;
            for due in self.errands.due(&lane, now, limit).await? {
                let id = E::id(&due).to_owned();
                if started < room && self.lanes.enter(&lane, &id) {
                    started += 1;
                    let (errands, lane) = (self.errands.clone(), lane.clone());
                    on_the_way.spawn(async move {
                        let end = errands.attempt(due).await;
                        Ended { lane, id, end }
                    });
                }
            }
        }
        let pause = u64::try_from(next - now).unwrap_or(0).max(1);
        Ok(Duration::from_millis(pause))
    }

    fn leave(&mut self, ended: &Ended) {
        let failed = match ended.end {
            AttemptEnd::Fine => None,
            AttemptEnd::Failing(asked) => Some(asked),
            AttemptEnd::NotWritten => Some(Some(IDLE_WAIT)),
        };
        let now = self.clock.now();
        self.lanes.leave(&ended.lane, &ended.id, now, failed);
    }
}

/// A random number from 0 to 1.
pub fn random_share() -> f64 {
    let bits = uuid::Uuid::new_v4().as_u128() as u32;
    f64::from(bits) / f64::from(u32::MAX)
}
