//! `/v1/templates`: the library of models that `model=auto` tries.

use super::app::App;
use super::jobs::order;
use super::openapi::{EraseProblems, ListProblems, LookupProblems};
use super::pagination::next_cursor;
use super::problem::{Answer, Problem};
use super::products::{self, Download, Offer, Software};
use super::request::{self, Path, query_pairs, refuse_unknown};
use super::wire::{path_of, rfc3339};
use crate::jobs::{ListRequest, Product, Resource};
use axum::Json;
use axum::body::Bytes;
use axum::extract::{RawQuery, Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use futures::TryStreamExt;
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;

const KIND: Resource = Resource::Template;

/// Largest mesh that is taken in: models to fit have a few thousand points, and 200 bytes
/// describe one.
const MESH_BYTES: usize = 4 << 20;

/// Longest name, characters.
const NAME_LENGTH: usize = 80;

/// A template: a model of the library.
#[derive(Serialize, ToSchema)]
pub struct Template {
    /// From organ and mesh: the same everywhere.
    #[schema(example = "tpl_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When it was added (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Its name.
    name: String,
    /// What it shows.
    #[schema(example = "left_ventricle")]
    organ: String,
    /// Counts and main figures.
    #[schema(value_type = Object)]
    summary: Map<String, Value>,
    /// What took it in.
    software: Software,
    /// Its downloads.
    files: Vec<Download>,
    /// Where to go from here.
    links: TemplateLinks,
}

/// Paths of one template.
#[derive(Serialize, ToSchema)]
struct TemplateLinks {
    /// This template.
    #[serde(rename = "self")]
    itself: String,
    /// Its mesh, in the format that `Accept` asks for.
    mesh: String,
}

/// A page of templates.
#[derive(Serialize, ToSchema)]
pub struct TemplateList {
    /// The templates, newest first.
    templates: Vec<Template>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<Product> for Template {
    fn from(product: Product) -> Self {
        let itself = path_of(&product.id);
        let text = |key: &str| {
            let value = product.parameters.get(key).and_then(Value::as_str);
            value.unwrap_or_default().to_owned()
        };
        Self {
            created_at: rfc3339(product.created_at),
            name: text("name"),
            organ: text("organ"),
            files: Download::all(&product),
            software: Software::of(&product),
            links: TemplateLinks {
                mesh: format!("{itself}/mesh"),
                itself,
            },
            id: product.id,
            summary: product.summary,
        }
    }
}

/// Add a template
///
/// The body is a JSON mesh (`mesh.json` of a model, or a file of `ventriform templates
/// build`); or `model` names a stored model or segmentation to be copied. The same mesh for the
/// same organ again is the template that is there. Templates outlive retention.
#[utoipa::path(post, path = "/v1/templates", tag = "templates",
    request_body(content = super::openapi::MeshDocument, content_type = "application/json"),
    params(super::openapi::TemplateQuery),
    responses(
        (status = 201, description = "Added", body = Template,
            headers(("Location" = String, description = "The template's path"))),
        (status = 200, description = "There already", body = Template,
            headers(("Location" = String, description = "The template's path"))),
        (status = 409, description = "The library is full",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        super::openapi::UploadProblems,
    ))]
pub async fn create_template(
    State(app): State<App>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Answer {
    let pairs = query_pairs(query.as_deref());
    refuse_unknown(&pairs, &["name", "organ", "model"])?;
    let value = |name: &str| {
        let found = pairs.iter().find(|(n, _)| n == name);
        found.map(|(_, value)| value.as_str())
    };
    let organ = value("organ").unwrap_or("left_ventricle").to_owned();
    let name = value("name").or(value("model")).unwrap_or("template");
    check_name(name)?;
    refuse_when_full(&app).await?;
    let body = request::json_bytes(&app, request, MESH_BYTES).await?;
    let mesh = match value("model") {
        None => body,
        Some(_) if !body.is_empty() => {
            return Err(Problem::bad_request(
                "contradiction",
                "The body and `model` both say what the template is.",
            )
            .at("model")
            .fix("Send a mesh or name a model, not both."));
        }
        Some(id) => stored_mesh(&app, id).await?,
    };
    let output = {
        let _permit = app.inspections.acquire().await.map_err(Problem::internal)?;
        let reader = app.engine.reader.clone();
        let organ = organ.clone();
        tokio::task::spawn_blocking(move || reader.template(&mesh, &organ))
            .await
            .map_err(Problem::internal)??
    };
    let (template, new) = app.queue.add_template(name, &organ, output).await?;
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = [(header::LOCATION, path_of(&template.id))];
    Ok((status, location, Json(Template::from(template))).into_response())
}

fn check_name(name: &str) -> Answer<()> {
    let length = name.chars().count();
    if (1..=NAME_LENGTH).contains(&length) && !name.chars().any(char::is_control) {
        return Ok(());
    }
    Err(order::wrong(
        "name",
        format!("The name is no text of 1 to {NAME_LENGTH} printable characters."),
    )
    .fix("Give a short name such as t1_150."))
}

async fn refuse_when_full(app: &App) -> Answer<()> {
    let limit = app.settings.template_limit;
    let page = ListRequest {
        before: None,
        limit,
    };
    let page = app.queue.catalogue.products(KIND, page).await?;
    if page.items.len() < limit as usize {
        return Ok(());
    }
    Err(Problem::new(
        StatusCode::CONFLICT,
        "library-full",
        format!("The library holds {limit} templates; auto would try all of them."),
    )
    .fix("DELETE a template first, or have the operator raise `template_limit`."))
}

/// The JSON mesh of a stored model or segmentation.
async fn stored_mesh(app: &App, id: &str) -> Answer<Bytes> {
    let known = matches!(
        Resource::of(id),
        Some(Resource::Model | Resource::Segmentation)
    );
    let product = match known {
        true => app.queue.catalogue.product(id).await?,
        false => None,
    };
    let Some(product) = product else {
        return Err(order::absent(app, "model", id).await?);
    };
    match product.file("mesh.json") {
        Some(file) if file.bytes <= MESH_BYTES as u64 => {
            let pieces = app.queue.blobs.read(id, &file.name, 0..file.bytes).await?;
            let pieces: Vec<Bytes> = pieces.try_collect().await?;
            Ok(pieces.concat().into())
        }
        _ => Err(
            order::wrong("model", "The model is too large to be fitted.")
                .fix("Name one of at most 5000 points."),
        ),
    }
}

/// List templates
#[utoipa::path(get, path = "/v1/templates", tag = "templates",
    params(super::openapi::PageParameters),
    responses((status = 200, description = "A page, newest first", body = TemplateList),
        ListProblems))]
