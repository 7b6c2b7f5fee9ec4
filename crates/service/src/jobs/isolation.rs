//! The program that computes one job in a process of its own.

use std::ffi::OsString;
use std::path::PathBuf;

/// The command of a process that calls [`serve_isolated`](super::serve_isolated).
#[derive(Debug, Clone)]
pub struct Isolation {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<OsString>,
}
