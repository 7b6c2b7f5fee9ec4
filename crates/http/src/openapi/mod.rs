//! The building blocks of the published document, OpenAPI 3.1.
//!
//! The handlers' attributes describe most of it; the library describes its documents (`ventriform::results::report`), by
//! its feature `schema`. This folder adds what attributes cannot say:
//!
//! | file | what it describes |
//! |---|---|
//! | [`inputs`] | headers; parameters of a model and a fit, which come from the tables of [`ventriform::parameters`], so a new one needs no change here |
//! | [`bodies`] | request bodies that several structs make up, or that the library reads |
//! | [`answers`] | answers and problems that several handlers share |
//! | [`access`] | credentials, and how requests are refused before any handler |
//! | [`operation`] | operations of handlers that serve several kinds of things |
//! | [`finish`] | the last steps on the whole document: bytes, examples |
//! | [`result_files`] | the files of results: names, media types, schemas |
//! | [`share`] | what several operations have alike, said once |
//! | [`walk`] | the operations of the document, with answers and contents |
//!
//! [`publish`] completes the document that the routes have collected.

mod access;
mod answers;
mod bodies;
mod finish;
mod inputs;
mod operation;
mod result_files;
mod share;
mod walk;
mod written;

pub use answers::{
    BeatAnswer, ComparisonAnswer, DicomProblems, DownloadAnswers, EraseProblems, EventsAnswer,
    FileAnswer, FileProblems, HoldProblems, IdentityProblems, ListProblems, LookupProblems,
    MeshAnswer, OriginalAnswer, PatchProblems, ReadingAnswer, ReportAnswer, ReportDocumentAnswer,
    ScanErasureProblems, ScopeProblems, SegmentationAnswer, SerialAnswer, StowAnswers,
    UnchangedAnswer, UploadProblems, WaitAnswers, WorkitemConflict, WorkitemProblems,
};
pub use bodies::{
    ComparisonForm, ComparisonRequest, DicomJson, JobParameters, JobRequest, MeshDocument,
    NormalsRequest, ReadingRequest, SegmentationForm, SerialRequest, StatedScanSchema, TagsPatch,
    UploadForm,
};
pub use inputs::{
    BeatQuery, CachedHeaders, ComparisonQuery, ConditionalHeaders, ErasureHeader, EventHeader,
    IdempotencyHeader, ModelQuery, OrganField, PreferHeader, SegmentationQuery, TransactionHeader,
    WebhookSecretHeader, fit_parameters,
};
pub use operation::Documented;
pub use written::written;

use utoipa::OpenApi;
use utoipa::openapi::{RefOr, Required};

/// Title, licence and tags.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Ventriform",
        description = "Surface models of the left ventricle from cardiac SPECT.\n\n\
            Errors are problem objects (RFC 9457) with a stable `type`. Results never change and \
            carry strong validators. Lists are paged by cursors. Breaking changes will appear \
            under `/v2`.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
        contact(),
    ),
    tags(
        (name = "volumes", description = "Uploaded volumes"),
        (name = "jobs", description = "Work on volumes: filed, followed, cancelled"),
        (name = "models", description = "Surface models, and one request from volume to model"),
        (name = "segmentations", description = "Models fitted to volumes, and one request from volume to segmentation"),
        (name = "beats", description = "Gated studies as one model in motion, and one request from study to beat"),
        (name = "comparisons", description = "Rest and stress of one patient"),
        (name = "readings", description = "What readers state of results: scores, impression, name and time"),
        (name = "serials", description = "One patient over the years: several scans, compared"),
        (name = "normals", description = "Normal limits: the uptake of healthy people, which segmentations, beats and \
            comparisons are scored by"),
        (name = "templates", description = "The library of models that `auto` chooses from"),
        (name = "readers", description = "How readers draw the wall: profiles that segmentations can be drawn by"),
        (name = "webhooks", description = "Telling other programs about jobs"),
        (name = "workitems", description = "Unified Procedure Steps (DICOM UPS-RS): work that is scheduled, claimed, \
            done"),
        (name = "access", description = "Keys and the audit trail, for the scope `admin`"),
        (name = "dicomweb", description = "Images from other systems: STOW-RS, and what became of them"),
        (name = "erasures", description = "Receipts of what was erased"),
        (name = "operations", description = "For operators"),
    ),
    components(schemas(
        crate::wire::problem::ProblemBody,
        bodies::FhirBundle,
        bodies::MeshDocument,
        ventriform::results::report::ModelReport,
        ventriform::results::report::Closeness,
        ventriform::results::report::SegmentationReport,
        ventriform::results::report::BeatReport,
        ventriform::results::report::ComparisonReport,
        ventriform::results::report::ReadingReport,
        ventriform::results::report::SerialReport,
        ventriform::heart::normals::NormalLimits,
        ventriform::heart::polar::PolarDocument,
        ventriform::heart::polar::FigureDocument,
    ))
)]
pub struct DocumentFrame;

/// The document as it is published, from what the routes have collected.
pub fn publish(mut collected: utoipa::openapi::OpenApi) -> serde_json::Value {
    let add = collected.paths.paths.get_mut("/v1/templates");
    let body = add.and_then(|path| path.post.as_mut()?.request_body.as_mut());
    if let Some(RefOr::T(body)) = body {
        // `model` may name the mesh instead. An optional type would allow the body `null`.
        body.required = Some(Required::False);
    }
    access::add_access(&mut collected);
    let mut document = serde_json::to_value(collected).expect("the document is plain data");
    finish::finish(&mut document);
    document
}
