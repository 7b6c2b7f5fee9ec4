//! DICOM objects of a stored segmentation or model.

use super::super::failures::broken_result;
use super::super::upload::UploadFacts;
use super::{scan, stored};
use crate::base::records::{Failure, Resource};
use crate::items::{StoredItem, StoredResult};
use serde_json::Value;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::voxelise::voxelise;
use ventriform::image::volume::ReadLimits;
use ventriform::results::export::dicom::{DicomObject, DicomResults, SignedReading, Structure};
use ventriform::results::report::SegmentationReport;
use ventriform::runs::advice::Explain;
use ventriform::runs::segmentation::cavity;

/// The files of a result of which objects are made.
pub const SOURCE_FILES: [&str; 5] = [MASK_FILE, MESH_FILE, REPORT_FILE, SLICES_FILE, POLAR_FILE];

/// The picture of the polar map.
pub const POLAR_FILE: &str = "polar.png";

const MASK_FILE: &str = "mask.nii.gz";
const MESH_FILE: &str = "mesh.json";
const REPORT_FILE: &str = "report.json";
const SLICES_FILE: &str = "slices.png";

/// The bytes of one object; `None` if the result has no picture of that name.
///
/// # Errors
/// As [`super::object`].
pub fn object(
    result: &StoredResult,
    object: DicomObject,
    reading: Option<SignedReading<'_>>,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<Vec<u8>>, Failure> {
    let facts =
        UploadFacts::from_volume(&result.source.volume).map_err(|error| broken_result(&error))?;
    let frame = scan::voxel_to_patient(&facts)?;
    let item = &result.files;
    let number = item.parameters.get("frame").and_then(Value::as_u64);
    let number = number.and_then(|number| usize::try_from(number).ok());
    let scan = scan::source(
        (&result.source, result.made_at),
        &facts,
        number,
        secret,
        limits,
    )?;
    let mesh = stored::mesh(item, MESH_FILE)?;
    // A silent monitor is never cancelled.
    let voxels_in = || {
        let mask = voxelise(&mesh, facts.shape, &frame, &Monitor::silent());
        mask.map_err(|error| broken_result(&error))
    };
    let mask = match Resource::from_id(&item.id) {
        // A mask that is stored on another grid than the scan's.
        Some(Resource::Segmentation)
            if item.parameters.get("mask_grid") == Some(&"orthogonal".into()) =>
        {
            voxels_in()?
        }
        Some(Resource::Segmentation) => {
            let volume = stored::voxels(item, MASK_FILE, facts.shape, limits)?;
            stored::mask(&volume, |value| value > 0.5)
        }
        _ => voxels_in()?,
    };
    let report = stored::required(item, REPORT_FILE)?;
    let text = stored::report_text(&report)?;
    let figures: Option<SegmentationReport> = match Resource::from_id(&item.id) {
        Some(Resource::Segmentation) => Some(stored::report(&report)?),
        _ => None,
    };
    let pictures = [
        stored::read(item, SLICES_FILE)?,
        stored::read(item, POLAR_FILE)?,
    ];
    let [slices, polar] = pictures.each_ref().map(Option::as_deref);
    let axes = match object {
        DicomObject::Mask => figures.as_ref().and_then(SegmentationReport::axes),
        _ => None,
    };
    let cavity = axes.and_then(|(axis, superior)| {
        // A silent monitor is never cancelled.
        let cavity = cavity(&axis, &superior, &mesh, &mask, &frame, &Monitor::silent());
        cavity.unwrap_or_default()
    });
    let results = DicomResults::new(&scan, structure(item, &facts), &mask, &mesh, &text)
        .with_cavity(cavity.as_ref())
        .with_pictures(slices, polar);
    let results = match &figures {
        Some(report) => results.with_figures(report).with_reading(reading),
        None => results,
    };
    results.write(object).map_err(|error| error.explain())
}

/// The content of a result, by the parameters it was made with.
fn structure(item: &StoredItem, facts: &UploadFacts) -> Structure {
    let parameter = |name: &str| item.parameters.get(name).and_then(Value::as_str);
    match Resource::from_id(&item.id) {
        Some(Resource::Segmentation) => {
            Structure::from_organ(parameter("organ").unwrap_or_default())
        }
        // Of a volume of intensities, and without a choice by the caller, it is the left ventricle.
        _ if parameter("isolate") == Some("auto") && facts.labels.is_none() => {
            Structure::from_organ("left_ventricle")
        }
        _ => Structure::from_organ(""),
    }
}
