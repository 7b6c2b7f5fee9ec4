//! The published document: OpenAPI 3.1, derived from the handlers.
//!
//! What the handlers' attributes cannot say comes from here: the parameters of a model (from
//! [`crate::parameters::SPECS`], so that a new one needs no word in this file), the formats
//! (from [`crate::export::Format`]), and the problems that whole groups of handlers share.

mod answers;
mod inputs;

pub use answers::{
    DownloadAnswers, EventsAnswer, FileAnswer, FileProblems, ListProblems, LookupProblems,
    MeshAnswer, ReportAnswer, UploadProblems,
};
pub use inputs::{
    ConditionalHeaders, EventHeader, FileName, IdempotencyHeader, JobRequest, ModelParameters,
    ModelQuery, PageParameters, UploadForm, file_names,
};

use utoipa::OpenApi;

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
        (name = "operations", description = "For operators"),
    ),
    components(schemas(super::problem::ProblemBody, FileName))
)]
pub struct Document;

/// The whole document as it is published.
pub fn document() -> utoipa::openapi::OpenApi {
    super::router::routes().split_for_parts().1
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
