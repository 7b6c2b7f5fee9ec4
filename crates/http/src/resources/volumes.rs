//! `/v1/volumes`: uploaded volumes.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::reserve_upload;
use crate::openapi::{self, LookupProblems, UploadProblems};
use crate::resources::collection::{Collection, find};
use crate::resources::scans;
use crate::resources::tags::{self, TagQuery};
use crate::wire::links::{added, path_of, rfc3339};
use crate::wire::problem::Answer;
use crate::wire::query::{NoQuery, QueryReader};
use crate::wire::request::{PathSegments, unknown};
use crate::wire::upload;
use crate::wire::validators::not_modified;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, header};
use axum::response::IntoResponse;
use futures::{FutureExt, TryFutureExt};
use serde::Serialize;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use utoipa::ToSchema;
use ventriform::image::volume::GateFacts;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{
    FileRecord, ItemFilter, LegalHold, ListPage, ListRequest, Owned, Resource, StoreError,
    StoredVolume, Tenant, content_id,
};
use ventriform_service::callers::Scope;
use ventriform_service::use_cases::service::Service;
use ventriform_service::work::UploadFacts;

/// A later version of the program may draw a preview differently.
const PREVIEW_CACHE_CONTROL: &str = "private, max-age=3600";

/// The collection of volumes.
pub struct Volumes;

impl Collection for Volumes {
    const RESOURCE_KIND: Resource = Resource::Volume;
    const CARRIES_TAGS: bool = true;
    type Row = StoredVolume;
    type Body = VolumeBody;

    async fn row(
        service: &Service,
        tenant: &Tenant,
        id: &str,
    ) -> Result<Option<Owned<StoredVolume>>, ServiceError> {
        service.volume(tenant, id).await
    }

    fn body(
        app: &App,
        scope: Scope,
        volume: Owned<StoredVolume>,
    ) -> Result<VolumeBody, StoreError> {
        VolumeBody::new(app, scope, volume)
    }

    async fn rows(
        service: &Service,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> Result<ListPage<Owned<StoredVolume>>, ServiceError> {
        service.volumes(tenant, filter, page).await
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
    /// The caller's own id for it; not shown to the scope `read`.
    #[schema(max_length = 128)]
    external_id: Option<String>,
    /// The caller's own names and values for it; none are shown to the scope `read`.
    labels: BTreeMap<String, String>,
    /// When it will be erased unless it is uploaded or used again (RFC 3339); absent if it is kept.
    #[schema(format = DateTime)]
    expires_at: Option<String>,
    /// The legal hold that forbids to erase it.
    legal_hold: Option<LegalHoldBody>,
    /// Size of all its files in bytes.
    bytes: u64,
    /// Number of its files.
    files: usize,
    /// Its files as they were uploaded.
    originals: Vec<OriginalBody>,
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
    /// The voxel values in rising order if the volume looks like a label map.
    label_values: Option<Vec<i64>>,
    /// The gates of one heart beat, if the frames are gates: a gated DICOM series, 6 to 32 DICOM or NIfTI files of one gate each,
    /// or a 4-D NIfTI file whose header does not contradict and whose volumes look like gates.
    gates: Option<GateFacts>,
    /// Oddities of the file that do not prevent its use.
    warnings: Vec<String>,
    /// Whose scan it is, as far as the caller's scope allows to see it; absent if nothing is known.
    #[schema(value_type = Option<ventriform::image::volume::Provenance>)]
    dicom: Option<Map<String, Value>>,
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

/// A legal hold.
#[derive(Serialize, ToSchema)]
#[schema(as = LegalHold)]
pub struct LegalHoldBody {
    /// The reason that was given; not shown to the scope `read`.
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    /// Since when (RFC 3339).
    #[schema(format = DateTime)]
    since: String,
    /// The name of the key that set it.
    by: String,
}

impl LegalHoldBody {
    /// The JSON of a legal hold for a caller of that scope.
    pub fn new(hold: LegalHold, scope: Scope) -> Self {
        Self {
            reason: Some(hold.reason).filter(|_| scans::sees_patients(scope)),
            since: rfc3339(hold.since),
            by: hold.by,
        }
    }
}

/// An uploaded file.
#[derive(Serialize, ToSchema)]
#[schema(as = VolumeFile)]
pub struct OriginalBody {
    /// Its name in the store; not that of the upload.
    #[schema(example = "volume.nii.gz")]
    name: String,
    /// Its path.
    href: String,
    /// Its media type.
    media_type: String,
    /// Its length in bytes.
    bytes: u64,
    /// SHA-256 of its content, hexadecimal; also its `ETag`.
    sha256: String,
}

impl OriginalBody {
    /// All files of a volume.
    pub fn all(volume: &StoredVolume) -> Vec<Self> {
        let itself = path_of(&volume.id);
        let describe = |file: &FileRecord| Self {
            href: format!("{itself}/files/{}", file.name),
            media_type: media_type(&file.name).to_owned(),
            name: file.name.clone(),
            bytes: file.bytes,
            sha256: file.sha256.clone(),
        };
        volume.files.iter().map(describe).collect()
    }
}

/// The media type that a file's name in the store stands for.
pub fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("gz") => "application/gzip",
        Some("dcm") => "application/dicom",
        Some("nii") => "application/nifti",
        _ => "application/octet-stream",
    }
}

/// Paths of one volume.
#[derive(Serialize, ToSchema)]
struct VolumeLinks {
    /// This volume.
    #[serde(rename = "self")]
    itself: String,
    /// Three middle slices as PNG.
    preview: String,
    /// The uploaded file; absent if there are several.
    #[serde(skip_serializing_if = "Option::is_none")]
    content: Option<String>,
    /// Its legal hold: PUT sets it, DELETE lifts it.
    hold: String,
    /// Whose scan it is: PUT states it, DELETE erases it.
    identity: String,
}

impl VolumeBody {
    /// The JSON of a volume for a caller of that scope.
    ///
    /// # Errors
    /// If its record is damaged.
    pub fn new(app: &App, scope: Scope, volume: Owned<StoredVolume>) -> Result<Self, StoreError> {
        let expires_at = app.expires_at(Resource::Volume, &volume.ownership);
        let Owned {
            item: volume,
            ownership,
        } = volume;
        let itself = path_of(&volume.id);
        let facts = UploadFacts::from_volume(&volume)?;
        let tags = tags::shown(ownership.tags, scope);
        Ok(Self {
            created_at: rfc3339(ownership.created_at),
            external_id: tags.external_id,
            labels: tags.labels,
            expires_at,
            legal_hold: ownership
                .legal_hold
                .map(|hold| LegalHoldBody::new(hold, scope)),
            originals: OriginalBody::all(&volume),
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
            label_values: facts.labels,
            gates: facts.gates,
            warnings: facts.warnings,
            dicom: scans::shown(&ownership.scan, scope),
            links: VolumeLinks {
                preview: format!("{itself}/preview.png"),
                content: (volume.files.len() == 1).then(|| format!("{itself}/content")),
                hold: format!("{itself}/hold"),
                identity: format!("{itself}/identity"),
                itself,
            },
            id: volume.id,
        })
    }
}

/// Upload a volume
///
/// The body is the file itself, or a form whose files make up one volume (a `.hdr`/`.img` pair, a
/// DICOM series, or 6 to 32 DICOM or NIfTI files of one gate each), or their parts as DICOMweb clients send them. The same bytes
/// always get the same id. DICOM files of gates are taken in the order that their headers state, NIfTI files in that of the
/// numbers in their names, where the names are the same but for one number; otherwise in the order of the form.
#[utoipa::path(post, path = "/v1/volumes", tag = "volumes",
    request_body(content(
        (Vec<u8> = "application/octet-stream"),
        (openapi::UploadForm = "multipart/form-data"))),
    params(TagQuery),
    responses(
        (status = 201, description = "Stored", body = VolumeBody,
            headers(("Location" = String, description = "The volume's path"))),
        (status = 200, description = "Already stored", body = VolumeBody,
            headers(("Location" = String, description = "The volume's path"))),
        UploadProblems,
    ))]
