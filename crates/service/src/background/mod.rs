//! Tasks that run beside requests and jobs for as long as the service lives.

mod upkeep;

pub use upkeep::Upkeep;
