//! The writer of the audit trail.
//!
//! All events pass one task, which appends what has come together in one transaction: under load
//! many writes share one sync of the disk.
//!
//! - [`Recorder::record`] returns when the event is on disk. Acts that change something wait for
//!   it before they are answered.
//! - [`Recorder::note`] returns at once. Alike events of one second (the same caller, item and
//!   activity) become one row with a count. A crash loses at most the last second of them.
//!
//! An event that cannot be written is kept and tried again each second. Beyond [`MOST_NOTED`] kinds of
//! events further ones are counted; once the database can be written again, a row says how many
//! are lost.

use super::event::{Activity, AuditEvent};
use crate::base::records::{Clock, Tenant};
use crate::callers::AccessStore;
use std::collections::HashMap;
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::{mpsc, oneshot};
use tokio::task::JoinHandle;
use tokio::time::Instant;

/// Time for which noted events may wait.
const FLUSH_AFTER: Duration = Duration::from_secs(1);
/// Events on their way to the task.
const BUFFERED_EVENTS: usize = 1024;
/// Most events of one transaction that somebody waits for.
const BATCH_EVENTS: usize = 256;
/// Most kinds of noted events that are kept.
const MOST_NOTED: usize = 4096;

enum Entry {
    Awaited(AuditEvent, oneshot::Sender<bool>),
    Noted(AuditEvent),
    Flush(oneshot::Sender<()>),
}

/// The event was not recorded, because the database failed or the recorder has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the audit trail cannot be written")]
pub struct NotRecorded;

/// Appends to the audit trail.
pub struct Recorder {
    entries: mpsc::Sender<Entry>,
    task: JoinHandle<()>,
}

impl Recorder {
    /// Starts the task that writes to `store`.
    pub fn start(store: Arc<dyn AccessStore>, clock: Arc<dyn Clock>) -> Self {
        let (entries, received) = mpsc::channel(BUFFERED_EVENTS);
        let writer = Writer {
            store,
            clock,
            noted: HashMap::new(),
            lost: 0,
        };
        Self {
            entries,
            task: tokio::spawn(writer.run(received)),
        }
    }

    /// Appends an event; returns when it is on disk.
    ///
    /// # Errors
    /// If it may not be on disk.
    pub async fn record(&self, event: AuditEvent) -> Result<(), NotRecorded> {
        let (done, written) = oneshot::channel();
        let entry = Entry::Awaited(event, done);
        self.entries.send(entry).await.map_err(|_| NotRecorded)?;
        match written.await {
            Ok(true) => Ok(()),
            _ => Err(NotRecorded),
        }
    }

    /// Appends an event within a second.
    pub async fn note(&self, event: AuditEvent) {
        if self.entries.send(Entry::Noted(event)).await.is_err() {
            tracing::error!("the audit trail has ended; an event is lost");
        }
    }

    /// Appends what was noted; returns when that was tried.
    pub async fn flush(&self) {
        let (done, flushed) = oneshot::channel();
        if self.entries.send(Entry::Flush(done)).await.is_ok() {
            // An error means that the task has ended, after it wrote everything.
            let _ = flushed.await;
        }
    }
}

impl Drop for Recorder {
    fn drop(&mut self) {
        self.task.abort();
    }
}

struct Writer {
    store: Arc<dyn AccessStore>,
    clock: Arc<dyn Clock>,
    /// Noted events, without time, request and count, with the first of each kind.
    noted: HashMap<AuditEvent, AuditEvent>,
    lost: u64,
}

impl Writer {
    async fn run(mut self, mut entries: mpsc::Receiver<Entry>) {
        let mut due = None;
        loop {
            let received = match due {
                None => entries.recv().await,
                Some(at) => match tokio::time::timeout_at(at, entries.recv()).await {
                    Ok(received) => received,
                    Err(_) => {
                        self.write(Vec::new()).await;
                        due = self.next_due();
                        continue;
                    }
                },
            };
            let Some(first) = received else { break };
            let (mut awaited, mut flushes) = (Vec::new(), Vec::new());
            self.sort(first, &mut awaited, &mut flushes);
            while awaited.len() < BATCH_EVENTS {
                match entries.try_recv() {
                    Ok(entry) => self.sort(entry, &mut awaited, &mut flushes),
                    Err(_) => break,
                }
            }
            if !awaited.is_empty() || !flushes.is_empty() {
                self.write(awaited).await;
                due = None;
            }
            for flushed in flushes {
                let _ = flushed.send(());
            }
            due = due.or_else(|| self.next_due());
        }
        self.write(Vec::new()).await;
    }

    fn next_due(&self) -> Option<Instant> {
        let waiting = !self.noted.is_empty() || self.lost > 0;
        waiting.then(|| Instant::now() + FLUSH_AFTER)
    }

    fn sort(
        &mut self,
        entry: Entry,
        awaited: &mut Vec<(AuditEvent, oneshot::Sender<bool>)>,
        flushes: &mut Vec<oneshot::Sender<()>>,
    ) {
        match entry {
            Entry::Awaited(event, done) => awaited.push((event, done)),
            Entry::Flush(done) => flushes.push(done),
            Entry::Noted(event) => {
                let kind = AuditEvent {
                    recorded: 0,
                    request: None,
                    count: 0,
                    ..event.clone()
                };
                if let Some(known) = self.noted.get_mut(&kind) {
                    known.count += event.count;
                    // The row stands for several requests.
                    known.request = None;
                } else if self.noted.len() < MOST_NOTED {
                    self.noted.insert(kind, event);
                } else {
                    self.lost += event.count;
                }
            }
        }
    }

    /// Appends everything that waits, in one transaction, in the order of time.
    async fn write(&mut self, awaited: Vec<(AuditEvent, oneshot::Sender<bool>)>) {
        let mut events: Vec<AuditEvent> = self.noted.values().cloned().collect();
        if self.lost > 0 {
            events.push(AuditEvent {
                count: self.lost,
                ..AuditEvent::new(
                    self.clock.now(),
                    Activity::AuditGap,
                    Tenant::default(),
                    "ventriform".into(),
                )
            });
        }
        events.extend(awaited.iter().map(|(event, _)| event.clone()));
        if events.is_empty() {
            return;
        }
        events.sort_by_key(|event| event.recorded);
        let appended = self.store.append(&events).await;
        match &appended {
            Ok(()) => {
                self.noted.clear();
                self.lost = 0;
            }
            Err(error) => tracing::error!(%error, "the audit trail cannot be written"),
        }
        for (_, done) in awaited {
            // An error means that nobody waits any more.
            let _ = done.send(appended.is_ok());
        }
    }
}
