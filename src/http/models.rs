//! `/v1/models`: what was made, and the one-line way to make it.

use super::app::App;
use super::files;
use super::jobs::{self, order};
use super::openapi::{EraseProblems, FileProblems, ListProblems, LookupProblems, UploadProblems};
use super::pagination::next_cursor;
use super::problem::Answer;
use super::products::{self, Download, Offer, Software};
use super::request::Path;
use super::wire::{path_of, rfc3339};
use crate::jobs::{Product, Resource};
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::HeaderMap;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

const KIND: Resource = Resource::Model;

/// A model: what it was made from, its main figures, and where its files are.
#[derive(Serialize, ToSchema)]
pub struct Model {
    /// From volume, parameters and mesh: the same everywhere.
    #[schema(example = "mdl_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When it was made (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// The volume it was made from.
    volume: String,
    /// The parameters used, every default written out.
    #[schema(value_type = Object)]
    parameters: Map<String, Value>,
    /// Counts and main figures; the report has all of them.
    #[schema(value_type = Object)]
    summary: Map<String, Value>,
    /// What made it.
    software: Software,
    /// Its downloads.
    files: Vec<Download>,
    /// Where to go from here.
    links: ModelLinks,
}

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
    /// The report as a page for people.
    page: String,
    /// Its volume.
    volume: String,
}

/// A page of models.
#[derive(Serialize, ToSchema)]
pub struct ModelList {
    /// The models, newest first.
    models: Vec<Model>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<Product> for Model {
    fn from(product: Product) -> Self {
        let itself = path_of(&product.id);
        let volume = product.volume.clone().unwrap_or_default();
        Self {
            created_at: rfc3339(product.created_at),
            files: Download::all(&product),
            software: Software::of(&product),
            links: ModelLinks {
                mesh: format!("{itself}/mesh"),
                report: format!("{itself}/report"),
                page: format!("{itself}/{}", files::PAGE),
                volume: path_of(&volume),
                itself,
            },
            volume,
            id: product.id,
            parameters: product.parameters,
            summary: product.summary,
        }
    }
}

/// Make a model of a volume
///
/// The body is the volume. Stores it, files a job, and answers 202 with the job; with
/// `Prefer: wait=60` it waits that long for the end and answers 200 with the mesh in the format
/// that `Accept` asks for. Every parameter of a model is a query parameter.
#[utoipa::path(post, path = "/v1/models", tag = "models",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (Vec<u8> = "application/gzip"),
        (Vec<u8> = "application/dicom"),
        (Vec<u8> = "application/nifti"),
        (super::openapi::UploadForm = "multipart/form-data"),
    )),
    params(super::openapi::ModelQuery, super::openapi::IdempotencyHeader,
        ("Prefer" = Option<String>, Header, description = "`wait=SECONDS`: how long to wait for the mesh")),
    responses(
        super::openapi::MeshAnswer,
        (status = 202, description = "Accepted", body = jobs::Job, headers(
            ("Location" = String, description = "The job's path"),
            ("Retry-After" = u64, description = "Seconds after which to look again"))),
        (status = 406, description = "`Accept` names no format of meshes",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        (status = 409, description = "The job was cancelled while this request waited",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        FileProblems, UploadProblems,
    ))]
pub async fn create_model(
    State(app): State<App>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Answer {
    let offers = Offer::meshes();
    order::one_line(&app, KIND, query.as_deref(), request, &[], &offers).await
}

/// List models
#[utoipa::path(get, path = "/v1/models", tag = "models",
    params(super::openapi::PageParameters),
    responses((status = 200, description = "A page, newest first", body = ModelList), ListProblems))]
pub async fn list_models(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<ModelList>> {
    let page = products::list(&app, KIND, query.as_deref()).await?;
    Ok(Json(ModelList {
        next_cursor: next_cursor(&page),
        models: page.items.into_iter().map(Model::from).collect(),
    }))
}

/// Facts of a model
#[utoipa::path(get, path = "/v1/models/{id}", tag = "models",
    params(("id" = String, Path, description = "The model's id")),
    responses((status = 200, description = "The model", body = Model), LookupProblems))]
pub async fn get_model(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer<Json<Model>> {
    let model = products::get(&app, KIND, &id, query.as_deref()).await?;
    Ok(Json(model.into()))
}

/// Erase a model
#[utoipa::path(delete, path = "/v1/models/{id}", tag = "models",
    params(("id" = String, Path, description = "The model's id")),
    responses((status = 204, description = "Erased"), EraseProblems, LookupProblems))]
pub async fn delete_model(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    products::erase(&app, KIND, &id, query.as_deref()).await
}

/// A model's mesh
///
/// In the format that `Accept` asks for; GLB where it does not care.
#[utoipa::path(get, path = "/v1/models/{id}/mesh", tag = "models",
    params(("id" = String, Path, description = "The model's id"),
        super::openapi::ConditionalHeaders),
    responses(
        super::openapi::MeshAnswer,
        super::openapi::DownloadAnswers, LookupProblems))]
pub async fn get_mesh(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    let offers = Offer::meshes();
    products::get_offered(&app, KIND, &id, query.as_deref(), &headers, &offers).await
}

/// A model's quality report
///
/// JSON, or a page for a person where `Accept` prefers `text/html`.
#[utoipa::path(get, path = "/v1/models/{id}/report", tag = "models",
    params(("id" = String, Path, description = "The model's id"),
        super::openapi::ConditionalHeaders),
    responses(
        super::openapi::ReportAnswer,
        super::openapi::DownloadAnswers, LookupProblems))]
pub async fn get_report(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    let offers = Offer::reports();
    products::get_offered(&app, KIND, &id, query.as_deref(), &headers, &offers).await
}

/// A model's file by name
///
/// The mesh in each format, `report.json`, `distance.json` (signed distances of the model's parts
/// to the surface) and `report.html`, which is made when it is asked for.
#[utoipa::path(get, path = "/v1/models/{id}/{file}", tag = "models",
    params(("id" = String, Path, description = "The model's id"),
        ("file" = super::openapi::FileName, Path, description = "The file's name"),
        super::openapi::ConditionalHeaders),
    responses(
        super::openapi::FileAnswer,
        super::openapi::DownloadAnswers, LookupProblems))]
pub async fn get_file(
    State(app): State<App>,
    Path((id, name)): Path<(String, String)>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    products::get_file(&app, KIND, (&id, &name), query.as_deref(), &headers).await
}
