//! `/v1/segmentations`: models fitted to volumes, and the one-line way to fit one.

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

const KIND: Resource = Resource::Segmentation;

/// The part of a form that is an expert's mask.
const EXPERT: &str = "expert";

/// A segmentation: a model fitted to a volume, what it says and how far to believe it.
#[derive(Serialize, ToSchema)]
pub struct Segmentation {
    /// From volume, parameters and fitted mesh: the same everywhere.
    #[schema(example = "seg_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When it was made (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// The volume that was segmented.
    volume: String,
    /// The parameters used, every default written out.
    #[schema(value_type = Object)]
    parameters: Map<String, Value>,
    /// The model taken and every candidate with its merit, why the motion ended, confidence,
    /// volumes, measures against the expert's mask, and reasons for doubt; the report has all
    /// of it.
    #[schema(value_type = Object)]
    summary: Map<String, Value>,
    /// What made it.
    software: Software,
    /// Its downloads.
    files: Vec<Download>,
    /// Where to go from here.
    links: SegmentationLinks,
}

/// Paths of one segmentation.
#[derive(Serialize, ToSchema)]
struct SegmentationLinks {
    /// This segmentation.
    #[serde(rename = "self")]
    itself: String,
    /// The mask on the volume's grid.
    mask: String,
    /// The fitted mesh, in the format that `Accept` asks for.
    mesh: String,
    /// The report.
    report: String,
    /// The report as a page for people.
    page: String,
    /// The polar map; ventricles only.
    #[serde(skip_serializing_if = "Option::is_none")]
    polar: Option<String>,
    /// The volume.
    volume: String,
}

/// A page of segmentations.
#[derive(Serialize, ToSchema)]
pub struct SegmentationList {
    /// The segmentations, newest first.
    segmentations: Vec<Segmentation>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<Product> for Segmentation {
    fn from(product: Product) -> Self {
        let itself = path_of(&product.id);
        let volume = product.volume.clone().unwrap_or_default();
        let polar = product.file("polar.svg");
        Self {
            created_at: rfc3339(product.created_at),
            files: Download::all(&product),
            software: Software::of(&product),
            links: SegmentationLinks {
                mask: format!("{itself}/mask.nii.gz"),
                mesh: format!("{itself}/mesh"),
                report: format!("{itself}/report"),
                page: format!("{itself}/{}", files::PAGE),
                polar: polar.map(|file| format!("{itself}/{}", file.name)),
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

/// What a finished segmentation can be had as: the mask, the mesh or the report.
fn offers() -> Vec<Offer> {
    let masks = [
        "application/gzip",
        "application/nifti",
        "application/x-nifti",
    ];
    let meshes = Offer::meshes().into_iter();
    masks
        .map(|media_type| Offer::new(media_type, "mask.nii.gz"))
        .into_iter()
        .chain(meshes.filter(|offer| offer.file != "mesh.json"))
        .chain([Offer::new("application/json", "report.json")])
        .collect()
}

/// Segment a volume
///
/// The body is the volume, or a form with the part `volume` and perhaps the part `expert`, an
/// expert's mask to measure against. Stores them, files a job, and answers 202 with the job;
/// with `Prefer: wait=60` it waits that long for the end and answers 200 with what `Accept` asks
/// for: the mask on the volume's grid, the fitted mesh, or the report (`application/json`). Every
/// parameter is a query parameter; `model` names the model to fit, `auto` takes the best of the
/// library.
#[utoipa::path(post, path = "/v1/segmentations", tag = "segmentations",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (Vec<u8> = "application/gzip"),
        (Vec<u8> = "application/dicom"),
        (Vec<u8> = "application/nifti"),
        (super::openapi::SegmentationForm = "multipart/form-data"),
    )),
    params(super::openapi::SegmentationQuery, super::openapi::IdempotencyHeader,
        ("Prefer" = Option<String>, Header, description = "`wait=SECONDS`: how long to wait for the end")),
    responses(
        super::openapi::SegmentationAnswer,
        (status = 202, description = "Accepted", body = jobs::Job, headers(
            ("Location" = String, description = "The job's path"),
            ("Retry-After" = u64, description = "Seconds after which to look again"))),
        (status = 406, description = "`Accept` names nothing that a segmentation can be had as",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        (status = 409, description = "The job was cancelled while this request waited",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        FileProblems, UploadProblems,
    ))]
pub async fn create_segmentation(
    State(app): State<App>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Answer {
    let offers = offers();
    order::one_line(&app, KIND, query.as_deref(), request, &[EXPERT], &offers).await
}

/// List segmentations
#[utoipa::path(get, path = "/v1/segmentations", tag = "segmentations",
    params(super::openapi::PageParameters),
    responses((status = 200, description = "A page, newest first", body = SegmentationList),
        ListProblems))]
pub async fn list_segmentations(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<SegmentationList>> {
    let page = products::list(&app, KIND, query.as_deref()).await?;
    Ok(Json(SegmentationList {
        next_cursor: next_cursor(&page),
        segmentations: page.items.into_iter().map(Segmentation::from).collect(),
    }))
}

/// Facts of a segmentation
#[utoipa::path(get, path = "/v1/segmentations/{id}", tag = "segmentations",
    params(("id" = String, Path, description = "The segmentation's id")),
    responses((status = 200, description = "The segmentation", body = Segmentation),
        LookupProblems))]
pub async fn get_segmentation(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer<Json<Segmentation>> {
    let segmentation = products::get(&app, KIND, &id, query.as_deref()).await?;
    Ok(Json(segmentation.into()))
}

/// Erase a segmentation
#[utoipa::path(delete, path = "/v1/segmentations/{id}", tag = "segmentations",
    params(("id" = String, Path, description = "The segmentation's id")),
    responses((status = 204, description = "Erased"), EraseProblems, LookupProblems))]
pub async fn delete_segmentation(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    products::erase(&app, KIND, &id, query.as_deref()).await
}

/// A segmentation's mesh
///
/// In the format that `Accept` asks for; GLB where it does not care.
#[utoipa::path(get, path = "/v1/segmentations/{id}/mesh", tag = "segmentations",
    params(("id" = String, Path, description = "The segmentation's id"),
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

/// A segmentation's report
///
/// JSON, or a page for a person where `Accept` prefers `text/html`.
#[utoipa::path(get, path = "/v1/segmentations/{id}/report", tag = "segmentations",
    params(("id" = String, Path, description = "The segmentation's id"),
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

/// A segmentation's file by name
///
/// `mask.nii.gz`, `mesh.glb` and the other formats, `report.json`, `report.html` (made when it is
/// asked for), `slices.png` (three slices with the contour of the fit); of a ventricle also
/// `polar.json`, `polar.svg` and `polar.png`.
#[utoipa::path(get, path = "/v1/segmentations/{id}/{file}", tag = "segmentations",
    params(("id" = String, Path, description = "The segmentation's id"),
        ("file" = super::openapi::SegmentationFileName, Path, description = "The file's name"),
        super::openapi::ConditionalHeaders),
    responses(
        super::openapi::SegmentationFileAnswer,
        super::openapi::DownloadAnswers, LookupProblems))]
pub async fn get_file(
    State(app): State<App>,
    Path((id, name)): Path<(String, String)>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    products::get_file(&app, KIND, (&id, &name), query.as_deref(), &headers).await
}
