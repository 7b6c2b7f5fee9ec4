//! Tests of the service over HTTP, one file per resource, in one binary.
//!
//! Most tests replace the computation by a fake that returns a sphere at once, or behaves as the
//! first word of the uploaded volume says. They test the service, not the geometry.

#![allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]

mod header_text;
mod helpers;

mod archives;
mod beats;
mod blobs;
#[cfg(target_os = "linux")]
mod bombs;
mod canary;
mod command;
mod comparisons;
mod config;
mod contract;
mod dicom;
mod dicom_flags;
mod doctor;
mod documents;
mod durability;
mod end_to_end;
mod events;
mod fake_archive;
mod faults;
mod gated;
mod hostile;
mod intake;
#[cfg(target_os = "linux")]
mod isolation;
mod items;
mod jobs;
mod limits;
mod losses;
mod meshes;
mod migrate;
mod models;
mod monitoring;
mod named;
mod on_postgres;
mod openapi;
mod operations;
mod postgres;
mod proxies;
mod quotas;
mod readers;
mod readings;
mod receiver;
mod records;
mod refused;
mod replicas;
mod s3;
mod s3_server;
mod scan_erasures;
mod scan_search;
mod scans;
mod scu;
mod security;
mod segmentations;
mod serials;
mod shutdown;
mod storage;
mod stores_found;
mod tenants;
mod tls;
mod traces;
mod upgrades;
mod volumes;
mod webhooks;
mod workitems;
