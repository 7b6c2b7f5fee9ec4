//! `/openapi.json`: serialised and compressed once, with validators. For clients who reach the service under a
//! path, `servers` names it: made when it is first asked for, and kept for the last path.

use crate::wire::public_base::PublicBase;
use crate::wire::validators::matches_any;
use axum::body::Bytes;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use flate2::{Compression, write::GzEncoder};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::io::Write;
use std::sync::{Arc, Mutex, PoisonError};
use ventriform_service::base::records::hex;

/// Another version of the program may publish another document.
const CACHE_CONTROL: HeaderValue = HeaderValue::from_static("public, max-age=300");

/// A JSON document that stays the same while the program runs.
#[derive(Clone)]
pub struct PublishedDocument {
    plain: Variant,
    gzip: Variant,
}

/// A prefix, and the document for those who reach the service under it.
type Prefixed = (String, Arc<PublishedDocument>);

/// The document, also for those who reach the service under a path.
#[derive(Clone)]
pub struct PublishedDocuments {
    document: Arc<Value>,
    plain: Arc<PublishedDocument>,
    prefixed: Arc<Mutex<Option<Prefixed>>>,
}

impl PublishedDocuments {
    /// Of this document.
    pub fn new(document: Value) -> Self {
        Self {
            plain: Arc::new(PublishedDocument::new(&document)),
            document: Arc::new(document),
            prefixed: Arc::default(),
        }
    }

    /// The document for the client of the current request, or 304 if the client has it.
    pub fn answer(&self, request: &HeaderMap) -> Response {
        let base = PublicBase::current();
        let prefix = base.as_ref().map_or("", |base| base.prefix());
        if prefix.is_empty() {
            return self.plain.answer(request);
        }
        self.with_prefix(prefix).answer(request)
    }

    fn with_prefix(&self, prefix: &str) -> Arc<PublishedDocument> {
        // A panic cannot leave the pair half changed: it is one assignment.
        let mut kept = self.prefixed.lock().unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some((path, document)) if path == prefix => document.clone(),
            _ => {
                let mut document = (*self.document).clone();
                document["servers"] = json!([{ "url": prefix }]);
                let document = Arc::new(PublishedDocument::new(&document));
                *kept = Some((prefix.to_owned(), document.clone()));
                document
            }
        }
    }
}

/// The document in one encoding.
#[derive(Clone)]
struct Variant {
    bytes: Bytes,
    etag: String,
    encoding: Option<HeaderValue>,
}

impl Variant {
    fn new(bytes: Vec<u8>, encoding: Option<&'static str>) -> Self {
        Self {
            etag: format!("\"{}\"", hex(&Sha256::digest(&bytes))),
            bytes: bytes.into(),
            encoding: encoding.map(HeaderValue::from_static),
        }
    }
}

impl PublishedDocument {
    /// Serialises and compresses `document`.
    ///
    /// # Panics
    /// Never: writing into memory does not fail.
    pub fn new(document: &serde_json::Value) -> Self {
        let plain = document.to_string().into_bytes();
        let mut gzip = GzEncoder::new(Vec::new(), Compression::best());
        let packed = gzip.write_all(&plain).and_then(|()| gzip.finish());
        Self {
            plain: Variant::new(plain, None),
            gzip: Variant::new(packed.expect("memory takes all"), Some("gzip")),
        }
    }

    /// The document, or 304 if the client has it.
    pub fn answer(&self, request: &HeaderMap) -> Response {
        let variant = if takes_gzip(request) {
            &self.gzip
        } else {
            &self.plain
        };
        let known = matches_any(request, &header::IF_NONE_MATCH, &variant.etag);
        let mut response = if known {
            StatusCode::NOT_MODIFIED.into_response()
        } else {
            let json = HeaderValue::from_static("application/json");
            let mut response = variant.bytes.clone().into_response();
            response.headers_mut().insert(header::CONTENT_TYPE, json);
            if let Some(encoding) = &variant.encoding {
                let encoding = encoding.clone();
                response
                    .headers_mut()
                    .insert(header::CONTENT_ENCODING, encoding);
            }
            response
        };
        let headers = response.headers_mut();
        headers.insert(header::CACHE_CONTROL, CACHE_CONTROL);
        headers.insert(header::VARY, HeaderValue::from_static("accept-encoding"));
        if let Ok(etag) = HeaderValue::from_str(&variant.etag) {
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
