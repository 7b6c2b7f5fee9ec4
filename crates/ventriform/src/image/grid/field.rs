//! A volume as a smooth function of position.
//!
//! [`Field`] holds a Gaussian-blurred part of a volume and interpolates trilinearly at any point of
//! the patient. Beyond the border of the volume the value at the border continues, so that an organ
//! cut off by the camera's field of view shows no edge there.

use nalgebra::Matrix3;

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::blocks::{self, BlockMeans, Window};
use crate::image::grid::blur::{Kernel, blur};
use crate::image::grid::volume::Volume;

/// Blurred voxel values with their position in the patient.
#[derive(Debug, Clone)]
pub struct Field {
    shape: [usize; 3],
    /// Index of the last sample along each axis.
    last: Vec3,
    values: Vec<f32>,
    to_index: Matrix3<f64>,
    shift: Vec3,
    to_patient: Matrix3<f64>,
}

impl Field {
    /// [`Field::cut_out`] that cannot be cancelled.
    pub fn new(volume: &Volume, region: Option<&Aabb>, sigma: f64) -> Self {
        Self::cut_out(volume, region, sigma, &Monitor::silent())
            .expect("a silent monitor is never cancelled")
    }

    /// The part of `volume` inside `region`, LPS mm (the whole volume for `None`), blurred by a Gaussian
    /// of `sigma` mm. Values that are not finite count as 0.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn cut_out(
        volume: &Volume,
        region: Option<&Aabb>,
        sigma: f64,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let window = region.map_or_else(
            || blocks::whole(volume),
            |region| index_window(volume, region),
        );
        let shape = window.map(|(first, end)| end - first);
        let mut values = Vec::with_capacity(shape.iter().product());
        for k in window[2].0..window[2].1 {
            monitor.check()?;
            for j in window[1].0..window[1].1 {
                let row = volume.shape[0] * (j + volume.shape[1] * k);
                let row = &volume.voxels[row + window[0].0..row + window[0].1];
                values.extend(row.iter().map(|v| if v.is_finite() { *v } else { 0.0 }));
            }
        }
        let offset = Vec3::from_fn(|a, _| window[a].0 as f64);
        let mut field = Self::from_parts(shape, values, volume, &offset, 1.0);
        field.blur(sigma, monitor)?;
        Ok(field)
    }

    /// The mean of every block of about `spacing` mm: a small picture of the whole volume, or of
    /// the blocks that `region` touches (LPS mm), which are the same as those of the whole.
    /// Values that are not finite count as 0.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn coarse(
        volume: &Volume,
        region: Option<&Aabb>,
        spacing: f64,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let fine = volume.frame.spacing();
        let factor = [0, 1, 2].map(|a| {
            let n = (spacing / fine[a]).round();
            (if n >= 1.0 { n as usize } else { 1 }).min(volume.shape[a])
        });
        let window = region.map_or_else(
            || blocks::whole(volume),
            |region| aligned(index_window(volume, region), factor, volume.shape),
        );
        let means = BlockMeans::new(volume, window, factor, monitor)?;
        let step = Matrix3::from_diagonal(&Vec3::from_fn(|a, _| factor[a] as f64));
        // The centre of a block of n voxels lies (n - 1) / 2 behind its first voxel.
        let offset = Vec3::from_fn(|a, _| means.origin[a] as f64 + (factor[a] as f64 - 1.0) / 2.0);
        Ok(Self::assemble(
            means.shape,
            means.values,
            volume,
            &offset,
            &step,
        ))
    }

    fn from_parts(
        shape: [usize; 3],
        values: Vec<f32>,
        volume: &Volume,
        offset: &Vec3,
        step: f64,
    ) -> Self {
        let step = Matrix3::identity() * step;
        Self::assemble(shape, values, volume, offset, &step)
    }

    fn assemble(
        shape: [usize; 3],
        values: Vec<f32>,
        volume: &Volume,
        offset: &Vec3,
        step: &Matrix3<f64>,
    ) -> Self {
        let to_patient = volume.frame.linear() * step;
        // The volume's map is invertible by construction and steps are positive.
        let to_index = to_patient.try_inverse().unwrap_or_else(Matrix3::identity);
        let first = volume.frame.to_patient(offset);
        Self {
            shape,
            last: Vec3::from_fn(|a, _| (shape[a] - 1) as f64),
            values,
            to_index,
            shift: -(to_index * first),
            to_patient,
        }
    }

    /// The same grid with other values, in the order of [`Self::values`].
    ///
    /// # Panics
    /// If the number of values differs.
    pub fn with_values(self, values: Vec<f32>) -> Self {
        assert_eq!(
            values.len(),
            self.values.len(),
            "one value for every sample"
        );
        Self { values, ..self }
    }

    /// The same with `ceiling` in place of greater values.
    pub fn clipped(mut self, ceiling: f64) -> Self {
        let ceiling = ceiling as f32;
        self.values.iter_mut().for_each(|v| *v = v.min(ceiling));
        self
    }

    /// Number of samples along i, j, k.
    pub fn shape(&self) -> [usize; 3] {
        self.shape
    }

    /// The samples, i fastest.
    pub fn values(&self) -> &[f32] {
        &self.values
    }

    /// Distance of neighbouring samples along i, j, k, mm.
    pub fn spacing(&self) -> [f64; 3] {
        [0, 1, 2].map(|a| self.to_patient.column(a).norm())
    }

    /// LPS millimetres of a (fractional) index.
    pub fn to_patient(&self, index: &Vec3) -> Vec3 {
        self.to_patient * (index - self.shift)
    }

    /// Fractional index of a point in LPS millimetres.
    pub fn to_index(&self, p: &Vec3) -> Vec3 {
        self.to_index * p + self.shift
    }

    /// A direction in LPS millimetres as a step in indices.
    pub fn step(&self, direction: &Vec3) -> Vec3 {
        self.to_index * direction
    }

    /// The value at a point in LPS millimetres.
    pub fn at(&self, p: &Vec3) -> f64 {
        self.at_index(&self.to_index(p))
    }

    /// The value at a fractional index; clamped to the border.
    #[inline]
    pub fn at_index(&self, index: &Vec3) -> f64 {
        let [nx, ny, nz] = self.shape;
        let (i, u) = split(index.x, self.last.x);
        let (j, v) = split(index.y, self.last.y);
        let (k, w) = split(index.z, self.last.z);
        let (di, dj, dk) = (
            usize::from(i + 1 < nx),
            if j + 1 < ny { nx } else { 0 },
            if k + 1 < nz { nx * ny } else { 0 },
        );
        let o = i + nx * (j + ny * k);
        // One check of bounds for all eight: this is the innermost read of search and fit.
        let f = &self.values[o..=o + di + dj + dk];
        let x00 = f[0] + u * (f[di] - f[0]);
        let x10 = f[dj] + u * (f[dj + di] - f[dj]);
        let x01 = f[dk] + u * (f[dk + di] - f[dk]);
        let x11 = f[dj + dk] + u * (f[dj + dk + di] - f[dj + dk]);
        let y0 = x00 + v * (x10 - x00);
        let y1 = x01 + v * (x11 - x01);
        f64::from(y0 + w * (y1 - y0))
    }

    /// Blurs the samples by a Gaussian of `sigma` mm, cut off at three sigma. Along an axis where sigma
    /// is below 0.2 voxels they stay as they are.
    ///
    /// # Errors
    /// [`Cancelled`]; the values are then blurred in part.
    pub fn blur(&mut self, sigma: f64, monitor: &Monitor) -> Result<(), Cancelled> {
        let kernels = self.spacing().map(|spacing| match sigma / spacing {
            voxels if voxels > 0.2 => Kernel::gaussian(voxels, 3.0),
            _ => Kernel::identity(),
        });
        blur(&mut self.values, self.shape, &kernels, monitor)
    }
}

