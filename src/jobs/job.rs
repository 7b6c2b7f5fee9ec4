//! A job and its life: `queued -> running -> succeeded | failed | cancelled`, and back from
//! `running` to `queued` when its worker was lost.

use super::{Failure, Timestamp};
use serde_json::{Map, Value};
use std::collections::BTreeMap;

/// Where a job is in its life.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum State {
    /// Waits for a worker.
    Queued,
    /// A worker holds it.
    Running,
    /// Its result is there.
    Succeeded,
    /// It ended with a [`Failure`].
    Failed,
    /// Somebody ended it.
    Cancelled,
}

impl State {
    /// Every state, in the order of a job's life.
    pub const ALL: [State; 5] = [
        State::Queued,
        State::Running,
        State::Succeeded,
        State::Failed,
        State::Cancelled,
    ];

    /// The state's name in the database and over HTTP.
    pub fn as_str(self) -> &'static str {
        match self {
            State::Queued => "queued",
            State::Running => "running",
            State::Succeeded => "succeeded",
            State::Failed => "failed",
            State::Cancelled => "cancelled",
        }
    }

    /// The state of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == name)
    }

    /// Whether nothing will change any more.
    pub fn is_final(self) -> bool {
        !matches!(self, State::Queued | State::Running)
    }
}

/// One row of the queue.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// `job_...`
    pub id: String,
    /// Order of filing; grows by one with each job.
    pub sequence: i64,
    /// What kind of work it is: `model`, `segmentation`.
    pub kind: String,
    /// The volume it works on.
    pub volume: String,
    /// The parameters, checked, every default written out.
    pub parameters: Map<String, Value>,
    /// Where it is in its life.
    pub state: State,
    /// The stage of the work, once one was reported.
    pub stage: Option<String>,
    /// How much is done, 0..=1.
    pub progress: f64,
    /// How often a worker took it.
    pub attempts: u32,
    /// Grows with every change; the id of its events.
    pub revision: i64,
    /// Whether somebody asked for its end.
    pub cancel_requested: bool,
    /// When it was accepted.
    pub created_at: Timestamp,
    /// When a worker last took it.
    pub started_at: Option<Timestamp>,
    /// When it came to its end.
    pub finished_at: Option<Timestamp>,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// What it made.
    pub result: Option<String>,
}

/// A job to be filed.
#[derive(Debug, Clone)]
pub struct NewJob {
    /// See [`Job::kind`].
    pub kind: String,
    /// See [`Job::volume`].
    pub volume: String,
    /// What the work needs besides the volume: field of the parameters and id.
    pub needs: BTreeMap<String, String>,
    /// See [`Job::parameters`].
    pub parameters: Map<String, Value>,
    /// The caller's `Idempotency-Key` and what it stood for.
    pub idempotency: Option<Idempotency>,
}

/// A caller's promise that two requests are one.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Idempotency {
    /// The key.
    pub key: String,
    /// A hash of the request it came with.
    pub fingerprint: String,
}

/// What became of an attempt to file a job.
#[derive(Debug, Clone)]
pub enum Filed {
    /// Accepted and durable.
    New(Job),
    /// Accepted earlier, under the same key with the same request.
    Same(Job),
    /// The key was used for another request.
    KeyReused,
    /// As many wait as may wait.
    QueueFull,
    /// Something that it needs does not exist (any more).
    Missing {
        /// `volume`, or the field of the parameters.
        field: String,
        /// The id in it.
        id: String,
    },
}
