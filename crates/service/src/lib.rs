//! The work of the ventriform service, whoever asks for it: volumes are stored, jobs are filed and computed, results
//! are delivered.
//!
//! In: [`config::Settings`], the [`config::stores::Stores`], a [`work::Engine`]. Out: a running [`use_cases::service::Service`], one
//! method for each use case. Quotas and limits are checked inside; a [`base::error::ServiceError`] says whether trying again
//! helps.
//!
//! It knows no HTTP interface and no database: the crate `ventriform-http` answers requests with it, `ventriform-store`
//! implements the traits of [`base::records`], `ventriform-http-client` those of [`base::http_client`].

pub mod base;
pub mod callers;
pub mod config;
pub mod items;
pub mod jobs;
pub mod limits;
pub mod network;
pub mod run;
pub mod telemetry;
pub mod use_cases;
pub mod work;
