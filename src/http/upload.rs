//! From a request's body to files: streamed, hashed and limited on the way.

use super::app::App;
use super::problem::{Answer, Problem, shorten};
use super::request::{media_type, refuse_content_encoding};
use crate::jobs::{Staged, VOLUME, Volume};
use axum::body::{Body, Bytes};
use axum::extract::{FromRequest, Multipart, Request};
use axum::http::{StatusCode, header};
use futures::{Stream, StreamExt, TryStreamExt};
use sha2::{Digest, Sha256};
use std::path::Path;
use std::sync::{Arc, Mutex, PoisonError};
use tokio::io::AsyncWriteExt;
use tokio::time::{Instant, timeout, timeout_at};

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

/// Bytes gathered before one write.
const WRITE_BYTES: usize = 1 << 20;
/// Longest text field of a form.
const FIELD_BYTES: usize = 4096;
/// Most text fields of a form.
const FIELDS: usize = 100;
/// Most bytes of a multipart body between two pieces of content: headers and boundaries.
const UNSEEN_BYTES: usize = 256 << 10;

/// A body taken in: files nobody can see yet, and the text fields of the form.
pub struct Upload {
    staged: Staged,
    files: Vec<Received>,
    /// Fields of the form that are no files.
    pub fields: Vec<(String, String)>,
}

/// One file.
struct Received {
    name: String,
    kind: &'static str,
    digest: [u8; 32],
    bytes: u64,
}

/// Takes a body in.
///
/// # Errors
/// 400 empty or malformed, 408 too slow, 413 too large, 415 of another type.
pub async fn receive(app: &App, request: Request) -> Answer<Upload> {
    refuse_content_encoding(request.headers())?;
    let media = media_type(request.headers());
    refuse_large(app, &request)?;
    let mut upload = Upload {
        staged: app.queue.blobs.stage().await?,
        files: Vec::new(),
        fields: Vec::new(),
    };
    let guard = Guard::new(app);
    match media.as_deref() {
        Some("multipart/form-data") => receive_form(app, request, guard, &mut upload).await?,
        None => receive_raw(request, guard, &mut upload).await?,
        Some(raw) if RAW_TYPES.contains(&raw) => receive_raw(request, guard, &mut upload).await?,
        Some(other) => {
            return Err(Problem::new(
                StatusCode::UNSUPPORTED_MEDIA_TYPE,
                "unsupported-media-type",
                format!(
                    "A body of type `{}` is not understood here.",
                    shorten(other)
                ),
            )
            .at("Content-Type")
            .fix(format!(
                "Send the file as {} or as multipart/form-data.",
                RAW_TYPES[0]
            )));
        }
    }
    match upload.files.iter().map(|f| f.bytes).sum() {
        0u64 => Err(
            Problem::bad_request("empty-body", "The body holds no file.")
                .fix("Send the volume as the body: curl --data-binary @volume.nii.gz ..."),
        ),
        _ => Ok(upload),
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
    let file = write(pieces, upload.staged.folder(), "0", || guard.reason()).await?;
    upload.files.push(file);
    Ok(())
}

async fn receive_form(
    app: &App,
    request: Request,
    guard: Guard,
    upload: &mut Upload,
) -> Answer<()> {
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
        if upload.files.len() == app.settings.parts_limit {
            return Err(Problem::new(
                StatusCode::PAYLOAD_TOO_LARGE,
                "too-many-parts",
                format!("The form has more than {} files.", app.settings.parts_limit),
            )
            .fix("Send one volume at a time."));
        }
        let given = field.file_name().unwrap_or_default().to_ascii_lowercase();
        let stream = field.inspect_ok(|_| guard.seen());
        let number = upload.files.len().to_string();
        let mut file = write(stream, upload.staged.folder(), &number, || {
            malformed(&guard, "a part breaks off".into())
        })
        .await?;
        file.kind = kind_by_name(&given).unwrap_or(file.kind);
        upload.files.push(file);
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

/// Writes a stream to a file, hashing it. Forced to the disk when it is published.
async fn write<E>(
    mut pieces: impl Stream<Item = Result<Bytes, E>> + Unpin,
    folder: &Path,
    name: &str,
    broken: impl FnOnce() -> Problem,
) -> Answer<Received> {
    let mut file = tokio::fs::File::create(folder.join(name))
        .await
        .map_err(Problem::internal)?;
    let mut hash = Sha256::new();
    let mut waiting = Vec::with_capacity(64 << 10);
    let mut head = Vec::new();
    let mut bytes = 0;
    loop {
        let piece = match pieces.next().await {
            Some(Ok(piece)) => piece,
            Some(Err(_)) => return Err(broken()),
            None => break,
        };
        hash.update(&piece);
        bytes += piece.len() as u64;
        if head.len() < 132 {
            head.extend_from_slice(&piece[..piece.len().min(132 - head.len())]);
        }
        waiting.extend_from_slice(&piece);
        if waiting.len() >= WRITE_BYTES {
            file.write_all(&waiting).await.map_err(Problem::internal)?;
            waiting.clear();
        }
    }
    file.write_all(&waiting).await.map_err(Problem::internal)?;
    file.flush().await.map_err(Problem::internal)?;
    Ok(Received {
        name: name.to_owned(),
        kind: kind_by_content(&head),
        digest: hash.finalize().into(),
        bytes,
    })
}

/// The extension that the first bytes speak for.
fn kind_by_content(head: &[u8]) -> &'static str {
    match head {
        [0x1f, 0x8b, ..] => "nii.gz",
        _ if head.get(128..132) == Some(b"DICM") => "dcm",
        _ => "nii",
    }
}

/// The two extensions that only a name can tell apart.
fn kind_by_name(name: &str) -> Option<&'static str> {
    ["hdr.gz", "img.gz", "hdr", "img"]
        .into_iter()
        .find(|kind| name.ends_with(&format!(".{kind}")))
}