/// Cell and fraction of a coordinate clamped to 0..=last; 0 for NaN. No axis is longer than
/// i32 can count, and a cast to it takes one instruction where usize takes five.
#[inline]
fn split(x: f64, last: f64) -> (usize, f32) {
    let x = x.max(0.0).min(last);
    let cell = x as i32;
    (cell as usize, (x - f64::from(cell)) as f32)
}

/// The index ranges of `volume` that `region` touches, never empty.
fn index_window(volume: &Volume, region: &Aabb) -> Window {
    let mut low = Vec3::repeat(f64::INFINITY);
    let mut high = Vec3::repeat(f64::NEG_INFINITY);
    for corner in 0..8 {
        let p = Vec3::from_fn(|a, _| {
            if corner >> a & 1 == 0 {
                region.min[a]
            } else {
                region.max[a]
            }
        });
        let index = volume.frame.to_voxel(&p);
        low = low.inf(&index);
        high = high.sup(&index);
    }
    [0, 1, 2].map(|a| {
        let last = volume.shape[a] - 1;
        let first = (low[a].floor().max(0.0) as usize).min(last);
        let end = (high[a].ceil().max(0.0) as usize).min(last);
        (first, end.max(first) + 1)
    })
}

/// `window` widened to whole blocks of the grid that starts at the first voxel.
fn aligned(window: Window, factor: [usize; 3], shape: [usize; 3]) -> Window {
    [0, 1, 2].map(|a| {
        let (first, end) = window[a];
        let last = shape[a] / factor[a] - 1;
        let block = |voxel: usize| (voxel / factor[a]).min(last);
        (block(first) * factor[a], (block(end - 1) + 1) * factor[a])
    })
}

