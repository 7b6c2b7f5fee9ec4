//! Tasks that run beside requests and jobs for as long as the service lives.

mod exchange;
mod tasks;
mod upkeep;

pub(crate) use tasks::{UPKEEP_EVERY, gatherer, run};
pub use upkeep::Upkeep;
