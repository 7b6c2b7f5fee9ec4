//! What the program's commands write and say: files, keys and errors that other programs rely on.

mod beat;
/// Files of scans, which the tests of the service make too.
#[allow(dead_code)]
#[path = "../api/dicom.rs"]
mod dicom;
mod evaluate;
#[path = "../api/gated.rs"]
mod gated;
mod segment;
