//! What is asked of the service: one method of [`service::Service`] for each use case.

pub mod erasures;
pub mod filing;
pub mod library;
mod pairs;
pub(crate) mod procedures;
mod rules;
mod scans;
pub mod series;
pub mod service;
pub mod uploads;
