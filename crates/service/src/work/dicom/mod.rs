//! Stored results as DICOM objects, for the archive.
//!
//! In: a stored result with its volume and whose scan that is, as
//! [`Items::result`](crate::items::Items::result) returns them for the files that [`ResultObject::source_files`] names.
//! Out: the file of one [`ResultObject`]. To be called on a blocking thread, from a request, a job or a delivery alike.
//!
//! | file | what |
//! |---|---|
//! | `scan` | whose scan it is, and which images or frames are the result's source |
//! | `stored` | the stored files of a result |
//! | `still` | objects of a segmentation or a model |
//! | `beat` | objects of a beat |
//! | `comparison` | objects of a comparison |
//! | `serial` | the structured report of a serial comparison |
//! | `reading` | the structured report with what a reader states |
//!
//! Objects are not stored: the same result, scan and secret give the same bytes, UIDs included.
//! Slices and instances of the source are read from the kept upload. What a tenant has erased of the
//! scan's identity is not read again.

mod beat;
mod comparison;
mod reading;
mod scan;
mod serial;
mod still;
mod stored;

pub use scan::check_stated;

use crate::base::records::{Failure, Product, Resource};
use crate::items::{OutputFile, StoredResult};
use ventriform::heart::comparison::WhichScan;
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{
    BeatEnd, BeatObject, ComparisonObject, DicomObject, SignedReading,
};
use ventriform::results::export::fhir::{FHIR_FILE, FHIR_MEDIA_TYPE, bundle};
use ventriform::runs::advice::Explain;

/// A DICOM object of a stored result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResultObject {
    /// Of a segmentation or a model.
    Still(DicomObject),
    /// Of a beat.
    Beat(BeatObject),
    /// Of a comparison.
    Comparison(ComparisonObject),
    /// The structured report of a serial comparison.
    Serial,
    /// The structured report of a result with what a reader states of it.
    Reading,
    /// The structured report as FHIR resources, which is no DICOM object: it cannot be sent to an archive.
    Fhir,
}

/// Of a segmentation without polar map there is no [`DicomObject::Polar`].
const SEGMENTATION_OBJECTS: &[ResultObject] = &[
    ResultObject::Still(DicomObject::Mask),
    ResultObject::Still(DicomObject::Contours),
    ResultObject::Still(DicomObject::Mesh),
    ResultObject::Still(DicomObject::Surface),
    ResultObject::Still(DicomObject::Measurements),
    ResultObject::Still(DicomObject::Polar),
    ResultObject::Still(DicomObject::Page),
];

const MODEL_OBJECTS: &[ResultObject] = &[
    ResultObject::Still(DicomObject::Mask),
    ResultObject::Still(DicomObject::Contours),
    ResultObject::Still(DicomObject::Mesh),
    ResultObject::Still(DicomObject::Surface),
];

const BEAT_OBJECTS: &[ResultObject] = &[
    ResultObject::Beat(BeatObject::Mask(BeatEnd::Diastole)),
    ResultObject::Beat(BeatObject::Mask(BeatEnd::Systole)),
    ResultObject::Beat(BeatObject::Measurements),
];

const COMPARISON_OBJECTS: &[ResultObject] = &[
    ResultObject::Comparison(ComparisonObject::Measurements),
    ResultObject::Comparison(ComparisonObject::Page),
    ResultObject::Comparison(ComparisonObject::Polar(WhichScan::Stress)),
    ResultObject::Comparison(ComparisonObject::Polar(WhichScan::Rest)),
    ResultObject::Comparison(ComparisonObject::Difference),
];

const SERIAL_OBJECTS: &[ResultObject] = &[ResultObject::Serial];

const READING_OBJECTS: &[ResultObject] = &[ResultObject::Reading];

impl ResultObject {
    /// The name of the file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Serial | Self::Reading => DicomObject::Measurements.file_name(),
            Self::Fhir => FHIR_FILE,
            Self::Still(object) => object.file_name(),
            Self::Beat(object) => object.file_name(),
            Self::Comparison(object) => object.file_name(),
        }
    }

    /// The media type of the file.
    pub fn media_type(self) -> &'static str {
        match self {
            Self::Fhir => FHIR_MEDIA_TYPE,
            _ => DicomObject::MEDIA_TYPE,
        }
    }

    /// Whether `product` has what the object shows: a polar map is of a ventricle only.
    pub fn is_of(self, product: &Product) -> bool {
        let picture = match self {
            Self::Still(DicomObject::Polar) => Some(still::POLAR_FILE),
            Self::Comparison(object) => object.needed_picture(),
            _ => None,
        };
        picture.is_none_or(|name| product.file(name).is_some())
    }

    /// The names of the files of `product` of which the object is made; those that it lacks are not needed.
    pub fn source_files(self, product: &Product) -> Vec<String> {
        match self {
            Self::Still(_) => still::SOURCE_FILES.map(str::to_owned).to_vec(),
            Self::Beat(object) => beat::source_files(object, product),
            Self::Comparison(object) => comparison::source_files(object),
            Self::Serial => vec![serial::REPORT_FILE.to_owned()],
            Self::Reading => reading::source_files(product),
            Self::Fhir => {
                let report = structured_report(product.resource());
                report.map_or_else(Vec::new, |report| report.source_files(product))
            }
        }
    }
}

