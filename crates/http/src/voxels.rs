//! `/v1/volumes/{id}/voxels.nii.gz`: the voxels as the service reads them, whatever the upload's format; or the one
//! structure in them that jobs take as an expert's mask.

use super::app::App;
use super::caller::Caller;
use super::collection::find;
use super::openapi::{self, LookupProblems};
use super::problem::{Answer, Problem};
use super::request::{PathSegments, flag, query_pairs, refuse_unknown, word};
use super::validators::not_modified;
use super::volumes::{Volumes, files_of};
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;
use ventriform::mesh_files::{MeshFrame, MeshUnit};
use ventriform::progress::Monitor;
use ventriform::volume::given_mask::MaskChoice;
use ventriform_service::records::content_id;
use ventriform_service::work::{UploadFacts, voxels_memory};

/// A later version of the program may read a file differently.
const CACHE_CONTROL: &str = "private, max-age=3600";

/// Download a volume's voxels
///
/// One frame as NIfTI-1, 16-bit integers with a scale, whatever the format of the upload. The gates
/// of a DICOM file are summed unless `frame` names one.
///
/// With `mask=true`, the structure that jobs compare with if the volume is their `expert`: 1 inside, 0 outside, on the
/// grid of the upload (of a mesh, on a grid about it). `label`, `mesh_unit` and `mesh_frame` are those of the job.
#[utoipa::path(get, path = "/v1/volumes/{id}/voxels.nii.gz", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id"),
        ("frame" = inline(Option<u32>), Query, description = "The frame, counted from 0"),
        ("mask" = inline(Option<bool>), Query, description = "Whether the volume is read as an expert's mask"),
        openapi::MaskParameters,
        openapi::CachedHeaders),
    responses((status = 200, description = "The voxels", body = Vec<u8>, content_type = "application/gzip"),
        (status = 422, description = "There is no such frame or structure, or one must be named",
            body = super::problem::ProblemBody, content_type = "application/problem+json"),
        openapi::UnchangedAnswer, LookupProblems))]
pub async fn download_voxels(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    RawQuery(query): RawQuery,
    headers: HeaderMap,
) -> Answer {
    let pairs = query_pairs(query.as_deref());
    refuse_unknown(
        &pairs,
        &["frame", "mask", "label", "mesh_unit", "mesh_frame"],
    )?;
    let value = |name: &str| {
        let found = pairs.iter().find(|(n, _)| n == name);
        found.map(|(_, text)| text.as_str())
    };
    let frame = value("frame").map(number).transpose()?;
    let mask = value("mask").map(|text| flag("mask", text)).transpose()?;
    let mask = mask.unwrap_or(false).then(|| choice(&value)).transpose()?;
    let of_mask = ["label", "mesh_unit", "mesh_frame"];
    let stray = match mask {
        Some(_) => frame.is_some(),
        None => of_mask.iter().any(|name| value(name).is_some()),
    };
    if stray {
        return Err(contradiction());
    }
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    // The voxels follow from the upload and the program, so they need not be read to be compared.
    let named: Vec<String> = pairs
        .iter()
        .map(|(name, text)| format!("{name}={text}"))
        .collect();
    let named = named.join("\n");
    let parts = ["voxels", env!("CARGO_PKG_VERSION"), &id, &named];
    let etag = format!("\"{}\"", content_id("", parts.map(str::as_bytes)));
    if let Some(unchanged) = not_modified(&headers, &etag, CACHE_CONTROL) {
        return Ok(unchanged);
    }
    let files = files_of(&app, &volume).await?;
    let reader = app.service.engine.reader.clone();
    let memory = voxels_memory(UploadFacts::of(&volume)?.shape);
    let read = move |monitor: &Monitor<'_>| match &mask {
        Some(choice) => reader.mask(&files, choice, monitor),
        None => reader.voxels(&files, frame, monitor),
    };
    let bytes = app.service.decoding.run(memory, read).await??;
    let headers = [
        (header::CONTENT_TYPE, "application/gzip"),
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, CACHE_CONTROL),
    ];
    Ok((headers, bytes).into_response())
}

/// Which structure is asked for.
fn choice<'a>(value: &dyn Fn(&str) -> Option<&'a str>) -> Answer<MaskChoice> {
    let mut choice = MaskChoice::default();
    if let Some(label) = value("label") {
        let Ok(label) = label.parse();
        choice.label = Some(label);
    }
    choice.mesh.unit = word(
        value("mesh_unit"),
        "mesh_unit",
        MeshUnit::named,
        "mm, cm or m",
    )?;
    choice.mesh.frame = word(
        value("mesh_frame"),
        "mesh_frame",
        MeshFrame::named,
        "lps or ras",
    )?;
    Ok(choice)
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

fn number(text: &str) -> Answer<usize> {
    text.parse().map_err(|_| {
        Problem::new(
            StatusCode::UNPROCESSABLE_ENTITY,
            "invalid-parameter",
            format!("`frame`: `{text}` is no number of a frame."),
        )
        .at("frame")
        .fix("Give a whole number, counted from 0.")
    })
}
