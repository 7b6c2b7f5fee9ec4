//! Why there is no evaluation.

use super::cohort::CohortError;
use crate::base::progress::Cancelled;
use crate::heart::deform::DeformError;
use crate::image::volume::VolumeError;
use crate::parameters::ParameterError;
use crate::results::export::ExportError;
use std::io;
use std::path::PathBuf;

/// Why a cohort cannot be evaluated. A single template, patient or fit that fails is no such
/// error: it stands among the problems of the [`Evaluation`](super::table::Evaluation).
#[derive(Debug, thiserror::Error)]
pub enum EvaluateError {
    /// The folder holds no usable cohort.
    #[error(transparent)]
    Cohort(#[from] CohortError),
    /// A parameter of our models is out of range.
    #[error(transparent)]
    ModelParameter(ParameterError),
    /// A parameter of the fit is out of range.
    #[error(transparent)]
    FitParameter(DeformError),
    /// Not one model could be made.
    #[error("no model could be made: {}", reasons.join("; "))]
    NoModel {
        /// The problem of each template.
        reasons: Vec<String>,
    },
    /// A scan that was read before cannot be read again.
    #[error("the scan of {case} could be read before, and now it cannot: {error}")]
    Scan {
        /// The patient.
        case: String,
        /// Why; boxed, because it is several times larger than any other error.
        error: Box<VolumeError>,
    },
    /// A fitted mesh cannot be written as JSON.
    #[error(transparent)]
    Export(#[from] ExportError),
    /// A record or the results cannot be written as JSON.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A table cannot be written as CSV.
    #[error(transparent)]
    Csv(#[from] csv::Error),
    /// A file or a folder cannot be written.
    #[error("cannot write {}: {error}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
