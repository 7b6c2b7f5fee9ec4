//! Results as DICOM objects, for an archive (PACS).
//!
//! In: a scan's identity and grid ([`SourceScan`]), and what was made of it ([`DicomResults`]).
//! Out: the bytes of one file for each [`DicomObject`], Explicit VR Little Endian.
//!
//! 1. [`identity`] completes what the file says about patient and study by what a person states.
//! 2. [`SourceScan::deidentified`] takes the identity away, on request.
//! 3. [`DicomResults::write`] builds the object: the modules that all have in common here, the
//!    rest in the module of its kind (`segmentation`, `structure_set`, `stl`, `surface`,
//!    `measurements` with `normals`, `capture`).
//! 4. [`nuclear_image`]: slices that were reconstructed here.
//! 5. [`DicomBeat`] does so for a beat: two Segmentations and a report; [`DicomComparison`] for a comparison of rest
//!    and stress: a report and pictures; [`DicomSerial`] for scans over the years: a report.
//!
//! The picture of a page names patient and study in its pixels (Burned In Annotation YES), unless the scan is freed of
//! the identity.
//!
//! Guaranteed: the same patient, study and Frame of Reference as the source, which is referenced
//! (of a multi-frame image, the frames); millimetres in LPS; standard attributes only; the same
//! input gives the same bytes, UIDs included, and other input gives other UIDs. A scan whose
//! position in the patient is assumed gives objects with a Frame of Reference of their own, so that
//! no viewer lays them over other images.
//!
//! Text is written in UTF-8. What could not be decoded of the source ([`legible`]) is in no object:
//! there is none.
//!
//! Not guaranteed: that the values which a source states about the patient are valid DICOM; they
//! are copied, so that the archive finds the same patient.

mod beat;
mod capture;
mod codes;
mod comparison;
mod measurements;
mod normals;
mod nuclear;
mod reading;
mod segmentation;
mod serial;
mod source;
mod stl;
mod structure_set;
mod structured_report;
mod surface;

#[cfg(test)]
mod tests;

pub use crate::image::volume::is_uid;
pub use beat::{BeatEnd, BeatObject, DicomBeat, EndWall};
pub use codes::{LabelSegment, Structure};
pub use comparison::{ComparisonObject, DicomComparison};
pub use nuclear::{nuclear_image, nuclear_projections};
pub use reading::SignedReading;
pub use serial::DicomSerial;
pub use source::{Deidentification, Moment, SourceScan, StatedIdentity, identity, legible};
pub use ventriform_dicom::write::data_set::{
    IMPLEMENTATION_CLASS_UID, IMPLEMENTATION_NAME, file_start,
};
pub use ventriform_dicom::write::uid::derived as derived_uid;

use self::codes::{ANATOMICAL_STRUCTURE, DEFORMABLE_MODELS};
use super::ExportError;
use crate::image::grid::voxelise::Mask;
use crate::mesh::TriMesh;
use crate::results::report::{
    DrawnPage, SegmentationReport, SegmentationSheet, segmentation_sheet,
};
use ventriform_dicom::report::ReportError;
use ventriform_dicom::write::EncodingError;
use ventriform_dicom::write::code::Code;
use ventriform_dicom::write::data_set::DataSet;
use ventriform_dicom::write::segmentation::SegmentDescription;
use ventriform_dicom::write::uid::Uids;
use ventriform_dicom::{tags, uids};

