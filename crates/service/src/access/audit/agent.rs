//! Who changes something, and the row that says so.
//!
//! A use case that changes something takes the [`Agent`] for whom it does, and makes the change by [`Agent::change`]: the
//! change and its row are one task, which goes on if the caller goes away. So a request whose connection is reset, or that
//! is refused after a part of it was done, leaves the rows of what it has done.

use super::event::{Activity, AuditEvent, Outcome};
use super::recorder::{NotRecorded, Recorder};
use crate::memory::Requester;
use crate::records::{Clock, ErasureAgent, StoreError, Tenant, Timestamp};
use std::fmt::{Debug, Formatter};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::Instrument;

/// An act that was done: what it was, and the id of the item.
pub type Done = (Activity, String);

/// What became of an agent's rows.
#[derive(Debug, Default)]
struct Rows {
    written: AtomicBool,
    missing: AtomicBool,
}

/// Who acts: a caller, a sender, a rule of the settings, a duty of the service. Clones are the same agent.
#[derive(Clone)]
pub struct Agent {
    who: Arc<AuditEvent>,
    recorder: Arc<Recorder>,
    clock: Arc<dyn Clock>,
    rows: Arc<Rows>,
}

impl Debug for Agent {
    fn fmt(&self, formatter: &mut Formatter<'_>) -> std::fmt::Result {
        formatter.debug_tuple("Agent").field(&self.who).finish()
    }
}

impl Agent {
    /// The agent of that name, whose acts concern items of `tenant`.
    pub fn new(
        recorder: Arc<Recorder>,
        clock: Arc<dyn Clock>,
        tenant: Tenant,
        name: impl Into<String>,
    ) -> Self {
        Self::of(
            recorder,
            clock,
            AuditEvent::new(0, Activity::Read, tenant, name.into()),
        )
    }

    /// The agent of that event: its tenant, name, key, address and request.
    pub fn of(recorder: Arc<Recorder>, clock: Arc<dyn Clock>, who: AuditEvent) -> Self {
        Self {
            who: Arc::new(who),
            recorder,
            clock,
            rows: Arc::default(),
        }
    }

    /// Sets the network address from which it acts.
    #[must_use]
    pub fn at(mut self, address: impl Into<String>) -> Self {
        Arc::make_mut(&mut self.who).address = Some(address.into());
        self
    }

    /// Who it is, for an erasure, whose row is written together with its receipt.
    pub fn of_erasure(&self) -> ErasureAgent {
        ErasureAgent {
            name: self.who.agent.clone(),
            key: self.who.key.clone(),
            address: self.who.address.clone(),
            request: self.who.request.clone(),
        }
    }

    /// The agent's act at that time.
    pub fn event(&self, activity: Activity, now: Timestamp) -> AuditEvent {
        AuditEvent {
            activity,
            recorded: now,
            ..AuditEvent::clone(&self.who)
        }
    }

    /// Makes a change and writes its row, both in a task of their own, which goes on if the caller goes away. `done` tells
    /// the act; `None` if nothing was changed.
    ///
    /// # Errors
    /// Those of `change`. That the row could not be written is no error here: see [`Agent::lacks_rows`].
    pub async fn change<T, E>(
        &self,
        change: impl Future<Output = Result<T, E>> + Send + 'static,
        done: impl FnOnce(&T) -> Option<Done> + Send + 'static,
    ) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
    {
        let agent = self.clone();
        let task = async move {
            let changed = change.await?;
            if let Some((activity, object)) = done(&changed) {
                // Whoever waits for the change asks the agent.
                let _ = agent.did(activity, object).await;
            }
            Ok(changed)
        };
        let task = Requester::current().scope(task);
        tokio::spawn(task.in_current_span())
            .await
            .unwrap_or_else(|error| Err(StoreError::database(error.to_string()).into()))
    }

    /// Writes the row of an act that was done; returns when it is on disk. One that cannot be written is tried again each
    /// second.
    ///
    /// # Errors
    /// If it may not be on disk.
    pub async fn did(&self, activity: Activity, object: String) -> Result<(), NotRecorded> {
        self.record(activity, Outcome::Success, object).await
    }

    /// Writes the row of an act that ended in that way.
    ///
    /// # Errors
    /// As [`Agent::did`].
    pub async fn record(
        &self,
        activity: Activity,
        outcome: Outcome,
        object: String,
    ) -> Result<(), NotRecorded> {
        let event = AuditEvent {
            outcome,
            ..self.event(activity, self.clock.now()).on(object)
        };
        let recorded = self.recorder.record(event.clone()).await;
        match recorded {
            Ok(()) => self.rows.written.store(true, Ordering::Relaxed),
            Err(NotRecorded) => {
                self.rows.missing.store(true, Ordering::Relaxed);
                self.recorder.note(event).await;
            }
        }
        recorded
    }

    /// Writes the row of an act within a second, together with alike ones.
    pub async fn note(&self, activity: Activity, object: String) {
        let event = self.event(activity, self.clock.now()).on(object);
        self.recorder.note(event).await;
    }

    /// Whether a change was tried to be recorded.
    pub fn has_acted(&self) -> bool {
        self.rows.written.load(Ordering::Relaxed) || self.lacks_rows()
    }

    /// Whether the row of a change could not be written at once.
    pub fn lacks_rows(&self) -> bool {
        self.rows.missing.load(Ordering::Relaxed)
    }
}
