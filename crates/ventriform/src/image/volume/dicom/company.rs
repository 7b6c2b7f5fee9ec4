//! Which of several DICOM files hold slices, and which only accompany them.
//!
//! An export from a workstation or a medium holds more than a series: presentation states, reports, captures, key
//! objects, projections, localizers. Of several files, those whose kind says that they hold no slices are set apart,
//! and a warning names them. So are projections where slices lie beside them: slices can be made of them, but those of
//! the camera's own software are there. A file that does not tell its kind stays, so that its damage is reported.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::VolumeFile;
use super::stored::{self, StoredDataSet};
use crate::base::progress::Monitor;
use ventriform_dicom::Endianness;
use ventriform_dicom::read::attributes::Attributes;
use ventriform_dicom::read::kind::Kind;
use ventriform_dicom::read::scan;

/// Most files that the warnings name.
const MOST_NAMED: usize = 8;

/// Files with slices, and what is said of the others.
pub(super) struct Sorted<'a> {
    pub slices: Vec<&'a VolumeFile>,
    pub notes: Vec<String>,
}

/// Sets those of `files` apart that hold no slices; a single file is taken as it is.
///
/// # Errors
/// The first file's [`VolumeError::NotVolume`] or [`VolumeError::NotSlices`] if none holds slices.
pub(super) fn set_apart<'a>(
    files: &[&'a VolumeFile],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Sorted<'a>, VolumeError> {
    let mut sorted = Sorted {
        slices: Vec::with_capacity(files.len()),
        notes: Vec::new(),
    };
    if let [file] = files {
        sorted.slices.push(file);
        return Ok(sorted);
    }
    let (mut others, mut projections) = (Vec::new(), Vec::new());
    for file in files {
        monitor.check()?;
        match check_kind(file, limits, monitor) {
            Err(error @ (VolumeError::NotVolume { .. } | VolumeError::NotSlices { .. })) => {
                others.push(error);
            }
            Err(error @ VolumeError::Cancelled(_)) => return Err(error),
            Ok(Some(Kind::Projections { .. })) => projections.push(*file),
            _ => sorted.slices.push(file),
        }
    }
    if sorted.slices.is_empty() {
        sorted.slices = projections;
    } else {
        others.extend(projections.into_iter().map(beside_slices));
    }
    if sorted.slices.is_empty()
        && let Some(first) = others.first()
    {
        return Err(first.clone());
    }
    let more = others.len().saturating_sub(MOST_NAMED);
    let named = others.iter().take(MOST_NAMED);
    sorted.notes = named
        .map(|error| format!("A file was left out: {error}."))
        .collect();
    if more > 0 {
        sorted
            .notes
            .push(format!("{more} more files without slices were left out."));
    }
    Ok(sorted)
}

/// What is said of projections that lie beside slices.
fn beside_slices(file: &VolumeFile) -> VolumeError {
    VolumeError::NotSlices {
        file: file.name().into(),
        image_type: "TOMO".into(),
        reason: "its frames are projections, and reconstructed slices lie beside them",
        fix: "Send the projections alone to have slices made of them.",
    }
}

/// The kind of the object in `file`, which can hold slices or become them; `None` if it does not tell.
///
/// # Errors
/// That it cannot, or why that is unknown.
fn check_kind(
    file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<Kind>, VolumeError> {
    match StoredDataSet::find(file, limits) {
        Ok(found) => {
            let mut source = found.open(file, limits.unpacked_bytes)?;
            Ok(scan::check_kind(
                &mut source,
                &found.syntax,
                &monitor.goes_on(),
            )?)
        }
        // A film is in a transfer syntax that is not read, and says what it is all the same.
        Err(error) => match stored::media_class(file, limits)? {
            Some(class) => {
                let mut attributes = Attributes::new(file.name(), Endianness::Little);
                attributes.media_class = Some(class);
                Ok(Some(Kind::from_attributes(&attributes)?))
            }
            None => Err(error),
        },
    }
}
