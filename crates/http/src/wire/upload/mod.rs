//! From a request's body to files: streamed to the disk and hashed on the way, never held in
//! memory.
//!
//! The body is one file, a form, or the parts of `multipart/related` that DICOMweb clients send
//! (PS3.18 section 8.6.1.2). A form's text fields are parameters; its files make up the volume,
//! except those whose name asks to be kept apart (an expert's mask). The limits on size
//! and time are layers of the route ([`crate::wire::limits`]); [`form`] adds those that only a
//! form needs.

mod form;
pub mod media_types;

use crate::app::App;
use crate::wire::limits::BodyLimits;
use crate::wire::problem::{Answer, body};
use crate::wire::request::{media_type, refuse_content_encoding};
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use futures::TryStreamExt;
use std::collections::BTreeMap;
use ventriform_service::limits::quotas::Counting;
use ventriform_service::use_cases::uploads::VolumeUpload;

/// A received body: files that are not published yet, and the text fields of the form.
pub struct Upload {
    /// The volume: the body, or the form's files.
    pub volume: VolumeUpload,
    /// The files that were to be kept apart, by name.
    pub others: BTreeMap<&'static str, VolumeUpload>,
    /// Counts what comes against the tenant's quota.
    counting: Counting,
    /// The form's text fields: name and value.
    pub fields: Vec<(String, String)>,
}

/// The length of the body, 0 if it is not announced.
pub fn announced_length(headers: &HeaderMap) -> u64 {
    let length = headers.get(header::CONTENT_LENGTH);
    let length = length.and_then(|value| value.to_str().ok()?.parse().ok());
    length.unwrap_or(0)
}

/// Receives a body. A form's files named in `apart` are kept apart from the volume's.
///
/// # Errors
/// 400 empty or malformed, 408 too slow, 413 too large, 415 of another type or encoding.
pub async fn receive(
    app: &App,
    counting: Counting,
    request: Request,
    apart: &[&'static str],
) -> Answer<Upload> {
    refuse_content_encoding(request.headers())?;
    let limits = BodyLimits::from_request(&request)?;
    app.service
        .require_disk_room(announced_length(request.headers()))?;
    let mut upload = Upload {
        volume: VolumeUpload::new(&app.service, &counting),
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
        Some(other) if !other.is_empty() && !media_types::is_raw(other) => {
            let wanted = format!(
                "{}, multipart/form-data, or multipart/related of application/dicom",
                media_types::VOLUME_TYPES[0]
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
