//! A closed surface in a file of a mesh, read as a volume: 1 inside, 0 outside.
//!
//! In: a file that [`crate::mesh::files`] reads. Out: the surface, and a grid about it whose voxels tell
//! inside from outside. Who has a grid of his own (an expert's mask on the scan's) voxelises the surface there and not
//! these voxels ([`GivenMask::on`](super::given_mask::GivenMask::on)).
//!
//! The grid is along the axes of the patient, of [`SPACING_MM`] voxels, finer for small surfaces and coarser for large
//! ones, so that [`LEAST_ACROSS`] voxels lie across and there are at most [`MOST_VOXELS`].

use super::VolumeError;
use super::decode::DataType;
use super::facts::{AffineSource, ByteOrder, FileFormat, LengthUnit};
use super::limits::ReadLimits;
use super::open::{Decoded, HeaderFacts, OpenVolume, Placement};
use super::source::{Source, VolumeFile};
use super::summary::Tally;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::voxelise::voxelise;
use crate::mesh::TriMesh;
use crate::mesh::files::{self, MeshFileError, MeshFormat, MeshStatement, UnlikelySize};

/// Distance of the voxels, mm.
const SPACING_MM: f64 = 1.0;
/// Fewest voxels across the greatest extent.
const LEAST_ACROSS: f64 = 32.0;
/// Most voxels, a cube of 128.
const MOST_VOXELS: f64 = 2_097_152.0;
/// Voxels beyond the surface on each side.
const BORDER_VOXELS: f64 = 2.0;
/// Bytes that are read at once.
const PORTION_BYTES: usize = 1 << 16;

/// A surface whose file was read and checked.
pub(super) struct SurfaceFile {
    name: String,
    packed: bool,
    format: MeshFormat,
    mesh: TriMesh,
    shape: [usize; 3],
    placement: Placement,
    unlikely: Option<UnlikelySize>,
}

