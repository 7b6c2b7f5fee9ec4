//! The structured report of a result with what a reader states of it, from the files that the reading keeps.

use super::super::failures::broken_result;
use super::super::reading::{RESULT_FIELD, kind_of};
use super::{ResultObject, stored};
use crate::base::records::{Failure, Product};
use crate::items::{StoredItem, StoredResult};
use serde_json::Value;
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{
    BeatObject, ComparisonObject, DicomObject, SignedReading,
};
use ventriform::results::report::{ReadKind, ReadingReport};
use ventriform::runs::reading::{READING_FILE, report_file};

/// The object of the result to which a reading of that kind is added.
fn unread(kind: ReadKind) -> ResultObject {
    match kind {
        ReadKind::Comparison => ResultObject::Comparison(ComparisonObject::Measurements),
        ReadKind::Segmentation => ResultObject::Still(DicomObject::Measurements),
        ReadKind::Beat => ResultObject::Beat(BeatObject::Measurements),
    }
}

/// The names of the files of the reading `product` of which its structured report is made.
pub fn source_files(product: &Product) -> Vec<String> {
    let result = product.parameters.get(RESULT_FIELD).and_then(Value::as_str);
    let unread = result.and_then(kind_of).map(unread);
    let kept = unread.map_or_else(Vec::new, |object| object.source_files(product));
    [READING_FILE.to_owned()].into_iter().chain(kept).collect()
}

/// What a reading states.
///
/// # Errors
/// If its file is missing or damaged.
pub fn statement(reading: &StoredResult) -> Result<ReadingReport, Failure> {
    stored::report(&stored::required(&reading.files, READING_FILE)?)
}

/// The bytes of the structured report.
///
/// # Errors
/// As [`super::object`].
pub fn measurements(
    reading: &StoredResult,
    stated: &ReadingReport,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let nameless = || broken_result(&"the reading does not say what was read");
    let id = stated.result.clone().ok_or_else(nameless)?;
    let report = stored::required(&reading.files, report_file(stated.kind))?;
    let report: Value = stored::report(&report)?;
    let parameters = report.get("parameters").and_then(Value::as_object);
    let parameters = parameters.cloned().unwrap_or_default();
    // The files that the reading keeps are those of the result that was read.
    let result = StoredResult {
        files: StoredItem {
            id,
            parameters,
            ..reading.files.clone()
        },
        ..reading.clone()
    };
    let signed = SignedReading {
        id: &reading.files.id,
        reading: stated,
    };
    super::made(&result, unread(stated.kind), Some(signed), secret, limits)
}
