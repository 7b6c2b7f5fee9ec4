//! The published document: OpenAPI 3.1, derived from the handlers.
//!
//! What the handlers' attributes cannot say comes from here: the parameters of a model and of a
//! fit (from the tables of [`crate::parameters`], so that a new one needs no word in this file), the formats
//! (from [`crate::export::Format`]), and the problems that whole groups of handlers share.

mod answers;
mod bodies;
mod inputs;

pub use answers::{
    DownloadAnswers, EraseProblems, EventsAnswer, FileAnswer, FileProblems, ListProblems,
    LookupProblems, MeshAnswer, ReportAnswer, SegmentationAnswer, SegmentationFileAnswer,
    UploadProblems,
};
pub use bodies::{JobRequest, MeshDocument, SegmentationForm, UploadForm};
pub use inputs::{
    ConditionalHeaders, EventHeader, FileName, IdempotencyHeader, ModelParameters, ModelQuery,
    PageParameters, SegmentationFileName, SegmentationParameters, SegmentationQuery,
    TemplateFileName, TemplateQuery, file_names,
};

use utoipa::OpenApi;
use utoipa::openapi::{RefOr, Required};

/// Title, licence and tags.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Ventriform",
        description = "Surface models of the left ventricle from cardiac SPECT.\n\n\
            Errors are problem objects (RFC 9457) with a stable `type`. Results are immutable \
            and carry strong validators. Lists have cursors. Breaking changes go to `/v2`.",
        license(name = "MIT OR Apache-2.0", identifier = "MIT OR Apache-2.0"),
        contact(),
    ),
    tags(
        (name = "volumes", description = "What was uploaded"),
        (name = "jobs", description = "What was asked for, and how far it is"),
        (name = "models", description = "What was made, and the one-line way to make it"),
        (name = "segmentations", description = "Models fitted to volumes, and the one-line way to fit one"),
        (name = "templates", description = "The library of models that `auto` tries"),
        (name = "operations", description = "For operators"),
    ),
    components(schemas(super::problem::ProblemBody, FileName, SegmentationFileName, TemplateFileName))
)]
pub struct Document;

/// The whole document as it is published.
pub fn document() -> utoipa::openapi::OpenApi {
    let mut document = super::router::routes().split_for_parts().1;
    let add = document.paths.paths.get_mut("/v1/templates");
    let body = add.and_then(|path| path.post.as_mut()?.request_body.as_mut());
    if let Some(RefOr::T(body)) = body {
        // `model` may name the mesh instead. An optional type would allow the body `null`.
        body.required = Some(Required::False);
    }
    document
}

/// The document's bytes, as committed under `openapi/`.
///
/// # Panics
/// Never: the document is plain data.
pub fn document_json() -> String {
    let mut text = document()
        .to_pretty_json()
        .expect("the document is plain data");
    text.push('\n');
    text
}
