//! Files that stay the same while the program runs: each is kept plain and compressed by gzip, with a validator of
//! each form.
//!
//! A request gets the form that the client can unpack, or 304 if it has that form.

use crate::wire::validators::matches_any;
use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use flate2::{Compression, write::GzEncoder};
use sha2::{Digest, Sha256};
use std::io::Write;
use ventriform_service::base::records::hex;

/// A file that stays the same while the program runs.
#[derive(Clone)]
pub struct PackedFile {
    media_type: HeaderValue,
    cache_control: HeaderValue,
    plain: Form,
    gzip: Form,
}

/// The file in one encoding.
#[derive(Clone)]
struct Form {
    bytes: Bytes,
    etag: String,
}

impl Form {
    fn new(bytes: Bytes) -> Self {
        Self {
            etag: format!("\"{}\"", hex(&Sha256::digest(&bytes))),
            bytes,
        }
    }
}

impl PackedFile {
    /// Compresses `bytes`, which are served as `media_type` and kept by clients as `cache_control` says.
    ///
    /// # Panics
    /// Never: writing into memory does not fail.
    pub fn new(
        bytes: impl Into<Bytes>,
        media_type: &'static str,
        cache_control: &'static str,
    ) -> Self {
        let bytes = bytes.into();
        let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
        let packed = gzip.write_all(&bytes).and_then(|()| gzip.finish());
        Self {
            media_type: HeaderValue::from_static(media_type),
            cache_control: HeaderValue::from_static(cache_control),
            plain: Form::new(bytes),
            gzip: Form::new(packed.expect("memory takes all").into()),
        }
    }

    /// The file, or 304 if the client has it.
    pub fn answer(&self, request: &HeaderMap) -> Response {
        let packed = takes_gzip(request);
        let form = if packed { &self.gzip } else { &self.plain };
        let known = matches_any(request, &header::IF_NONE_MATCH, &form.etag);
        let mut response = if known {
            StatusCode::NOT_MODIFIED.into_response()
        } else {
            form.bytes.clone().into_response()
        };
        let headers = response.headers_mut();
        if !known {
            headers.insert(header::CONTENT_TYPE, self.media_type.clone());
            if packed {
                let gzip = HeaderValue::from_static("gzip");
                headers.insert(header::CONTENT_ENCODING, gzip);
            }
        }
        headers.insert(header::CACHE_CONTROL, self.cache_control.clone());
        headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
        if let Ok(etag) = HeaderValue::from_str(&form.etag) {
            headers.insert(header::ETAG, etag);
        }
        response
    }
}

/// Whether the client named gzip among the encodings it takes (RFC 9110, 12.5.3).
fn takes_gzip(request: &HeaderMap) -> bool {
    let values = request.get_all(header::ACCEPT_ENCODING).iter();
    let codings = values.flat_map(|value| value.to_str().unwrap_or_default().split(','));
    let mut gzip = codings.filter_map(|coding| {
        let (name, weight) = coding.split_once(';').unwrap_or((coding, ""));
        name.trim()
            .eq_ignore_ascii_case("gzip")
            .then(|| weight.trim())
    });
    gzip.next().is_some_and(|weight| {
        let q = weight.strip_prefix("q=").map_or(Ok(1.0), str::parse::<f32>);
        q.is_ok_and(|q| q > 0.0)
    })
}
