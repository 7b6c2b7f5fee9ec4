//! The service: one method for each use case, whoever asks for it.
//!
//! HTTP, C-STORE, archive fetches, rules, work items and background tasks call the same methods, which check the
//! same quotas and limits and return a [`ServiceError`](crate::base::error::ServiceError).
//!
//! | use case | where |
//! |---|---|
//! | store a volume | [`crate::use_cases::uploads`] |
//! | file a job | [`crate::use_cases::filing`], its archives [`crate::use_cases::series`] |
//! | erase what was received, or a work item | [`crate::use_cases::erasures`] |
//! | add a template or a reader | [`crate::use_cases::library`] |
//! | read whose scan a volume is | [`crate::use_cases::scans`] |
//! | serve rules for received series | [`crate::use_cases::rules`] |
//! | perform work items | [`crate::use_cases::procedures`] |
//! | count what tenants may store and queue | [`crate::limits::quotas`] |

use crate::base::http_client::ClientFactory;
use crate::base::memory::MemoryBudget;
use crate::base::records::{Clock, FigureStore, Ownership, Resource, Tenant, Timestamp};
use crate::callers::{AccessStore, Agent, Recorder};
use crate::config::Settings;
use crate::items::{Items, RetentionAges};
use crate::jobs::Queue;
use crate::limits::decoding::Decoding;
use crate::limits::quotas::Quotas;
use crate::network::archive::ArchiveDesk;
use crate::network::hooks::Hooks;
use crate::network::intake::Intake;
use crate::network::worklist::Worklist;
use crate::telemetry::{Dependencies, Metrics, Readiness, Spans};
use crate::work::Engine;
use std::sync::Arc;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;

/// The parts of one service.
pub struct Service {
    pub(crate) queue: Arc<Queue>,
    /// The kinds of work, and the reader of uploads.
    pub engine: Engine,
    /// Keys and audit trail.
    pub access: Arc<dyn AccessStore>,
    /// Writes the audit trail.
    pub recorder: Arc<Recorder>,
    /// Work items of other systems.
    pub worklist: Arc<dyn Worklist>,
    /// Notified when a work item is scheduled or changed.
    pub scheduled: Notify,
    /// Limits on what tenants store and queue.
    pub quotas: Quotas,
    /// The operator's settings.
    pub settings: Settings,
    /// Cancelled when the service shuts down, so that long answers end.
    pub closing: CancellationToken,
    /// Reads files outside of jobs.
    pub decoding: Arc<Decoding>,
    /// The memory that requests may hold.
    pub memory: MemoryBudget,
    /// Webhooks.
    pub hooks: Hooks,
    /// Archives.
    pub archives: ArchiveDesk,
    /// Receives objects of other systems.
    pub intake: Intake,
    /// Figures for operators.
    pub metrics: Metrics,
    /// Whether the storage works.
    pub readiness: Readiness,
    /// Figures that only the database knows.
    pub figures: Arc<dyn FigureStore>,
    /// Traces of requests.
    pub spans: Spans,
    /// Makes the clients of requests to other programs.
    pub http_clients: Arc<dyn ClientFactory>,
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

    /// What readiness depends on.
    pub fn dependencies(&self) -> Dependencies<'_> {
        Dependencies {
            queue: &self.queue,
            access: &*self.access,
        }
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
