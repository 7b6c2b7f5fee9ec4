//! The service over HTTP: version 1 of the API.
//!
//! [`router`] is the map. There is one file per resource; each handler takes a request apart,
//! calls [`crate::jobs`], and puts an answer together. Nothing is computed here.
//!
//! Promised of every answer: an error is `application/problem+json` (RFC 9457) with a stable
//! `type`, and `field` and `fix` where there are such; every body and list has a limit; what
//! a client sends is streamed to the disk, never held in memory. `openapi` derives the
//! published document from the same handlers.

pub mod openapi;
pub mod router;

mod app;
mod events;
mod files;
mod health;
mod idempotency;
mod jobs;
mod models;
mod negotiate;
mod observe;
mod pages;
mod pagination;
mod problem;
mod products;
mod request;
mod segmentations;
mod server;
mod templates;
mod upload;
mod volumes;
mod wire;

pub use app::App;
pub use server::{Running, ServeError, serve, start};
