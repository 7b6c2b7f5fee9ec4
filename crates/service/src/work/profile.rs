//! From a reader's profile as it was uploaded to one that is stored.

use super::segmentation::PROFILE_FILE;
use crate::base::records::Failure;
use crate::items::{OutputFile, WorkOutput};
use ventriform::heart::reader::ReaderProfile;
use ventriform::results::report::{ReaderSummary, object};
use ventriform::runs::advice::Explain;

/// Checks a reader's profile. Returns its main figures and the profile, spaced as
/// [`ReaderProfile::to_json`] does, so that the same profile is the same file.
///
/// # Errors
/// If it is no profile that can be used.
pub(super) fn make(text: &[u8]) -> Result<WorkOutput, Failure> {
    let profile = ReaderProfile::from_json(text).map_err(|error| error.explain())?;
    Ok(WorkOutput {
        summary: object(&ReaderSummary::from_profile(&profile)),
        files: vec![OutputFile {
            name: PROFILE_FILE.into(),
            media_type: "application/json".into(),
            bytes: profile.to_json().into_bytes(),
        }],
    })
}
