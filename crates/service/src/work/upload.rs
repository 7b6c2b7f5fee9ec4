//! Validating uploads: volumes by [`ventriform::image::volume`], templates by [`ventriform::heart::deform`].

use super::files::volume_files;
use super::{limits, profile, template};
use crate::base::records::{Failure, Fault, LocalFile, ScanFields, StoreError, StoredVolume};
use crate::items::WorkOutput;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::given_mask::{MaskChoice, read_mask};
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::{self, GateFacts, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform::mesh::files::MeshStatement;
use ventriform::results::report::header_text;
use ventriform::runs::advice::Explain;

/// Most memory that [`UploadReader::inspect`] takes, bytes: that of the largest DICOM Segmentation. The
/// largest JPEG 2000 frame takes 40 MiB. A gzipped file of 16 MiB is unpacked in memory if it holds at
/// most 16 MiB, and everything else is read in portions.
pub const INSPECTION_MEMORY: u64 = 64 << 20;

/// Most memory that [`UploadReader::preview`] takes for volumes of `shape`, bytes: three planes of
/// voxels beside what an inspection takes.
pub fn preview_memory(shape: [usize; 3]) -> u64 {
    let [x, y, z] = shape.map(|n| n as u64);
    let voxels = x.saturating_mul(y) + y.saturating_mul(z) + x.saturating_mul(z);
    INSPECTION_MEMORY + voxels.saturating_mul(size_of::<f32>() as u64)
}

/// Most memory that [`UploadReader::voxels`] takes for volumes of `shape`, bytes: the voxels, the
/// same as 16-bit integers, and those packed, beside what an inspection takes.
pub fn voxels_memory(shape: [usize; 3]) -> u64 {
    let [x, y, z] = shape.map(|n| n as u64);
    let voxels = x.saturating_mul(y).saturating_mul(z);
    INSPECTION_MEMORY.saturating_add(voxels.saturating_mul(8))
}

/// Validates uploads. Its methods are called on blocking threads.
pub trait UploadReader: Send + Sync + 'static {
    /// Reads and validates the files of one volume.
    ///
    /// # Errors
    /// Why the files do not make up a usable volume.
    fn inspect(&self, files: &[LocalFile], monitor: &Monitor<'_>) -> Result<UploadFacts, Failure>;

    /// The statements of the files of one volume about patient, study and acquisition: the fields of
    /// [`Provenance`](ventriform::image::volume::Provenance), without the frames of slices, which differ
    /// between gates. `None` unless they are DICOM.
    ///
    /// # Errors
    /// As [`UploadReader::inspect`].
    fn scan(
        &self,
        files: &[LocalFile],
        monitor: &Monitor<'_>,
    ) -> Result<Option<ScanFields>, Failure>;

    /// The three orthogonal middle slices as a PNG.
    ///
    /// # Errors
    /// As [`UploadReader::inspect`].
    fn preview(&self, files: &[LocalFile], monitor: &Monitor<'_>) -> Result<Vec<u8>, Failure>;

    /// The voxels of one frame as a `.nii.gz` file of 16-bit integers.
    ///
    /// # Errors
    /// As [`UploadReader::inspect`], or why there is no such frame.
    fn voxels(
        &self,
        files: &[LocalFile],
        frame: Option<usize>,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure>;

    /// The structure that `choice` names in an expert's mask, as a `.nii.gz` file: 1 inside, 0 outside.
    ///
    /// # Errors
    /// As [`UploadReader::inspect`], or why the structure cannot be told.
    fn mask(
        &self,
        files: &[LocalFile],
        choice: &MaskChoice,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure>;

    /// Reads and validates a mesh that is to serve as a template of `organ`; `stated` is what the caller says of its
    /// unit and frame. Returns its main figures and every download.
    ///
    /// # Errors
    /// Why the mesh cannot be fitted.
    fn template(
        &self,
        mesh: &[u8],
        organ: &str,
        stated: &MeshStatement,
    ) -> Result<WorkOutput, Failure>;

    /// Whether a stored file holds voxels, where they lie and nothing else, so that it cannot name a patient.
    ///
    /// # Errors
    /// If it cannot be read, or the caller asked for an end.
    fn is_bare(&self, file: &LocalFile, monitor: &Monitor<'_>) -> Result<bool, Failure>;

    /// Reads and validates a reader's profile. Returns its main figures and its file.
    ///
    /// # Errors
    /// Why the profile cannot be used.
    fn profile(&self, profile: &[u8]) -> Result<WorkOutput, Failure>;

    /// Reads and validates normal limits. Returns their content and their file.
    ///
    /// # Errors
    /// Why the limits cannot be used.
    fn normals(&self, limits: &[u8]) -> Result<WorkOutput, Failure>;
}

/// Facts about a volume that was read. Stored as JSON in [`StoredVolume::facts`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct UploadFacts {
    /// `NIfTI-1`, `DICOM NM` ...
    pub format: String,
    /// Whether it was gzipped.
    pub compressed: bool,
    /// Voxels along i, j, k of one frame.
    pub shape: [usize; 3],
    /// Number of frames, each a volume of that shape.
    pub frames: usize,
    /// Voxel spacing along the first three axes, mm.
    pub spacing_mm: [f64; 3],
    /// Voxel index to millimetres in the patient frame LPS, row by row.
    pub affine: [[f64; 4]; 4],
    /// The source of the affine: `sform`, `qform`, `pixdim`.
    pub affine_source: String,
    /// The file's data type, such as `int16`.
    pub dtype: String,
    /// Summary of the values.
    pub intensity: IntensityFacts,
    /// The labels, rising, if the volume looks like a label map.
    pub labels: Option<Vec<i64>>,
    /// The gates, if it is gated.
    pub gates: Option<GateFacts>,
    /// Oddities of the file that do not prevent its use.
    pub warnings: Vec<String>,
}

/// A summary of the voxel values, slope and intercept applied.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct IntensityFacts {
    /// Smallest finite value.
    pub min: f64,
    /// Largest finite value.
    pub max: f64,
    /// Mean of the finite values.
    pub mean: f64,
    /// Number of voxels that are NaN or infinite.
    pub not_finite: u64,
}

impl UploadFacts {
    /// The facts as stored with a volume.
    pub fn to_json(&self) -> Value {
        serde_json::to_value(self).expect("facts always serialise")
    }

    /// The facts stored with `volume`.
    ///
    /// # Errors
    /// If the record is damaged.
    pub fn from_volume(volume: &StoredVolume) -> Result<Self, StoreError> {
        Self::deserialize(&volume.facts).map_err(|error| {
            StoreError::database(format!("volume {}: damaged facts: {error}", volume.id))
        })
    }
}

/// The reader of the product.
#[derive(Debug, Clone, Copy)]
pub struct DomainReader {
    /// Limits on a volume.
    pub limits: ReadLimits,
}

impl UploadReader for DomainReader {
    fn inspect(&self, files: &[LocalFile], monitor: &Monitor<'_>) -> Result<UploadFacts, Failure> {
        let facts = volume::inspect(&volume_files(files), &self.limits, monitor)
            .map_err(|error| error.explain())?;
        let affine = facts.affine_lps;
        Ok(UploadFacts {
            format: facts.format.as_str().into(),
            compressed: facts.compressed,
            shape: facts.shape,
            frames: facts.frames,
            spacing_mm: facts.spacing_mm,
            affine: std::array::from_fn(|row| std::array::from_fn(|column| affine[(row, column)])),
            affine_source: facts.affine_source.as_str().into(),
            dtype: facts.data_type.into(),
            intensity: IntensityFacts {
                min: facts.intensity.minimum.into(),
                max: facts.intensity.maximum.into(),
                mean: facts.intensity.mean,
                not_finite: facts.intensity.missing,
            },
            labels: facts
                .intensity
                .labels
                .map(|labels| labels.iter().map(|l| l.label).collect()),
            gates: facts.gates,
            warnings: (facts.warnings.iter())
                .map(|text| header_text::warning(text).into_owned())
                .collect(),
        })
    }

    fn scan(
        &self,
        files: &[LocalFile],
        monitor: &Monitor<'_>,
    ) -> Result<Option<ScanFields>, Failure> {
        let options = ReadOptions { frame: Some(0) };
        let found = volume::provenance(&volume_files(files), &options, &self.limits, monitor);
        let Some(mut found) = found.map_err(|error| error.explain())? else {
            return Ok(None);
        };
        found.slice_frames.clear();
        match serde_json::to_value(found) {
            Ok(Value::Object(fields)) => Ok(Some(ScanFields(fields))),
            _ => Ok(None),
        }
    }

    fn preview(&self, files: &[LocalFile], monitor: &Monitor<'_>) -> Result<Vec<u8>, Failure> {
        let picture = volume::preview_files(&volume_files(files), &self.limits, monitor)
            .map_err(|error| error.explain())?;
        Ok(picture.png())
    }

    fn voxels(
        &self,
        files: &[LocalFile],
        frame: Option<usize>,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure> {
        let options = ReadOptions { frame };
        let reading = volume::read(&volume_files(files), &options, &self.limits, monitor)
            .map_err(|error| error.explain())?;
        packed(&reading.volume)
    }

    fn mask(
        &self,
        files: &[LocalFile],
        choice: &MaskChoice,
        monitor: &Monitor<'_>,
    ) -> Result<Vec<u8>, Failure> {
        let mask = read_mask(&volume_files(files), choice, &self.limits, monitor)
            .map_err(|error| error.explain())?;
        packed(&mask.to_volume())
    }

    fn template(
        &self,
        mesh: &[u8],
        organ: &str,
        stated: &MeshStatement,
    ) -> Result<WorkOutput, Failure> {
        template::make(mesh, organ, stated)
    }

    fn is_bare(&self, file: &LocalFile, monitor: &Monitor<'_>) -> Result<bool, Failure> {
        let file = VolumeFile::at(file);
        nifti::is_bare(&file, &self.limits, monitor).map_err(|error| error.explain())
    }

    fn profile(&self, profile: &[u8]) -> Result<WorkOutput, Failure> {
        profile::make(profile)
    }

    fn normals(&self, limits: &[u8]) -> Result<WorkOutput, Failure> {
        limits::make(limits)
    }
}

/// The voxels as a packed file of 16-bit integers.
fn packed(volume: &Volume) -> Result<Vec<u8>, Failure> {
    nifti::write(volume, StoredType::Int16, true).map_err(|error| {
        Failure::new(Fault::Content, "axis-too-long", error.to_string())
            .fix("Download the upload itself instead.")
    })
}
