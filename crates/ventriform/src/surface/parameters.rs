//! Parameters of the surface's extraction.

use super::SurfaceError;
use crate::image::grid::Volume;
use crate::image::locate::Hints;

/// Choice of the iso-value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum IsoLevel {
    /// Half the ventricle's reference intensity, or another fraction near by where that tears the
    /// wall or closes the cavity; for masks the level that keeps their volume.
    Auto,
    /// A fraction (0, 1) of the ventricle's reference maximum.
    Fraction(f64),
    /// An intensity in the volume's own units.
    Absolute(f64),
    /// An intensity in the volume's own units, below which the object lies: for objects darker than their
    /// surroundings, and distances that are negative inside.
    Below(f64),
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

/// Treatment of handles, cavities and further components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TopologyMode {
    /// Remove them, so that one component without handles or cavities remains (a digital ball), and
    /// report the changes.
    Genus0,
    /// Keep them.
    Keep,
}

/// Treatment of the noise of intensities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Denoise {
    /// It is measured and taken off the surface.
    Auto,
    /// It stays: the surface lies at the iso-value of the voxels.
    Off,
}

/// Parameters of [`extract`](super::extract).
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceParameters {
    /// Default [`IsoLevel::Auto`].
    pub iso: IsoLevel,
    /// Default [`Isolate::Auto`].
    pub isolate: Isolate,
    /// Hints at the ventricle's position, for [`Isolate::Auto`]. Default: none.
    pub hints: Hints,
    /// Default [`TopologyMode::Genus0`].
    pub topology: TopologyMode,
    /// Sigma of the Gaussian that smooths binary masks before surfacing, 0..=3: a length, the same along
    /// every axis, in edges of a cube of a voxel's volume. Default 0.8 (measured best of the range on a known surface).
    pub mask_smoothing: f64,
    /// Default [`Denoise::Auto`].
    pub denoise: Denoise,
}

impl Default for SurfaceParameters {
    fn default() -> Self {
        Self {
            iso: IsoLevel::Auto,
            isolate: Isolate::Auto,
            hints: Hints::default(),
            topology: TopologyMode::Genus0,
            mask_smoothing: 0.8,
            denoise: Denoise::Auto,
        }
    }
}

impl SurfaceParameters {
    /// Checks the parameters against their ranges and the volume.
    ///
    /// # Errors
    /// The first one out of range.
    pub(super) fn check(&self, volume: &Volume) -> Result<(), SurfaceError> {
        let bad_iso = |value, expected| Err(SurfaceError::BadIso { value, expected });
        match self.iso {
            IsoLevel::Fraction(f) if !(f > 0.0 && f < 1.0) => {
                return bad_iso(f, "a fraction between 0 and 1 (0 % and 100 %)");
            }
            IsoLevel::Absolute(v) | IsoLevel::Below(v) if !(v as f32).is_finite() => {
                return bad_iso(v, "a finite intensity");
            }
            IsoLevel::Below(v) if matches!(self.isolate, Isolate::Label(_)) => {
                return bad_iso(v, "auto for a label, whose voxels are not below a value");
            }
            _ => {}
        }
        if !(0.0..=3.0).contains(&self.mask_smoothing) {
            let value = self.mask_smoothing;
            return Err(SurfaceError::BadSmoothing { value });
        }
        let shape = volume.shape;
        let voxels = volume.voxels.len();
        let product = shape.iter().try_fold(1usize, |a, &n| a.checked_mul(n));
        if product != Some(voxels) || voxels == 0 {
            return Err(SurfaceError::BadShape { shape, voxels });
        }
        let inside = |p: [usize; 3]| {
            if (0..3).all(|r| p[r] < shape[r]) {
                Ok(())
            } else {
                Err(SurfaceError::OutsideVolume { voxel: p, shape })
            }
        };
        match self.isolate {
            Isolate::Seed(seed) => inside(seed),
            Isolate::Box(first, last) => {
                inside(first)?;
                inside(last)?;
                if (0..3).any(|r| first[r] > last[r]) {
                    return Err(SurfaceError::EmptyBox { first, last });
                }
                Ok(())
            }
            _ => Ok(()),
        }
    }
}
