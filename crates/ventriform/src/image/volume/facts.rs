//! Facts about a file, for a person to check.

use crate::mesh::files::MeshFormat;
use nalgebra::Matrix4;
use serde::{Deserialize, Serialize};

/// Format of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FileFormat {
    /// NIfTI-1, voxels in the same file.
    Nifti1,
    /// NIfTI-1, header and voxels in two files.
    Nifti1Pair,
    /// NIfTI-2, voxels in the same file.
    Nifti2,
    /// NIfTI-2, header and voxels in two files.
    Nifti2Pair,
    /// DICOM Nuclear Medicine Image, all slices in one file.
    DicomNm,
    /// DICOM Nuclear Medicine Image of projections, of which slices were reconstructed.
    DicomProjections,
    /// DICOM Enhanced PET, CT or MR image: all slices in one file, each with its position.
    DicomEnhanced,
    /// PET, CT or MR slices, each in a DICOM file.
    DicomSeries,
    /// DICOM Segmentation, read as a volume of labels.
    DicomSeg,
    /// A closed surface, voxelised.
    Mesh(MeshFormat),
    /// No file: an array in memory.
    Array,
}

impl FileFormat {
    /// The common name of the format.
    pub fn as_str(self) -> &'static str {
        match self {
            FileFormat::Nifti1 => "NIfTI-1",
            FileFormat::Nifti1Pair => "NIfTI-1 pair",
            FileFormat::Nifti2 => "NIfTI-2",
            FileFormat::Nifti2Pair => "NIfTI-2 pair",
            FileFormat::DicomNm => "DICOM NM",
            FileFormat::DicomProjections => "DICOM NM projections",
            FileFormat::DicomEnhanced => "DICOM enhanced",
            FileFormat::DicomSeries => "DICOM series",
            FileFormat::DicomSeg => "DICOM SEG",
            FileFormat::Mesh(MeshFormat::Stl) => "STL mesh",
            FileFormat::Mesh(MeshFormat::Ply) => "PLY mesh",
            FileFormat::Mesh(MeshFormat::Obj) => "OBJ mesh",
            FileFormat::Mesh(MeshFormat::Vtk) => "VTK mesh",
            FileFormat::Mesh(MeshFormat::Vtp) => "VTP mesh",
            FileFormat::Mesh(MeshFormat::Gltf) => "glTF mesh",
            FileFormat::Mesh(MeshFormat::Json) => "JSON mesh",
            FileFormat::Array => "array",
        }
    }
}

/// Order of the bytes of a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ByteOrder {
    /// Least significant byte first.
    Little,
    /// Most significant byte first.
    Big,
}

impl ByteOrder {
    /// `little` or `big`.
    pub fn as_str(self) -> &'static str {
        match self {
            ByteOrder::Little => "little",
            ByteOrder::Big => "big",
        }
    }
}

/// The fields that define the position of the voxels in the patient.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AffineSource {
    /// NIfTI's general affine (`srow_x/y/z`).
    Sform,
    /// NIfTI's rigid transform (`quatern_*`, `qoffset_*`, `pixdim`).
    Qform,
    /// NIfTI's spacing alone: orientation and origin are assumptions.
    Pixdim,
    /// DICOM's Image Position and Orientation (Patient), of the detector or of the image.
    ImagePosition,
    /// DICOM without a position or an orientation: the origin is an assumption.
    UnknownOrigin,
    /// No field: the grid was laid about a mesh, whose vertices say where it is.
    Mesh,
    /// The affine that came with an array.
    Caller,
}

impl AffineSource {
    /// Those by which orientation or origin in the patient are assumed.
    pub const ASSUMED: [Self; 2] = [Self::Pixdim, Self::UnknownOrigin];

    /// Whether the orientation in the patient is stated. NIfTI's spacing alone says nothing about it.
    pub fn states_orientation(self) -> bool {
        self != Self::Pixdim
    }

    /// Whether orientation and origin in the patient are stated, not assumed.
    pub fn is_placed(self) -> bool {
        !Self::ASSUMED.contains(&self)
    }

