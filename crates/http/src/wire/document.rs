//! `/openapi.json`: serialised and compressed once, with validators. For clients who reach the service under a
//! path, `servers` names it: made when it is first asked for, and kept for the last path.

use crate::wire::packed::PackedFile;
use crate::wire::public_base::PublicBase;
use axum::http::HeaderMap;
use axum::response::Response;
use serde_json::{Value, json};
use std::sync::{Arc, Mutex, PoisonError};

/// Another version of the program may publish another document.
const CACHE_CONTROL: &str = "public, max-age=300";

/// A prefix, and the document for those who reach the service under it.
type Prefixed = (String, Arc<PackedFile>);

/// The document, also for those who reach the service under a path.
#[derive(Clone)]
pub struct PublishedDocuments {
    document: Arc<Value>,
    plain: Arc<PackedFile>,
    prefixed: Arc<Mutex<Option<Prefixed>>>,
}

impl PublishedDocuments {
    /// Of this document.
    pub fn new(document: Value) -> Self {
        Self {
            plain: Arc::new(packed(&document)),
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

    fn with_prefix(&self, prefix: &str) -> Arc<PackedFile> {
        // A panic cannot leave the pair half changed: it is one assignment.
        let mut kept = self.prefixed.lock().unwrap_or_else(PoisonError::into_inner);
        match &*kept {
            Some((path, document)) if path == prefix => document.clone(),
            _ => {
                let mut document = (*self.document).clone();
                document["servers"] = json!([{ "url": prefix }]);
                let document = Arc::new(packed(&document));
                *kept = Some((prefix.to_owned(), document.clone()));
                document
            }
        }
    }
}

/// The document as it is served.
fn packed(document: &Value) -> PackedFile {
    PackedFile::new(document.to_string(), "application/json", CACHE_CONTROL)
}