/// Why a result cannot be written as DICOM.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DicomError {
    /// Patient or study is unknown.
    #[error("the volume's file does not say whose scan it is: `{field}` is needed")]
    NoIdentity {
        /// The field that is needed.
        field: &'static str,
    },
    /// A person states another value than the file.
    #[error("`{field}` differs from what the volume's file says")]
    Contradiction {
        /// The field that differs.
        field: &'static str,
    },
    /// The file states a value in characters that cannot be told.
    #[error("the volume's file has a `{field}` that cannot be decoded")]
    Undecoded {
        /// The field that cannot be decoded.
        field: &'static str,
    },
    /// A stated value is not valid DICOM.
    #[error("`{field}` is not {expected}")]
    Identity {
        /// The value at fault.
        field: &'static str,
        /// Values that are valid.
        expected: &'static str,
    },
    /// Rows and columns of the volume are not at right angles.
    #[error("the rows and columns of the volume are not at right angles, which DICOM images are")]
    Oblique,
    /// The volume has more rows or columns than an image may have.
    #[error("the volume has more than 65535 rows or columns")]
    TooLarge,
    /// A contour has more points than its element can hold.
    #[error("the contour in slice {slice} has more points than DICOM can hold")]
    LongContour {
        /// Number of the slice, from 0.
        slice: usize,
    },
    /// The mesh cannot be written.
    #[error(transparent)]
    Mesh(#[from] ExportError),
    /// A picture cannot be read.
    #[error("{name}: {reason}")]
    Picture {
        /// The object.
        name: &'static str,
        /// Why.
        reason: String,
    },
    /// The data set cannot be encoded.
    #[error(transparent)]
    Encoding(#[from] EncodingError),
    /// A structured report cannot be read again.
    #[error(transparent)]
    Report(#[from] ReportError),
}

/// An object for the archive.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DicomObject {
    /// The mask: Segmentation, binary.
    Mask,
    /// The mask's outlines in every slice: RT Structure Set.
    Contours,
    /// The mesh: Encapsulated STL.
    Mesh,
    /// The mesh: Surface Segmentation.
    Surface,
    /// The figures: Comprehensive 3D SR, TID 1500.
    Measurements,
    /// The polar map: Secondary Capture.
    Polar,
    /// The page of the report as one picture: Secondary Capture.
    Page,
}

impl DicomObject {
    /// All objects.
    pub const ALL: [DicomObject; 7] = [
        DicomObject::Mask,
        DicomObject::Contours,
        DicomObject::Mesh,
        DicomObject::Surface,
        DicomObject::Measurements,
        DicomObject::Polar,
        DicomObject::Page,
    ];

    /// The object with that file name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL
            .into_iter()
            .find(|object| object.file_name() == name)
    }

    /// The media type of all of them.
    pub const MEDIA_TYPE: &str = "application/dicom";

    /// The name of the file.
    pub fn file_name(self) -> &'static str {
        self.facts().name
    }

    fn facts(self) -> ObjectFacts {
        let facts = |name, class, modality, series, description| ObjectFacts {
            name,
            class,
            modality,
            series,
            description,
        };
        match self {
            DicomObject::Mask => facts(
                "mask.dcm",
                uids::SEGMENTATION_STORAGE,
                "SEG",
                9101,
                "segmentation",
            ),
            DicomObject::Contours => facts(
                "contours.dcm",
                uids::RT_STRUCTURE_SET_STORAGE,
                "RTSTRUCT",
                9102,
                "contours",
            ),
            DicomObject::Mesh => facts(
                "mesh.dcm",
                uids::ENCAPSULATED_STL_STORAGE,
                "M3D",
                9103,
                "model (STL)",
            ),
            DicomObject::Surface => facts(
                "surface.dcm",
                uids::SURFACE_SEGMENTATION_STORAGE,
                "SEG",
                9104,
                "surface",
            ),
            DicomObject::Measurements => facts(
                "measurements.dcm",
                uids::COMPREHENSIVE3_DSR_STORAGE,
                "SR",
                9105,
                "measurements",
            ),
            DicomObject::Polar => facts(
                "polar.dcm",
                uids::SECONDARY_CAPTURE_IMAGE_STORAGE,
                "OT",
                9106,
                "polar map",
            ),
            DicomObject::Page => facts(
                "page.dcm",
                uids::SECONDARY_CAPTURE_IMAGE_STORAGE,
                "OT",
                9107,
                "page of the report",
            ),
        }
    }
}

/// Attributes that distinguish an object from the others.
struct ObjectFacts {
    name: &'static str,
    class: &'static str,
    modality: &'static str,
    /// Series Number.
    series: u16,
    description: &'static str,
}

/// Results of one scan.
#[derive(Clone)]
pub struct DicomResults<'a> {
    scan: &'a SourceScan,
    structure: Structure,
    mask: &'a Mask,
    mesh: &'a TriMesh,
    figures: Option<&'a SegmentationReport>,
    reading: Option<SignedReading<'a>>,
    cavity: Option<&'a Mask>,
    slices: Option<&'a [u8]>,
    polar: Option<&'a [u8]>,
    /// The end of the beat that is shown; `None` for an image of all moments.
    end: Option<BeatEnd>,
    uids: Uids,
}

