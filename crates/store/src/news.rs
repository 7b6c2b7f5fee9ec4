//! News of other processes on the same PostgreSQL tables (`NOTIFY`).
//!
//! A task takes the notifications off a connection of its own as soon as they come, and leaves them in an
//! [`Inbox`] for whoever follows them at the speed of its own reads. If they stayed on the connection, the
//! server would wait inside a transaction until it can send the next one, and could not clean away any row
//! that ended since then.
//!
//! The inbox is bounded: the same news is in it once, and if more different news come than it holds, all
//! of them are replaced by [`News::Missed`].

use super::query::jitter;
use async_trait::async_trait;
use sqlx::postgres::{PgListener, PgPool, PgPoolOptions};
use std::collections::{HashSet, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::task::JoinHandle;
use ventriform_service::base::records::{News, NewsFeed};

/// Pause between two attempts to listen.
const LISTEN_RETRY: Duration = Duration::from_secs(1);
/// Number of different news that wait to be followed.
const QUEUED_NEWS: usize = 10_000;
/// The channel on which the function `tell_processes` of the database notifies.
const SELECT_CHANNEL: &str = "SELECT 'ventriform_' || md5(current_schema())";

/// News that wait to be followed, in the order in which they came.
struct Inbox {
    waiting: Mutex<Waiting>,
    more: Notify,
}

#[derive(Default)]
struct Waiting {
    order: VecDeque<News>,
    known: HashSet<News>,
}

impl Inbox {
    fn new() -> Self {
        Self {
            waiting: Mutex::default(),
            more: Notify::new(),
        }
    }

    /// Adds news, unless the same is waiting already.
    fn put(&self, news: News) {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let news = if waiting.order.len() < QUEUED_NEWS {
            news
        } else {
            *waiting = Waiting::default();
            News::Missed
        };
        if waiting.known.insert(news.clone()) {
            waiting.order.push_back(news);
        }
        self.more.notify_one();
    }

    fn take(&self) -> Option<News> {
        let mut waiting = self.waiting.lock().unwrap_or_else(PoisonError::into_inner);
        let news = waiting.order.pop_front()?;
        waiting.known.remove(&news);
        Some(news)
    }
}

/// The news of other processes since it was made.
pub(super) struct PgNews {
    inbox: Arc<Inbox>,
    listening: JoinHandle<()>,
}

impl PgNews {
    /// The news of others than `run` from the server of `pool`. To be called in a runtime.
    pub fn new(pool: &PgPool, run: &str) -> Self {
        let own = PgPoolOptions::new()
            .max_connections(1)
            .max_lifetime(None)
            .idle_timeout(None);
        let pool = own.connect_lazy_with((*pool.connect_options()).clone());
        let inbox = Arc::new(Inbox::new());
        Self {
            listening: tokio::spawn(listen(pool, run.to_owned(), inbox.clone())),
            inbox,
        }
    }
}

impl Drop for PgNews {
    fn drop(&mut self) {
        self.listening.abort();
    }
}

#[async_trait]
impl NewsFeed for PgNews {
    async fn next(&mut self) -> News {
        loop {
            if let Some(news) = self.inbox.take() {
                return news;
            }
            self.inbox.more.notified().await;
        }
    }
}

/// Puts what others than `run` tell into the inbox, for ever.
async fn listen(pool: PgPool, run: String, inbox: Arc<Inbox>) {
    loop {
        let mut listener = match listener(&pool).await {
            Ok(listener) => listener,
            Err(error) => {
                tracing::debug!(%error, "other processes cannot be listened to");
                tokio::time::sleep(jitter(LISTEN_RETRY)).await;
                continue;
            }
        };
        inbox.put(News::Missed);
        loop {
            match listener.try_recv().await {
                Ok(Some(notification)) => {
                    if let Some(news) = told(notification.payload(), &run) {
                        inbox.put(news);
                    }
                }
                // It was connected anew.
                Ok(None) => inbox.put(News::Missed),
                Err(error) => {
                    tracing::warn!(%error, "other processes are not heard for a while");
                    break;
                }
            }
        }
    }
}

async fn listener(pool: &PgPool) -> Result<PgListener, sqlx::Error> {
    let mut listener = PgListener::connect_with(pool).await?;
    let channel: String = sqlx::query_scalar(SELECT_CHANNEL)
        .fetch_one(&mut listener)
        .await?;
    listener.listen(&channel).await?;
    Ok(listener)
}

/// The content of a notification; `None` if it is of `run` itself, or of a newer version.
fn told(payload: &str, run: &str) -> Option<News> {
    let mut words = payload.splitn(3, ' ');
    let (kind, by, what) = (words.next()?, words.next()?, words.next()?);
    match kind {
        _ if by == run => None,
        "job" => Some(News::Job(what.to_owned())),
        "erased" => Some(News::Erased(what.to_owned())),
        "workitem" => Some(News::Scheduled),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn job(number: usize) -> News {
        News::Job(format!("job_{number}"))
    }

    fn all(inbox: &Inbox) -> Vec<News> {
        std::iter::from_fn(|| inbox.take()).collect()
    }

    #[test]
    fn the_same_news_waits_once_and_can_come_again_after_it_was_taken() {
        let inbox = Inbox::new();
        for number in [1, 2, 1, 1, 2, 3] {
            inbox.put(job(number));
        }
        assert_eq!(all(&inbox), [job(1), job(2), job(3)]);
        inbox.put(job(1));
        assert_eq!(all(&inbox), [job(1)]);
    }

    #[test]
    fn more_than_it_holds_is_missed_and_what_comes_later_is_not() {
        let inbox = Inbox::new();
        for number in 0..=QUEUED_NEWS {
            inbox.put(job(number));
        }
        inbox.put(job(1));
        assert_eq!(all(&inbox), [News::Missed, job(1)]);
    }

    #[test]
    fn what_others_tell_is_understood_and_what_this_run_tells_is_not_heard() {
        let of_job = Some(News::Job("job_1".into()));
        assert_eq!(told("job run_b job_1", "run_a"), of_job);
        assert_eq!(told("job  job_1", "run_a"), of_job);
        assert_eq!(told("job run_a job_1", "run_a"), None);
        assert_eq!(told("workitem run_b ", "run_a"), Some(News::Scheduled));
        assert_eq!(told("of a newer version", "run_a"), None);
    }
}
