//! Receiving `multipart/form-data` and `multipart/related`, with the limits that a form needs beside those on its body:
//! the number of files and of text fields, the length of a text field, and the length of headers
//! and boundaries, which the parser gathers in memory ([`Unparsed`]).

use super::Upload;
use crate::app::App;
use crate::wire::memory::charge;
use crate::wire::problem::{Answer, body, shorten};
use axum::extract::Request;
use axum::http::{HeaderMap, header};
use futures::TryStreamExt;
use multer::{Field, Multipart};
use std::error::Error;
use ventriform_service::config::Size;
use ventriform_service::network::archive::{RelatedType, Unparsed};
use ventriform_service::use_cases::uploads::VolumeUpload;

/// Longest text field, bytes.
const FIELD_BYTES: usize = 4096;
/// Most text fields.
const TEXT_FIELDS: usize = 100;

/// Memory of a form beside the parts' contents: what the parser has read and not handed out.
const FORM_MEMORY: u64 = 128 << 10;

/// Memory that is kept of a part whose content is on disk: its names and its hash.
const PART_MEMORY: u64 = 512;

/// Receives a form of at most `limit` bytes into `upload`; files named in `apart` are kept apart.
pub async fn receive(
    app: &App,
    request: Request,
    limit: Size,
    apart: &[&'static str],
    upload: &mut Upload,
) -> Answer<()> {
    let boundary = multer::parse_boundary(content_type(request.headers()))
        .map_err(|error| body::malformed_form(&error.to_string()))?;
    receive_parts(app, request, (&boundary, limit), Some(apart), upload).await
}

/// Receives `multipart/related` of DICOM files; every part is one.
pub async fn receive_related(
    app: &App,
    request: Request,
    limit: Size,
    upload: &mut Upload,
) -> Answer<()> {
    let boundary = related_boundary(request.headers())?;
    receive_parts(app, request, (&boundary, limit), None, upload).await
}

fn content_type(headers: &HeaderMap) -> &str {
    let text = headers.get(header::CONTENT_TYPE);
    text.and_then(|value| value.to_str().ok()).unwrap_or("?")
}

/// The boundary of `multipart/related` of the type `application/dicom`.
fn related_boundary(headers: &HeaderMap) -> Answer<String> {
    let unreadable = || body::malformed_form("its Content-Type cannot be read");
    let related = RelatedType::parse(content_type(headers)).ok_or_else(unreadable)?;
    if !related.is_dicom() {
        let found = related.parts.unwrap_or_default();
        let found = format!("multipart/related; type={found}");
        let wanted = "multipart/related; type=\"application/dicom\"";
        return Err(body::unsupported_type(&found, wanted));
    }
    let boundary = related.boundary;
    boundary.ok_or_else(|| body::malformed_form("it has no boundary"))
}

/// Receives the parts of a body; without `apart`, every part is a file.
async fn receive_parts(
    app: &App,
    request: Request,
    (boundary, limit): (&str, Size),
    apart: Option<&[&'static str]>,
    upload: &mut Upload,
) -> Answer<()> {
    charge(FORM_MEMORY).await?;
    let unparsed = Unparsed::default();
    let pieces = unparsed.pieces(request.into_body().into_data_stream());
    let mut form = Multipart::new(pieces, boundary);
    let interrupted = |error: &(dyn Error + 'static)| body::form_interrupted(error, limit);
    let mut files = 0;
    while let Some(field) = form.next_field().await.map_err(|e| interrupted(&e))? {
        unparsed.reset();
        let name = field.name().unwrap_or_default().to_owned();
        let is_text = field.file_name().is_none() && field.content_type().is_none();
        if is_text && apart.is_some() {
            let text = text_field(field, &name, &unparsed, interrupted).await?;
            upload.fields.push((name, text));
            if upload.fields.len() > TEXT_FIELDS {
                let reason = format!("it has more than {TEXT_FIELDS} text fields");
                return Err(body::malformed_form(&reason));
            }
            continue;
        }
        charge(PART_MEMORY).await?;
        files += 1;
        let most = app.service.settings().parts_limit;
        if files > most {
            return Err(body::too_many_files(most));
        }
        let file_name = field.file_name().unwrap_or_default().to_ascii_lowercase();
        let pieces = field
            .inspect_ok(|_| unparsed.reset())
            .map_err(|error| interrupted(&error));
        let files = files_of(upload, app, apart.unwrap_or_default(), &name);
        files.write(pieces).await?.known_as(&file_name);
    }
    Ok(())
}

/// The upload to which the files of that name belong.
fn files_of<'a>(
    upload: &'a mut Upload,
    app: &App,
    apart: &[&'static str],
    name: &str,
) -> &'a mut VolumeUpload {
    match apart.iter().find(|own| **own == name) {
        None => &mut upload.volume,
        Some(own) => {
            let (others, counting) = (&mut upload.others, &upload.counting);
            others
                .entry(own)
                .or_insert_with(|| VolumeUpload::new(&app.service, counting))
        }
    }
}

async fn text_field(
    mut field: Field<'_>,
    name: &str,
    unparsed: &Unparsed,
    interrupted: impl Fn(&(dyn Error + 'static)) -> crate::wire::problem::Problem,
) -> Answer<String> {
    let unusable =
        |what: String| body::malformed_form(&format!("the text field `{}` {what}", shorten(name)));
    let mut bytes = Vec::new();
    while let Some(piece) = field.chunk().await.map_err(|error| interrupted(&error))? {
        unparsed.reset();
        charge(2 * piece.len() as u64).await?;
        bytes.extend_from_slice(&piece);
        if bytes.len() > FIELD_BYTES {
            return Err(unusable(format!("is longer than {FIELD_BYTES} bytes")));
        }
    }
    String::from_utf8(bytes).map_err(|_| unusable("is not UTF-8".into()))
}
