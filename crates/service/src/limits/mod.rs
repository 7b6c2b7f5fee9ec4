//! What tenants and clients may hold: quotas, places in turn, memory for decoding outside of jobs.

pub mod decoding;
pub mod places;
pub mod quotas;
mod reservations;