#[cfg(test)]
mod tests {
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::grid::field::*;

    fn volume(shape: [usize; 3], f: impl Fn(&Vec3) -> f64) -> Volume {
        let linear = Matrix3::new(2.0, 0.3, 0.0, -0.2, 3.0, 0.1, 0.0, 0.0, -2.5);
        let frame = VoxelToPatient::new(linear, Vec3::new(5.0, -7.0, 11.0)).unwrap();
        Volume::sampled(shape, frame, f)
    }

    #[test]
    fn a_linear_function_comes_back_blurred_or_not() {
        let f = |p: &Vec3| 3.0 * p.x - 2.0 * p.y + 0.5 * p.z + 40.0;
        let v = volume([20, 18, 16], f);
        let p = v.frame.to_patient(&Vec3::new(9.3, 8.8, 7.4));
        let around = Aabb {
            min: p - Vec3::repeat(14.0),
            max: p + Vec3::repeat(14.0),
        };
        for field in [
            Field::new(&v, None, 0.0),
            Field::new(&v, None, 3.0),
            Field::new(&v, Some(&around), 2.0),
            Field::coarse(&v, None, 6.0, &Monitor::silent()).unwrap(),
            Field::coarse(&v, Some(&around), 6.0, &Monitor::silent()).unwrap(),
        ] {
            assert!(
                (field.at(&p) - f(&p)).abs() < 0.01,
                "{}",
                field.at(&p) - f(&p)
            );
            assert!((field.to_patient(&field.to_index(&p)) - p).norm() < 1e-9);
        }
    }

    #[test]
    fn the_border_goes_on_beyond_the_volume() {
        let v = volume([4, 4, 4], |p| p.x);
        let field = Field::new(&v, None, 0.0);
        let inside = field.at_index(&Vec3::new(0.0, 2.0, 2.0));
        assert_eq!(field.at_index(&Vec3::new(-9.0, 2.0, 2.0)), inside);
        assert!(field.at_index(&Vec3::new(1e300, 2.0, -1e300)).is_finite());
    }
}
