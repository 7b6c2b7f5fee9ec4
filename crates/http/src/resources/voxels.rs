//! `/v1/volumes/{id}/voxels.nii.gz`: the voxels as the service reads them, whatever the upload's format; or the one
//! structure in them that jobs take as an expert's mask.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, LookupProblems};
use crate::resources::collection::find;
use crate::resources::volumes::Volumes;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::{Query, fields_of};
use crate::wire::request::PathSegments;
use crate::wire::validators::not_modified;
use crate::wire::words::{MeshFrameName, MeshUnitName};
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use serde::Deserialize;
use utoipa::IntoParams;
use utoipa::openapi::path::{Parameter, ParameterIn};
use ventriform::image::volume::given_mask::MaskChoice;
use ventriform::mesh::files::MeshStatement;
use ventriform_service::base::records::content_id;
use ventriform_service::use_cases::volumes::VoxelChoice;

/// A later version of the program may read a file differently.
const CACHE_CONTROL: &str = "private, max-age=3600";

/// The voxels that are asked for.
#[derive(Debug, Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct VoxelQuery {
    /// The frame, counted from 0
    frame: Option<u32>,
    /// Whether the volume is read as an expert's mask
    mask: Option<bool>,
}

/// The structure of an expert's mask that is asked for, by the parameters of a job.
#[derive(Debug, Deserialize)]
pub struct MaskQuery {
    label: Option<String>,
    mesh_unit: Option<MeshUnitName>,
    mesh_frame: Option<MeshFrameName>,
}

impl IntoParams for MaskQuery {
    fn into_params(_: impl Fn() -> Option<ParameterIn>) -> Vec<Parameter> {
        openapi::fit_parameters(&fields_of::<Self>())
    }
}

impl MaskQuery {
    fn is_given(&self) -> bool {
        self.label.is_some() || self.mesh_unit.is_some() || self.mesh_frame.is_some()
    }

    fn choice(self) -> MaskChoice {
        MaskChoice {
            label: self.label.map(|label| {
                let Ok(label) = label.parse();
                label
            }),
            mesh: MeshStatement {
                unit: self.mesh_unit.map(|word| word.0),
                frame: self.mesh_frame.map(|word| word.0),
            },
            ..MaskChoice::default()
        }
    }
}

/// Download a volume's voxels
///
/// One frame as NIfTI-1, 16-bit integers with a scale, whatever the format of the upload. The gates
/// of a DICOM file are summed unless `frame` names one.
///
/// With `mask=true`, the structure that jobs compare with if the volume is their `expert`: 1 inside, 0 outside, on the
/// grid of the upload (of a mesh, on a grid about it). `label`, `mesh_unit` and `mesh_frame` are those of the job.
#[utoipa::path(get, path = "/v1/volumes/{id}/voxels.nii.gz", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id"),
        VoxelQuery, MaskQuery,
        openapi::CachedHeaders),
    responses((status = 200, description = "The voxels", body = Vec<u8>, content_type = "application/gzip"),
        (status = 422, description = "There is no such frame or structure, or one must be named",
            body = crate::wire::problem::ProblemBody, content_type = "application/problem+json"),
        openapi::UnchangedAnswer, LookupProblems))]
pub async fn download_voxels(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    Query((query, of_mask)): Query<(VoxelQuery, MaskQuery)>,
    headers: HeaderMap,
) -> Answer {
    let asked = format!("{query:?} {of_mask:?}");
    let frame = query.frame.map(|frame| frame as usize);
    let stray = match query.mask {
        Some(true) => frame.is_some(),
        _ => of_mask.is_given(),
    };
    if stray {
        return Err(contradiction());
    }
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    // The voxels follow from the upload and the program, so they need not be read to be compared.
    let parts = ["voxels", env!("CARGO_PKG_VERSION"), &id, &asked];
    let etag = format!("\"{}\"", content_id("", parts.map(str::as_bytes)));
    if let Some(unchanged) = not_modified(&headers, &etag, CACHE_CONTROL) {
        return Ok(unchanged);
    }
    let choice = match query.mask {
        Some(true) => VoxelChoice::Mask(of_mask.choice()),
        _ => VoxelChoice::Frame(frame),
    };
    let bytes = app.service.voxels(&volume, choice).await?;
    let headers = [
        (header::CONTENT_TYPE, "application/gzip"),
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, CACHE_CONTROL),
    ];
    Ok((headers, bytes).into_response())
}

fn contradiction() -> Problem {
    Problem::new(
        StatusCode::UNPROCESSABLE_ENTITY,
        "invalid-parameter",
        "`label`, `mesh_unit` and `mesh_frame` belong to `mask=true`, and `frame` does not.",
    )
    .at("mask")
    .fix("Set `mask` to true for a mask, or leave these parameters out.")
}
