//! Normal limits: as they are uploaded, and as jobs need them.

use super::failures::{normals_missing, unreadable_model, work_error};
use crate::base::records::Failure;
use crate::items::{OutputFile, WorkOutput};
use crate::jobs::{WorkError, WorkInput};
use ventriform::heart::normals::NormalLimits;
use ventriform::results::report::{NormalsSummary, object};
use ventriform::runs::advice::Explain;

/// The parameter that names normal limits.
pub(super) const NORMALS_FIELD: &str = "normals";
/// The file of normal limits.
pub(super) const NORMALS_FILE: &str = "normals.json";

/// Checks normal limits. Returns their content and the file, spaced as [`NormalLimits::to_json`] does, so that the
/// same limits are the same file.
///
/// # Errors
/// If they cannot be used.
pub(super) fn make(text: &[u8]) -> Result<WorkOutput, Failure> {
    let limits = NormalLimits::from_json(text).map_err(|error| error.explain())?;
    Ok(output(&limits))
}

/// The content and the file of `limits`.
pub(super) fn output(limits: &NormalLimits) -> WorkOutput {
    WorkOutput {
        summary: object(&NormalsSummary::from_limits(limits)),
        files: vec![OutputFile {
            name: NORMALS_FILE.into(),
            media_type: "application/json".into(),
            bytes: limits.to_json().into_bytes(),
        }],
    }
}

/// The normal limits that the parameters of a job name.
///
/// # Errors
/// If their file is missing or cannot be read.
pub(super) fn of_input(input: &WorkInput) -> Result<Option<NormalLimits>, WorkError> {
    let Some(item) = input.items.get(NORMALS_FIELD) else {
        return Ok(None);
    };
    let bytes = item.read(NORMALS_FILE).map_err(|e| unreadable_model(&e))?;
    let bytes = bytes.ok_or_else(|| normals_missing(&item.id))?;
    let limits = NormalLimits::from_json(&bytes).map_err(|error| work_error(&error))?;
    Ok(Some(limits))
}
