//! `/v1/models`: surface models, and the request that uploads a volume and makes its model.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, FileProblems, UploadProblems, WaitAnswers};
use crate::resources::files;
use crate::resources::jobs::PriorityQuery;
use crate::resources::jobs::filing::{self, UploadJob};
use crate::resources::products::{Offer, ProductCollection, body_of_product, object_paths};
use crate::resources::tags::TagQuery;
use crate::wire::links::path_of;
use crate::wire::problem::Answer;
use crate::wire::query::QueryReader;
use crate::wire::webhook_request::WebhookQuery;
use axum::extract::{Request, State};
use serde::Serialize;
use utoipa::ToSchema;
use ventriform_service::base::records::{Product, Resource};

/// The collection of models.
pub struct Models;

impl ProductCollection for Models {
    const RESOURCE_KIND: Resource = Resource::Model;
    type Body = ModelBody;
    const FILE_NAMES: &'static [&'static str] =
        &["report.json", files::REPORT_PAGE, "distance.json"];
    const FILE_SCHEMA: &'static str = "ModelFileName";
    const FILE_HELP: &'static str = "The `.dcm` files are DICOM objects of the scan's patient and study, made on request; \
        they need the scope `submit`, or `deidentify=true`.";
}

body_of_product!(
    /// A model: what it was made of, its main figures, and its files.
    ModelBody,
    Model,
    ModelLinks,
    ventriform::parameters::ModelParameters,
    ventriform::results::report::ModelSummary,
    "Counts and main figures; the report has all figures.",
    "mdl_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one model.
#[derive(Serialize, ToSchema)]
struct ModelLinks {
    /// This model.
    #[serde(rename = "self")]
    itself: String,
    /// Its mesh, in the format that `Accept` asks for.
    mesh: String,
    /// Its quality report.
    report: String,
    /// The report as an HTML page.
    page: String,
    /// DICOM objects of the scan's patient and study, for the archive.
    dicom: Vec<String>,
    /// Its volume.
    volume: String,
}

impl ModelLinks {
    fn from_product(model: &Product) -> Self {
        let itself = path_of(&model.id);
        Self {
            mesh: format!("{itself}/mesh"),
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            dicom: object_paths(model),
            volume: path_of(model.volume.as_deref().unwrap_or_default()),
            itself,
        }
    }
}

/// Make a model of a volume
///
/// The body is the volume. The service stores it, files a job, and answers 202 with the job. With
/// `Prefer: wait=60` it waits up to 60 seconds for the job to end and answers 200 with the mesh in
/// the format that `Accept` asks for. Every parameter of a model is a query parameter.
#[utoipa::path(post, path = "/v1/models", tag = "models",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (openapi::UploadForm = "multipart/form-data"))),
    params(openapi::ModelQuery, TagQuery, PriorityQuery,
        openapi::IdempotencyHeader,
        openapi::PreferHeader, WebhookQuery, openapi::WebhookSecretHeader),
    responses(openapi::MeshAnswer, WaitAnswers, FileProblems, UploadProblems))]
pub async fn create_model(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    let job = UploadJob {
        makes: Resource::Model,
        apart: &[],
        offers: Offer::meshes("mesh"),
    };
    filing::file_upload(&app, &caller, job, query, request).await
}