impl<'a> DicomResults<'a> {
    /// Results of `scan`, which show `structure`: the mask on the scan's grid, the mesh (LPS mm) and
    /// the text of the report, as JSON in one line, from which UIDs are derived.
    pub fn new(
        scan: &'a SourceScan,
        structure: Structure,
        mask: &'a Mask,
        mesh: &'a TriMesh,
        report: &str,
    ) -> Self {
        Self {
            scan,
            structure,
            mask,
            mesh,
            figures: None,
            reading: None,
            cavity: None,
            slices: None,
            polar: None,
            end: None,
            uids: Uids::over_all(|add| {
                add(env!("CARGO_PKG_VERSION").as_bytes());
                scan.add_to(add);
                add(structure.label.as_bytes());
                add(&mask.voxels.iter().map(|v| u8::from(*v)).collect::<Vec<_>>());
                let numbers = mesh.vertices.iter().flat_map(|v| [v.x, v.y, v.z]);
                add(&numbers.flat_map(f64::to_le_bytes).collect::<Vec<_>>());
                let corners = mesh.triangles.iter().flatten();
                add(&corners.flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>());
                add(report.as_bytes());
            }),
        }
    }

    /// Adds the figures of a segmentation, for [`DicomObject::Measurements`] and [`DicomObject::Page`].
    #[must_use]
    pub fn with_figures(self, report: &'a SegmentationReport) -> Self {
        Self {
            figures: Some(report),
            ..self
        }
    }

    /// Adds what a reader states, to [`DicomObject::Measurements`].
    #[must_use]
    pub fn with_reading(self, reading: Option<SignedReading<'a>>) -> Self {
        Self { reading, ..self }
    }

    /// Adds a ventricle's cavity: voxels of the mask's grid that are not of the mask.
    #[must_use]
    pub fn with_cavity(self, cavity: Option<&'a Mask>) -> Self {
        Self { cavity, ..self }
    }

    /// Adds pictures, as PNG files: the slices with contours and the polar map.
    #[must_use]
    pub fn with_pictures(self, slices: Option<&'a [u8]>, polar: Option<&'a [u8]>) -> Self {
        Self {
            slices,
            polar,
            ..self
        }
    }

    /// Says which end of a beat is shown.
    #[must_use]
    fn at(self, end: BeatEnd) -> Self {
        Self {
            end: Some(end),
            ..self
        }
    }

    /// The bytes of `object`; `None` for a picture that is not there: a polar map, or a page where there are no
    /// figures.
    ///
    /// # Errors
    /// See [`DicomError`].
    pub fn write(&self, object: DicomObject) -> Result<Option<Vec<u8>>, DicomError> {
        let there = match object {
            DicomObject::Polar => self.polar.is_some(),
            DicomObject::Page => self.figures.is_some(),
            _ => true,
        };
        if there {
            self.write_always(object).map(Some)
        } else {
            self.scan.check().map(|()| None)
        }
    }

    /// The bytes of `object`; a picture that is not there cannot be read.
    fn write_always(&self, object: DicomObject) -> Result<Vec<u8>, DicomError> {
        self.scan.check()?;
        let mut set = DataSet::new();
        let picture = self.picture(object)?;
        let instance = self.instance(object, picture.as_ref());
        match object {
            DicomObject::Mask => segmentation::put(self, &mut set)?,
            DicomObject::Contours => structure_set::put(self, &mut set)?,
            DicomObject::Mesh => stl::put(self, &mut set)?,
            DicomObject::Surface => surface::put(self, &mut set)?,
            DicomObject::Measurements => measurements::put(self, &mut set),
            DicomObject::Polar | DicomObject::Page => {}
        }
        if let Some(picture) = picture {
            let name = object.file_name();
            capture::put(self.scan, self.structure, name, picture, &mut set)?;
        }
        let facts = object.facts();
        let end = self.end.map(|end| format!(", {}", end.name()));
        put_facts(
            self.scan,
            &facts,
            [instance, self.series(object)],
            format!(
                "{}: {}{}",
                self.structure.label,
                facts.description,
                end.unwrap_or_default()
            ),
            &mut set,
        );
        Ok(set.file()?)
    }

    /// What a Secondary Capture shows; `None` for other objects.
    fn picture(&self, object: DicomObject) -> Result<Option<DrawnPage>, DicomError> {
        let name = object.file_name();
        match (object, self.figures) {
            (DicomObject::Polar, _) => {
                let map = capture::decoded(name, self.polar.unwrap_or_default())?;
                Ok(Some(capture::anonymous(map)))
            }
            (DicomObject::Page, Some(report)) => {
                let decoded = |png| capture::decoded(name, png);
                let slices = self.slices.map(decoded).transpose()?;
                let polar = self.polar.map(decoded).transpose()?;
                Ok(Some(segmentation_sheet(&SegmentationSheet {
                    report,
                    slices: slices.as_ref(),
                    polar: polar.as_ref(),
                    scan: self.scan.shown(),
                })))
            }
            _ => Ok(None),
        }
    }

