//! Whether a volume has the size of a scan of a chest.
//!
//! A file that states no unit of length, or none of its sizes, is read in millimetres, with voxels of 1 mm. Where no
//! heart is found in such a volume, its size is the likeliest reason.

use super::Volume;
use std::fmt;

/// The narrowest field of a scan in which a heart fits, along its longest side, mm.
const MIN_FIELD_MM: f64 = 100.0;

/// Size of the voxels in a file that states none, mm.
const DEFAULT_VOXEL_MM: f64 = 1.0;

/// A size that no scan of a chest is likely to have. It is printed as what follows a statement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OddSize {
    /// Voxels along i, j, k.
    shape: [usize; 3],
    /// Their sizes, mm.
    spacing_mm: [f64; 3],
}

impl OddSize {
    /// The size of `volume` if it is an odd one.
    pub fn from_volume(volume: &Volume) -> Option<Self> {
        let size = Self {
            shape: volume.shape,
            spacing_mm: volume.frame.spacing(),
        };
        let widest = size.field_mm().into_iter().fold(0.0, f64::max);
        let is_default = size.spacing_mm.iter().all(|mm| *mm == DEFAULT_VOXEL_MM);
        (widest < MIN_FIELD_MM || is_default).then_some(size)
    }

    fn field_mm(self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.shape[axis] as f64 * self.spacing_mm[axis])
    }
}

impl fmt::Display for OddSize {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |sizes: [f64; 3]| {
            let sizes = sizes.map(|mm| ((mm * 100.0).round() / 100.0).to_string());
            sizes.join(" x ")
        };
        write!(
            f,
            "; its voxels are {} mm and its field is {} mm: check the size of its voxels and its unit of length, \
             which is taken for mm where a file states none",
            list(self.spacing_mm),
            list(self.field_mm())
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;

    #[test]
    fn voxels_of_one_millimetre_and_narrow_fields_are_odd() {
        let of = |size: usize, mm: f64| {
            let shape = [size, size, 2];
            OddSize::from_volume(&Volume {
                shape,
                voxels: vec![0.0; size * size * 2],
                frame: VoxelToPatient::centred(shape, [mm; 3], Vec3::zeros()).unwrap(),
                integral: true,
            })
        };
        assert_eq!(of(64, 6.4), None);
        assert_eq!(of(128, 2.0), None);
        let odd = of(64, 1.0).unwrap().to_string();
        assert!(
            odd.contains("1 x 1 x 1 mm") && odd.contains("64 x 64 x 2 mm"),
            "{odd}"
        );
        assert!(of(200, 1.0).is_some() && of(64, 0.0064).is_some() && of(64, 1.5).is_some());
    }
}