pub async fn list_templates(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<TemplateList>> {
    let page = products::list(&app, KIND, query.as_deref()).await?;
    Ok(Json(TemplateList {
        next_cursor: next_cursor(&page),
        templates: page.items.into_iter().map(Template::from).collect(),
    }))
}

/// Facts of a template
#[utoipa::path(get, path = "/v1/templates/{id}", tag = "templates",
    params(("id" = String, Path, description = "The template's id")),
    responses((status = 200, description = "The template", body = Template), LookupProblems))]
pub async fn get_template(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer<Json<Template>> {
    let template = products::get(&app, KIND, &id, query.as_deref()).await?;
    Ok(Json(template.into()))
}

/// Erase a template
#[utoipa::path(delete, path = "/v1/templates/{id}", tag = "templates",
    params(("id" = String, Path, description = "The template's id")),
    responses((status = 204, description = "Erased"), EraseProblems, LookupProblems))]
pub async fn delete_template(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    products::erase(&app, KIND, &id, query.as_deref()).await
}

/// A template's mesh
///
/// In the format that `Accept` asks for; GLB where it does not care.
#[utoipa::path(get, path = "/v1/templates/{id}/mesh", tag = "templates",
    params(("id" = String, Path, description = "The template's id"),
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

/// A template's file by name
#[utoipa::path(get, path = "/v1/templates/{id}/{file}", tag = "templates",
    params(("id" = String, Path, description = "The template's id"),
        ("file" = super::openapi::TemplateFileName, Path, description = "The file's name"),
        super::openapi::ConditionalHeaders),
    responses(
        super::openapi::MeshAnswer,
        super::openapi::DownloadAnswers, LookupProblems))]
pub async fn get_file(
    State(app): State<App>,
    Path((id, name)): Path<(String, String)>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    products::get_file(&app, KIND, (&id, &name), query.as_deref(), &headers).await
}
