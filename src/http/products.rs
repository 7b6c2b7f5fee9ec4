//! What models, segmentations and templates have in common over HTTP: they are found, listed,
//! erased and downloaded in the same way.

use super::app::App;
use super::files;
use super::negotiate;
use super::openapi::file_names;
use super::pagination::list_query;
use super::problem::{Answer, Problem, shorten};
use super::request::{query_pairs, refuse_unknown};
use super::wire::missing;
use crate::export::Format;
use crate::jobs::{Deleted, ListPage, Product, Resource};
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use utoipa::ToSchema;

/// A program and its version.
#[derive(Serialize, ToSchema)]
pub struct Software {
    /// The program.
    name: String,
    /// Its version.
    version: String,
}

/// One download.
#[derive(Serialize, ToSchema)]
pub struct Download {
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

impl Software {
    /// What made a product.
    pub fn of(product: &Product) -> Self {
        Self {
            name: env!("CARGO_PKG_NAME").into(),
            version: product.software.clone(),
        }
    }
}

impl Download {
    /// All downloads of a product.
    pub fn all(product: &Product) -> Vec<Self> {
        product
            .files
            .iter()
            .map(|file| Self {
                href: files::path(product, file),
                name: file.name.clone(),
                media_type: file.media_type.clone(),
                bytes: file.bytes,
                sha256: file.sha256.clone(),
            })
            .collect()
    }
}

/// A media type that can be had, and the file that has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Offer {
    /// The media type.
    pub media_type: &'static str,
    /// The file's name.
    pub file: String,
}

impl Offer {
    /// An offer.
    pub fn new(media_type: &'static str, file: impl Into<String>) -> Self {
        Self {
            media_type,
            file: file.into(),
        }
    }

    /// The report for programs and for people.
    pub fn reports() -> [Self; 2] {
        [
            Self::new("application/json", "report.json"),
            Self::new("text/html", files::PAGE),
        ]
    }

    /// The mesh in every format, GLB first.
    pub fn meshes() -> Vec<Self> {
        Format::ALL
            .map(|format| Self::new(format.media_type(), format!("mesh.{}", format.extension())))
            .to_vec()
    }
}

/// The offer that the client likes best, or the refusal that lists the offers.
pub fn choose<'a>(headers: &HeaderMap, offers: &'a [Offer]) -> Answer<&'a Offer> {
    let types: Vec<&str> = offers.iter().map(|offer| offer.media_type).collect();
    Ok(&offers[negotiate::require_offer(headers, &types)?])
}

/// Answers with an offered file, under the media type by which it was offered.
pub async fn send(app: &App, product: &Product, offer: &Offer, headers: &HeaderMap) -> Answer {
    let mut response = send_named(app, product, &offer.file, headers).await?;
    if let Some(own) = response.headers_mut().get_mut(header::CONTENT_TYPE)
        && !own.as_bytes().starts_with(offer.media_type.as_bytes())
    {
        *own = HeaderValue::from_static(offer.media_type);
    }
    Ok(response)
}

/// The product of that id, or why there is none.
pub async fn find(app: &App, id: &str) -> Answer<Product> {
    let resource = Resource::of(id).unwrap_or(Resource::Model);
    find_as(app, resource, id).await
}

/// The product of that id and kind, or why there is none.
pub async fn find_as(app: &App, resource: Resource, id: &str) -> Answer<Product> {
    let found = match Resource::of(id) == Some(resource) {
        true => app.queue.catalogue.product(id).await?,
        false => None,
    };
    match found {
        Some(product) => Ok(product),
        None => Err(missing(&*app.queue.catalogue, resource, id).await),
    }
}

/// One product; no query parameter is taken.
pub async fn get(app: &App, resource: Resource, id: &str, query: Option<&str>) -> Answer<Product> {
    refuse_unknown(&query_pairs(query), &[])?;
    find_as(app, resource, id).await
}

/// A page of products.
pub async fn list(app: &App, resource: Resource, query: Option<&str>) -> Answer<ListPage<Product>> {
    let (page, []) = list_query(query, [])?;
    Ok(app.queue.catalogue.products(resource, page).await?)
}

/// Erases a volume or a product.
pub async fn erase(app: &App, resource: Resource, id: &str, query: Option<&str>) -> Answer {
    refuse_unknown(&query_pairs(query), &[])?;
    let noun = resource.noun();
    let deleted = match Resource::of(id) == Some(resource) {
        true => app.queue.erase(id).await?,
        false => Deleted::Unknown,
    };
    match deleted {
        Deleted::Done => Ok(StatusCode::NO_CONTENT.into_response()),
        Deleted::Unknown => Err(missing(&*app.queue.catalogue, resource, id).await),
        Deleted::InUse => Err(Problem::new(
            StatusCode::CONFLICT,
            "in-use",
            format!("A job that has not ended needs this {noun}."),
        )
        .fix("Wait for the job or DELETE it first; GET /v1/jobs?state=queued shows them.")),
    }
}

/// The file among `offers` that `Accept` likes best.
pub async fn get_offered(
    app: &App,
    resource: Resource,
    id: &str,
    query: Option<&str>,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    let product = get(app, resource, id, query).await?;
    let mut response = send(app, &product, choose(headers, offers)?, headers).await?;
    response
        .headers_mut()
        .insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// The file of that name.
pub async fn get_file(
    app: &App,
    resource: Resource,
    (id, name): (&str, &str),
    query: Option<&str>,
    headers: &HeaderMap,
) -> Answer {
    refuse_unknown(&query_pairs(query), &[])?;
    let names = file_names(resource);
    if !names.iter().any(|known| known == name) {
        return Err(no_such_file(resource, name, &names));
    }
    let product = find_as(app, resource, id).await?;
    send_named(app, &product, name, headers).await
}

async fn send_named(
    app: &App,
    product: &Product,
    name: &str,
    headers: &HeaderMap,
) -> Answer<Response> {
    match product.file(name) {
        Some(file) => files::send(app, product, file, headers).await,
        None if name == files::PAGE => {
            let page = make_page(app, product).await?;
            files::send_page(product, page, headers).await
        }
        None => {
            let names: Vec<_> = product.files.iter().map(|file| file.name.clone()).collect();
            Err(no_such_file(product.resource(), name, &names))
        }
    }
}

/// The page of a product, of its own files.
async fn make_page(app: &App, product: &Product) -> Answer<String> {
    let resource = product.resource();
    let Some(work) = app.engine.work(resource.noun()).cloned() else {
        return Err(no_such_file(resource, files::PAGE, &file_names(resource)));
    };
    let stored = app
        .queue
        .with_files(product.clone(), work.page_files())
        .await?;
    let _permit = app.inspections.acquire().await.map_err(Problem::internal)?;
    let page = tokio::task::spawn_blocking(move || work.page(&stored));
    Ok(page.await.map_err(Problem::internal)??)
}

fn no_such_file(resource: Resource, name: &str, names: &[String]) -> Problem {
    Problem::new(
        StatusCode::NOT_FOUND,
        "not-found",
        format!("This {} has no file `{}`.", resource.noun(), shorten(name)),
    )
    .fix(format!("There is {}.", names.join(", ")))
}