    /// Label, description and creator of a segmentation.
    fn put_content(&self, set: &mut DataSet) {
        self.scan.put_made(set);
        set.text(tags::CONTENT_LABEL, "VENTRIFORM");
        set.text(tags::CONTENT_DESCRIPTION, self.structure.label);
        set.empty(tags::CONTENT_CREATOR_NAME);
    }

    /// The first segment: the structure, for its item in the Segment Sequence.
    fn put_segment(&self, segment: &mut DataSet) {
        let description = SegmentDescription {
            number: 1,
            label: self.structure.label,
            category: ANATOMICAL_STRUCTURE,
            kind: self.structure.kind,
            tracking_uid: &self.tracking(),
        };
        description.put(segment);
    }

    /// The Referenced Series Sequence of the Common Instance Reference module.
    fn put_referenced_series(&self, set: &mut DataSet) {
        let Some(images) = self.scan.images() else {
            return;
        };
        let mut series = DataSet::new();
        series.text(tags::SERIES_INSTANCE_UID, images.series);
        series.items(tags::REFERENCED_INSTANCE_SEQUENCE, images.references());
        set.item(tags::REFERENCED_SERIES_SEQUENCE, series);
    }

    /// SOP Instance UID of `object`; of a Secondary Capture it needs what that shows.
    fn instance(&self, object: DicomObject, picture: Option<&DrawnPage>) -> String {
        let cavity: Option<Vec<u8>> = (self.cavity)
            .filter(|_| object == DicomObject::Mask)
            .map(|mask| mask.voxels.iter().map(|v| u8::from(*v)).collect());
        let pixels = picture.map(|picture| picture.image.pixels.as_flattened());
        let signature = self.signature(object).map(|reading| reading.id.as_bytes());
        let content = cavity.as_deref().or(pixels).or(signature);
        self.uids
            .over(object.file_name(), content.unwrap_or_default())
    }

    fn series(&self, object: DicomObject) -> String {
        let name = format!("series of {}", object.file_name());
        reading::uid(&self.uids, &name, self.signature(object))
    }

    /// The reading that an object states.
    fn signature(&self, object: DicomObject) -> Option<SignedReading<'a>> {
        self.reading.filter(|_| object == DicomObject::Measurements)
    }

    /// Tracking UID of the structure.
    fn tracking(&self) -> String {
        self.uids.uid("tracking")
    }
}

/// The modules that all objects have: patient, study, series, equipment and SOP Common. `uids` are those of the
/// instance and of its series.
fn put_facts(
    scan: &SourceScan,
    facts: &ObjectFacts,
    [instance, series]: [String; 2],
    description: String,
    set: &mut DataSet,
) {
    scan.put_identity(set);
    set.text(tags::SOP_CLASS_UID, facts.class);
    set.text(tags::SOP_INSTANCE_UID, instance);
    set.text(tags::MODALITY, facts.modality);
    set.text(tags::SERIES_INSTANCE_UID, series);
    set.text(tags::SERIES_NUMBER, facts.series.to_string());
    set.text(tags::INSTANCE_NUMBER, "1");
    set.text(tags::SERIES_DESCRIPTION, description);
    let made = scan.made();
    set.text(tags::SERIES_DATE, made.date.as_str());
    set.text(tags::SERIES_TIME, made.time.as_str());
    set.text(tags::MANUFACTURER, "ventriform");
    set.text(tags::MANUFACTURER_MODEL_NAME, "ventriform");
    set.text(tags::DEVICE_SERIAL_NUMBER, "none");
    set.text(tags::SOFTWARE_VERSIONS, env!("CARGO_PKG_VERSION"));
}

/// An item of the Algorithm Identification Macro.
fn algorithm() -> DataSet {
    let mut item = DataSet::new();
    let family: Code = DEFORMABLE_MODELS;
    item.code(tags::ALGORITHM_FAMILY_CODE_SEQUENCE, family);
    item.text(tags::ALGORITHM_NAME, "ventriform");
    item.text(tags::ALGORITHM_VERSION, env!("CARGO_PKG_VERSION"));
    item
}

/// Red, green and blue of the structure in viewers.
const STRUCTURE_RGB: [u8; 3] = [255, 150, 0];

/// [`STRUCTURE_RGB`] as CIELab values (PS3.3 C.10.7.1.1).
const STRUCTURE_CIELAB: [u16; 3] = [46928, 41046, 52636];

/// Blue, for the cavity, as CIELab values.
const CAVITY_CIELAB: [u16; 3] = [33644, 36596, 18297];
