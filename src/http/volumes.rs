//! `/v1/volumes`: what was uploaded.

use super::app::App;
use super::openapi::{EraseProblems, ListProblems, LookupProblems, UploadProblems};
use super::pagination::{list_query, next_cursor};
use super::problem::{Answer, Problem};
use super::request::{Path, query_pairs, refuse_unknown, unknown};
use super::wire::{missing, path_of, rfc3339};
use super::{products, upload};
use crate::jobs::{Resource, StoreError, StoredVolume};
use crate::work::UploadFacts;
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use utoipa::ToSchema;

/// A stored volume: the facts of its header.
#[derive(Serialize, ToSchema)]
pub struct Volume {
    /// From the SHA-256 of the content: the same everywhere.
    #[schema(example = "vol_9f86d081884c7d659a2feaa0c55ad015")]
    id: String,
    /// When it was stored (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Bytes of all its files.
    bytes: u64,
    /// Number of its files.
    files: usize,
    /// File format.
    #[schema(example = "NIfTI-1")]
    format: String,
    /// Whether it came gzipped.
    compressed: bool,
    /// Voxels along i, j, k of one frame.
    shape: [usize; 3],
    /// How many volumes of that shape the file holds; of several, `frame` chooses one.
    frames: usize,
    /// Voxel spacing along the first three axes, millimetres.
    spacing_mm: [f64; 3],
    /// Voxel index to millimetres in the patient frame LPS, row by row.
    affine: [[f64; 4]; 4],
    /// The frame of `affine`.
    #[schema(example = "LPS")]
    frame: String,
    /// What the affine was taken from.
    #[schema(example = "sform")]
    affine_source: String,
    /// Data type in the file.
    #[schema(example = "int16")]
    dtype: String,
    /// The voxel values, slope and intercept applied.
    intensity: Intensity,
    /// The labels, rising, where the volume looks like a label map.
    labels: Option<Vec<i64>>,
    /// What is odd about the file but does not keep it from use.
    warnings: Vec<String>,
    /// Where to go from here.
    links: VolumeLinks,
}

/// A summary of voxel values.
#[derive(Serialize, ToSchema)]
struct Intensity {
    /// Smallest finite value.
    min: f64,
    /// Largest finite value.
    max: f64,
    /// Mean of the finite values.
    mean: f64,
    /// Voxels that are no finite number.
    not_finite: u64,
}

/// Paths of one volume.
#[derive(Serialize, ToSchema)]
#[schema(as = VolumeLinks)]
struct VolumeLinks {
    /// This volume.
    #[serde(rename = "self")]
    itself: String,
    /// Three middle slices as PNG.
    preview: String,
}

/// A page of volumes.
#[derive(Serialize, ToSchema)]
pub struct VolumeList {
    /// The volumes, newest first.
    volumes: Vec<Volume>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl TryFrom<StoredVolume> for Volume {
    type Error = StoreError;

    fn try_from(volume: StoredVolume) -> Result<Self, StoreError> {
        let itself = path_of(&volume.id);
        let facts = UploadFacts::of(&volume)?;
        Ok(Self {
            created_at: rfc3339(volume.created_at),
            bytes: volume.bytes,
            files: volume.files.len(),
            format: facts.format,
            compressed: facts.compressed,
            shape: facts.shape,
            frames: facts.frames,
            spacing_mm: facts.spacing_mm,
            affine: facts.affine,
            frame: "LPS".into(),
            affine_source: facts.affine_source,
            dtype: facts.dtype,
            intensity: Intensity {
                min: facts.intensity.min,
                max: facts.intensity.max,
                mean: facts.intensity.mean,
                not_finite: facts.intensity.not_finite,
            },
            labels: facts.labels,
            warnings: facts.warnings,
            links: VolumeLinks {
                preview: format!("{itself}/preview.png"),
                itself,
            },
            id: volume.id,
        })
    }
}

/// Upload a volume
///
/// The body is the file itself, or a form whose file parts make up one volume (a `.hdr`/`.img`
/// pair, a DICOM series). The same bytes again give the same id.
#[utoipa::path(post, path = "/v1/volumes", tag = "volumes",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (Vec<u8> = "application/gzip"),
        (Vec<u8> = "application/dicom"),
        (Vec<u8> = "application/nifti"),
        (super::openapi::UploadForm = "multipart/form-data"),
    )),
    responses(
        (status = 201, description = "Stored", body = Volume,
            headers(("Location" = String, description = "The volume's path"))),
        (status = 200, description = "Known already", body = Volume,
            headers(("Location" = String, description = "The volume's path"))),
        UploadProblems,
    ))]
pub async fn create_volume(
    State(app): State<App>,
    RawQuery(query): RawQuery,
    request: Request,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let upload = upload::receive(&app, request, &[]).await?;
    if let Some((name, _)) = upload.fields.first() {
        return Err(unknown("form field", name, &[]));
    }
    let (volume, new) = upload.volume.store(&app).await?;
    let status = if new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = [(header::LOCATION, path_of(&volume.id))];
    Ok((status, location, Json(Volume::try_from(volume)?)).into_response())
}

/// List volumes
#[utoipa::path(get, path = "/v1/volumes", tag = "volumes",
    params(super::openapi::PageParameters),
    responses((status = 200, description = "A page, newest first", body = VolumeList), ListProblems))]
pub async fn list_volumes(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<VolumeList>> {
    let (page, []) = list_query(query.as_deref(), [])?;
    let page = app.queue.catalogue.volumes(page).await?;
    Ok(Json(VolumeList {
        next_cursor: next_cursor(&page),
        volumes: page
            .items
            .into_iter()
            .map(Volume::try_from)
            .collect::<Result<_, _>>()?,
    }))
}

/// Facts of a volume
#[utoipa::path(get, path = "/v1/volumes/{id}", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 200, description = "The volume", body = Volume), LookupProblems))]
pub async fn get_volume(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer<Json<Volume>> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    Ok(Json(find(&app, &id).await?.try_into()?))
}

/// Look at a volume
///
/// Three orthogonal middle slices, side by side.
#[utoipa::path(get, path = "/v1/volumes/{id}/preview.png", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 200, description = "The slices", body = Vec<u8>, content_type = "image/png"),
        LookupProblems))]
pub async fn preview_volume(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let volume = find(&app, &id).await?;
    let files = app.queue.volume_files(&id, &volume.files).await?;
    let files = files.ok_or_else(|| Problem::internal(format!("a file of {id} is missing")))?;
    let _permit = app.inspections.acquire().await.map_err(Problem::internal)?;
    let reader = app.engine.reader.clone();
    let png = tokio::task::spawn_blocking(move || reader.preview(&files))
        .await
        .map_err(Problem::internal)?
        .map_err(Problem::internal)?;
    let headers = [
        (header::CONTENT_TYPE, "image/png"),
        (header::CACHE_CONTROL, "private, max-age=3600"),
    ];
    Ok((headers, png).into_response())
}

/// Erase a volume
///
/// Refused while a job that has not ended needs it.
#[utoipa::path(delete, path = "/v1/volumes/{id}", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 204, description = "Erased"),
        EraseProblems, LookupProblems))]
pub async fn delete_volume(
    State(app): State<App>,
    Path(id): Path<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    products::erase(&app, Resource::Volume, &id, query.as_deref()).await
}

async fn find(app: &App, id: &str) -> Answer<StoredVolume> {
    match app.queue.catalogue.volume(id).await? {
        Some(volume) => Ok(volume),
        None => Err(missing(&*app.queue.catalogue, Resource::Volume, id).await),
    }
}
