//! `/v1/models`: what was made, and the one-line way to make it.

use super::app::App;
use super::openapi::{FileProblems, ListProblems, LookupProblems, UploadProblems};
use super::pagination::{list_query, next_cursor};
use super::problem::{Answer, Problem, shorten};
use super::request::{Path, query_pairs, refuse_unknown};
use super::wire::{missing, rfc3339};
use super::{files, idempotency, jobs as jobs_api, negotiate, upload};
use crate::export::Format;
use crate::jobs::{self, Deleted, ModelFile, NewJob, State as JobState};
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

const KIND: &str = "model";

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

/// A program and its version.
#[derive(Serialize, ToSchema)]
struct Software {
    /// The program.
    name: String,
    /// Its version.
    version: String,
}

/// One download.
#[derive(Serialize, ToSchema)]
struct Download {
    /// The file's name.
    #[schema(example = "mesh.glb")]
    name: String,
    /// Its path.
    href: String,
    /// Its media type.
    media_type: String,
    /// Its length.
    bytes: u64,
    /// SHA-256 of its content; also its `ETag`.
    sha256: String,
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

impl From<jobs::Model> for Model {
    fn from(model: jobs::Model) -> Self {
        let itself = format!("/v1/models/{}", model.id);
        Self {
            created_at: rfc3339(model.created_at),
            files: model
                .files
                .iter()
                .map(|file| Download {
                    href: files::path(&model, file),
                    name: file.name.clone(),
                    media_type: file.media_type.clone(),
                    bytes: file.bytes,
                    sha256: file.sha256.clone(),
                })
                .collect(),
            links: ModelLinks {
                mesh: format!("{itself}/mesh"),
                report: format!("{itself}/report"),
                volume: format!("/v1/volumes/{}", model.volume),
                itself,
            },
            software: Software {
                name: env!("CARGO_PKG_NAME").into(),
                version: model.software,
            },
            id: model.id,
            volume: model.volume,
            parameters: model.parameters,
            summary: model.summary,
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
        (status = 202, description = "Accepted", body = jobs_api::Job, headers(
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
    let headers = request.headers().clone();
    let patience = negotiate::preferred_wait(&headers);
    if patience.is_some() {
        negotiate::require_offer(&headers, &mesh_types())?;
    }
    let key = idempotency::key(&headers)?;
    let Some(work) = app.engine.work(KIND) else {
        return Err(Problem::internal("no work of kind `model`"));
    };
    // What can be refused without the body is refused before it is read.
    let pairs = query_pairs(query.as_deref());
    let mut parameters = work.parameters_from_text(&pairs)?;
    if app.queue.is_full().await? {
        return Err(jobs_api::queue_full(&app).await);
    }
    let upload = upload::receive(&app, request).await?;
    if !upload.fields.is_empty() {
        let all: Vec<_> = pairs.into_iter().chain(upload.fields.clone()).collect();
        parameters = work.parameters_from_text(&all)?;
    }
    let (volume, _) = upload.store(&app).await?;
    let job = NewJob {
        kind: KIND.into(),
        idempotency: idempotency::promise(key, KIND, &volume.id, &parameters),
        volume: volume.id,
        parameters,
    };
    let job = jobs_api::file(&app, &job).await?;
    match patience {
        Some(patience) => wait_for_mesh(&app, job, patience, &headers).await,
        None => jobs_api::accepted(&app, job).await,
    }
}

async fn wait_for_mesh(
    app: &App,
    job: jobs::Job,
    patience: std::time::Duration,
    headers: &HeaderMap,
) -> Answer {
    let patience = patience.min(app.settings.wait_limit.0);
    let waited = tokio::select! {
        job = app.queue.wait(&job.id, patience) => job?,
        () = app.closing.cancelled() => None,
    };
    let job = waited.unwrap_or(job);
    let applied = HeaderValue::from_str(&format!("wait={}", patience.as_secs()))
        .unwrap_or(HeaderValue::from_static("wait"));
    let mut response = match (job.state, &job.result) {
        (JobState::Succeeded, Some(model)) => {
            let model = find(app, model).await?;
            // The headers of this request are about the upload, not about a part of the mesh.
            let file = mesh_for(&model, headers)?;
            let mut response = files::send(app, &model, file, &HeaderMap::new()).await?;
            let location = format!("/v1/models/{}", model.id);
            if let Ok(location) = HeaderValue::from_str(&location) {
                response.headers_mut().insert(header::LOCATION, location);
            }
            response
        }
        (state, _) if state.is_final() => jobs_api::failed(&job),
        _ => jobs_api::accepted(app, job).await?,
    };
    response.headers_mut().insert("preference-applied", applied);
    Ok(response)
}

/// List models
#[utoipa::path(get, path = "/v1/models", tag = "models",
    params(super::openapi::PageParameters),
    responses((status = 200, description = "A page, newest first", body = ModelList), ListProblems))]
pub async fn list_models(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<ModelList>> {
    let (page, []) = list_query(query.as_deref(), [])?;
    let page = app.queue.catalogue.models(page).await?;
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
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    Ok(Json(find(&app, &id).await?.into()))
}

/// Erase a model
#[utoipa::path(delete, path = "/v1/models/{id}", tag = "models",
    params(("id" = String, Path, description = "The model's id")),
    responses((status = 204, description = "Erased"), LookupProblems))]
pub async fn delete_model(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    if !id.starts_with(jobs::MODEL) {
        return Err(Problem::not_found("model", &id));
    }
    match app.queue.erase(&id).await? {
        Deleted::Done => Ok(StatusCode::NO_CONTENT.into_response()),
        _ => Err(missing(&*app.queue.catalogue, "model", &id).await),
    }
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
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let model = find(&app, &id).await?;
    let file = mesh_for(&model, &headers)?;
    let mut response = files::send(&app, &model, file, &headers).await?;
    response
        .headers_mut()
        .insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
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
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let model = find(&app, &id).await?;
    let names = ["report.json", "report.html"];
    let chosen = negotiate::require_offer(&headers, &["application/json", "text/html"])?;
    let mut response = send_named(&app, &model, names[chosen], &headers).await?;
    response
        .headers_mut()
        .insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// A model's file by name
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
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    if !super::openapi::file_names().contains(&name) {
        return Err(no_such_file(&name, &super::openapi::file_names()));
    }
    let model = find(&app, &id).await?;
    send_named(&app, &model, &name, &headers).await
}

async fn send_named(app: &App, model: &jobs::Model, name: &str, headers: &HeaderMap) -> Answer {
    match model.file(name) {
        Some(file) => files::send(app, model, file, headers).await,
        None => {
            let names: Vec<_> = model.files.iter().map(|file| file.name.clone()).collect();
            Err(no_such_file(name, &names))
        }
    }
}

fn no_such_file(name: &str, names: &[String]) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "not-found",
        format!("A model has no file `{}`.", shorten(name)),
    )
    .fix(format!("It has {}.", names.join(", ")))
}

async fn find(app: &App, id: &str) -> Answer<jobs::Model> {
    match app.queue.catalogue.model(id).await? {
        Some(model) => Ok(model),
        None => Err(missing(&*app.queue.catalogue, "model", id).await),
    }
}

/// Media types of meshes, the usual one first.
fn mesh_types() -> Vec<&'static str> {
    Format::ALL.map(Format::media_type).to_vec()
}

fn mesh_for<'a>(model: &'a jobs::Model, headers: &HeaderMap) -> Answer<&'a ModelFile> {
    let meshes: Vec<&ModelFile> = model
        .files
        .iter()
        .filter(|file| file.name.starts_with("mesh."))
        .collect();
    let types: Vec<&str> = meshes.iter().map(|file| file.media_type.as_str()).collect();
    Ok(meshes[negotiate::require_offer(headers, &types)?])
}
