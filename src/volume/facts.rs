//! What was understood of a file, for a person to check.

use nalgebra::Matrix4;

/// The file's format.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
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
}

impl Format {
    /// The name by which people know it.
    pub fn as_str(self) -> &'static str {
        match self {
            Format::Nifti1 => "NIfTI-1",
            Format::Nifti1Pair => "NIfTI-1 pair",
            Format::Nifti2 => "NIfTI-2",
            Format::Nifti2Pair => "NIfTI-2 pair",
            Format::DicomNm => "DICOM NM",
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

/// Where the voxels' place in the patient was taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AffineSource {
    /// NIfTI's general affine (`srow_x/y/z`).
    Sform,
    /// NIfTI's rigid one (`quatern_*`, `qoffset_*`, `pixdim`).
    Qform,
    /// The spacing alone: orientation and origin are assumptions.
    Pixdim,
    /// DICOM's Image Position and Orientation (Patient), of the detector or of the image.
    ImagePosition,
    /// DICOM without a position (or an orientation): the origin is an assumption.
    UnknownOrigin,
}

impl AffineSource {
    /// The name in answers: `sform`, `qform`, `pixdim`, `image-position`, `unknown-origin`.
    pub fn as_str(self) -> &'static str {
        match self {
            AffineSource::Sform => "sform",
            AffineSource::Qform => "qform",
            AffineSource::Pixdim => "pixdim",
            AffineSource::ImagePosition => "image-position",
            AffineSource::UnknownOrigin => "unknown-origin",
        }
    }
}

/// The unit of length in which the file speaks; everything of ours is in millimetres.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LengthUnit {
    /// Not stated; millimetres are assumed, as every reader does.
    Unknown,
    /// Metres.
    Metre,
    /// Millimetres.
    Millimetre,
    /// Micrometres.
    Micrometre,
}

impl LengthUnit {
    /// Millimetres in one unit.
    pub fn in_millimetres(self) -> f64 {
        match self {
            LengthUnit::Metre => 1000.0,
            LengthUnit::Unknown | LengthUnit::Millimetre => 1.0,
            LengthUnit::Micrometre => 0.001,
        }
    }

    /// The unit's name.
    pub fn as_str(self) -> &'static str {
        match self {
            LengthUnit::Unknown => "unknown (read as mm)",
            LengthUnit::Metre => "m",
            LengthUnit::Millimetre => "mm",
            LengthUnit::Micrometre => "um",
        }
    }
}

/// Everything a person needs to see whether the right volume was read the right way.
#[derive(Debug, Clone, PartialEq)]
pub struct VolumeFacts {
    /// The file's format.
    pub format: Format,
    /// Order of its bytes.
    pub byte_order: ByteOrder,
    /// Whether it came gzipped.
    pub compressed: bool,
    /// The stored data type, as in `int16`.
    pub data_type: &'static str,
    /// Slope and intercept that were applied, if any.
    pub scaling: Option<(f64, f64)>,
    /// All dimensions in the file, trailing ones of size 1 included.
    pub file_shape: Vec<usize>,
    /// How many volumes of [`VolumeFacts::shape`] the file holds.
    pub frames: usize,
    /// Which of them was read, from 0; `None` where all were looked at.
    pub frame: Option<usize>,
    /// Voxels along i, j, k of one volume.
    pub shape: [usize; 3],
    /// Distance of neighbouring voxel centres along i, j, k, mm.
    pub spacing_mm: [f64; 3],
    /// Voxel index to LPS millimetres (DICOM's patient frame).
    pub affine_lps: Matrix4<f64>,
    /// Voxel index to RAS millimetres (NIfTI's patient frame).
    pub affine_ras: Matrix4<f64>,
    /// Where the affine came from.
    pub affine_source: AffineSource,
    /// The file's unit of length.
    pub unit: LengthUnit,
    /// The values.
    pub intensity: IntensitySummary,
    /// What a careful reader should know, in sentences.
    pub warnings: Vec<String>,
}

/// The values of a volume (or of all volumes of a file).
#[derive(Debug, Clone, PartialEq)]
pub struct IntensitySummary {
    /// Smallest number.
    pub minimum: f32,
    /// Largest number.
    pub maximum: f32,
    /// Their mean.
    pub mean: f64,
    /// Their sum.
    pub sum: f64,
    /// How many voxels are numbers.
    pub finite: u64,
    /// How many are not (NaN in the volume, NaN or infinite in the file).
    pub missing: u64,
    /// Whether every number is whole.
    pub integral: bool,
    /// The labels and their sizes where the volume looks like a label map: few whole values,
    /// and neighbours mostly alike. Background (0) left out; rising by label.
    pub labels: Option<Vec<LabelCount>>,
}

/// One label of a label map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelCount {
    /// The voxels' value.
    pub label: i64,
    /// How many voxels carry it.
    pub voxels: u64,
}
