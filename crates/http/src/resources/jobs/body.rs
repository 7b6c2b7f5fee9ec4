//! A job as JSON.

use crate::app::App;
use crate::openapi::JobParameters;
use crate::resources::tags;
use crate::wire::links::{path_of, rfc3339};
use crate::wire::problem::{Answer, Problem, ProblemBody};
use crate::wire::words::{JobStateName, PriorityName, Word};
use serde::Serialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use ventriform_service::base::records::{Job, JobState, Resource, SendOrder, SeriesSource};
use ventriform_service::callers::Scope;
use ventriform_service::network::archive::{ObjectDelivery, Pull};
use ventriform_service::network::hooks::DeliveryState;
use ventriform_service::use_cases::reading::JobFacts;

/// An accepted job.
#[derive(Serialize, ToSchema)]
#[schema(as = Job)]
pub struct JobBody {
    /// The job's id.
    #[schema(example = "job_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f")]
    id: String,
    /// The caller's own id for it; not shown to the scope `read`.
    #[schema(max_length = 128)]
    external_id: Option<String>,
    /// The caller's own names and values for it; none are shown to the scope `read`.
    labels: BTreeMap<String, String>,
    /// The kind of work.
    #[schema(example = "model")]
    kind: String,
    /// How urgent it is.
    priority: PriorityName,
    /// The volume it works on; `null` until it has been fetched from `source`.
    volume: Option<String>,
    /// The series in an archive that the volume comes from.
    #[serde(skip_serializing_if = "Option::is_none")]
    source: Option<SourceBody>,
    /// The DICOM objects of its result that are sent to an archive.
    #[serde(skip_serializing_if = "Option::is_none")]
    deliveries: Option<Vec<ObjectDeliveryBody>>,
    /// The parameters, including every default.
    #[schema(value_type = JobParameters)]
    parameters: Map<String, Value>,
    /// Its state.
    state: JobStateName,
    /// The stage of the work, after the first one has begun.
    #[schema(example = "retile")]
    stage: Option<String>,
    /// The share of the work that is done.
    #[schema(minimum = 0, maximum = 1)]
    progress: f64,
    /// Place in the queue; the next job to start has 1. Only while it waits.
    queue_position: Option<u64>,
    /// When it will probably start (RFC 3339), estimated from past jobs. Only while it waits.
    #[schema(format = DateTime)]
    estimated_start: Option<String>,
    /// How often a worker has started it.
    attempts: u32,
    /// Whether a client has asked to cancel it.
    cancel_requested: bool,
    /// Grows with every change; also the id of the events.
    revision: i64,
    /// When it was accepted (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// When a worker last started it (RFC 3339).
    #[schema(format = DateTime)]
    started_at: Option<String>,
    /// When it ended (RFC 3339).
    #[schema(format = DateTime)]
    finished_at: Option<String>,
    /// Why it failed.
    error: Option<ProblemBody>,
    /// The model it made; only for kind `model`.
    model: Option<String>,
    /// The segmentation it made; only for kind `segmentation`.
    segmentation: Option<String>,
    /// The beat it made; only for kind `beat`.
    beat: Option<String>,
    /// The comparison it made; only for kind `comparison`.
    comparison: Option<String>,
    /// The serial comparison it made; only for kind `serial`.
    serial: Option<String>,
    /// The reading it wrote; only for kind `reading`.
    reading: Option<String>,
    /// The normal limits it built; only for kind `normals`.
    normals: Option<String>,
    /// Related paths.
    links: JobLinks,
}

/// A series in an archive.
#[derive(Serialize, ToSchema)]
#[schema(as = JobSource)]
struct SourceBody {
    /// The archive's name.
    #[serde(skip_serializing_if = "Option::is_none")]
    archive: Option<String>,
    /// Base URL of its DICOMweb service, if no archive is configured for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    dicomweb: Option<String>,
    /// Study Instance UID; `null` after the volume, or whose scan it is, was erased.
    study: Option<String>,
    /// Series Instance UID; `null` likewise.
    series: Option<String>,
    /// `pending`, `fetched`, or `failed`.
    #[schema(example = "fetched")]
    state: &'static str,
    /// Number of attempts to fetch it.
    attempts: u32,
    /// When it is tried next (RFC 3339).
    #[schema(format = DateTime)]
    next_attempt_at: Option<String>,
    /// Why the last attempt failed.
    last_error: Option<String>,
}