    /// The name in JSON: `sform`, `qform`, `pixdim`, `image-position`, `unknown-origin`, `mesh`,
    /// `caller`.
    pub fn as_str(self) -> &'static str {
        match self {
            AffineSource::Sform => "sform",
            AffineSource::Qform => "qform",
            AffineSource::Pixdim => "pixdim",
            AffineSource::ImagePosition => "image-position",
            AffineSource::UnknownOrigin => "unknown-origin",
            AffineSource::Mesh => "mesh",
            AffineSource::Caller => "caller",
        }
    }
}

/// The unit of length in the file. All lengths in this crate are in millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// Not stated: read as millimetres, as other readers do.
    Unknown,
    /// Metres.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Micrometres.
    Micrometre,
}

impl LengthUnit {
    /// Millimetres per unit.
    pub fn in_millimetres(self) -> f64 {
        match self {
            LengthUnit::Metre => 1000.0,
            LengthUnit::Unknown | LengthUnit::Millimetre => 1.0,
            LengthUnit::Micrometre => 0.001,
        }
    }

    /// The symbol of the unit.
    pub fn as_str(self) -> &'static str {
        match self {
            LengthUnit::Unknown => "unknown (read as mm)",
            LengthUnit::Metre => "m",
            LengthUnit::Millimetre => "mm",
            LengthUnit::Micrometre => "um",
        }
    }
}

/// Facts by which a person checks that the right volume was read correctly.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeFacts {
    /// Format of the file.
    pub format: FileFormat,
    /// Byte order of the file.
    pub byte_order: ByteOrder,
    /// Whether the file is gzipped.
    pub compressed: bool,
    /// The stored data type, for example `int16`.
    pub data_type: &'static str,
    /// Slope and intercept that were applied, if any.
    pub scaling: Option<(f64, f64)>,
    /// All dimensions in the file, including trailing ones of size 1.
    pub file_shape: Vec<usize>,
    /// Number of volumes in the file.
    pub frames: usize,
    /// The volume that was read, from 0; `None` if all were examined or summed.
    pub frame: Option<usize>,
    /// Voxels along i, j, k of one volume.
    pub shape: [usize; 3],
    /// Distance of neighbouring voxel centres along i, j, k, mm.
    pub spacing_mm: [f64; 3],
    /// Voxel index to LPS millimetres (DICOM's patient frame).
    pub affine_lps: Matrix4<f64>,
    /// Voxel index to RAS millimetres (NIfTI's patient frame).
    pub affine_ras: Matrix4<f64>,
    /// The fields that define the affine.
    pub affine_source: AffineSource,
    /// Unit of length in the file.
    pub unit: LengthUnit,
    /// Figures over the values.
    pub intensity: IntensitySummary,
    /// The gates; `None` if the file holds one volume, or its volumes are no gates of a heart beat.
    pub gates: Option<GateFacts>,
    /// Assumptions, contradictions and oddities, in sentences.
    pub warnings: Vec<String>,
}

/// The gates of a study, and what its files say of the beats.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Gates))]
pub struct GateFacts {
    /// Gates of one R-R interval.
    pub number: usize,
    /// R-R intervals into which the beats were sorted by their length.
    pub intervals: usize,
    /// The R-R interval, ms; `null` if the files do not say, or have several: that with the most counts is taken.
    pub rr_ms: Option<f64>,
    /// Beats accepted.
    pub beats_accepted: Option<f64>,
    /// Beats rejected.
    pub beats_rejected: Option<f64>,
}

/// Figures over the values of a volume, or of all volumes of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct IntensitySummary {
    /// Smallest value.
    pub minimum: f32,
    /// Largest value.
    pub maximum: f32,
    /// Mean of the values that are not missing.
    pub mean: f64,
    /// Sum of the values that are not missing.
    pub sum: f64,
    /// Number of voxels that have a finite value.
    pub finite: u64,
    /// Number of voxels that do not (NaN in the volume, NaN or infinite in the file).
    pub missing: u64,
    /// Whether all finite values are whole numbers.
    pub integral: bool,
    /// The labels and their sizes, in ascending order and without background (0), if the volume looks
    /// like a label map: few different whole values, and neighbours mostly alike.
    pub labels: Option<Vec<LabelCount>>,
}

/// One label of a label map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct LabelCount {
    /// Value of the voxels.
    pub label: i64,
    /// Number of voxels with that value.
    pub voxels: u64,
}
