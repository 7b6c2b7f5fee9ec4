//! Voxels and the map that places them in the patient.

use crate::base::geometry::Vec3;
use crate::base::geometry::frame::{SingularAffine, VoxelToPatient};
use nalgebra::Matrix4;

/// Voxel values on a regular grid and its position in the patient.
///
/// The value of voxel (i, j, k) is at index `i + nx * (j + ny * k)`: i runs fastest.
#[derive(Debug, Clone)]
pub struct Volume {
    /// Number of voxels along i, j, k; each at least 1.
    pub shape: [usize; 3],
    /// The `shape[0] * shape[1] * shape[2]` values with slope and intercept applied. Never infinite;
    /// NaN where a value is missing.
    pub voxels: Vec<f32>,
    /// Voxel index to LPS millimetres.
    pub frame: VoxelToPatient,
    /// Whether all values that are not NaN are whole numbers, as in label maps.
    pub integral: bool,
}

/// A 4x4 affine, row by row, from voxel indices (i, j, k) to millimetres in the patient. Index
/// (0, 0, 0) is the centre of the first voxel; the last row is (0, 0, 0, 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Affine {
    /// To x right to left, y anterior to posterior, z inferior to superior: the frame of DICOM, ITK
    /// and this crate.
    Lps([[f64; 4]; 4]),
    /// To x left to right, y posterior to anterior, z inferior to superior: the frame of NIfTI and
    /// nibabel.
    Ras([[f64; 4]; 4]),
}

impl Affine {
    /// The map to LPS millimetres.
    fn to_frame(self) -> Result<VoxelToPatient, ArrayError> {
        let (Affine::Lps(rows) | Affine::Ras(rows)) = self;
        if rows[3] != [0.0, 0.0, 0.0, 1.0] {
            return Err(ArrayError::LastRow { row: rows[3] });
        }
        let matrix = Matrix4::from_fn(|r, c| rows[r][c]);
        Ok(match self {
            Affine::Lps(_) => {
                let linear = matrix.fixed_view::<3, 3>(0, 0).into_owned();
                VoxelToPatient::new(linear, matrix.fixed_view::<3, 1>(0, 3).into_owned())
            }
            Affine::Ras(_) => VoxelToPatient::from_ras(&matrix),
        }?)
    }
}

/// Why an array is not a volume.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum ArrayError {
    /// A dimension is 0, or the shape has more voxels than can be counted.
    #[error("the shape {shape:?} is not that of a volume: every axis needs at least one voxel")]
    Shape {
        /// Voxels along i, j, k.
        shape: [usize; 3],
    },
    /// The number of values does not match the shape.
    #[error("the array has {found} values; the shape needs {needed}")]
    Count {
        /// Product of the shape.
        needed: usize,
        /// Length of the array.
        found: usize,
    },
    /// A value is infinite.
    #[error("the value at index {index} is infinite; use NaN for missing values")]
    Infinite {
        /// Index in the array.
        index: usize,
    },
    /// The last row of the affine is not (0, 0, 0, 1).
    #[error("the last row of the affine is {row:?}; it must be (0, 0, 0, 1)")]
    LastRow {
        /// The row given.
        row: [f64; 4],
    },
    /// The affine cannot be inverted.
    #[error(transparent)]
    Affine(#[from] SingularAffine),
}

impl Volume {
    /// The same with `ceiling` in place of greater values; missing values stay.
    pub fn clipped(&self, ceiling: f32) -> Self {
        let clip = |v: &f32| if *v > ceiling { ceiling } else { *v };
        Self {
            voxels: self.voxels.iter().map(clip).collect(),
            shape: self.shape,
            frame: self.frame.clone(),
            integral: false,
        }
    }

    /// A volume from an array in memory, i fastest: index `i + nx * (j + ny * k)`, which is the order
    /// of a NumPy array in Fortran order. NaN marks missing values.
    ///
    /// # Errors
    /// [`ArrayError`] if shape, number of values and affine do not make a volume.
    ///
    /// ```
    /// use ventriform::{Affine, Volume};
    ///
    /// let [nx, ny, nz] = [4, 3, 2];
    /// let voxels = (0..nx * ny * nz).map(|n| n as f32).collect();
    /// let affine = Affine::Ras([
    ///     [-3.0, 0.0, 0.0, 90.0],
    ///     [0.0, 3.0, 0.0, -126.0],
    ///     [0.0, 0.0, 3.0, -72.0],
    ///     [0.0, 0.0, 0.0, 1.0],
    /// ]);
    /// let volume = Volume::from_array(voxels, [nx, ny, nz], affine)?;
    /// assert_eq!(volume.at(1, 2, 1), 21.0);
    /// assert_eq!(volume.frame.spacing(), [3.0; 3]);
    /// # Ok::<(), ventriform::ArrayError>(())
    /// ```
    pub fn from_array(
        voxels: Vec<f32>,
        shape: [usize; 3],
        affine: Affine,
    ) -> Result<Self, ArrayError> {
        let count = |n: usize, &d: &usize| n.checked_mul(d);
        let needed = match shape.iter().try_fold(1, count) {
            None | Some(0) => return Err(ArrayError::Shape { shape }),
            Some(needed) => needed,
        };
        let found = voxels.len();
        if found != needed {
            return Err(ArrayError::Count { needed, found });
        }
        if let Some(index) = voxels.iter().position(|v| v.is_infinite()) {
            return Err(ArrayError::Infinite { index });
        }
        let numbers = || voxels.iter().filter(|v| !v.is_nan());
        let integral = numbers().next().is_some() && numbers().all(|v| v.trunc() == *v);
        Ok(Self {
            shape,
            frame: affine.to_frame()?,
            integral,
            voxels,
        })
    }