/// The delivery of a DICOM object to an archive.
#[derive(Serialize, ToSchema)]
#[schema(as = ObjectDelivery)]
pub struct ObjectDeliveryBody {
    /// Its id; absent until the job has succeeded.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(example = "snd_2c26b46b68ffc68ff99b453c1d304134")]
    id: Option<String>,
    /// The object.
    #[schema(example = "mask.dcm")]
    name: String,
    /// The archive.
    #[schema(example = "pacs")]
    to: String,
    /// `pending`, `delivered`, or `dead` if it was given up.
    #[schema(example = "delivered")]
    state: &'static str,
    /// Number of attempts.
    attempts: u32,
    /// When it is tried next (RFC 3339).
    #[schema(format = DateTime)]
    next_attempt_at: Option<String>,
    /// When it was tried last (RFC 3339).
    #[schema(format = DateTime)]
    last_attempt_at: Option<String>,
    /// How it last ended: `stored`, `present` (the archive had it already), `failed`, `refused`,
    /// `erased` (here, before it was sent).
    last_outcome: Option<String>,
    /// Why the last attempt failed.
    last_error: Option<String>,
}

impl From<ObjectDelivery> for ObjectDeliveryBody {
    fn from(delivery: ObjectDelivery) -> Self {
        Self {
            id: Some(delivery.id),
            name: delivery.name,
            to: delivery.to,
            state: delivery.state.as_str(),
            attempts: delivery.attempts,
            next_attempt_at: delivery.next_attempt_at.map(rfc3339),
            last_attempt_at: delivery.last_attempt_at.map(rfc3339),
            last_outcome: delivery.last_outcome,
            last_error: delivery.last_error,
        }
    }
}

/// The deliveries of a job: those that were ordered, until it has succeeded.
fn deliveries(
    order: SendOrder,
    made: Option<&Vec<ObjectDelivery>>,
    job: JobState,
) -> Vec<ObjectDeliveryBody> {
    if let Some(made) = made {
        return made.iter().cloned().map(Into::into).collect();
    }
    // A job that failed or was cancelled has nothing to send.
    let state = if job.is_final() && job != JobState::Succeeded {
        DeliveryState::Dead
    } else {
        DeliveryState::Pending
    };
    let ordered = order.names.into_iter().map(|name| ObjectDeliveryBody {
        id: None,
        name,
        to: order.to.clone(),
        state: state.as_str(),
        attempts: 0,
        next_attempt_at: None,
        last_attempt_at: None,
        last_outcome: None,
        last_error: None,
    });
    ordered.collect()
}

impl SourceBody {
    fn new(source: SeriesSource, pull: Option<&Pull>) -> Self {
        Self {
            state: pull.map_or("failed", |pull| match pull.state {
                DeliveryState::Pending => "pending",
                DeliveryState::Delivered => "fetched",
                DeliveryState::Dead => "failed",
            }),
            attempts: pull.map_or(0, |pull| pull.attempts),
            next_attempt_at: pull.and_then(|pull| pull.next_attempt_at).map(rfc3339),
            last_error: pull.and_then(|pull| pull.last_error.clone()),
            archive: source.archive,
            dicomweb: source.dicomweb,
            study: Some(source.study).filter(|uid| !uid.is_empty()),
            series: Some(source.series).filter(|uid| !uid.is_empty()),
        }
    }
}

