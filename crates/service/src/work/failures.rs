//! Why jobs and requests of the works end: the domain's errors, as [`ventriform::runs::advice`] explains them, and what only
//! a service meets.

use super::page::PageError;
use crate::base::records::{Failure, Fault};
use crate::jobs::WorkError;
use std::error::Error;
use std::fmt::Display;
use ventriform::heart::model::Organ;
use ventriform::results::export::dicom::{DicomError, StatedIdentity};
use ventriform::runs::advice::{Explain, UNSUITABLE_MODEL, failure, sentence};
use ventriform::runs::segmentation::SegmentationFilesError;

/// The failure of a job that met `error`.
pub(super) fn work_error(error: &impl Explain) -> WorkError {
    if error.is_cancelled() {
        WorkError::Cancelled
    } else {
        WorkError::Failed(error.explain())
    }
}

impl Explain for PageError {
    fn explain(&self) -> Failure {
        failure(
            (Fault::Service, "unreadable"),
            self,
            None,
            "Use report.json, which contains the same figures.".into(),
        )
    }
}

/// A mesh that no file format can represent, or not one of them.
pub(super) fn not_exportable(error: &dyn Error) -> Failure {
    Failure::new(Fault::Content, "not-exportable", sentence(error))
}

/// Why a result's files are not written.
pub(super) fn unwritten(error: SegmentationFilesError) -> WorkError {
    match error {
        SegmentationFilesError::Cancelled(cancelled) => cancelled.into(),
        error => WorkError::Failed(not_exportable(&error)),
    }
}

/// A stored result whose files do not fit together, or cannot be read.
pub(super) fn broken_result(error: &dyn Display) -> Failure {
    Failure::new(
        Fault::Service,
        "unreadable",
        format!("The stored result cannot be used: {error}."),
    )
    .fix("Start the same job again, which stores the result anew.")
}

/// Nobody knows of which patient and study the volume with that id is.
pub(super) fn identity_needed(error: &DicomError, volume: &str) -> Failure {
    let path = format!("/v1/volumes/{volume}/identity");
    error.explain().fix(format!(
        "DICOM objects belong to a patient and a study: state both by PUT {path} with \
         `patient_id` and `study_uid`, or upload the scan as the DICOM file that it came from."
    ))
}

/// A statement about a scan has a field that is not known.
pub(super) fn unknown_identity(name: &str) -> Failure {
    let name: String = name.chars().take(80).collect();
    let known = StatedIdentity::FIELD_NAMES.join(", ");
    Failure::new(
        Fault::Request,
        "invalid-field",
        format!("There is no field `{name}`."),
    )
    .at(&name)
    .fix(format!("Give one of {known}."))
}

/// A statement about a scan has a field that is no text.
pub(super) fn malformed_identity(name: &str) -> Failure {
    let detail = format!("`{name}` must be a string.");
    Failure::new(Fault::Request, "invalid-field", detail)
        .at(name)
        .fix("Give a JSON string.")
}

/// A template that cannot be written in every format.
pub(super) fn unsuitable_mesh(error: &dyn Error) -> Failure {
    failure(
        UNSUITABLE_MODEL,
        error,
        None,
        "Give a mesh without coincident vertices.".into(),
    )
}

/// A word that names no organ.
pub(super) fn unknown_organ(organ: &str) -> Failure {
    let words = Organ::ALL.map(Organ::as_str).join(", ");
    Failure::new(
        Fault::Request,
        "invalid-parameter",
        format!("There is no organ `{organ}`."),
    )
    .at("organ")
    .fix(format!("Give one of {words}."))
}

/// A model that was chosen for a segmentation and has no mesh.
pub(super) fn mesh_missing(id: &str) -> Failure {
    Failure::new(
        Fault::Request,
        "invalid-field",
        format!("The model `{id}` has no mesh any more."),
    )
    .at("model")
    .fix("Choose another model; GET /v1/models and /v1/templates list them.")
}

/// A reader's profile that was chosen for a segmentation and has no file any more.
pub(super) fn profile_missing(id: &str) -> Failure {
    Failure::new(
        Fault::Request,
        "invalid-field",
        format!("The reader `{id}` has no profile any more."),
    )
    .at("reader")
    .fix("Choose another reader; GET /v1/readers lists them.")
}

/// Normal limits that were chosen for a job and have no file any more.
pub(super) fn normals_missing(id: &str) -> Failure {
    Failure::new(
        Fault::Request,
        "invalid-field",
        format!("The normal limits `{id}` have no file any more."),
    )
    .at("normals")
    .fix("Choose other limits; GET /v1/normals lists them.")
}

/// A volume that a job needs beside its own and that is not there any more.
pub(super) fn volume_missing(field: &str) -> Failure {
    Failure::new(
        Fault::Request,
        "invalid-field",
        "The volume does not exist any more.",
    )
    .at(field)
    .fix("Upload the volume again, then start the job again.")
}

/// A stored model whose file cannot be read.
pub(super) fn unreadable_model(error: &std::io::Error) -> Failure {
    Failure::new(
        Fault::Service,
        "unreadable",
        format!("A stored model cannot be read: {error}."),
    )
}
