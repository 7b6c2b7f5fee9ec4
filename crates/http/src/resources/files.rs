//! Downloads: immutable files with strong validators, whole or in part (RFC 9110, sections 13 and
//! 14).

use crate::app::App;
use crate::wire::links::path_of;
use crate::wire::memory::charge;
use crate::wire::problem::{Answer, Problem};
use crate::wire::validators::not_modified;
use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::IntoResponse;
use sha2::{Digest, Sha256};
use std::ops::Range;
use ventriform_service::base::records::{FileRecord, Product, ProductFile, hex};
use ventriform_service::items::OutputFile;

/// The report as an HTML page. It is made on request, of the other files.
pub const REPORT_PAGE: &str = "report.html";

/// Results never change; only the client that asked may cache them.
const CACHE_CONTROL: &str = "private, max-age=31536000, immutable";

/// Of pages and objects: whose scan it is may be stated otherwise, or erased, and not every key sees it.
const OBJECT_CACHE_CONTROL: &str = "private, no-cache";

/// Of files made of results: another version of the program may make them otherwise.
const DERIVED_CACHE_CONTROL: &str = "private, max-age=86400";

/// Memory of a download: a slow client has one portion waiting and one on its way.
const SENT_MEMORY: u64 = 512 << 10;

/// A file to be sent.
pub struct Download<'a> {
    /// The id of its item.
    pub id: &'a str,
    /// Its name, length and SHA-256.
    pub record: FileRecord,
    /// Its own path.
    pub path: String,
    /// Its media type.
    pub media_type: &'a str,
    /// Whether a browser saves it instead of showing it.
    pub attached: bool,
}

impl<'a> Download<'a> {
    fn new(product: &'a Product, file: &'a ProductFile) -> Self {
        Self {
            id: &product.id,
            record: file.record(),
            path: path(product, file),
            media_type: &file.media_type,
            attached: false,
        }
    }
}

/// Answers with a product's file, or the part of it that `Range` asks for, or 304.
pub async fn send(app: &App, product: &Product, file: &ProductFile, headers: &HeaderMap) -> Answer {
    send_file(app, &Download::new(product, file), headers).await
}

/// Answers with a stored file, or the part of it that `Range` asks for, or 304.
pub async fn send_file(app: &App, file: &Download<'_>, headers: &HeaderMap) -> Answer {
    let read = async |span: Range<u64>| {
        charge(SENT_MEMORY.min(span.end - span.start)).await?;
        let content = app
            .service
            .items()
            .read(file.id, &file.record, span)
            .await?;
        Ok(Body::from_stream(content))
    };
    respond(file, headers, CACHE_CONTROL, read).await
}

/// Answers with the page of a product in the same way.
pub async fn send_page(product: &Product, page: String, headers: &HeaderMap) -> Answer {
    let file = OutputFile {
        name: REPORT_PAGE.into(),
        media_type: "text/html; charset=utf-8".into(),
        bytes: page.into_bytes(),
    };
    send_made(product, file, OBJECT_CACHE_CONTROL, false, headers).await
}

/// Answers with a file that is made of a product's files in the same way.
pub async fn send_derived(product: &Product, file: OutputFile, headers: &HeaderMap) -> Answer {
    send_made(product, file, DERIVED_CACHE_CONTROL, false, headers).await
}

/// Answers with a DICOM object of a product in the same way.
pub async fn send_object(product: &Product, object: OutputFile, headers: &HeaderMap) -> Answer {
    send_made(product, object, OBJECT_CACHE_CONTROL, true, headers).await
}

async fn send_made(
    product: &Product,
    made: OutputFile,
    cache_control: &str,
    attached: bool,
    headers: &HeaderMap,
) -> Answer {
    let content = Bytes::from(made.bytes);
    let file = ProductFile {
        name: made.name,
        media_type: made.media_type.into_owned(),
        bytes: content.len() as u64,
        sha256: hex(&Sha256::digest(&content)),
        place: None,
    };
    // The range lies within the content, whose length is a `usize`.
    let read =
        async |span: Range<u64>| Ok(content.slice(span.start as usize..span.end as usize).into());
    let download = Download {
        attached,
        ..Download::new(product, &file)
    };
    respond(&download, headers, cache_control, read).await
}

