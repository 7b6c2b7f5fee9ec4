//! The stored files of a result.

use super::super::failures::{broken_result, not_exportable};
use crate::base::records::Failure;
use crate::items::StoredItem;
use serde::de::DeserializeOwned;
use serde_json::Value;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::voxelise::Mask;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::mesh::TriMesh;
use ventriform::results::export::read_json;
use ventriform::runs::advice::Explain;

/// A file's content; `None` if the result has no such file.
///
/// # Errors
/// If it cannot be read.
pub fn read(item: &StoredItem, name: &str) -> Result<Option<Vec<u8>>, Failure> {
    item.read_whole(name).map_err(|error| broken_result(&error))
}

/// A file's content.
///
/// # Errors
/// If it is missing or cannot be read.
pub fn required(item: &StoredItem, name: &str) -> Result<Vec<u8>, Failure> {
    read(item, name)?.ok_or_else(|| broken_result(&format!("the file {name} is missing")))
}

/// A report of type `R`.
///
/// # Errors
/// If it is none.
pub fn report<R: DeserializeOwned>(bytes: &[u8]) -> Result<R, Failure> {
    serde_json::from_slice(bytes).map_err(|error| broken_result(&error))
}

/// A report without its spaces; UIDs are derived from this text.
///
/// # Errors
/// If it is no JSON.
pub fn report_text(bytes: &[u8]) -> Result<String, Failure> {
    let whole: Value = serde_json::from_slice(bytes).map_err(|error| broken_result(&error))?;
    Ok(whole.to_string())
}

/// The mesh in the JSON file of that name.
///
/// # Errors
/// If it is missing or no mesh.
pub fn mesh(item: &StoredItem, name: &str) -> Result<TriMesh, Failure> {
    let bytes = required(item, name)?;
    read_json::decode(&bytes).map_err(|error| not_exportable(&error))
}

/// The volume in the NIfTI file of that name, which has `shape`.
///
/// # Errors
/// If it is missing, no volume, or of another shape.
pub fn voxels(
    item: &StoredItem,
    name: &str,
    shape: [usize; 3],
    limits: &ReadLimits,
) -> Result<Volume, Failure> {
    let file = VolumeFile::in_memory(name, required(item, name)?);
    let reading = volume::read(&[file], &ReadOptions::default(), limits, &Monitor::silent());
    let volume = reading.map_err(|error| error.explain())?.volume;
    if volume.shape == shape {
        Ok(volume)
    } else {
        Err(broken_result(&format!("{name} and volume differ in size")))
    }
}

/// The voxels of `volume` whose values are `chosen`.
pub fn mask(volume: &Volume, chosen: impl Fn(f32) -> bool) -> Mask {
    Mask {
        shape: volume.shape,
        voxels: volume.voxels.iter().map(|value| chosen(*value)).collect(),
    }
}
