//! DICOM objects of a stored serial comparison: of the study of the last scan.

use super::{scan, stored};
use crate::base::records::Failure;
use crate::items::StoredResult;
use ventriform::image::volume::{Provenance, ReadLimits};
use ventriform::results::export::dicom::{DicomSerial, SourceScan, Structure};
use ventriform::results::report::SerialReport;
use ventriform::runs::advice::Explain;

/// The report, of which the structured report is made.
pub const REPORT_FILE: &str = "serial.json";

/// The bytes of the structured report; `None` if the comparison has no scan.
///
/// # Errors
/// As [`super::object`].
pub fn measurements(
    result: &StoredResult,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let bytes = stored::required(&result.files, REPORT_FILE)?;
    let report: SerialReport = stored::report(&bytes)?;
    let text = stored::report_text(&bytes)?;
    let given = std::iter::once(&result.source).chain(&result.others);
    let given: Vec<SourceScan> = given
        .map(|source| scan::whole(source, result.made_at, secret, limits))
        .collect::<Result<_, Failure>>()?;
    let shown: Option<Vec<Provenance>> = given.iter().map(|scan| scan.shown().cloned()).collect();
    // Objects that are freed of the identity say nothing of the headers.
    let report = match shown {
        Some(shown) => report.with_scans(&shown),
        None => report,
    };
    let in_order: Vec<SourceScan> = (report.scans.iter())
        .filter_map(|own| given.get(own.given.checked_sub(1)?).cloned())
        .collect();
    let structure = Structure::from_organ("left_ventricle");
    let serial = DicomSerial::new(structure, &in_order, &report, &text);
    serial.measurements().map_err(|error| error.explain())
}