/// Answers with the range of `file` that `read` returns.
async fn respond(
    file: &Download<'_>,
    headers: &HeaderMap,
    cache_control: &str,
    read: impl AsyncFnOnce(Range<u64>) -> Answer<Body>,
) -> Answer {
    let etag = format!("\"{}\"", file.record.sha256);
    if let Some(unchanged) = not_modified(headers, &etag, cache_control) {
        return Ok(unchanged);
    }
    let range = wanted_range(headers, &etag, file.record.bytes)?;
    let (status, span) = match &range {
        Some(range) => (StatusCode::PARTIAL_CONTENT, range.clone()),
        None => (StatusCode::OK, 0..file.record.bytes),
    };
    let length = span.end - span.start;
    let disposition = if file.attached {
        "attachment"
    } else {
        "inline"
    };
    let content = read(span.clone()).await?;
    let mut response = (
        status,
        [
            (header::CONTENT_TYPE, file.media_type.to_owned()),
            (header::CONTENT_LENGTH, length.to_string()),
            (header::ETAG, etag),
            (header::CACHE_CONTROL, cache_control.into()),
            (header::ACCEPT_RANGES, "bytes".into()),
            (header::CONTENT_LOCATION, file.path.clone()),
            (
                header::CONTENT_DISPOSITION,
                format!(
                    "{disposition}; filename=\"{}-{}\"",
                    file.id, file.record.name
                ),
            ),
        ],
        content,
    )
        .into_response();
    if range.is_some()
        && let Ok(value) = HeaderValue::from_str(&format!(
            "bytes {}-{}/{}",
            span.start,
            span.end - 1,
            file.record.bytes
        ))
    {
        response.headers_mut().insert(header::CONTENT_RANGE, value);
    }
    Ok(response)
}

/// The path of a product's file.
pub fn path(product: &Product, file: &ProductFile) -> String {
    format!("{}/{}", path_of(&product.id), file.name)
}

/// The bytes that `Range` asks for, end exclusive. `None` is the whole file: RFC 9110 lets a
/// server ignore several ranges and other units, and demands it if `If-Range` names another
/// version.
fn wanted_range(headers: &HeaderMap, etag: &str, length: u64) -> Answer<Option<Range<u64>>> {
    let text = |name: HeaderName| headers.get(name).and_then(|value| value.to_str().ok());
    let Some(spec) = text(header::RANGE).and_then(|range| range.strip_prefix("bytes=")) else {
        return Ok(None);
    };
    if text(header::IF_RANGE).is_some_and(|tag| tag != etag) {
        return Ok(None);
    }
    match parse_range(spec.trim(), length) {
        ParsedRange::Whole => Ok(None),
        ParsedRange::Part(range) => Ok(Some(range)),
        ParsedRange::Outside => Err(Problem::new(
            StatusCode::RANGE_NOT_SATISFIABLE,
            "range-not-satisfiable",
            format!("The range begins after the end of the file, which has {length} bytes."),
        )
        .at("Range")
        .fix("Ask for a range within the file.")
        .header(header::CONTENT_RANGE, format!("bytes */{length}"))),
    }
}

#[derive(Debug, PartialEq)]
enum ParsedRange {
    Whole,
    Part(Range<u64>),
    Outside,
}

/// Our own, as `headers::Range` (0.4.2) drops a suffix that is longer than the file, which stands
/// for the whole file, and does not tell a range outside of the file from one it cannot read.
fn parse_range(spec: &str, length: u64) -> ParsedRange {
    let Some((first, last)) = spec.split_once('-') else {
        return ParsedRange::Whole;
    };
    match (first.parse::<u64>(), last.parse::<u64>()) {
        (Ok(first), Ok(last)) if first <= last && first < length => {
            ParsedRange::Part(first..length.min(last.saturating_add(1)))
        }
        (Ok(first), Err(_)) if last.is_empty() && first < length => {
            ParsedRange::Part(first..length)
        }
        (Err(_), Ok(count)) if first.is_empty() && count > 0 && length > 0 => {
            ParsedRange::Part(length.saturating_sub(count)..length)
        }
        (Ok(first), Ok(last)) if first > last => ParsedRange::Whole,
        (Ok(_), Ok(_)) => ParsedRange::Outside,
        (Ok(_), Err(_)) if last.is_empty() => ParsedRange::Outside,
        (Err(_), Ok(_)) if first.is_empty() => ParsedRange::Outside,
        _ => ParsedRange::Whole,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_as_rfc_9110_writes_them() {
        for (spec, parsed) in [
            ("0-99", ParsedRange::Part(0..100)),
            ("90-1000", ParsedRange::Part(90..100)),
            ("50-", ParsedRange::Part(50..100)),
            ("-10", ParsedRange::Part(90..100)),
            ("-1000", ParsedRange::Part(0..100)),
            ("0-0", ParsedRange::Part(0..1)),
            ("100-", ParsedRange::Outside),
            ("100-200", ParsedRange::Outside),
            ("-0", ParsedRange::Outside),
            ("5-4", ParsedRange::Whole),
            ("0-1,5-6", ParsedRange::Whole),
            ("x-y", ParsedRange::Whole),
            ("", ParsedRange::Whole),
        ] {
            assert_eq!(parse_range(spec, 100), parsed, "{spec}");
        }
    }
}
