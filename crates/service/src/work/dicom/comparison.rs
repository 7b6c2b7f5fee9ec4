//! DICOM objects of a stored comparison: of the study of the scan at stress.

use super::super::problems::{Explain, broken_result};
use super::super::upload::UploadFacts;
use super::{scan, stored};
use crate::items::{StoredResult, StoredSource};
use crate::records::Failure;
use ventriform::export::dicom::{ComparisonObject, DicomComparison, Structure};
use ventriform::report::ComparisonReport;
use ventriform::volume::ReadLimits;

const REPORT_FILE: &str = "comparison.json";

/// The names of the files of which `object` is made.
pub fn source_files(object: ComparisonObject) -> Vec<String> {
    let names = [Some(REPORT_FILE), object.picture()];
    names.into_iter().flatten().map(str::to_owned).collect()
}

/// The bytes of one object; `None` if the comparison has no such picture.
///
/// # Errors
/// As [`super::object`].
pub fn object(
    result: &StoredResult,
    object: ComparisonObject,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let rest = result.rest.as_ref();
    let rest = rest.ok_or_else(|| broken_result(&"the volume at rest is missing"))?;
    let bytes = stored::required(&result.files, REPORT_FILE)?;
    let report: ComparisonReport = stored::report(&bytes)?;
    let text = stored::report_text(&bytes)?;
    let source = |source: &StoredSource| {
        let facts = UploadFacts::of(&source.volume).map_err(|error| broken_result(&error))?;
        // Gates are added up: the scan is all of them.
        scan::source((source, result.made_at), &facts, None, secret, limits)
    };
    let scans = [source(&result.source)?, source(rest)?];
    let structure = Structure::of("left_ventricle");
    let comparison = DicomComparison::new(structure, &scans, &report, &text);
    let made = match object.picture() {
        None => comparison.measurements(),
        Some(name) => match stored::read(&result.files, name)? {
            None => return Ok(None),
            Some(png) => comparison.picture(object, &png),
        },
    };
    made.map(Some).map_err(|error| error.explain())
}
