//! The service: one method for each use case, whoever asks for it.
//!
//! HTTP, C-STORE, archive fetches, rules, work items and background tasks call the same methods, which check the
//! same quotas and limits and return a [`ServiceError`](crate::base::error::ServiceError). Every one fails if the storage
//! does, and if the request has no memory for what it reads; what else it refuses stands beside it. What an
//! [`Agent`] changes belongs to the agent's tenant.
//!
//! | use case | where |
//! |---|---|
//! | store a volume | [`crate::use_cases::uploads`] |
//! | file, cancel and erase a job | [`crate::use_cases::filing`], its archives [`crate::use_cases::series`] |
//! | read items, jobs, receipts | [`crate::use_cases::reading`] |
//! | look at a volume, name it, hold it | [`crate::use_cases::volumes`] |
//! | make a file of a result | [`crate::use_cases::results`] |
//! | erase items, what was received, or a work item | `erasures` |
//! | add a template or a reader | [`crate::use_cases::library`] |
//! | read, state and erase whose scan a volume is | `scans` |
//! | make and revoke keys | [`crate::use_cases::keys`] |
//! | register webhooks, deliver again | [`crate::use_cases::webhooks`] |
//! | serve work items of other systems | [`crate::use_cases::workitems`] |
//! | serve rules for received series | `rules` |
//! | perform work items | `procedures` |
//! | watch the service | `operation` |
//! | count what tenants may store and queue | [`crate::limits::quotas`] |

use crate::base::http_client::ClientFactory;
use crate::base::memory::MemoryBudget;
use crate::base::records::{Clock, FigureStore, Ownership, Resource, Tenant, Timestamp};
use crate::callers::{AccessStore, Agent, AuditEvent, Recorder};
use crate::config::Settings;
use crate::items::{Items, RetentionAges};
use crate::jobs::Queue;
use crate::limits::decoding::Decoding;
use crate::limits::quotas::Quotas;
use crate::network::archive::ArchiveDesk;
use crate::network::hooks::Hooks;
use crate::network::intake::{Intake, Receiver, Sessions};
use crate::network::worklist::Worklist;
use crate::telemetry::{Metrics, Readiness, RequestMetrics, Spans};
use crate::work::Engine;
use std::sync::Arc;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// The parts of one service.
pub struct Service {
    pub(crate) queue: Arc<Queue>,
    /// The kinds of work, and the reader of uploads.
    pub(crate) engine: Engine,
    /// Keys and audit trail.
    pub(crate) access: Arc<dyn AccessStore>,
    /// Writes the audit trail.
    pub(crate) recorder: Arc<Recorder>,
    /// Work items of other systems.
    pub(crate) worklist: Arc<dyn Worklist>,
    /// Notified when a work item is scheduled or changed.
    pub(crate) scheduled: Notify,
    /// Limits on what tenants store and queue.
    pub(crate) quotas: Quotas,
    /// The operator's settings.
    pub(crate) settings: Settings,
    /// Cancelled when the service shuts down, so that long answers end.
    pub(crate) closing: CancellationToken,
    /// Reads files outside of jobs.
    pub(crate) decoding: Arc<Decoding>,
    /// The memory that requests may hold.
    pub(crate) memory: MemoryBudget,
    /// Webhooks.
    pub(crate) hooks: Hooks,
    /// Archives.
    pub(crate) archives: ArchiveDesk,
    /// Receives objects of other systems.
    pub(crate) intake: Intake,
    /// Figures for operators.
    pub(crate) metrics: Metrics,
    /// Whether the storage works.
    pub(crate) readiness: Readiness,
    /// Figures that only the database knows.
    pub(crate) figures: Arc<dyn FigureStore>,
    /// Traces of requests.
    pub(crate) spans: Spans,
    /// Makes the clients of requests to other programs.
    pub(crate) http_clients: Arc<dyn ClientFactory>,
}

/// The ages at which the operator lets things be erased.
pub fn retention_ages(settings: &Settings) -> RetentionAges {
    let general = settings.retention.0.map(|span| span.0);
    RetentionAges {
        volumes: settings.volume_retention.or(general),
        results: settings.result_retention.or(general),
        jobs: settings.job_retention.or(general),
    }
}

impl Service {
    /// The jobs.
    pub fn queue(&self) -> &Arc<Queue> {
        &self.queue
    }

    /// The volumes and products.
    pub fn items(&self) -> &Arc<Items> {
        self.queue.items()
    }

    /// The time of day.
    pub fn clock(&self) -> &Arc<dyn Clock> {
        self.queue.clock()
    }

    /// The time now.
    pub fn now(&self) -> Timestamp {
        self.queue.now()
    }

    /// The operator's settings.
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// Cancelled when the service shuts down, so that long answers end.
    pub fn closing(&self) -> &CancellationToken {
        &self.closing
    }

    /// Reads what takes long outside of jobs.
    pub fn decoding(&self) -> &Decoding {
        &self.decoding
    }

    /// The memory that requests may hold.
    pub fn memory(&self) -> &MemoryBudget {
        &self.memory
    }

    /// Limits on what tenants store and queue.
    pub fn quotas(&self) -> &Quotas {
        &self.quotas
    }

    /// Takes objects of other systems.
    pub fn receiver(&self) -> &Arc<Receiver> {
        &self.intake.receiver
    }

    /// The received groups that wait for more.
    pub fn sessions(&self) -> &Arc<Sessions> {
        &self.intake.sessions
    }

    /// Figures of requests.
    pub fn request_metrics(&self) -> &RequestMetrics {
        &self.metrics.requests
    }

    /// Traces of requests.
    pub fn spans(&self) -> &Spans {
        &self.spans
    }

    /// Writes the audit trail.
    pub fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    /// Whoever acts in that event.
    pub fn agent_of(&self, event: AuditEvent) -> Agent {
        Agent::from_recorder(self.recorder.clone(), self.clock().clone(), event)
    }

    /// The agent of that name, for acts of no caller.
    pub fn agent(&self, tenant: &Tenant, name: impl Into<String>) -> Agent {
        let (recorder, clock) = (self.recorder.clone(), self.clock().clone());
        Agent::new(recorder, clock, tenant.clone(), name)
    }

    /// When an item of that kind will be erased; `None` if it is kept.
    pub fn expires_at(&self, kind: Resource, ownership: &Ownership) -> Option<Timestamp> {
        if ownership.legal_hold.is_some() || ownership.source_on_hold {
            return None;
        }
        retention_ages(&self.settings).expires_at(kind, ownership.renewed_at)
    }
}
