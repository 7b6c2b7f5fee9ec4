//! The service over HTTP, as its clients meet it.
//!
//! One binary; one file per resource. The work behind most tests is a stand-in that makes a
//! sphere at once, or does what the first word of the volume says, so that these tests are
//! about the service and not about geometry.

#![allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]

mod helpers;

mod config;
mod durability;
mod end_to_end;
mod events;
mod hostile;
mod jobs;
mod models;
mod openapi;
mod operations;
mod segmentations;
mod shutdown;
mod volumes;
