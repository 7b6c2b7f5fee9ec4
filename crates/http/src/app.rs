//! The state that all handlers share.

use super::archives::ArchiveDesk;
use super::decoding::Decoding;
use super::guard::state::Guard;
use super::hooks::Hooks;
use super::intake::Intake;
use super::kept::Kept;
use super::memory::MemoryBudget;
use super::metrics::Metrics;
use super::readiness::Readiness;
use super::spans::Spans;
use super::streams::EventStreams;
use super::validators::ValidatedJson;
use super::wire::rfc3339;
use std::sync::Arc;
use tokio::sync::Notify;
use tokio_util::sync::CancellationToken;
use ventriform_service::access::AccessStore;
use ventriform_service::config::Settings;
use ventriform_service::items::RetentionAges;
use ventriform_service::jobs::Queue;
use ventriform_service::records::{FigureStore, Holding, Product, Resource};
use ventriform_service::work::Engine;
use ventriform_service::worklist::Worklist;

/// The ages at which the operator lets things be erased.
pub fn retention_ages(settings: &Settings) -> RetentionAges {
    let general = settings.retention.0.map(|span| span.0);
    RetentionAges {
        volumes: settings.volume_retention.or(general),
        results: settings.result_retention.or(general),
        jobs: settings.job_retention.or(general),
    }
}

/// The service's shared state.
#[derive(Clone)]
pub struct App(Arc<Shared>);

/// See [`App`].
pub struct Shared {
    /// Jobs, volumes and products.
    pub queue: Arc<Queue>,
    /// The kinds of work, and the reader of uploads.
    pub engine: Engine,
    /// Keys and audit trail.
    pub access: Arc<dyn AccessStore>,
    /// Work items of other systems.
    pub worklist: Arc<dyn Worklist>,
    /// Told when an item is scheduled or changed.
    pub scheduled: Notify,
    /// Tells and limits callers.
    pub guard: Guard,
    /// The operator's settings.
    pub settings: Settings,
    /// Cancelled when the service shuts down, so that long answers end.
    pub closing: CancellationToken,
    /// Reads files outside of jobs.
    pub decoding: Decoding,
    /// What requests hold in memory.
    pub memory: MemoryBudget,
    /// Answers about items that are still current.
    pub answers: Kept<ValidatedJson>,
    /// Products that are still current.
    pub products: Kept<Arc<Product>>,
    /// The open streams of events.
    pub streams: EventStreams,
    /// Telling other programs about jobs.
    pub hooks: Hooks,
    /// Archives.
    pub archives: ArchiveDesk,
    /// Receiving objects from other systems.
    pub intake: Intake,
    /// Figures for operators.
    pub metrics: Metrics,
    /// Whether the storage works.
    pub readiness: Readiness,
    /// Figures that only the database knows.
    pub figures: Arc<dyn FigureStore>,
    /// Traces of requests.
    pub spans: Spans,
}

/// How operators watch the service.
pub struct Watching {
    /// See [`Shared::metrics`].
    pub metrics: Metrics,
    /// See [`Shared::figures`].
    pub figures: Arc<dyn FigureStore>,
    /// See [`Shared::spans`].
    pub spans: Spans,
}

impl App {
    /// The state of a service that has just started.
    pub fn new(
        queue: Arc<Queue>,
        engine: Engine,
        (access, worklist, guard): (Arc<dyn AccessStore>, Arc<dyn Worklist>, Guard),
        settings: Settings,
        (hooks, archives, intake): (Hooks, ArchiveDesk, Intake),
        watching: Watching,
        closing: CancellationToken,
    ) -> Self {
        let answer_memory = usize::try_from(settings.answer_memory.0).unwrap_or(usize::MAX);
        Self(Arc::new(Shared {
            queue,
            engine,
            access,
            worklist,
            scheduled: Notify::new(),
            guard,
            decoding: Decoding::new(&settings, watching.metrics.requests.decoding_waits.clone()),
            memory: MemoryBudget::new(settings.request_memory.0),
            answers: Kept::new(answer_memory / 2),
            products: Kept::new(answer_memory / 2),
            streams: EventStreams::new(&settings),
            settings,
            hooks,
            archives,
            intake,
            closing,
            metrics: watching.metrics,
            figures: watching.figures,
            spans: watching.spans,
            readiness: Readiness::default(),
        }))
    }

    /// When an item of that kind will be erased (RFC 3339); `None` if it is kept.
    pub fn expires_at(&self, kind: Resource, holding: &Holding) -> Option<String> {
        if holding.legal_hold.is_some() || holding.source_on_hold {
            return None;
        }
        let ages = retention_ages(&self.settings);
        ages.expires_at(kind, holding.renewed_at).map(rfc3339)
    }
}

impl std::ops::Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}
