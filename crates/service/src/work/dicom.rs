//! Stored results as DICOM objects, for the archive.
//!
//! In: a stored result with its volume and whose scan that is, as
//! [`Items::result`](crate::items::Items::result) returns them for [`SOURCE_FILES`]. Out: the file of one
//! [`DicomObject`]. To be called on a blocking thread, from a request, a job or a delivery alike.
//!
//! Objects are not stored: the same result, scan and secret give the same bytes, UIDs included.
//! Slices and instances of the source are read from the kept upload. What a tenant has erased of the
//! scan's identity is not read again.

use super::files::volume_files;
use super::problems::{
    Explain, broken_result, identity_needed, malformed_identity, not_exportable, unknown_identity,
};
use super::upload::UploadFacts;
use crate::items::{OutputFile, StoredItem, StoredResult};
use crate::records::{Failure, Resource, ScanFields, ScanIdentity, Timestamp, rfc3339};
use nalgebra::Matrix3;
use serde_json::{Map, Value};
use ventriform::export::dicom::{
    Deidentification, DicomError, DicomObject, DicomResults, Moment, SourceScan, StatedIdentity,
    Structure, identity,
};
use ventriform::export::read_json;
use ventriform::geometry::Vec3;
use ventriform::geometry::frame::VoxelToPatient;
use ventriform::grid::voxelise::{Mask, voxelise};
use ventriform::mesh::TriMesh;
use ventriform::progress::Monitor;
use ventriform::report::SegmentationReport;
use ventriform::segmentation::cavity;
use ventriform::volume::Provenance;
use ventriform::volume::{self, AffineSource, ReadLimits, ReadOptions, VolumeFile};

/// The files of a result of which objects are made.
pub const SOURCE_FILES: &[&str] = &[
    MASK_FILE,
    "mesh.json",
    "report.json",
    "slices.png",
    "polar.png",
];

const MASK_FILE: &str = "mask.nii.gz";

/// The objects that are made of results of that kind. Of a segmentation without polar map there is
/// no [`DicomObject::Polar`].
pub fn objects(kind: Resource) -> &'static [DicomObject] {
    match kind {
        Resource::Segmentation => &DicomObject::ALL,
        Resource::Model => &[
            DicomObject::Mask,
            DicomObject::Contours,
            DicomObject::Mesh,
            DicomObject::Surface,
        ],
        _ => &[],
    }
}

/// The object with that file name that is made of results of that kind.
pub fn object_named(kind: Resource, name: &str) -> Option<DicomObject> {
    let all = objects(kind).iter();
    all.copied().find(|object| object.file_name() == name)
}

/// Most memory that [`object`] takes for a volume of `shape`, bytes: mask, its bits and the file.
pub fn object_memory(shape: [usize; 3]) -> u64 {
    let voxels = shape
        .iter()
        .fold(1, |all: u64, n| all.saturating_mul(*n as u64));
    (64 << 20) + voxels.saturating_mul(8)
}

/// Checks what a person states of a scan's identity beside what its file says, and completes one by
/// the other.
///
/// # Errors
/// A field that DICOM does not allow, that is unknown, or that differs from what the file says; or
/// the study or the patient is unknown.
pub fn check_stated(scan: &ScanIdentity, stated: &Map<String, Value>) -> Result<(), Failure> {
    for (name, value) in stated {
        if !StatedIdentity::FIELDS.contains(&name.as_str()) {
            return Err(unknown_identity(name));
        }
        if !value.is_string() {
            return Err(malformed_identity(name));
        }
    }
    let known: StatedIdentity = serde_json::from_value(stated.clone().into()).unwrap_or_default();
    let found = scan.found.as_ref().map(provenance);
    identity(found.as_ref(), &known).map_err(|error| error.explain())?;
    Ok(())
}

