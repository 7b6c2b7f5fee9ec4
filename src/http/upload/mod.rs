//! From a request's body to files: streamed to the disk and hashed on the way, never held in
//! memory.
//!
//! The body is one file, a form, or the parts of `multipart/related` that DICOMweb clients send
//! (PS3.18 section 8.6.1.2). A form's text fields are parameters; its files make up the volume,
//! except those whose name asks to be kept apart (an expert's mask). The limits on size
//! and time are layers of the route ([`crate::http::limits`]); [`form`] adds those that only a
//! form needs.

mod bundle;
mod form;

pub use bundle::Bundle;

use super::app::App;
use super::guard::Counting;
use super::limits::BodyLimits;
use super::problem::{Answer, body};
use super::request::{media_type, refuse_content_encoding};
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use futures::TryStreamExt;
use std::collections::BTreeMap;

/// Bodies of these types are the bytes of a volume; what they hold is told by their content. Browsers,
/// operating systems and old clients have names of their own for the same formats.
/// `x-www-form-urlencoded` is what curl and urllib send unless told otherwise.
const RAW_TYPES: [&str; 48] = [
    "application/octet-stream",
    "application/x-octet-stream",
    "application/binary",
    "application/x-binary",
    "binary/octet-stream",
    "application/gzip",
    "application/x-gzip",
    "application/gzip-compressed",
    "application/x-gzip-compressed",
    "application/x-gunzip",
    "application/x-compressed",
    "application/x-compress",
    "application/zip",
    "application/x-zip",
    "application/x-zip-compressed",
    "application/zip-compressed",
    "multipart/x-zip",
    "multipart/x-gzip",
    "application/dicom",
    "application/x-dicom",
    "application/dicom+zip",
    "application/nifti",
    "application/x-nifti",
    "application/x-nifti-gz",
    "image/nifti",
    "image/x-nifti",
    // Meshes: an expert's.
    "model/stl",
    "model/x.stl-ascii",
    "model/x.stl-binary",
    "application/sla",
    "application/vnd.ms-pki.stl",
    "application/x-navistyle",
    "model/ply",
    "model/x-ply",
    "application/ply",
    "application/x-ply",
    "model/obj",
    "text/prs.wavefront-obj",
    "application/x-tgif",
    "model/vtk",
    "application/x-vtk",
    "application/vtk",
    "model/vtp",
    "application/x-vtp",
    "application/vtp",
    "model/gltf-binary",
    "model/gltf+json",
    "application/x-www-form-urlencoded",
];

/// A received body: files that are not published yet, and the text fields of the form.
pub struct Upload {
    /// The volume: the body, or the form's files.
    pub volume: Bundle,
    /// The files that were to be kept apart, by name.
    pub others: BTreeMap<&'static str, Bundle>,
    /// Counts what comes against the tenant's quota.
    counting: Counting,
    /// The form's text fields: name and value.
    pub fields: Vec<(String, String)>,
}

/// The length of the body, 0 if it is not announced.
fn announced_length(headers: &HeaderMap) -> u64 {
    let length = headers.get(header::CONTENT_LENGTH);
    let length = length.and_then(|value| value.to_str().ok()?.parse().ok());
    length.unwrap_or(0)
}

/// Receives a body. A form's files named in `apart` are kept apart from the volume's.
///
/// # Errors
/// 400 empty or malformed, 408 too slow, 413 too large, 415 of another type or encoding.
pub async fn receive(app: &App, request: Request, apart: &[&'static str]) -> Answer<Upload> {
    refuse_content_encoding(request.headers())?;
    let counting = Counting::of(&request);
    let limits = BodyLimits::of(&request)?;
    app.queue
        .blobs
        .require_room(announced_length(request.headers()))?;
    let mut upload = Upload {
        volume: Bundle::new(app, &counting),
        others: BTreeMap::new(),
        counting,
        fields: Vec::new(),
    };
    match media_type(request.headers()).as_deref() {
        Some("multipart/form-data") => {
            form::receive(app, request, limits.size, apart, &mut upload).await?;
        }
        Some("multipart/related") => {
            form::receive_related(app, request, limits.size, &mut upload).await?;
        }
        // An empty header says as much as none.
        Some(other) if !other.is_empty() && !RAW_TYPES.contains(&other) => {
            let wanted = format!(
                "{}, multipart/form-data, or multipart/related of application/dicom",
                RAW_TYPES[0]
            );
            return Err(body::unsupported_type(other, &wanted));
        }
        _ => {
            let pieces = request.into_body().into_data_stream();
            let pieces = pieces.map_err(|error| body::interrupted(&error, limits.size));
            upload.volume.write(pieces).await?;
        }
    }
    if upload.volume.is_empty() {
        return Err(body::empty());
    }
    match upload.others.iter().find(|(_, files)| files.is_empty()) {
        Some((name, _)) => Err(body::empty_part(name)),
        None => Ok(upload),
    }
}
