//! Tasks that run beside requests and jobs for as long as the service lives.

mod exchange;
mod tasks;
mod time_of_day;
mod upkeep;

pub(crate) use tasks::{UPKEEP_EVERY, gatherer, run};
pub use time_of_day::TimeOfDay;
pub use upkeep::Upkeep;
