//! The work of the ventriform service, whoever asks for it: volumes are stored, jobs are filed and computed, results
//! are delivered.
//!
//! In: [`config::Settings`], the [`stores::Stores`], a [`work::Engine`]. Out: a running [`service::Service`], one
//! method for each use case. Quotas and limits are checked inside; a [`error::ServiceError`] says whether trying again
//! helps.
//!
//! It knows no HTTP interface and no database: the crate `ventriform-http` answers requests with it, `ventriform-store`
//! implements the traits of [`records`], `ventriform-http-client` those of [`http_client`].

pub mod access;
pub mod archive;
pub mod background;
pub mod client;
pub mod config;
pub mod decoding;
pub mod dicom_tags;
pub mod erasures;
pub mod error;
pub mod filing;
pub mod hooks;
pub mod http_client;
pub mod intake;
pub mod items;
pub mod jobs;
pub mod library;
pub mod memory;
mod pairs;
pub mod pem;
pub mod places;
mod procedures;
pub mod quotas;
pub mod records;
mod reservations;
mod rules;
mod scans;
pub mod series;
pub mod service;
pub mod start;
pub mod stores;
pub mod telemetry;
pub mod uploads;
pub mod work;
pub mod worklist;