/// One object of a stored result; `None` if the result has no picture of that name. With a `secret`,
/// the object is freed of the patient's identity, and its UIDs are derived from the secret.
///
/// # Errors
/// `identity-needed` if patient or study of the scan are unknown, or were erased; `not-exportable`
/// if DICOM cannot express the result.
pub fn object(
    result: &StoredResult,
    object: DicomObject,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<Option<OutputFile>, Failure> {
    let facts = UploadFacts::of(&result.volume).map_err(|error| broken_result(&error))?;
    let frame = voxel_to_patient(&facts)?;
    let scan = source(result, &facts, frame.clone(), limits)?;
    let scan = match secret {
        Some(secret) => {
            let how = Deidentification {
                secret: secret.to_owned(),
            };
            scan.deidentified(&how, &StatedIdentity::default())
        }
        None => scan,
    };
    let item = &result.files;
    let mesh = mesh(item)?;
    let mask = match Resource::of(&item.id) {
        // A mask that is stored on another grid than the scan's.
        Some(Resource::Segmentation)
            if item.parameters.get("mask_grid") == Some(&"orthogonal".into()) =>
        {
            voxelise(&mesh, facts.shape, &frame)
        }
        Some(Resource::Segmentation) => stored_mask(item, limits)?,
        _ => voxelise(&mesh, facts.shape, &frame),
    };
    if mask.shape != facts.shape {
        return Err(broken_result(&"mask and volume differ in size"));
    }
    let report = required(item, "report.json")?;
    // UIDs are derived from the text without its spaces.
    let text: Value = serde_json::from_slice(&report).map_err(|error| broken_result(&error))?;
    let text = text.to_string();
    let figures = match Resource::of(&item.id) {
        Some(Resource::Segmentation) => Some(figures(&report)?),
        _ => None,
    };
    let pictures = [read(item, "slices.png")?, read(item, "polar.png")?];
    let [slices, polar] = pictures.each_ref().map(Option::as_deref);
    let axes = match object {
        DicomObject::Mask => figures.as_ref().and_then(SegmentationReport::axes),
        _ => None,
    };
    let cavity = axes.and_then(|(axis, superior)| {
        // A silent monitor is never cancelled.
        let cavity = cavity(&axis, &superior, &mesh, (&mask, &frame), &Monitor::silent());
        cavity.unwrap_or_default()
    });
    let results = DicomResults::new(&scan, structure(item, &facts), &mask, &mesh, &text)
        .with_cavity(cavity.as_ref())
        .with_pictures(slices, polar);
    let results = match &figures {
        Some(report) => results.with_figures(report),
        None => results,
    };
    let made = results.write(object);
    let bytes = made.map_err(|error| error.explain())?;
    Ok(bytes.map(|bytes| OutputFile {
        name: object.file_name().into(),
        media_type: DicomObject::MEDIA_TYPE.into(),
        bytes,
    }))
}

fn figures(report: &[u8]) -> Result<SegmentationReport, Failure> {
    serde_json::from_slice(report).map_err(|error| broken_result(&error))
}

/// The texts of the fields; those of another type are left out.
fn provenance(fields: &ScanFields) -> Provenance {
    serde_json::from_value(fields.0.clone().into()).unwrap_or_default()
}

/// The scan that the objects belong to.
fn source(
    result: &StoredResult,
    facts: &UploadFacts,
    frame: VoxelToPatient,
    limits: &ReadLimits,
) -> Result<SourceScan, Failure> {
    let found = match &result.scan.found {
        Some(_) => source_frames(result, limits)?,
        None => None,
    };
    let stated = match &result.scan.stated {
        Some(fields) => serde_json::from_value(fields.0.clone().into()).unwrap_or_default(),
        None => StatedIdentity::default(),
    };
    let known = identity(found.as_ref(), &stated).map_err(|error| match error {
        DicomError::NoIdentity { .. } => identity_needed(&error, &result.volume.id),
        other => other.explain(),
    })?;
    let assumed = [AffineSource::Pixdim, AffineSource::UnknownOrigin];
    let placed = !assumed.iter().any(|a| a.as_str() == facts.affine_source);
    let made = moment(result.made_at);
    Ok(SourceScan::new(known, frame, facts.shape, placed, made))
}

/// The fields of the upload, with the instances and frames of the volume that the result was made of.
fn source_frames(
    result: &StoredResult,
    limits: &ReadLimits,
) -> Result<Option<Provenance>, Failure> {
    let frame = result.files.parameters.get("frame").and_then(Value::as_u64);
    let frame = frame.and_then(|frame| usize::try_from(frame).ok());
    let files = volume_files(&result.volume_files);
    volume::provenance(&files, &ReadOptions { frame }, limits, &Monitor::silent())
        .map_err(|error| error.explain())
}

fn voxel_to_patient(facts: &UploadFacts) -> Result<VoxelToPatient, Failure> {
    let a = &facts.affine;
    let linear = Matrix3::from_fn(|row, column| a[row][column]);
    let origin = Vec3::from_fn(|row, _| a[row][3]);
    VoxelToPatient::new(linear, origin).map_err(|error| broken_result(&error))
}

/// `YYYYMMDD` and `HHMMSS` of a moment, in UTC.
fn moment(at: Timestamp) -> Moment {
    let text = rfc3339(at);
    let digits = |range: std::ops::Range<usize>| {
        let part = text.get(range).unwrap_or_default().chars();
        part.filter(char::is_ascii_digit).collect()
    };
    Moment {
        date: digits(0..10),
        time: digits(11..19),
    }
}

/// The content of a result, by the parameters it was made with.
fn structure(item: &StoredItem, facts: &UploadFacts) -> Structure {
    let parameter = |name: &str| item.parameters.get(name).and_then(Value::as_str);
    match Resource::of(&item.id) {
        Some(Resource::Segmentation) => Structure::of(parameter("organ").unwrap_or_default()),
        // Of a volume of intensities, and without a choice by the caller, it is the left ventricle.
        _ if parameter("isolate") == Some("auto") && facts.labels.is_none() => {
            Structure::of("left_ventricle")
        }
        _ => Structure::of(""),
    }
}

fn read(item: &StoredItem, name: &str) -> Result<Option<Vec<u8>>, Failure> {
    item.read(name).map_err(|error| broken_result(&error))
}

fn required(item: &StoredItem, name: &str) -> Result<Vec<u8>, Failure> {
    read(item, name)?.ok_or_else(|| broken_result(&format!("the file {name} is missing")))
}

fn mesh(item: &StoredItem) -> Result<TriMesh, Failure> {
    let bytes = required(item, "mesh.json")?;
    read_json::decode(&bytes).map_err(|error| not_exportable(&error))
}

fn stored_mask(item: &StoredItem, limits: &ReadLimits) -> Result<Mask, Failure> {
    let file = VolumeFile::in_memory(MASK_FILE, required(item, MASK_FILE)?);
    let reading = volume::read(&[file], &ReadOptions::default(), limits, &Monitor::silent());
    let volume = reading.map_err(|error| error.explain())?.volume;
    Ok(Mask {
        shape: volume.shape,
        voxels: volume.voxels.iter().map(|value| *value > 0.5).collect(),
    })
}