/// The format of `file` if it is a mesh; `start` holds its first bytes.
pub(super) fn recognise(
    file: &VolumeFile,
    start: &[u8],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<MeshFormat>, Cancelled> {
    let Ok(source) = Source::open(file, limits.mesh_bytes) else {
        return Ok(None);
    };
    if !source.is_gzip() {
        return Ok(files::recognise(start, source.capacity()));
    }
    // How long a packed file is unpacked is known by unpacking it. A binary STL file states it.
    let Some(count) = start.get(80..84) else {
        return Ok(None);
    };
    let stated = 84 + 50 * u64::from(u32::from_le_bytes([count[0], count[1], count[2], count[3]]));
    let known = files::recognise(start, 0);
    if known.is_some() || stated > limits.mesh_bytes || stated > source.capacity() {
        return Ok(known);
    }
    Ok(match whole(file, limits, monitor) {
        Ok(bytes) => files::recognise(&bytes, bytes.len() as u64),
        Err(VolumeError::Cancelled(cancelled)) => return Err(cancelled),
        Err(_) => None,
    })
}

/// The unpacked bytes of `file`.
fn whole(
    file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Vec<u8>, VolumeError> {
    let mut source = Source::open(file, limits.mesh_bytes)?;
    let mut bytes = Vec::new();
    let mut portion = vec![0; PORTION_BYTES];
    loop {
        monitor.check()?;
        let got = source.fill(&mut portion)?;
        if got == 0 {
            break;
        }
        bytes.extend_from_slice(&portion[..got]);
    }
    source.finish()?;
    Ok(bytes)
}

impl SurfaceFile {
    /// Reads the surface in `file`.
    ///
    /// # Errors
    /// [`VolumeError`] if the file cannot be read or holds no closed surface.
    pub(super) fn open(
        file: &VolumeFile,
        stated: &MeshStatement,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Self, VolumeError> {
        let packed = Source::open(file, limits.mesh_bytes)?.is_gzip();
        let bytes = whole(file, limits, monitor)?;
        let refused = |error| match error {
            MeshFileError::Cancelled(cancelled) => VolumeError::Cancelled(cancelled),
            error => VolumeError::Mesh {
                file: file.name().into(),
                error,
            },
        };
        let read = files::look_watched(&bytes, stated, limits.mesh_bytes, monitor);
        let read = read.map_err(refused)?;
        drop(bytes);
        let (shape, frame) = grid(&read.mesh).ok_or_else(|| VolumeError::Mesh {
            file: file.name().into(),
            error: MeshFileError::Flat,
        })?;
        let mut warnings = vec![format!(
            "The file is a closed surface of {} triangles; its inside was voxelised at {:.3} mm.",
            read.mesh.triangles.len(),
            frame.spacing()[0]
        )];
        warnings.extend(read.notes);
        warnings.extend(
            read.unlikely
                .map(|unlikely| format!("No model can be made of it: {unlikely}.")),
        );
        Ok(Self {
            name: file.name().into(),
            packed,
            format: read.format,
            mesh: read.mesh,
            shape,
            placement: Placement {
                frame,
                source: AffineSource::Mesh,
                warnings,
            },
            unlikely: read.unlikely,
        })
    }

    fn voxels(&self, monitor: &Monitor) -> Result<Vec<f32>, Cancelled> {
        let mask = voxelise(&self.mesh, self.shape, &self.placement.frame, monitor)?;
        let value = |inside: &bool| f32::from(u8::from(*inside));
        Ok(mask.voxels.iter().map(value).collect())
    }
}

/// Shape and frame of the grid about `mesh`.
fn grid(mesh: &TriMesh) -> Option<([usize; 3], VoxelToPatient)> {
    let bounds = Aabb::around(&mesh.vertices);
    let size = bounds.max - bounds.min;
    let centre = bounds.min + size / 2.0;
    let mut spacing = SPACING_MM.min(size.amax() / LEAST_ACROSS);
    if !(spacing.is_finite() && spacing > 0.0) {
        return None;
    }
    // Each round brings the grid nearer to what is allowed, whatever the border takes.
    loop {
        let across = size.map(|s| (s / spacing).ceil() + 1.0 + 2.0 * BORDER_VOXELS);
        if across.product() <= MOST_VOXELS {
            let shape = [0, 1, 2].map(|a| across[a] as usize);
            let frame = VoxelToPatient::centred(shape, [spacing; 3], centre).ok()?;
            return Some((shape, frame));
        }
        spacing *= (across.product() / MOST_VOXELS).cbrt().clamp(1.01, 1e6);
    }
}

impl OpenVolume for SurfaceFile {
    fn header(&self) -> HeaderFacts<'_> {
        HeaderFacts {
            file: &self.name,
            format: FileFormat::Mesh(self.format),
            byte_order: ByteOrder::Little,
            compressed: self.packed,
            data_type: DataType::F32.name(),
            scaling: None,
            file_shape: self.shape.to_vec(),
            frames: 1,
            gated: false,
            shape: self.shape,
            placement: &self.placement,
            unit: LengthUnit::Millimetre,
            warnings: &[],
        }
    }

    fn problem(&self) -> Option<VolumeError> {
        Some(VolumeError::Mesh {
            file: self.name.clone(),
            error: MeshFileError::Size(self.unlikely?),
        })
    }

    fn surface(&self) -> Option<&TriMesh> {
        Some(&self.mesh)
    }

    fn decode_frame(&mut self, _frame: usize, monitor: &Monitor) -> Result<Decoded, VolumeError> {
        let voxels = self.voxels(monitor)?;
        let mut tally = Tally::default();
        tally.add_portion(&voxels);
        Ok(Decoded {
            voxels,
            tally,
            warnings: Vec::new(),
        })
    }

    fn stream_frame(
        &mut self,
        _frame: usize,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(), VolumeError> {
        take(0, &self.voxels(monitor)?);
        Ok(())
    }

    fn decode_all(
        &mut self,
        take: &mut dyn FnMut(usize, &[f32]),
        monitor: &Monitor,
    ) -> Result<(Tally, Vec<String>), VolumeError> {
        let decoded = self.decode_frame(0, monitor)?;
        take(0, &decoded.voxels);
        Ok((decoded.tally, decoded.warnings))
    }
}
