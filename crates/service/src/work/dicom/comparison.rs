//! DICOM objects of a stored comparison: of the study of the scan at stress.

use super::super::failures::broken_result;
use super::{scan, stored};
use crate::base::records::Failure;
use crate::items::StoredResult;
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{
    ComparisonObject, DicomComparison, SignedReading, SourceScan, Structure,
};
use ventriform::results::report::ComparisonReport;
use ventriform::runs::advice::Explain;

const REPORT_FILE: &str = "comparison.json";

/// The names of the files of which `object` is made.
pub fn source_files(object: ComparisonObject) -> Vec<String> {
    let pictures = object.pictures().iter().copied();
    let names = [REPORT_FILE].into_iter().chain(pictures);
    names.map(str::to_owned).collect()
}

/// The bytes of one object; `None` if the comparison has no such picture.
///
/// # Errors
/// As [`super::object`].
pub fn object(
    result: &StoredResult,
    object: ComparisonObject,
    reading: Option<SignedReading<'_>>,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let rest = result.others.first();
    let rest = rest.ok_or_else(|| broken_result(&"the volume at rest is missing"))?;
    let bytes = stored::required(&result.files, REPORT_FILE)?;
    let report: ComparisonReport = stored::report(&bytes)?;
    let text = stored::report_text(&bytes)?;
    let scans = [&result.source, rest];
    let [stress, rest] = scans.map(|source| scan::whole(source, result.made_at, secret, limits));
    let scans = [stress?, rest?];
    let structure = Structure::from_organ("left_ventricle");
    let [stress, rest] = scans.each_ref().map(SourceScan::shown);
    // Objects that are freed of the identity say nothing of the headers.
    let report = match stress.zip(rest) {
        Some((stress, rest)) => report.with_scans([stress, rest]),
        None => report,
    };
    let comparison = DicomComparison::new(structure, &scans, &report, &text).with_reading(reading);
    if object == ComparisonObject::Measurements {
        return (comparison.measurements().map(Some)).map_err(|error| error.explain());
    }
    let mut pictures = Vec::new();
    for name in object.pictures() {
        pictures.extend(stored::read(&result.files, name)?.map(|png| (*name, png)));
    }
    let pictures: Vec<(&str, &[u8])> = (pictures.iter())
        .map(|(name, png)| (*name, png.as_slice()))
        .collect();
    let made = comparison.picture(object, &pictures);
    made.map_err(|error| error.explain())
}
