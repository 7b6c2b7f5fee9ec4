//! From a reader's profile as it was uploaded to one that is stored.

use super::problems::Explain;
use super::segmentation::PROFILE_FILE;
use crate::items::{OutputFile, WorkOutput};
use crate::records::Failure;
use serde_json::json;
use ventriform::reader::ReaderProfile;

/// Checks a reader's profile. Returns its main figures and the profile, spaced as
/// [`ReaderProfile::to_json`] does, so that the same profile is the same file.
///
/// # Errors
/// If it is no profile that can be used.
pub(super) fn make(text: &[u8]) -> Result<WorkOutput, Failure> {
    let profile = ReaderProfile::from_json(text).map_err(|error| error.explain())?;
    let offsets = profile.offsets();
    let summary = [
        ("edge", json!(profile.edge.as_str())),
        ("masks", json!(profile.masks())),
        (
            "offsets_mm",
            json!({
                "endocardium": offsets.endocardium,
                "epicardium": offsets.epicardium,
                "rim": offsets.rim,
            }),
        ),
    ];
    Ok(WorkOutput {
        summary: summary
            .map(|(name, figure)| (name.to_owned(), figure))
            .into_iter()
            .collect(),
        files: vec![OutputFile {
            name: PROFILE_FILE.into(),
            media_type: "application/json".into(),
            bytes: profile.to_json().into_bytes(),
        }],
    })
}
