//! Who changes something, and the row that says so.
//!
//! A use case that changes something takes the [`Agent`] for whom it does, and makes the change by [`Agent::change`].
//! While the change runs, [`Agent::acting`] tells the store who acts; the store names the act where it makes the
//! change, and writes its row ([`Agent::acts`]) in the transaction of the change. Both are on disk, or neither: a row
//! that cannot be written undoes the change, and a process that dies between the two leaves none of them.
//!
//! The change is a task of its own, which goes on if the caller goes away. So a request whose connection is reset, or
//! that is refused after a part of it was done, leaves the rows of what it has done. What the service does of itself,
//! without an agent, leaves no row.

use super::event::{Activity, AuditEvent};
use super::recorder::Recorder;
use crate::base::memory::Requester;
use crate::base::records::{Clock, ErasureAgent, StoreError, Tenant, Timestamp};
use std::fmt::{Debug, Formatter};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use tracing::Instrument;

tokio::task_local! {
    /// For whom the task makes changes.
    static ACTING: Agent;
}

/// Who acts: a caller, a sender, a rule of the settings, a duty of the service. Clones are the same agent.
#[derive(Clone)]
pub struct Agent {
    who: Arc<AuditEvent>,
    recorder: Arc<Recorder>,
    clock: Arc<dyn Clock>,
    /// Whether a change of it has a row.
    acted: Arc<AtomicBool>,
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
        Self::from_recorder(
            recorder,
            clock,
            AuditEvent::new(0, Activity::Read, tenant, name.into()),
        )
    }

    /// The agent of that event: its tenant, name, key, address and request.
    pub fn from_recorder(recorder: Arc<Recorder>, clock: Arc<dyn Clock>, who: AuditEvent) -> Self {
        Self {
            who: Arc::new(who),
            recorder,
            clock,
            acted: Arc::default(),
        }
    }

    /// Sets the network address from which it acts.
    #[must_use]
    pub fn at(mut self, address: impl Into<String>) -> Self {
        Arc::make_mut(&mut self.who).address = Some(address.into());
        self
    }

    /// Whose items its acts concern.
    pub fn tenant(&self) -> &Tenant {
        &self.who.tenant
    }

    /// Its name.
    pub fn name(&self) -> &str {
        &self.who.agent
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

    /// Makes a change for this agent, in a task of its own, which goes on if the caller goes away. The store writes the
    /// row of each act in the transaction of the change.
    ///
    /// # Errors
    /// Those of `change`; one is that the row cannot be written: then nothing was changed.
    pub async fn change<T, E>(
        &self,
        change: impl Future<Output = Result<T, E>> + Send + 'static,
    ) -> Result<T, E>
    where
        T: Send + 'static,
        E: From<StoreError> + Send + 'static,
    {
        let task = Self::scope(Some(self.clone()), change);
        let task = Requester::current().scope(task);
        tokio::spawn(task.in_current_span())
            .await
            .unwrap_or_else(|error| Err(StoreError::database(error.to_string()).into()))
    }

    /// For whom the running task makes changes; `None` if the service does of itself.
    pub fn acting() -> Option<Self> {
        ACTING.try_with(Clone::clone).ok()
    }

    /// Runs a part of a change that has a task of its own for `agent`, which [`Agent::acting`] told before that task
    /// began.
    pub async fn scope<T>(agent: Option<Self>, part: impl Future<Output = T>) -> T {
        match agent {
            Some(agent) => ACTING.scope(agent, part).await,
            None => part.await,
        }
    }

    /// The row of an act of this agent that is being done. The store commits it with the change.
    pub fn acts(&self, activity: Activity, object: &str) -> AuditEvent {
        self.acted.store(true, Ordering::Relaxed);
        self.event(activity, self.clock.now()).on(object)
    }

    /// Writes the row of an act within a second, together with alike ones.
    pub async fn note(&self, activity: Activity, object: String) {
        let event = self.event(activity, self.clock.now()).on(object);
        self.recorder.note(event).await;
    }

    /// Whether a change was made that has a row.
    pub fn has_acted(&self) -> bool {
        self.acted.load(Ordering::Relaxed)
    }
}