pub async fn create_volume(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    let counting = reserve_upload(&app, &caller, request.headers(), 0).await?;
    query.clone().all::<TagQuery>()?.tags(&app)?;
    let upload = upload::receive(&app, counting, request, &[]).await?;
    let mut given = query.rest();
    given.extend(upload.fields);
    let mut given = QueryReader::of_pairs(given);
    let tags = given.take::<TagQuery>()?.tags(&app)?;
    if let Some((name, _)) = given.rest().first() {
        return Err(unknown("form field", name, &tags::TAG_FIELDS));
    }
    let stored = app
        .service
        .store_volume(&caller.by, &caller.tenant, upload.volume, &tags);
    let stored = stored.await.map_err(ServiceError::for_sender)?;
    let volume = stored.volume;
    let body = VolumeBody::new(&app, caller.scope, volume)?;
    Ok(added(stored.new, &body.id, &body))
}

/// Change a volume's names
///
/// A JSON merge patch (RFC 7396) of `external_id` and `labels`: what is `null` is removed, what is
/// absent stays.
#[utoipa::path(patch, path = "/v1/volumes/{id}", tag = "volumes", operation_id = "update_volume",
    params(("id" = String, Path, description = "The volume's id")),
    request_body(content(
        (openapi::TagsPatch = "application/merge-patch+json"),
        (openapi::TagsPatch = "application/json"))),
    responses((status = 200, description = "The volume", body = VolumeBody),
        openapi::PatchProblems, LookupProblems))]
pub async fn update_volume(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer<Json<VolumeBody>> {
    let tags_of = || {
        let found = find::<Volumes>(&app, &caller.tenant, &id);
        found.map_ok(|volume| volume.ownership.tags).boxed()
    };
    tags::change(&app, &caller, &id, request, tags_of).await?;
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    Ok(Json(VolumeBody::new(&app, caller.scope, volume)?))
}

/// Preview a volume
///
/// The three orthogonal slices through the middle, side by side.
#[utoipa::path(get, path = "/v1/volumes/{id}/preview.png", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id"), openapi::CachedHeaders),
    responses((status = 200, description = "The slices", body = Vec<u8>, content_type = "image/png"),
        openapi::UnchangedAnswer, LookupProblems))]
pub async fn preview_volume(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    // The drawing follows from the volume and the program, so it need not be made to be compared.
    let version = env!("CARGO_PKG_VERSION");
    let etag = content_id("", ["preview", version, &id].map(str::as_bytes));
    let etag = format!("\"{etag}\"");
    if let Some(unchanged) = not_modified(&headers, &etag, PREVIEW_CACHE_CONTROL) {
        return Ok(unchanged);
    }
    let png = app.service.preview(&volume).await?;
    let headers = [
        (header::CONTENT_TYPE, "image/png"),
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, PREVIEW_CACHE_CONTROL),
    ];
    Ok((headers, png).into_response())
}