/// Paths of one job and of its results.
#[derive(Serialize, ToSchema)]
struct JobLinks {
    /// This job.
    #[serde(rename = "self")]
    itself: String,
    /// Its changes as server-sent events.
    events: String,
    /// Its volume, once it is stored.
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<String>,
    /// The model it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    model: Option<String>,
    /// The segmentation it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    segmentation: Option<String>,
    /// The beat it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    beat: Option<String>,
    /// The comparison it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<String>,
    /// The serial comparison it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    serial: Option<String>,
    /// The reading it wrote.
    #[serde(skip_serializing_if = "Option::is_none")]
    reading: Option<String>,
    /// The normal limits it built.
    #[serde(skip_serializing_if = "Option::is_none")]
    normals: Option<String>,
    /// The segmentation's mask.
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<String>,
    /// The mesh of what it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    mesh: Option<String>,
    /// The report on what it made.
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<String>,
}

/// The JSON of a job for a caller of that scope, with its place in the queue if it waits.
pub async fn describe(app: &App, scope: Scope, job: Job) -> Answer<JobBody> {
    let facts = app.service.job_facts(std::slice::from_ref(&job)).await?;
    Ok(body(job, scope, &facts))
}

/// The JSON of each job for a caller of that scope, with the places in the queue of those that wait.
pub async fn describe_all(app: &App, scope: Scope, jobs: Vec<Job>) -> Answer<Vec<JobBody>> {
    let facts = app.service.job_facts(&jobs).await?;
    let bodies = jobs.into_iter().map(|job| body(job, scope, &facts));
    Ok(bodies.collect())
}

fn body(job: Job, scope: Scope, facts: &JobFacts) -> JobBody {
    let tags = tags::shown(job.tags, scope);
    let standing = facts.positions.get(&job.sequence);
    let made = |resource: Resource| {
        let id = job.result.clone();
        id.filter(|id| Resource::from_id(id) == Some(resource))
    };
    let (model, segmentation) = (made(Resource::Model), made(Resource::Segmentation));
    let (beat, comparison) = (made(Resource::Beat), made(Resource::Comparison));
    let (serial, reading) = (made(Resource::Serial), made(Resource::Reading));
    let normals = made(Resource::Normals);
    // Limits have neither mesh nor report, readings no mesh.
    let shown = normals.is_none();
    let result = job.result.as_deref().map(path_of);
    let below = |name: &str| result.as_ref().map(|path| format!("{path}/{name}"));
    let itself = path_of(&job.id);
    let source = job.source.map(|source| {
        let pull = facts.pulls.get(&job.id);
        SourceBody::new(source, pull)
    });
    let deliveries = job.send.map(|order| {
        let made = facts.deliveries.get(&job.id);
        deliveries(order, made, job.state)
    });
    JobBody {
        state: Word(job.state),
        queue_position: standing.map(|s| s.position),
        estimated_start: standing
            .and_then(|s| s.starts_in_ms)
            .map(|ms| rfc3339(facts.now.saturating_add(ms as i64))),
        error: job.failure.map(|f| Problem::from(f).into_body()),
        created_at: rfc3339(job.created_at),
        started_at: job.started_at.map(rfc3339),
        finished_at: job.finished_at.map(rfc3339),
        links: JobLinks {
            events: format!("{itself}/events"),
            itself,
            volume: job.volume.as_deref().map(path_of),
            model: model.as_deref().map(path_of),
            segmentation: segmentation.as_deref().map(path_of),
            beat: beat.as_deref().map(path_of),
            mask: segmentation.as_ref().and_then(|_| below("mask.nii.gz")),
            comparison: comparison.as_deref().map(path_of),
            serial: serial.as_deref().map(path_of),
            reading: reading.as_deref().map(path_of),
            normals: normals.as_deref().map(path_of),
            mesh: below("mesh").filter(|_| shown && reading.is_none()),
            report: below("report").filter(|_| shown),
        },
        id: job.id,
        external_id: tags.external_id,
        labels: tags.labels,
        kind: job.kind,
        priority: Word(job.priority),
        volume: job.volume,
        source,
        deliveries,
        parameters: job.parameters,
        stage: job.stage,
        progress: job.progress,
        attempts: job.attempts,
        cancel_requested: job.cancel_requested,
        revision: job.revision,
        model,
        segmentation,
        beat,
        comparison,
        serial,
        reading,
        normals,
    }
}
