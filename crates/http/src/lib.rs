//! The service over HTTP: version 1 of the API.
//!
//! [`router`] is the map of all paths and the list of the layers that every request passes. There
//! is one file per resource; a handler reads the request, calls a method of
//! [`Service`](ventriform_service::service::Service), and writes the answer. Nothing is computed here.
//!
//! | content | where |
//! |---|---|
//! | the paths, the layers around them | [`router`] |
//! | uploads, jobs, results | [`volumes`], [`volume_download`], [`jobs`], [`models`], [`segmentations`], [`beats`], [`comparisons`], [`normals`], [`templates`], [`readers`] |
//! | webhooks and their deliveries | [`webhooks`], [`webhook_request`] |
//! | common parts of them | [`collection`] (list, show, erase), [`products`] (meshes, reports, files), [`files`] (ranges, validators), [`validators`] (of JSON), [`response_cache`] |
//! | who may do what, and the record of it | [`guard`] (before every handler), [`caller`], [`quota`], [`keys`], [`audit`] |
//! | a tenant's names for its things, legal holds, receipts of erasures | [`tags`], [`legal_hold`], [`erasures`] |
//! | whose scan a volume is | [`scans`] (in answers and searches), [`identities`] (stated, erased) |
//! | objects that other systems send | [`stow`], [`intake_status`] |
//! | work items of other systems (UPS-RS) | [`workitems`] |
//! | errors and their wording | [`problem`]; 404 and 410 in [`problem::not_found`] |
//! | limits on bodies, connections and memory | [`limits`], [`connections`], [`memory`] |
//! | the address that sent a request | [`client`] |
//! | reading requests | [`request`], [`negotiate`], [`pagination`], [`idempotency`], [`upload`] |
//! | log, traces, health | [`observe`], [`health`] |
//! | the published document | [`openapi`], [`document`] |
//! | streams of events | [`streams`] |
//!
//! Guarantees: every error is a problem object (RFC 9457) with a stable `type`, and with `field`
//! and `fix` where they apply; every body and list has a limit; uploads are streamed to the disk
//! and never held in memory. The published document is derived from the handlers.
//!
//! Not guaranteed: that a service is closed. On a loopback address without keys, and with the
//! setting `allow_anonymous`, it admits everybody; see `docs/security.md`.

mod app;
mod audit;
mod beats;
pub mod caller;
mod client;
mod collection;
mod comparisons;
mod connections;
mod cryptography;
mod document;
mod erasures;
mod files;
mod front_page;
mod guard;
mod health;
mod held_body;
mod idempotency;
mod identities;
mod intake_status;
mod jobs;
mod keys;
mod legal_hold;
mod limits;
mod links;
mod memory;
mod models;
mod negotiate;
mod normals;
mod observe;
mod openapi;
mod packed;
mod pagination;
mod problem;
mod products;
mod public_base;
mod query;
mod quota;
mod readers;
mod request;
mod response_cache;
mod router;
mod scan_erasures;
mod scans;
mod segmentations;
mod server;
mod stow;
mod streams;
mod tags;
mod templates;
mod upload;
mod validators;
mod volume_download;
mod volumes;
mod voxels;
mod watch;
mod webhook_request;
mod webhooks;
mod words;
mod workitems;

use serde::Serialize;
use serde_json::Serializer;
use serde_json::ser::PrettyFormatter;

pub use app::App;
pub use connections::tls::TlsError;
pub use cryptography::install_cryptography;
pub use server::{Running, ServeError, start};

/// The OpenAPI document, as committed under `openapi/`: a line for each value, so that changes can be read.
///
/// # Panics
/// Never: writing into memory does not fail.
pub fn document_json() -> String {
    let mut text = Vec::new();
    let indented = PrettyFormatter::with_indent(b" ");
    let mut writer = Serializer::with_formatter(&mut text, indented);
    let written = router::document().serialize(&mut writer);
    written.expect("memory takes all");
    String::from_utf8(text).expect("JSON is UTF-8") + "\n"
}
