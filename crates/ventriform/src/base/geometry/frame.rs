//! Coordinate frames: from voxel indices to patient coordinates.
//!
//! A volume is an array with indices (i, j, k), of which i varies fastest; index (0, 0, 0) is the
//! *centre* of the first voxel. [`VoxelToPatient`] maps indices, fractional ones too, to
//! millimetres in the patient frame of DICOM, LPS: x increases to the patient's left, y to
//! posterior, z to superior. NIfTI uses RAS, in which x and y have the opposite sign;
//! [`VoxelToPatient::from_ras`], [`VoxelToPatient::to_ras`] and [`lps_of_ras`] are the only conversions.

use super::Vec3;
use nalgebra::{Matrix3, Matrix4};

/// Sizes that a voxel of a scan can have, mm: from scanners of mice to thick slices. Work and memory of a blur grow
/// with the number of voxels in a millimetre.
pub const VOXEL_MM: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// The affine map from voxel indices to LPS millimetres; always finite and invertible.
#[derive(Debug, Clone, PartialEq)]
pub struct VoxelToPatient {
    linear: Matrix3<f64>,
    origin: Vec3,
    inverse: Matrix3<f64>,
}

/// An affine map is not finite or not invertible.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the affine is singular or not finite")]
pub struct SingularAffine;

/// The point in LPS that has the coordinates `ras` in RAS.
pub fn lps_of_ras(ras: &Vec3) -> Vec3 {
    Vec3::new(-ras.x, -ras.y, ras.z)
}

/// The point in LPS that has the coordinates `world` in the frame of glTF, in which the patient stands upright
/// and faces +Z: x to the left, y to superior, z to anterior.
pub fn lps_of_y_up(world: &Vec3) -> Vec3 {
    Vec3::new(world.x, -world.z, world.y)
}

impl VoxelToPatient {
    /// The map with the given linear part, whose columns are the steps of i, j, k in millimetres
    /// (LPS), and with the centre of voxel (0, 0, 0) at `origin`.
    ///
    /// # Errors
    /// [`SingularAffine`] if an entry is not finite, or if the volume of a voxel is less than a
    /// millionth of the product of its spacings.
    pub fn new(linear: Matrix3<f64>, origin: Vec3) -> Result<Self, SingularAffine> {
        let spacing_product: f64 = linear.column_iter().map(|c| c.norm()).product();
        let finite = linear.iter().chain(origin.iter()).all(|x| x.is_finite());
        if !finite || !(spacing_product > 0.0) || !spacing_product.is_finite() {
            return Err(SingularAffine);
        }
        if linear.determinant().abs() < 1e-6 * spacing_product {
            return Err(SingularAffine);
        }
        let inverse = linear.try_inverse().ok_or(SingularAffine)?;
        Ok(Self {
            linear,
            origin,
            inverse,
        })
    }

    /// The map given by an affine of NIfTI, from indices to RAS+ millimetres.
    ///
    /// # Errors
    /// See [`VoxelToPatient::new`].
    pub fn from_ras(ras: &Matrix4<f64>) -> Result<Self, SingularAffine> {
        let turn = Matrix3::from_diagonal(&Vec3::new(-1.0, -1.0, 1.0));
        let linear = turn * ras.fixed_view::<3, 3>(0, 0);
        let origin = turn * ras.fixed_view::<3, 1>(0, 3);
        Self::new(linear, origin)
    }

    /// The map for an axis-aligned array of voxels of `spacing` mm that is centred at `centre`.
    ///
    /// # Errors
    /// See [`VoxelToPatient::new`].
    pub fn centred(
        shape: [usize; 3],
        spacing: [f64; 3],
        centre: Vec3,
    ) -> Result<Self, SingularAffine> {
        let half = Vec3::from_fn(|r, _| (shape[r] as f64 - 1.0) / 2.0 * spacing[r]);
        Self::new(Matrix3::from_diagonal(&Vec3::from(spacing)), centre - half)
    }

