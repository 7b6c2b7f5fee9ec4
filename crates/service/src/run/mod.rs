//! From settings and stores to a running service, and the tasks beside requests.

pub mod background;
pub mod start;
