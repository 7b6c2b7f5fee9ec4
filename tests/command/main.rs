//! The output of the program's commands: files, keys and errors that other programs rely on.

// Helpers of a test state their expectations by panicking, as tests do.
#![allow(clippy::unwrap_used)]

mod beat;
mod compare;
/// Files of scans, which the tests of the service make too.
#[allow(dead_code)]
#[path = "../api/dicom.rs"]
mod dicom;
mod evaluate;
#[path = "../api/gated.rs"]
mod gated;
mod segment;
mod serial;
