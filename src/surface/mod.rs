//! From voxels to a closed triangle surface of the wall.
//!
//! STUB: the owner of this folder writes the module page.

pub mod labels;
pub mod marching_cubes;
pub mod table;

use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::progress::{Cancelled, Monitor};
use crate::volume::Volume;

/// How the iso-value is chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IsoLevel {
    /// The region's own choice: a fraction of the ventricle's maximum that does not merge it
    /// with its neighbours; for masks the level that keeps their volume.
    Auto,
    /// A fraction (0, 1) of the ventricle's reference maximum.
    Fraction(f64),
    /// An intensity in the volume's own units.
    Absolute(f64),
}

/// Which part of the volume is the object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Isolate {
    /// A label map's label, or else the left ventricle, searched among liver and gut.
    Auto,
    /// Everything above the iso-value.
    None,
    /// The largest connected part above the iso-value.
    Largest,
    /// Voxels inside the box, first and last index (inclusive) along i, j, k.
    Box([usize; 3], [usize; 3]),
    /// The connected part that holds the voxel (0-based i, j, k).
    Seed([usize; 3]),
    /// Voxels that carry this value in a label map.
    Label(i64),
}

/// What becomes of handles, cavities and further components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TopologyMode {
    /// Make one component without handles or cavities (a digital ball) and say what it took.
    Genus0,
    /// Leave everything as the iso-surface has it.
    Keep,
}

/// Parameters of [`extract`].
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceParameters {
    /// Default [`IsoLevel::Auto`].
    pub iso: IsoLevel,
    /// Default [`Isolate::Auto`].
    pub isolate: Isolate,
    /// Default [`TopologyMode::Genus0`].
    pub topology: TopologyMode,
    /// Gaussian sigma in voxels that smooths binary masks before surfacing, 0..=3. Default
    /// 0.8 (measured best of the range on a known surface).
    pub mask_smoothing: f64,
}

impl Default for SurfaceParameters {
    fn default() -> Self {
        Self {
            iso: IsoLevel::Auto,
            isolate: Isolate::Auto,
            topology: TopologyMode::Genus0,
            mask_smoothing: 0.8,
        }
    }
}

/// A closed, oriented surface in patient space and what was done to get it.
#[derive(Debug, Clone)]
pub struct Surface {
    /// The reference surface S: LPS millimetres, closed manifold, facing outward.
    pub mesh: TriMesh,
    /// The working surface W: S's vertices after Taubin smoothing, same connectivity. For
    /// geodesics and curvature only; distances are measured against S.
    pub working: Vec<Vec3>,
    /// Smallest voxel spacing, mm.
    pub spacing: f64,
    /// What was seen and changed on the way.
    pub facts: SurfaceFacts,
}

/// What [`extract`] saw and did; goes into the report.
#[derive(Debug, Clone, Default)]
pub struct SurfaceFacts {
    /// The iso-value used, in the volume's units.
    pub iso_value: f64,
    /// Things a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Why there is no surface.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Extracts the surface.
///
/// # Errors
/// See [`SurfaceError`].
pub fn extract(
    _volume: &Volume,
    _parameters: &SurfaceParameters,
    _monitor: &Monitor,
) -> Result<Surface, SurfaceError> {
    Err(SurfaceError::Cancelled(Cancelled))
}
