//! Receiving `multipart/form-data` and `multipart/related`, with the limits that a form needs beside those on its body:
//! the number of files and of text fields, the length of a text field, and the length of headers
//! and boundaries, which the parser gathers in memory.

use super::{Bundle, Upload};
use crate::archive::RelatedType;
use crate::config::Size;
use crate::http::app::App;
use crate::http::problem::body::{self, EndlessFormHeader};
use crate::http::problem::{Answer, shorten};
use axum::body::{Body, Bytes};
use axum::extract::multipart::Field;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::{HeaderMap, HeaderValue, header};
use futures::{StreamExt, TryStreamExt};
use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Longest text field, bytes.
const FIELD_BYTES: usize = 4096;
/// Most text fields.
const FIELDS: usize = 100;
/// Most bytes between two pieces of content: headers and boundaries.
const HEADER_BYTES: usize = 256 << 10;

/// Bytes of the body that were read since the parser last returned something.
#[derive(Clone, Default)]
pub struct Unparsed(Arc<AtomicUsize>);

impl Unparsed {
    /// Adds a piece of the body. An error if the parser has gathered too much: the form has a
    /// header or boundary without end.
    fn add(&self, piece: Bytes) -> Result<Bytes, Box<dyn Error + Send + Sync>> {
        let length = piece.len();
        let waiting = self.0.fetch_add(length, Ordering::Relaxed) + length;
        if waiting > HEADER_BYTES.max(4 * length) {
            return Err(EndlessFormHeader.into());
        }
        Ok(piece)
    }

    /// The parser returned a field or a piece of one.
    pub fn reset(&self) {
        self.0.store(0, Ordering::Relaxed);
    }
}

/// Receives a form of at most `limit` bytes into `upload`; files named in `apart` are kept apart.
pub async fn receive(
    app: &App,
    request: Request,
    limit: Size,
    apart: &[&'static str],
    upload: &mut Upload,
) -> Answer<()> {
    receive_parts(app, request, limit, Some(apart), upload).await
}

/// Receives `multipart/related` of DICOM files; every part is one.
pub async fn receive_related(
    app: &App,
    mut request: Request,
    limit: Size,
    upload: &mut Upload,
) -> Answer<()> {
    let boundary = related_boundary(request.headers())?;
    // The parts are written alike; the parser asks for the name of a form.
    let form = HeaderValue::from_str(&format!("multipart/form-data; boundary=\"{boundary}\""));
    let form = form.map_err(|_| body::malformed_form("its boundary cannot be read"))?;
    request.headers_mut().insert(header::CONTENT_TYPE, form);
    receive_parts(app, request, limit, None, upload).await
}

/// The boundary of `multipart/related` of the type `application/dicom`.
fn related_boundary(headers: &HeaderMap) -> Answer<String> {
    let text = headers.get(header::CONTENT_TYPE);
    let text = text.and_then(|value| value.to_str().ok()).unwrap_or("?");
    let unreadable = || body::malformed_form("its Content-Type cannot be read");
    let related = RelatedType::parse(text).ok_or_else(unreadable)?;
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
    limit: Size,
    apart: Option<&[&'static str]>,
    upload: &mut Upload,
) -> Answer<()> {
    let unparsed = Unparsed::default();
    let request = request.map(|body| counted(body, unparsed.clone()));
    let mut form = Multipart::from_request(request, app)
        .await
        .map_err(|error| body::malformed_form(&error.body_text()))?;
    let interrupted = |error: &(dyn Error + 'static)| body::form_interrupted(error, limit);
    let mut files = 0;
    while let Some(field) = form.next_field().await.map_err(|e| interrupted(&e))? {
        unparsed.reset();
        let name = field.name().unwrap_or_default().to_owned();
        let is_text = field.file_name().is_none() && field.content_type().is_none();
        if is_text && apart.is_some() {
            let text = text_field(field, &name, &unparsed, interrupted).await?;
            upload.fields.push((name, text));
            if upload.fields.len() > FIELDS {
                let reason = format!("it has more than {FIELDS} text fields");
                return Err(body::malformed_form(&reason));
            }
            continue;
        }
        files += 1;
        if files > app.settings.parts_limit {
            return Err(body::too_many_files(app.settings.parts_limit));
        }
        let file_name = field.file_name().unwrap_or_default().to_ascii_lowercase();
        let pieces = field
            .inspect_ok(|_| unparsed.reset())
            .map_err(|error| interrupted(&error));
        let bundle = bundle_of(upload, app, apart.unwrap_or_default(), &name);
        bundle.write(pieces).await?.known_as(&file_name);
    }
    Ok(())
}

/// The body, whose bytes are counted by `unparsed` as they are read.
pub fn counted(body: Body, unparsed: Unparsed) -> Body {
    let pieces = body.into_data_stream();
    Body::from_stream(pieces.map(move |piece| unparsed.add(piece?)))
}

/// The bundle to which the files of that name belong.
fn bundle_of<'a>(
    upload: &'a mut Upload,
    app: &App,
    apart: &[&'static str],
    name: &str,
) -> &'a mut Bundle {
    match apart.iter().find(|own| **own == name) {
        None => &mut upload.volume,
        Some(own) => {
            let others = &mut upload.others;
            others.entry(own).or_insert_with(|| Bundle::new(app))
        }
    }
}

async fn text_field(
    mut field: Field<'_>,
    name: &str,
    unparsed: &Unparsed,
    interrupted: impl Fn(&(dyn Error + 'static)) -> crate::http::problem::Problem,
) -> Answer<String> {
    let unusable =
        |what: String| body::malformed_form(&format!("the text field `{}` {what}", shorten(name)));
    let mut bytes = Vec::new();
    while let Some(piece) = field.chunk().await.map_err(|error| interrupted(&error))? {
        unparsed.reset();
        bytes.extend_from_slice(&piece);
        if bytes.len() > FIELD_BYTES {
            return Err(unusable(format!("is longer than {FIELD_BYTES} bytes")));
        }
    }
    String::from_utf8(bytes).map_err(|_| unusable("is not UTF-8".into()))
}
