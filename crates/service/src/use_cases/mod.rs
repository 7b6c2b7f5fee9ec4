//! What is asked of the service: one method of [`service::Service`] for each use case.

mod erasures;
pub mod filing;
pub mod keys;
pub mod library;
mod operation;
mod pairs;
pub(crate) mod procedures;
pub mod reading;
pub mod readings;
pub mod results;
mod rules;
mod scans;
pub mod series;
pub mod service;
pub mod uploads;
pub mod volumes;
pub mod webhooks;
pub mod workitems;
