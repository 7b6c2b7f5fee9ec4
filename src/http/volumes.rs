//! `/v1/volumes`: uploaded volumes.

use super::app::App;
use super::collection::{Collection, find};
use super::openapi::{self, LookupProblems, UploadProblems};
use super::problem::{Answer, Problem};
use super::request::{PathSegments, query_pairs, refuse_unknown, unknown};
use super::upload;
use super::wire::{path_of, rfc3339};
use crate::jobs::{
    BlobError, Catalogue, ListPage, ListRequest, Resource, StoreError, StoreFault, StoredVolume,
};
use crate::progress::Monitor;
use crate::work::{UploadFacts, preview_memory};
use axum::Json;
use axum::extract::{RawQuery, Request, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Serialize;
use utoipa::ToSchema;

/// The collection of volumes.
pub struct Volumes;

impl Collection for Volumes {
    const RESOURCE: Resource = Resource::Volume;
    type Row = StoredVolume;
    type Body = VolumeBody;

    async fn row(catalogue: &dyn Catalogue, id: &str) -> Result<Option<StoredVolume>, StoreError> {
        catalogue.volume(id).await
    }

    fn body(volume: StoredVolume) -> Result<VolumeBody, StoreError> {
        VolumeBody::try_from(volume)
    }

    async fn rows(
        catalogue: &dyn Catalogue,
        page: ListRequest,
    ) -> Result<ListPage<StoredVolume>, StoreError> {
        catalogue.volumes(page).await
    }
}

/// A stored volume: what its header says.
#[derive(Serialize, ToSchema)]
#[schema(as = Volume)]
pub struct VolumeBody {
    /// Derived from the SHA-256 of the content, so it is the same on every machine.
    #[schema(example = "vol_9f86d081884c7d659a2feaa0c55ad015")]
    id: String,
    /// When it was stored (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Size of all its files in bytes.
    bytes: u64,
    /// Number of its files.
    files: usize,
    /// File format.
    #[schema(example = "NIfTI-1")]
    format: String,
    /// Whether it was gzipped.
    compressed: bool,
    /// Voxels along i, j, k of one frame.
    shape: [usize; 3],
    /// How many volumes of that shape the file holds; if several, the parameter `frame` chooses
    /// one.
    frames: usize,
    /// Voxel spacing along the first three axes, millimetres.
    spacing_mm: [f64; 3],
    /// Maps a voxel index to millimetres in the patient frame LPS; row by row.
    affine: [[f64; 4]; 4],
    /// The frame of `affine`.
    #[schema(example = "LPS")]
    frame: String,
    /// The part of the header that gave the affine.
    #[schema(example = "sform")]
    affine_source: String,
    /// Data type in the file.
    #[schema(example = "int16")]
    dtype: String,
    /// The voxel values after slope and intercept.
    intensity: IntensityBody,
    /// The labels in rising order if the volume looks like a label map.
    labels: Option<Vec<i64>>,
    /// Oddities of the file that do not prevent its use.
    warnings: Vec<String>,
    /// Related paths.
    links: VolumeLinks,
}

/// A summary of voxel values.
#[derive(Serialize, ToSchema)]
#[schema(as = Intensity)]
struct IntensityBody {
    /// Smallest finite value.
    min: f64,
    /// Largest finite value.
    max: f64,
    /// Mean of the finite values.
    mean: f64,
    /// Number of voxels that are NaN or infinite.
    not_finite: u64,
}

/// Paths of one volume.
#[derive(Serialize, ToSchema)]
struct VolumeLinks {
    /// This volume.
    #[serde(rename = "self")]
    itself: String,
    /// Three middle slices as PNG.
    preview: String,
}

impl TryFrom<StoredVolume> for VolumeBody {
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
            intensity: IntensityBody {
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
/// The body is the file itself, or a form whose files make up one volume (a `.hdr`/`.img` pair, a
/// DICOM series). The same bytes always get the same id.
#[utoipa::path(post, path = "/v1/volumes", tag = "volumes",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (Vec<u8> = "application/gzip"),
        (Vec<u8> = "application/dicom"),
        (Vec<u8> = "application/nifti"),
        (openapi::UploadForm = "multipart/form-data"),
    )),
    responses(
        (status = 201, description = "Stored", body = VolumeBody,
            headers(("Location" = String, description = "The volume's path"))),
        (status = 200, description = "Already stored", body = VolumeBody,
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
    let stored = upload.volume.store(&app).await?;
    let volume = stored.volume;
    let status = if stored.new {
        StatusCode::CREATED
    } else {
        StatusCode::OK
    };
    let location = [(header::LOCATION, path_of(&volume.id))];
    Ok((status, location, Json(VolumeBody::try_from(volume)?)).into_response())
}

/// Preview a volume
///
/// The three orthogonal slices through the middle, side by side.
#[utoipa::path(get, path = "/v1/volumes/{id}/preview.png", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id")),
    responses((status = 200, description = "The slices", body = Vec<u8>, content_type = "image/png"),
        LookupProblems))]
pub async fn preview_volume(
    State(app): State<App>,
    PathSegments(id): PathSegments<String>,
    RawQuery(query): RawQuery,
) -> Answer {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let volume = find::<Volumes>(&app, &id).await?;
    let files = app.queue.volume_files(&id, &volume.files).await?;
    let files = files.ok_or_else(|| {
        BlobError::new(
            StoreFault::DamagedFile,
            format!("a file of {id} is missing"),
        )
    })?;
    let reader = app.engine.reader.clone();
    let memory = preview_memory(UploadFacts::of(&volume)?.shape);
    let draw = move |monitor: &Monitor<'_>| reader.preview(&files, monitor);
    let preview = app.decoding.run(memory, draw).await?;
    let png = preview.map_err(Problem::internal)?;
    let headers = [
        (header::CONTENT_TYPE, "image/png"),
        (header::CACHE_CONTROL, "private, max-age=3600"),
    ];
    Ok((headers, png).into_response())
}
