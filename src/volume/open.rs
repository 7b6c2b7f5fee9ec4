//! Steps that are the same for every format once a file's header has been checked.
//!
//! A format implements [`OpenVolume`]; [`read`] and [`inspect`] do the rest.

use super::decode::DataType;
use super::facts::{
    AffineSource, ByteOrder, FileFormat, IntensitySummary, LengthUnit, VolumeFacts,
};
use super::limits::ReadOptions;
use super::summary::{Tally, judge, summarise};
use super::{Volume, VolumeError};
use crate::geometry::frame::VoxelToPatient;
use crate::progress::Monitor;

/// A volume and the facts about the file it was read from.
#[derive(Debug, Clone)]
pub struct Reading {
    /// Voxels and their position in the patient.
    pub volume: Volume,
    /// Facts about the file.
    pub facts: VolumeFacts,
}

/// A file whose header has been read and checked.
pub(super) trait OpenVolume {
    /// Everything the header says about the volumes.
    fn header(&self) -> HeaderFacts<'_>;

    /// Decodes volume number `frame`, from 0.
    fn decode_frame(&mut self, frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError>;

    /// Decodes all volumes one after the other without keeping their voxels.
    fn decode_all(&mut self, monitor: &Monitor) -> Result<(Tally, Vec<String>), VolumeError>;
}

/// The content of a header that [`VolumeFacts`] repeats.
pub(super) struct HeaderFacts<'a> {
    /// Name of the file.
    pub file: &'a str,
    pub format: FileFormat,
    pub byte_order: ByteOrder,
    /// Whether the voxels are stored in a gzipped file.
    pub compressed: bool,
    /// The stored data type, for example `int16`.
    pub data_type: &'static str,
    /// Slope and intercept, if the voxels are scaled.
    pub scaling: Option<(f64, f64)>,
    /// All dimensions in the file.
    pub file_shape: Vec<usize>,
    /// Number of volumes.
    pub frames: usize,
    /// Voxels along i, j, k of one volume.
    pub shape: [usize; 3],
    pub placement: &'a Placement,
    pub unit: LengthUnit,
    /// Warnings about the header other than those of its placement.
    pub warnings: &'a [String],
}

/// Position of a voxel grid in the patient.
#[derive(Debug, Clone)]
pub(super) struct Placement {
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// The fields that define the position.
    pub source: AffineSource,
    /// Assumptions and contradictions.
    pub warnings: Vec<String>,
}

/// The decoded voxels of one volume.
pub(super) struct Decoded {
    /// Values with slope and intercept applied, i fastest.
    pub voxels: Vec<f32>,
    /// Running figures over the voxels.
    pub tally: Tally,
    /// Warnings about the values.
    pub warnings: Vec<String>,
}

/// Reads the volume that `options` ask for.
pub(super) fn read(
    file: &mut dyn OpenVolume,
    options: ReadOptions,
    monitor: &Monitor,
) -> Result<Reading, VolumeError> {
    let frame = options.choose(file.header().frames)?;
    let decoded = file.decode_frame(frame, monitor)?;
    let header = file.header();
    let shape = header.shape;
    let intensity = decoded.tally.with_labels(&decoded.voxels, shape[0]);
    let volume = Volume {
        shape,
        voxels: decoded.voxels,
        frame: header.placement.frame.clone(),
        integral: intensity.integral,
    };
    let facts = facts(header, Some(frame), intensity, decoded.warnings)?;
    Ok(Reading { volume, facts })
}

/// Decodes every volume of `file` and returns the facts.
pub(super) fn inspect(
    file: &mut dyn OpenVolume,
    monitor: &Monitor,
) -> Result<VolumeFacts, VolumeError> {
    if file.header().frames == 1 {
        let only = ReadOptions { frame: Some(0) };
        return Ok(read(file, only, monitor)?.facts);
    }
    let (tally, warnings) = file.decode_all(monitor)?;
    facts(file.header(), None, tally.summary(None), warnings)
}

/// The facts about a volume that comes from an array in memory instead of a file.
///
/// # Errors
/// [`VolumeError::NoFiniteVoxel`] if every voxel is NaN.
pub fn describe(volume: &Volume) -> Result<VolumeFacts, VolumeError> {
    let placement = Placement {
        frame: volume.frame.clone(),
        source: AffineSource::Caller,
        warnings: Vec::new(),
    };
    let header = HeaderFacts {
        file: "the array",
        format: FileFormat::Array,
        byte_order: ByteOrder::Little,
        compressed: false,
        data_type: DataType::F32.name(),
        scaling: None,
        file_shape: volume.shape.to_vec(),
        frames: 1,
        shape: volume.shape,
        placement: &placement,
        unit: LengthUnit::Millimetre,
        warnings: &[],
    };
    let intensity = summarise(&volume.voxels, volume.shape[0]);
    facts(header, Some(0), intensity, Vec::new())
}

fn facts(
    header: HeaderFacts<'_>,
    frame: Option<usize>,
    intensity: IntensitySummary,
    voxel_warnings: Vec<String>,
) -> Result<VolumeFacts, VolumeError> {
    let placement = header.placement;
    let mut warnings = header.warnings.to_vec();
    warnings.extend(placement.warnings.iter().cloned());
    warnings.extend(voxel_warnings);
    warnings.extend(judge(&intensity, header.file)?);
    Ok(VolumeFacts {
        format: header.format,
        byte_order: header.byte_order,
        compressed: header.compressed,
        data_type: header.data_type,
        scaling: header.scaling,
        file_shape: header.file_shape,
        frames: header.frames,
        frame,
        shape: header.shape,
        spacing_mm: placement.frame.spacing(),
        // Adding 0 turns negative zeros into positive ones.
        affine_lps: placement.frame.matrix().add_scalar(0.0),
        affine_ras: placement.frame.to_ras().add_scalar(0.0),
        affine_source: placement.source,
        unit: header.unit,
        intensity,
        warnings,
    })
}
