//! A job and its states: `queued -> running -> succeeded | failed | cancelled`, and from
//! `running` back to `queued` when its worker was lost.

use super::{Failure, Priority, Tags, Tenant, Timestamp};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use std::fmt;

/// The state of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum JobState {
    /// Waiting for a worker.
    Queued,
    /// Claimed by a worker.
    Running,
    /// Finished; the result is stored.
    Succeeded,
    /// Finished with a [`Failure`].
    Failed,
    /// Ended on request.
    Cancelled,
}

impl JobState {
    /// Every state, in the order in which a job goes through them.
    pub const ALL: [JobState; 5] = [
        JobState::Queued,
        JobState::Running,
        JobState::Succeeded,
        JobState::Failed,
        JobState::Cancelled,
    ];

    /// The state's name in the database and over HTTP.
    pub fn as_str(self) -> &'static str {
        match self {
            JobState::Queued => "queued",
            JobState::Running => "running",
            JobState::Succeeded => "succeeded",
            JobState::Failed => "failed",
            JobState::Cancelled => "cancelled",
        }
    }

    /// The state with that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == name)
    }

    /// Whether the job has ended. A job that has ended never changes again.
    pub fn is_final(self) -> bool {
        !matches!(self, JobState::Queued | JobState::Running)
    }
}

/// One row of the jobs table.
#[derive(Debug, Clone, PartialEq)]
pub struct Job {
    /// `job_...`
    pub id: String,
    /// Whose job it is; only this tenant sees it.
    pub tenant: Tenant,
    /// Position in the order of filing.
    pub sequence: i64,
    /// The tenant's names for it.
    pub tags: Tags,
    /// The kind of work: `model`, `segmentation`, `beat`, `comparison`, `normals`.
    pub kind: String,
    /// Its urgency.
    pub priority: Priority,
    /// Id of the volume to work on; `None` until it has come from [`Job::source`].
    pub volume: Option<String>,
    /// The series in an archive that the volume comes from.
    pub source: Option<SeriesSource>,
    /// The objects of the result that are sent to an archive.
    pub send: Option<SendOrder>,
    /// The validated parameters, with every default written out.
    pub parameters: Map<String, Value>,
    /// The state.
    pub state: JobState,
    /// The current stage of the work, once one was reported.
    pub stage: Option<String>,
    /// The completed fraction, 0..=1.
    pub progress: f64,
    /// The number of times that a worker has claimed the job.
    pub attempts: u32,
    /// How often the service died while the job was running on its threads. From the first time
    /// on, the job is computed in a process of its own, where that is possible.
    pub interruptions: u32,
    /// The number of times that the job's own process died while the service lived.
    pub crashes: u32,
    /// Increases with every change; the id of the job's events.
    pub revision: i64,
    /// Whether cancellation was requested.
    pub cancel_requested: bool,
    /// When the job was accepted.
    pub created_at: Timestamp,
    /// When a worker last claimed it.
    pub started_at: Option<Timestamp>,
    /// When it ended.
    pub finished_at: Option<Timestamp>,
    /// Why it failed.
    pub failure: Option<Failure>,
    /// Id of the product it made.
    pub result: Option<String>,
    /// The W3C trace context of the request that filed it: a value of the header `traceparent`.
    pub trace_parent: Option<String>,
}

/// A series in an archive. `Debug` does not show which.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SeriesSource {
    /// Name of the configured archive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub archive: Option<String>,
    /// Base URL of a DICOMweb service for which no archive is configured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dicomweb: Option<String>,
    /// Study Instance UID.
    pub study: String,
    /// Series Instance UID.
    pub series: String,
}

impl fmt::Debug for SeriesSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("SeriesSource(..)")
    }
}

/// The objects of a job's result that are sent to an archive.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SendOrder {
    /// Names of the DICOM objects, such as `mask.dcm`; not empty, each once.
    pub names: Vec<String>,
    /// Name of the archive.
    pub to: String,
}

/// A job to be filed.
#[derive(Debug, Clone, Default)]
pub struct NewJob {
    /// See [`Job::tenant`].
    pub tenant: Tenant,
    /// See [`Job::tags`].
    pub tags: Tags,
    /// See [`Job::kind`].
    pub kind: String,
    /// See [`Job::priority`].
    pub priority: Priority,
    /// See [`Job::volume`]; `None` if there is a source.
    pub volume: Option<String>,
    /// See [`Job::source`].
    pub source: Option<SeriesSource>,
    /// See [`Job::send`].
    pub send: Option<SendOrder>,
    /// Other stored items the work needs: parameter name to id.
    pub needs: BTreeMap<String, String>,
    /// See [`Job::parameters`].
    pub parameters: Map<String, Value>,
    /// The client's `Idempotency-Key`, with a hash of the request.
    pub idempotency: Option<Idempotency>,
    /// Where this job is told about.
    pub webhook: Option<JobWebhook>,
    /// See [`Job::trace_parent`].
    pub trace_parent: Option<String>,
    /// Bytes that the tenant may store in all once the result is added; `None` is no bound.
    pub storage_limit: Option<u64>,
}

/// Where a job is told about, as it is stored with the job. `Debug` does not show it.
#[derive(Clone, PartialEq, Eq, Serialize)]
pub struct JobWebhook {
    /// The receiver.
    pub url: String,
    /// Scheme, host and port of the URL.
    pub destination: String,
    /// Names of the events to tell.
    pub events: Vec<String>,
    /// The secret that signs the deliveries; the tenant's secret if there is none.
    pub secret: Option<String>,
}

impl fmt::Debug for JobWebhook {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("JobWebhook(..)")
    }
}

/// Marks repeated requests of a tenant as one: the same key with the same fingerprint files one
/// job.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Idempotency {
    /// The key.
    pub key: String,
    /// A hash of the request sent with the key.
    pub fingerprint: String,
}

impl Idempotency {
    /// The outcome of a request with this key, after `job` was filed under it by the request with
    /// that fingerprint.
    pub fn judge(&self, job: Job, fingerprint: &str) -> Filed {
        if self.fingerprint == fingerprint {
            Filed::Same(job)
        } else {
            Filed::KeyReused
        }
    }
}

/// The result of filing a job.
#[derive(Debug, Clone)]
pub enum Filed {
    /// Accepted and on disk.
    New(Job),
    /// Accepted earlier, under the same idempotency key with the same request.
    Same(Job),
    /// Rejected: the idempotency key was used for a different request.
    KeyReused,
    /// Rejected: the queue is full.
    QueueFull,
    /// Rejected: an item that the job needs does not exist, or was deleted.
    Missing {
        /// `volume`, or the parameter that names the item.
        field: String,
        /// The id given there.
        id: String,
    },
}