impl Upload {
    /// Reads the volume and stores it. Tells whether it is new.
    ///
    /// # Errors
    /// 413 or 422 if the files are no volume that can be used.
    pub async fn store(mut self, app: &App) -> Answer<(Volume, bool)> {
        // The order of parts carries no meaning, so it must not change the id.
        self.files
            .sort_by(|a, b| (a.kind, a.digest).cmp(&(b.kind, b.digest)));
        let id = self.volume_id();
        if let Some(known) = app.queue.catalogue.volume(&id).await? {
            return Ok((known, false));
        }
        let names = self.name_files().await.map_err(Problem::internal)?;
        let paths: Vec<_> = names.iter().map(|n| self.staged.folder().join(n)).collect();
        let facts = {
            let _permit = app.inspections.acquire().await.map_err(Problem::internal)?;
            let reader = app.engine.reader.clone();
            tokio::task::spawn_blocking(move || reader.inspect(&paths))
                .await
                .map_err(Problem::internal)??
        };
        let volume = Volume {
            sequence: 0,
            created_at: app.queue.clock.now(),
            bytes: self.files.iter().map(|f| f.bytes).sum(),
            files: names,
            facts,
            id: id.clone(),
        };
        let _shelving = app.queue.shelving.lock().await;
        app.queue.blobs.publish(&id, self.staged).await?;
        let new = app.queue.catalogue.add_volume(&volume).await?;
        let stored = app.queue.catalogue.volume(&id).await?;
        Ok((stored.unwrap_or(volume), new))
    }

    /// One file: its SHA-256, as `sha256sum` shows it, cut to 32 digits. Several: the same of
    /// the list of kinds and hashes.
    fn volume_id(&self) -> String {
        if let [file] = &self.files[..] {
            return format!("{VOLUME}{}", hex(&file.digest[..16]));
        }
        let mut hash = Sha256::new();
        for file in &self.files {
            hash.update(format!("{}:{}\n", file.kind, hex(&file.digest)));
        }
        format!("{VOLUME}{}", hex(&hash.finalize()[..16]))
    }

    /// Gives the files the names they keep: `volume.hdr` and `volume.img` for a pair, else
    /// numbers with the extension that the content speaks for.
    async fn name_files(&self) -> std::io::Result<Vec<String>> {
        let pair = self.files.len() == 2
            && self.files[0].kind.starts_with("hdr")
            && self.files[1].kind.starts_with("img");
        let mut names = Vec::new();
        for (number, file) in self.files.iter().enumerate() {
            let name = match (pair, self.files.len()) {
                (true, _) | (_, 1) => format!("volume.{}", file.kind),
                _ => format!("{number:04}.{}", file.kind),
            };
            let folder = self.staged.folder();
            tokio::fs::rename(folder.join(&file.name), folder.join(&name)).await?;
            names.push(name);
        }
        Ok(names)
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Watches a body: its size, its pauses, its whole time. Says why it was cut.
#[derive(Clone)]
struct Guard {
    app: App,
    state: Arc<Mutex<GuardState>>,
}

#[derive(Default)]
struct GuardState {
    total: u64,
    unseen: usize,
    problem: Option<Problem>,
}

impl Guard {
    fn new(app: &App) -> Self {
        Self {
            app: app.clone(),
            state: Arc::default(),
        }
    }

    /// The body's pieces, until a limit is met.
    fn watch(
        &self,
        body: Body,
    ) -> impl Stream<Item = Result<Bytes, CutShort>> + Unpin + Send + use<> {
        let guard = self.clone();
        let deadline = Instant::now() + self.app.settings.upload_time_limit.0;
        let pieces = body.into_data_stream();
        Box::pin(futures::stream::unfold(
            (pieces, guard),
            move |(mut pieces, guard)| async move {
                let pause = guard.app.settings.body_timeout.0;
                let next = timeout_at(deadline, timeout(pause, pieces.next())).await;
                let piece = match next {
                    Ok(Ok(None)) => return None,
                    Ok(Ok(Some(Ok(piece)))) => guard.count(piece),
                    Ok(Ok(Some(Err(error)))) => Err(Problem::bad_request(
                        "broken-body",
                        format!("The body broke off: {error}."),
                    )),
                    _ => Err(Problem::new(
                        StatusCode::REQUEST_TIMEOUT,
                        "body-too-slow",
                        "The body did not arrive in time.",
                    )),
                };
                let piece = piece.map_err(|problem| {
                    guard.lock().problem = Some(problem);
                    CutShort
                });
                Some((piece, (pieces, guard)))
            },
        ))
    }

    fn count(&self, piece: Bytes) -> Answer<Bytes> {
        let mut state = self.lock();
        state.total += piece.len() as u64;
        state.unseen += piece.len();
        if state.total > self.app.settings.body_limit.0 {
            return Err(too_large(&self.app));
        }
        if state.unseen > UNSEEN_BYTES.max(4 * piece.len()) {
            return Err(Problem::bad_request(
                "malformed-form",
                "The form has a header or boundary without end.",
            ));
        }
        Ok(piece)
    }

    /// Content was handed on.
    fn seen(&self) {
        self.lock().unseen = 0;
    }

    fn recorded(&self) -> Option<Problem> {
        self.lock().problem.take()
    }

    fn reason(&self) -> Problem {
        self.recorded()
            .unwrap_or_else(|| Problem::bad_request("broken-body", "The body broke off."))
    }

    fn lock(&self) -> std::sync::MutexGuard<'_, GuardState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A body met a limit; the guard knows which.
#[derive(Debug, thiserror::Error)]
#[error("the body was cut short")]
struct CutShort;
