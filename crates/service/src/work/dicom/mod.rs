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
//!
//! Objects are not stored: the same result, scan and secret give the same bytes, UIDs included.
//! Slices and instances of the source are read from the kept upload. What a tenant has erased of the
//! scan's identity is not read again.

mod beat;
mod comparison;
mod scan;
mod still;
mod stored;

pub use scan::check_stated;

use crate::base::records::{Failure, Product, Resource};
use crate::items::{OutputFile, StoredResult};
use ventriform::heart::comparison::WhichScan;
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{BeatEnd, BeatObject, ComparisonObject, DicomObject};

/// A DICOM object of a stored result.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResultObject {
    /// Of a segmentation or a model.
    Still(DicomObject),
    /// Of a beat.
    Beat(BeatObject),
    /// Of a comparison.
    Comparison(ComparisonObject),
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

impl ResultObject {
    /// The name of the file.
    pub fn file_name(self) -> &'static str {
        match self {
            Self::Still(object) => object.file_name(),
            Self::Beat(object) => object.file_name(),
            Self::Comparison(object) => object.file_name(),
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
        _ => &[],
    }
}

/// The object with that file name that is made of results of that kind.
pub fn object_named(kind: Resource, name: &str) -> Option<ResultObject> {
    let all = objects(kind).iter();
    all.copied().find(|object| object.file_name() == name)
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
        ResultObject::Still(object) => still::object(result, object, secret, limits)?,
        ResultObject::Beat(object) => Some(beat::object(result, object, secret, limits)?),
        ResultObject::Comparison(object) => comparison::object(result, object, secret, limits)?,
    };
    Ok(bytes.map(|bytes| OutputFile {
        name: object.file_name().into(),
        media_type: DicomObject::MEDIA_TYPE.into(),
        bytes,
    }))
}
