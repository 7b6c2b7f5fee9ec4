//! `/v1/volumes/{id}/voxels.nii.gz`: the voxels as the service reads them, whatever the upload's format.

use super::app::App;
use super::caller::Caller;
use super::collection::find;
use super::openapi::{self, LookupProblems};
use super::problem::{Answer, Problem};
use super::request::{PathSegments, query_pairs, refuse_unknown};
use super::validators::not_modified;
use super::volumes::{Volumes, files_of};
use crate::jobs::content_id;
use crate::progress::Monitor;
use crate::work::{UploadFacts, voxels_memory};
use axum::extract::{RawQuery, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::IntoResponse;

/// A later version of the program may read a file differently.
const CACHE_CONTROL: &str = "private, max-age=3600";

/// Download a volume's voxels
///
/// One frame as NIfTI-1, 16-bit integers with a scale, whatever the format of the upload. The gates
/// of a DICOM file are summed unless `frame` names one.
#[utoipa::path(get, path = "/v1/volumes/{id}/voxels.nii.gz", tag = "volumes",
    params(("id" = String, Path, description = "The volume's id"),
        ("frame" = inline(Option<u32>), Query, description = "The frame, counted from 0"),
        openapi::CachedHeaders),
    responses((status = 200, description = "The voxels", body = Vec<u8>, content_type = "application/gzip"),
        (status = 422, description = "There is no such frame, or a frame must be named",
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
    refuse_unknown(&pairs, &["frame"])?;
    let frame = pairs.iter().find(|(name, _)| name == "frame");
    let frame = frame.map(|(_, text)| number(text)).transpose()?;
    let volume = find::<Volumes>(&app, &caller.tenant, &id).await?;
    // The voxels follow from the upload and the program, so they need not be read to be compared.
    let named = frame.map_or_else(String::new, |frame| frame.to_string());
    let parts = ["voxels", env!("CARGO_PKG_VERSION"), &id, &named];
    let etag = format!("\"{}\"", content_id("", parts.map(str::as_bytes)));
    if let Some(unchanged) = not_modified(&headers, &etag, CACHE_CONTROL) {
        return Ok(unchanged);
    }
    let files = files_of(&app, &volume).await?;
    let reader = app.engine.reader.clone();
    let memory = voxels_memory(UploadFacts::of(&volume)?.shape);
    let read = move |monitor: &Monitor<'_>| reader.voxels(&files, frame, monitor);
    let bytes = app.decoding.run(memory, read).await??;
    let headers = [
        (header::CONTENT_TYPE, "application/gzip"),
        (header::ETAG, etag.as_str()),
        (header::CACHE_CONTROL, CACHE_CONTROL),
    ];
    Ok((headers, bytes).into_response())
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
