//! From a request's body to files: streamed, hashed and limited on the way.

mod bundle;
mod guard;

pub use bundle::Bundle;

use super::app::App;
use super::problem::{Answer, Problem, shorten};
use super::request::{media_type, refuse_content_encoding, unsupported_type};
use axum::body::Body;
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::{StatusCode, header};
use futures::TryStreamExt;
use guard::Guard;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;

/// Bodies of these types are a volume's bytes. `x-www-form-urlencoded` is what curl says
/// when it is told nothing.
const RAW_TYPES: [&str; 7] = [
    "application/octet-stream",
    "application/gzip",
    "application/x-gzip",
    "application/dicom",
    "application/nifti",
    "application/x-nifti",
    "application/x-www-form-urlencoded",
];

/// Longest text field of a form.
const FIELD_BYTES: usize = 4096;
/// Most text fields of a form.
const FIELDS: usize = 100;

/// A body taken in: files nobody can see yet, and the text fields of the form.
pub struct Upload {
    /// The volume: the body, or the form's file parts.
    pub volume: Bundle,
    /// File parts that were asked for by name.
    pub others: BTreeMap<&'static str, Bundle>,
    /// Fields of the form that are no files.
    pub fields: Vec<(String, String)>,
}

/// Takes a body in. File parts of a form that bear one of the names `apart` are kept apart
/// from the volume's.
///
/// # Errors
/// 400 empty or malformed, 408 too slow, 413 too large, 415 of another type.
pub async fn receive(app: &App, request: Request, apart: &[&'static str]) -> Answer<Upload> {
    refuse_content_encoding(request.headers())?;
    let media = media_type(request.headers());
    refuse_large(app, &request)?;
    let mut upload = Upload {
        volume: Bundle::new(app).await?,
        others: BTreeMap::new(),
        fields: Vec::new(),
    };
    let guard = Guard::new(app);
    match media.as_deref() {
        Some("multipart/form-data") => {
            receive_form(app, request, guard, apart, &mut upload).await?
        }
        None => receive_raw(request, guard, &mut upload).await?,
        Some(raw) if RAW_TYPES.contains(&raw) => receive_raw(request, guard, &mut upload).await?,
        Some(other) => {
            return Err(unsupported_type(other).fix(format!(
                "Send the file as {} or as multipart/form-data.",
                RAW_TYPES[0]
            )));
        }
    }
    if upload.volume.is_empty() {
        return Err(
            Problem::bad_request("empty-body", "The body holds no volume.")
                .fix("Send the volume as the body: curl --data-binary @volume.nii.gz ..."),
        );
    }
    match upload.others.iter().find(|(_, files)| files.is_empty()) {
        Some((name, _)) => Err(Problem::bad_request(
            "empty-body",
            format!("The part `{name}` is empty."),
        )
        .at(*name)
        .fix("Send the file's content, or leave the part out.")),
        None => Ok(upload),
    }
}

fn refuse_large(app: &App, request: &Request) -> Answer<()> {
    let length = request
        .headers()
        .get(header::CONTENT_LENGTH)
        .and_then(|value| value.to_str().ok()?.parse::<u64>().ok());
    match length {
        Some(length) if length > app.settings.body_limit.0 => Err(too_large(app)),
        _ => Ok(()),
    }
}

fn too_large(app: &App) -> Problem {
    Problem::new(
        StatusCode::PAYLOAD_TOO_LARGE,
        "body-too-large",
        format!("The body is larger than {}.", app.settings.body_limit),
    )
    .fix("Send a smaller or compressed file, or have the operator raise `body_limit`.")
}

async fn receive_raw(request: Request, guard: Guard, upload: &mut Upload) -> Answer<()> {
    let pieces = guard
        .watch(request.into_body())
        .inspect_ok(|_| guard.seen());
    upload.volume.write(pieces, || guard.reason()).await?;
    Ok(())
}

async fn receive_form(
    app: &App,
    request: Request,
    guard: Guard,
    apart: &[&'static str],
    upload: &mut Upload,
) -> Answer<()> {
    let mut files = 0;
    let (parts, body) = request.into_parts();
    let body = Body::from_stream(guard.watch(body));
    let malformed = |guard: &Guard, what: String| {
        match guard.recorded() {
        Some(problem) => problem,
        None => Problem::bad_request("malformed-form", format!("The form cannot be read: {what}."))
            .fix("Send multipart/form-data with the volume as a file part: curl -F file=@volume.nii.gz ..."),
    }
    };
    let mut form = Multipart::from_request(Request::from_parts(parts, body), app)
        .await
        .map_err(|e| malformed(&guard, e.body_text()))?;
    loop {
        let field = form
            .next_field()
            .await
            .map_err(|e| malformed(&guard, e.body_text()))?;
        let Some(field) = field else { return Ok(()) };
        guard.seen();
        let name = field.name().unwrap_or_default().to_owned();
        if field.file_name().is_none() && field.content_type().is_none() {
            let text = text_field(field, &guard).await.ok_or_else(|| {
                malformed(
                    &guard,
                    format!("the field `{}` is too long or no text", shorten(&name)),
                )
            })?;
            upload.fields.push((name, text));
            if upload.fields.len() > FIELDS {
                return Err(malformed(&guard, format!("more than {FIELDS} fields")));
            }
            continue;
        }
        files += 1;
        if files > app.settings.parts_limit {
            return Err(Problem::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "too-many-parts",
                format!("The form has more than {} files.", app.settings.parts_limit),
            )
            .fix("Send one volume at a time."));
        }
        let given = field.file_name().unwrap_or_default().to_ascii_lowercase();
        let stream = field.inspect_ok(|_| guard.seen());
        let broken = || malformed(&guard, "a part breaks off".into());
        let bundle = upload.bundle(app, apart, &name).await?;
        bundle.write(stream, broken).await?.known_as(&given);
    }
}

impl Upload {
    /// Where the file parts of that name belong.
    async fn bundle(
        &mut self,
        app: &App,
        apart: &[&'static str],
        name: &str,
    ) -> Answer<&mut Bundle> {
        let Some(own) = apart.iter().find(|own| **own == name) else {
            return Ok(&mut self.volume);
        };
        match self.others.entry(own) {
            Entry::Occupied(bundle) => Ok(bundle.into_mut()),
            Entry::Vacant(place) => Ok(place.insert(Bundle::new(app).await?)),
        }
    }
}

async fn text_field(
    mut field: axum::extract::multipart::Field<'_>,
    guard: &Guard,
) -> Option<String> {
    let mut bytes = Vec::new();
    while let Some(piece) = field.chunk().await.ok()? {
        guard.seen();
        bytes.extend_from_slice(&piece);
        if bytes.len() > FIELD_BYTES {
            return None;
        }
    }
    String::from_utf8(bytes).ok()
}