/// The objects that are made of results of that kind.
pub fn objects(kind: Resource) -> &'static [ResultObject] {
    match kind {
        Resource::Segmentation => SEGMENTATION_OBJECTS,
        Resource::Model => MODEL_OBJECTS,
        Resource::Beat => BEAT_OBJECTS,
        Resource::Comparison => COMPARISON_OBJECTS,
        Resource::Serial => SERIAL_OBJECTS,
        Resource::Reading => READING_OBJECTS,
        _ => &[],
    }
}

/// The structured report of results of that kind.
fn structured_report(kind: Resource) -> Option<ResultObject> {
    object_named(kind, DicomObject::Measurements.file_name())
}

/// The object with that file name that is made of results of that kind.
pub fn object_named(kind: Resource, name: &str) -> Option<ResultObject> {
    let all = objects(kind).iter();
    all.copied().find(|object| object.file_name() == name)
}

/// Everything that is made of results of that kind on request, with whose scan they are: objects, and the structured report
/// as FHIR resources.
pub fn made_on_request(kind: Resource) -> Vec<ResultObject> {
    let fhir = structured_report(kind).map(|_| ResultObject::Fhir);
    objects(kind).iter().copied().chain(fhir).collect()
}

/// The file names of all objects, each once.
pub fn object_names() -> Vec<&'static str> {
    let mut names = Vec::new();
    for object in Resource::ALL.into_iter().flat_map(objects) {
        if !names.contains(&object.file_name()) {
            names.push(object.file_name());
        }
    }
    names
}

/// Most memory that [`object`] takes for a volume of `shape`, bytes: masks, their bits and the file.
pub fn object_memory(shape: [usize; 3]) -> u64 {
    let voxels = shape
        .iter()
        .fold(1, |all: u64, n| all.saturating_mul(*n as u64));
    (64 << 20) + voxels.saturating_mul(8)
}

/// One object of a stored result; `None` if the result has no picture of that name. With a `secret`,
/// the object is freed of the patient's identity, and its UIDs are derived from the secret.
///
/// # Errors
/// `identity-needed` if patient or study of the scan are unknown, or were erased; `not-exportable`
/// if DICOM cannot express the result.
pub fn object(
    result: &StoredResult,
    object: ResultObject,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<OutputFile>, Failure> {
    let bytes = match object {
        ResultObject::Fhir => fhir(result, secret, limits)?,
        _ => made(result, object, None, secret, limits)?,
    };
    Ok(bytes.map(|bytes| OutputFile {
        name: object.file_name().into(),
        media_type: object.media_type().into(),
        bytes,
    }))
}

/// The bytes of a DICOM object, with what a reader states if it is a structured report.
fn made(
    result: &StoredResult,
    object: ResultObject,
    reading: Option<SignedReading<'_>>,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    match object {
        ResultObject::Still(object) => still::object(result, object, reading, secret, limits),
        ResultObject::Beat(object) => {
            beat::object(result, object, reading, secret, limits).map(Some)
        }
        ResultObject::Comparison(object) => {
            comparison::object(result, object, reading, secret, limits)
        }
        ResultObject::Serial => serial::measurements(result, secret, limits),
        ResultObject::Reading => {
            reading::measurements(result, &reading::statement(result)?, secret, limits)
        }
        ResultObject::Fhir => Ok(None),
    }
}

/// The structured report of a result as FHIR resources.
fn fhir(
    result: &StoredResult,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let kind = Resource::from_id(&result.files.id);
    let Some(object) = kind.and_then(structured_report) else {
        return Ok(None);
    };
    let (report, amended) = match object {
        ResultObject::Reading => {
            let stated = reading::statement(result)?;
            let report = reading::measurements(result, &stated, secret, limits)?;
            (report, stated.amends.is_some())
        }
        _ => (made(result, object, None, secret, limits)?, false),
    };
    let bundle = report.map(|report| bundle(&report, amended)).transpose();
    bundle.map_err(|error| error.explain())
}