    /// The values of `value`, a function of the position in LPS mm, at the centres of the voxels.
    /// [`Volume::integral`] is false.
    pub fn sampled(shape: [usize; 3], frame: VoxelToPatient, value: impl Fn(&Vec3) -> f64) -> Self {
        let [nx, ny, nz] = shape;
        let centre = |v: usize| [v % nx, v / nx % ny, v / nx / ny].map(|index| index as f64);
        let at = |v: usize| value(&frame.to_patient(&Vec3::from(centre(v)))) as f32;
        Self {
            shape,
            voxels: (0..nx * ny * nz).map(at).collect(),
            frame,
            integral: false,
        }
    }

    /// The sum of all values that are finite: the counts of a scan.
    pub fn counts(&self) -> f64 {
        let known = self.voxels.iter().filter(|value| value.is_finite());
        known.map(|value| f64::from(*value)).sum()
    }

    /// The value of voxel (i, j, k).
    ///
    /// # Panics
    /// If an index is out of range.
    pub fn at(&self, i: usize, j: usize, k: usize) -> f32 {
        assert!(i < self.shape[0] && j < self.shape[1] && k < self.shape[2]);
        self.voxels[i + self.shape[0] * (j + self.shape[1] * k)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const AFFINE_ROWS: [[f64; 4]; 4] = [
        [2.0, 0.0, 0.0, -7.0],
        [0.0, 3.0, 0.0, 5.0],
        [0.0, 0.5, -4.0, 11.0],
        [0.0, 0.0, 0.0, 1.0],
    ];

    #[test]
    fn the_affine_is_taken_in_the_named_frame() {
        let make = |affine| Volume::from_array(vec![0.0, 1.0, f32::NAN, 3.0], [2, 2, 1], affine);
        let (lps, ras) = (
            make(Affine::Lps(AFFINE_ROWS)).unwrap(),
            make(Affine::Ras(AFFINE_ROWS)).unwrap(),
        );
        let index = Vec3::new(1.0, 1.0, 0.0);
        assert_eq!(lps.frame.to_patient(&index), Vec3::new(-5.0, 8.0, 11.5));
        assert_eq!(ras.frame.to_patient(&index), Vec3::new(5.0, -8.0, 11.5));
        assert!(lps.integral);
        assert_eq!(lps.at(1, 1, 0), 3.0);
    }

    #[test]
    fn every_mistake_has_its_error() {
        let make = |voxels: &[f32], shape, rows| {
            Volume::from_array(voxels.to_vec(), shape, Affine::Ras(rows)).unwrap_err()
        };
        let shape = [2, 0, 1];
        assert_eq!(make(&[], shape, AFFINE_ROWS), ArrayError::Shape { shape });
        let shape = [usize::MAX, 2, 1];
        assert_eq!(make(&[], shape, AFFINE_ROWS), ArrayError::Shape { shape });
        let counts = ArrayError::Count {
            needed: 4,
            found: 3,
        };
        assert_eq!(make(&[0.0; 3], [2, 2, 1], AFFINE_ROWS), counts);
        let infinite = ArrayError::Infinite { index: 1 };
        assert_eq!(
            make(&[0.0, f32::INFINITY], [2, 1, 1], AFFINE_ROWS),
            infinite
        );
        let mut rows = AFFINE_ROWS;
        rows[3][3] = 0.0;
        assert_eq!(
            make(&[0.0], [1; 3], rows),
            ArrayError::LastRow { row: [0.0; 4] }
        );
        let mut rows = AFFINE_ROWS;
        rows[0][0] = f64::NAN;
        assert_eq!(make(&[0.0], [1; 3], rows), SingularAffine.into());
        assert!(
            !Volume::from_array(vec![f32::NAN], [1; 3], Affine::Lps(AFFINE_ROWS))
                .unwrap()
                .integral
        );
    }
}