    /// The affine for NIfTI, from indices to RAS+ millimetres.
    pub fn to_ras(&self) -> Matrix4<f64> {
        let mut m = self.matrix();
        m.row_mut(0).neg_mut();
        m.row_mut(1).neg_mut();
        m
    }

    /// The 4×4 matrix from indices to LPS millimetres.
    pub fn matrix(&self) -> Matrix4<f64> {
        let mut m = Matrix4::identity();
        m.fixed_view_mut::<3, 3>(0, 0).copy_from(&self.linear);
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&self.origin);
        m
    }

    /// Maps a voxel index, possibly fractional, to LPS millimetres.
    pub fn to_patient(&self, index: &Vec3) -> Vec3 {
        self.linear * index + self.origin
    }

    /// Maps LPS millimetres to a fractional voxel index.
    pub fn to_voxel(&self, patient: &Vec3) -> Vec3 {
        self.inverse * (patient - self.origin)
    }

    /// How far `other` takes a voxel of a grid of `shape` from where this map takes it, at most, mm.
    pub fn greatest_distance(&self, other: &Self, shape: [usize; 3]) -> f64 {
        let last = shape.map(|n| n.saturating_sub(1) as f64);
        // Both are affine: no voxel is farther apart than one of the corners.
        let corners = (0..8).map(|corner| {
            let index = Vec3::from_fn(|axis, _| f64::from(corner >> axis & 1) * last[axis]);
            (self.to_patient(&index) - other.to_patient(&index)).norm()
        });
        corners.fold(0.0, f64::max)
    }

    /// The 3×3 linear part, whose columns are the steps along i, j, k in mm.
    pub fn linear(&self) -> &Matrix3<f64> {
        &self.linear
    }

    /// The distances of neighbouring voxel centres along i, j, k, mm.
    pub fn spacing(&self) -> [f64; 3] {
        [0, 1, 2].map(|axis| self.linear.column(axis).norm())
    }

    /// The greatest cosine of the angle between two axes: 0 where i, j and k are at right angles, as a
    /// quaternion with spacings (NIfTI's qform) demands, 1 where two are parallel.
    pub fn shear(&self) -> f64 {
        let axes = [0, 1, 2].map(|axis| self.linear.column(axis).normalize());
        let cosine = |a: usize, b: usize| axes[a].dot(&axes[b]).abs();
        cosine(0, 1).max(cosine(0, 2)).max(cosine(1, 2))
    }

    /// A grid at right angles that covers the grid of `shape` on this map, and its shape: i keeps direction and
    /// spacing, j and k lose the part along the axes before them (k becomes the normal of the slices,
    /// and its spacing their distance). A voxel of it lies at the first voxel of this grid.
    ///
    /// `None` if it would have more than `most` voxels, as a strong shear over many slices makes it.
    pub fn orthogonal_cover(
        &self,
        shape: [usize; 3],
        most: usize,
    ) -> Option<(VoxelToPatient, [usize; 3])> {
        /// Share of a voxel by which rounding may exceed a whole number of voxels.
        const ROUNDING_SHARE: f64 = 1e-3;
        let mut steps = [0, 1, 2].map(|axis| self.linear.column(axis).into_owned());
        for axis in 1..3 {
            for before in 0..axis {
                let along = steps[before]
                    * (steps[axis].dot(&steps[before]) / steps[before].norm_squared());
                steps[axis] -= along;
            }
        }
        let mut cover = Self::new(Matrix3::from_columns(&steps), self.origin).ok()?;
        let (mut low, mut high) = ([0.0_f64; 3], [0.0_f64; 3]);
        for corner in 0..8_usize {
            let index = Vec3::from_fn(|axis, _| match (corner >> axis) & 1 {
                0 => 0.0,
                _ => shape[axis].saturating_sub(1) as f64,
            });
            let at = cover.to_voxel(&self.to_patient(&index));
            for axis in 0..3 {
                low[axis] = low[axis].min((at[axis] + ROUNDING_SHARE).floor());
                high[axis] = high[axis].max((at[axis] - ROUNDING_SHARE).ceil());
            }
        }
        let sizes = [0, 1, 2].map(|axis| high[axis] - low[axis] + 1.0);
        // A product of whole numbers as f64: NaN and infinity fail as well.
        if !(sizes.iter().product::<f64>() <= most as f64) {
            return None;
        }
        cover.origin = cover.to_patient(&Vec3::from(low));
        Some((cover, sizes.map(|size| size as usize)))
    }

    /// The volume of one voxel, mm³.
    pub fn voxel_volume(&self) -> f64 {
        self.linear.determinant().abs()
    }

    /// Whether the map reverses orientation. Triangles that face outward in index space must then
    /// be reversed.
    pub fn is_left_handed(&self) -> bool {
        self.linear.determinant() < 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ras_and_back_is_the_identity() {
        let ras = Matrix4::new(
            3.0, 0.4, 0.0, -90.0, -0.3, 3.2, 0.1, -80.0, 0.0, 0.2, -4.0, 60.0, 0.0, 0.0, 0.0, 1.0,
        );
        let map = VoxelToPatient::from_ras(&ras).unwrap();
        assert!((map.to_ras() - ras).norm() < 1e-12);
        let index = Vec3::new(3.5, 7.0, 1.25);
        assert!((map.to_voxel(&map.to_patient(&index)) - index).norm() < 1e-12);
        assert!(map.is_left_handed());
    }

    #[test]
    fn flat_and_infinite_maps_are_refused() {
        assert!(VoxelToPatient::new(Matrix3::zeros(), Vec3::zeros()).is_err());
        let mut flat = Matrix3::identity();
        flat.set_column(2, &Vec3::new(1.0, 1.0, 0.0));
        assert!(VoxelToPatient::new(flat, Vec3::zeros()).is_err());
        assert!(VoxelToPatient::new(Matrix3::identity() * f64::NAN, Vec3::zeros()).is_err());
    }

    #[test]
    fn the_orthogonal_cover_has_right_angles_and_every_voxel_of_the_grid() {
        let shape = [7, 5, 6];
        for (row, column, tilt) in [(0, 1, 0.4), (0, 2, -0.9), (1, 2, 0.6), (2, 0, 0.3)] {
            for flip in [1.0, -1.0] {
                let turn = nalgebra::Rotation3::from_euler_angles(0.3, -0.2, 1.1);
                let mut linear = Matrix3::from_diagonal(&Vec3::new(2.0, 3.0, 4.0 * flip));
                linear[(row, column)] += tilt * 4.0;
                let map = VoxelToPatient::new(turn * linear, Vec3::new(5.0, -7.0, 90.0)).unwrap();
                assert!(map.shear() > 0.1);
                let (cover, size) = map.orthogonal_cover(shape, 10_000).unwrap();
                assert!(cover.shear() < 1e-12);
                assert_eq!(cover.is_left_handed(), map.is_left_handed());
                for corner in 0..8_usize {
                    let index =
                        Vec3::from_fn(|axis, _| ((corner >> axis & 1) * (shape[axis] - 1)) as f64);
                    let at = cover.to_voxel(&map.to_patient(&index));
                    for axis in 0..3 {
                        let last = (size[axis] - 1) as f64;
                        assert!((-0.01..=last + 0.01).contains(&at[axis]), "{at:?} {size:?}");
                    }
                }
                // The first voxel of the grid is the centre of one of the cover.
                let at = cover.to_voxel(&map.to_patient(&Vec3::zeros()));
                assert!((at - at.map(f64::round)).norm() < 1e-9);
                assert!(map.orthogonal_cover(shape, 200).is_none());
            }
        }
        let square = VoxelToPatient::centred(shape, [2.0, 3.0, 4.0], Vec3::zeros()).unwrap();
        assert_eq!(square.shear(), 0.0);
        assert_eq!(
            square.orthogonal_cover(shape, 210),
            Some((square.clone(), shape))
        );
    }
}
