//! The service over HTTP: version 1 of the API.
//!
//! [`router`] is the map of all paths and the list of the layers that every request passes. There
//! is one file per resource; a handler reads the request, calls a method of
//! [`Service`](ventriform_service::use_cases::service::Service), and writes the answer. Nothing is computed here.
//!
//! | content | where |
//! |---|---|
//! | the paths, the layers around them | [`router`] |
//! | volumes, jobs, results, and what belongs to them: tags, legal holds, receipts of erasures | [`resources`] |
//! | objects and work items of other systems (STOW-RS, UPS-RS) | [`dicomweb`] |
//! | keys, webhooks and their deliveries, the audit trail, readiness | [`admin`] |
//! | what every request passes: connections, who may do what, the log; the page | [`edge`] |
//! | requests read and answers written: queries, lists, problems, validators, events | [`wire`] |
//! | the published document | [`openapi`] |
//!
//! Guarantees: every error is a problem object (RFC 9457) with a stable `type`, and with `field`
//! and `fix` where they apply; every body and list has a limit; uploads are streamed to the disk
//! and never held in memory. The published document is derived from the handlers.
//!
//! Not guaranteed: that a service is closed. On a loopback address without keys, and with the
//! setting `allow_anonymous`, it admits everybody; see `docs/security.md`.

mod admin;
mod app;
mod dicomweb;
pub mod edge;
mod openapi;
mod resources;
mod router;
mod serve;
mod wire;

pub use app::App;
pub use edge::connections::tls::{Tls, TlsError};
pub use edge::cryptography::install_cryptography;
pub use serve::serve;

/// The OpenAPI document, as committed under `openapi/`.
pub fn document_json() -> String {
    openapi::written(&router::document())
}

/// The examples of README.md, compiled as tests.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
