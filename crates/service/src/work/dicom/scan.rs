//! Whose scan a result is of, and which images or frames it was made of.

use super::super::failures::{
    broken_result, identity_needed, malformed_identity, unknown_identity,
};
use super::super::files::volume_files;
use super::super::upload::UploadFacts;
use crate::base::records::{Failure, ScanFields, ScanIdentity, Timestamp, rfc3339};
use crate::items::StoredSource;
use nalgebra::Matrix3;
use serde_json::{Map, Value};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{self, AffineSource, Provenance, ReadLimits, ReadOptions};
use ventriform::results::export::dicom::{
    Deidentification, DicomError, Moment, SourceScan, StatedIdentity, identity,
};
use ventriform::runs::advice::Explain;

/// Checks what a person states of a scan's identity beside what its file says, and completes one by
/// the other.
///
/// # Errors
/// A field that DICOM does not allow, that is unknown, or that differs from what the file says; or
/// the study or the patient is unknown.
pub fn check_stated(scan: &ScanIdentity, stated: &Map<String, Value>) -> Result<(), Failure> {
    for (name, value) in stated {
        if !StatedIdentity::FIELD_NAMES.contains(&name.as_str()) {
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

/// The texts of the fields; those of another type are left out.
fn provenance(fields: &ScanFields) -> Provenance {
    serde_json::from_value(fields.0.clone().into()).unwrap_or_default()
}

/// The scan that the objects of a result belong to, which was made at that moment: of the volume with the number
/// `frame`, or of all where it is `None`.
/// With a `secret` it is freed of the patient's identity.
///
/// # Errors
/// `identity-needed` if patient or study are unknown, or were erased; or if the upload cannot be read.
pub fn source(
    (source, made_at): (&StoredSource, Timestamp),
    facts: &UploadFacts,
    frame: Option<usize>,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<SourceScan, Failure> {
    let found = match &source.scan.found {
        Some(_) => {
            let files = volume_files(&source.files);
            volume::provenance(&files, &ReadOptions { frame }, limits, &Monitor::silent())
                .map_err(|error| error.explain())?
        }
        None => None,
    };
    let stated = match &source.scan.stated {
        Some(fields) => serde_json::from_value(fields.0.clone().into()).unwrap_or_default(),
        None => StatedIdentity::default(),
    };
    let known = identity(found.as_ref(), &stated).map_err(|error| match error {
        DicomError::NoIdentity { .. } => identity_needed(&error, &source.volume.id),
        other => other.explain(),
    })?;
    let placed = !AffineSource::ASSUMED
        .iter()
        .any(|a| a.as_str() == facts.affine_source);
    let made = moment(made_at);
    let scan = SourceScan::new(known, voxel_to_patient(facts)?, facts.shape, placed, made);
    Ok(match secret {
        Some(secret) => {
            let how = Deidentification {
                secret: secret.to_owned(),
            };
            scan.deidentified(&how, &StatedIdentity::default())
        }
        None => scan,
    })
}

/// [`source`] of all gates of a stored volume together.
///
/// # Errors
/// As there, and if the record is damaged.
pub fn whole(
    source: &StoredSource,
    made_at: Timestamp,
    secret: Option<&[u8]>,
    limits: &ReadLimits,
) -> Result<SourceScan, Failure> {
    let facts = UploadFacts::from_volume(&source.volume).map_err(|error| broken_result(&error))?;
    self::source((source, made_at), &facts, None, secret, limits)
}

/// The place of the volume's voxels.
///
/// # Errors
/// If the record is damaged.
pub fn voxel_to_patient(facts: &UploadFacts) -> Result<VoxelToPatient, Failure> {
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
