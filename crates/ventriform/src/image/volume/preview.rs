//! A picture of a volume: its three middle slices, side by side.
//!
//! From left to right: an axial, a coronal and a sagittal slice through the middle of the array, each
//! in true proportions. Oblique volumes are shown along the array axes that are closest to the axes
//! of the patient. The orientation follows radiological convention: the patient's right is on the
//! left of the axial and the coronal slice; anterior is at the top of the axial slice and on the left
//! of the sagittal one; superior is at the top of the coronal and the sagittal slice. The grey scale
//! runs from 0 (or the smallest value, if that is negative) to the 99.5th percentile of the shown
//! slices, so that a single bright voxel does not darken the rest.
//!
//! Only the three planes of voxels through the middle are needed. [`MiddlePlanes`] collects them
//! while a file is decoded, so that the volume need not be held in memory.

use super::Volume;
use crate::base::geometry::frame::VoxelToPatient;
use crate::image::draw::Image;

/// Length of the longest side of a slice in pixels.
const LONGEST_SIDE: usize = 256;

/// Black columns between the slices.
const SLICE_GAP_PX: usize = 4;

/// Share of the shown pixels that are not saturated.
const UNSATURATED_SHARE: f64 = 0.995;

/// Draws the three middle slices of `volume`; at most 776 x 256 pixels.
pub fn preview(volume: &Volume) -> Image<1> {
    let mut planes = MiddlePlanes::new(volume.shape);
    planes.add(0, &volume.voxels);
    planes.draw(&volume.frame)
}

/// [`preview`] as a PNG file.
pub fn preview_png(volume: &Volume) -> Vec<u8> {
    preview(volume).png()
}

/// The voxels of the three planes through the middle of an array.
pub(super) struct MiddlePlanes {
    shape: [usize; 3],
    /// Index of the middle along each axis.
    middle: [usize; 3],
    /// The plane across each axis; of the two other axes, the first runs fastest.
    planes: [Vec<f32>; 3],
}

impl MiddlePlanes {
    /// Planes of an array of `shape`; all voxels are missing.
    pub(super) fn new(shape: [usize; 3]) -> Self {
        let [nx, ny, nz] = shape;
        Self {
            shape,
            middle: shape.map(|n| (n - 1) / 2),
            planes: [ny * nz, nx * nz, nx * ny].map(|voxels| vec![f32::NAN; voxels]),
        }
    }

    /// Copies what lies in the planes from `voxels`, which begin with voxel number `first` of the
    /// array.
    pub(super) fn add(&mut self, first: usize, voxels: &[f32]) {
        let [nx, ny, _] = self.shape;
        let [mx, my, mz] = self.middle;
        let (mut at, mut rest) = (first, voxels);
        while !rest.is_empty() {
            let (i, j, k) = (at % nx, at / nx % ny, at / nx / ny);
            let (line, tail) = rest.split_at(rest.len().min(nx - i));
            if let Some(voxel) = mx.checked_sub(i).and_then(|n| line.get(n)) {
                self.planes[0][j + ny * k] = *voxel;
            }
            if j == my {
                self.planes[1][i + nx * k..][..line.len()].copy_from_slice(line);
            }
            if k == mz {
                self.planes[2][i + nx * j..][..line.len()].copy_from_slice(line);
            }
            at += line.len();
            rest = tail;
        }
    }

    /// The voxel at `index`, which lies in the plane across `axis`.
    fn at(&self, axis: usize, index: [usize; 3]) -> f32 {
        let [i, j, k] = index;
        let [nx, ny, _] = self.shape;
        self.planes[axis][[j + ny * k, i + nx * k, i + nx * j][axis]]
    }

    /// Draws the planes of a volume with that position in the patient.
    pub(super) fn draw(&self, frame: &VoxelToPatient) -> Image<1> {
        let axes = PatientAxes::new(self.shape, frame);
        // Columns run to the patient's left or back, rows to the back or feet.
        let views = [
            (axes.x, axes.y),
            (axes.x, axes.z.reversed()),
            (axes.y, axes.z.reversed()),
        ];
        let longest = [axes.x, axes.y, axes.z].map(|a| a.extent_mm);
        let longest = longest.into_iter().fold(0.0, f64::max);
        let slices = views.map(|(right, down)| self.slice(right, down, longest));
        let (low, high) = window(&slices);
        Image::side_by_side(&slices.map(|slice| slice.grey(low, high)), SLICE_GAP_PX)
    }

    /// The middle slice whose columns run along `right` and rows along `down`.
    fn slice(&self, right: ArrayAxis, down: ArrayAxis, longest_mm: f64) -> Slice {
        let pixels = |a: ArrayAxis| {
            let length = (a.extent_mm / longest_mm * LONGEST_SIDE as f64).round();
            (length as usize).clamp(1, LONGEST_SIDE)
        };
        let (width, height) = (pixels(right), pixels(down));
        let mut values = Vec::with_capacity(width * height);
        for row in 0..height {
            let v = down.index((row as f64 + 0.5) / height as f64);
            for column in 0..width {
                let u = right.index((column as f64 + 0.5) / width as f64);
                values.push(self.bilinear((right.array, u), (down.array, v)));
            }
        }
        Slice {
            width,
            height,
            values,
        }
    }

    /// The value interpolated between four voxels of the middle plane of axes `a` and `b`; missing
    /// voxels count as 0.
    fn bilinear(&self, a: (usize, f64), b: (usize, f64)) -> f32 {
        // The axes are 0, 1 and 2.
        let across = 3 - a.0 - b.0;
        let mut index = self.middle;
        let mut value = 0.0;
        for (da, db) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let mut weight = 1.0;
            for ((axis, at), step) in [(a, da), (b, db)] {
                let share = at - at.floor();
                weight *= if step == 0 { 1.0 - share } else { share };
                index[axis] = (at as usize + step).min(self.shape[axis] - 1);
            }
            let voxel = self.at(across, index);
            if weight > 0.0 && !voxel.is_nan() {
                value += weight * f64::from(voxel);
            }
        }
        value as f32
    }
}

/// An array axis, walked in a direction of the patient.
#[derive(Debug, Clone, Copy)]
struct ArrayAxis {
    array: usize,
    size: usize,
    backwards: bool,
    extent_mm: f64,
}

impl ArrayAxis {
    fn reversed(self) -> Self {
        Self {
            backwards: !self.backwards,
            ..self
        }
    }

    /// The fractional index at `fraction` of the extent.
    fn index(self, fraction: f64) -> f64 {
        let along = if self.backwards {
            1.0 - fraction
        } else {
            fraction
        };
        (along * self.size as f64 - 0.5).clamp(0.0, self.size as f64 - 1.0)
    }
}

/// The array axes nearest to the patient's x (left), y (back), z (head).
struct PatientAxes {
    x: ArrayAxis,
    y: ArrayAxis,
    z: ArrayAxis,
}

impl PatientAxes {
    fn new(shape: [usize; 3], frame: &VoxelToPatient) -> Self {
        const AXIS_ORDERS: [[usize; 3]; 6] = [
            [0, 1, 2],
            [0, 2, 1],
            [1, 0, 2],
            [1, 2, 0],
            [2, 0, 1],
            [2, 1, 0],
        ];
        let cosine = |patient, array| direction_cosine(frame, patient, array);
        let fit = |order: &[usize; 3]| -> f64 { (0..3).map(|p| cosine(p, order[p]).abs()).sum() };
        // Of equally good orders the first is used, so that the choice is deterministic.
        let best = AXIS_ORDERS.iter().fold(&AXIS_ORDERS[0], |best, order| {
            if fit(order) > fit(best) { order } else { best }
        });
        let spacing = frame.spacing();
        let axis = |patient: usize| ArrayAxis {
            array: best[patient],
            size: shape[best[patient]],
            backwards: cosine(patient, best[patient]) < 0.0,
            extent_mm: shape[best[patient]] as f64 * spacing[best[patient]],
        };
        Self {
            x: axis(0),
            y: axis(1),
            z: axis(2),
        }
    }
}

fn direction_cosine(frame: &VoxelToPatient, patient: usize, array: usize) -> f64 {
    frame.linear()[(patient, array)] / frame.spacing()[array]
}

/// A resampled slice in the volume's values.
struct Slice {
    width: usize,
    height: usize,
    values: Vec<f32>,
}

impl Slice {
    /// Grey values, black at `low` and white from `high` on.
    fn grey(self, low: f32, high: f32) -> Image<1> {
        let grey = |value: &f32| [(255.0 * (value - low) / (high - low)).round() as u8];
        Image {
            width: self.width,
            height: self.height,
            pixels: self.values.iter().map(grey).collect(),
        }
    }
}

/// The values shown as black and as white.
fn window(slices: &[Slice]) -> (f32, f32) {
    let mut values: Vec<f32> = slices
        .iter()
        .flat_map(|s| s.values.iter().copied())
        .collect();
    let rank = ((values.len() - 1) as f64 * UNSATURATED_SHARE) as usize;
    let (below, &mut high, above) = values.select_nth_unstable_by(rank, f32::total_cmp);
    let low = below.iter().copied().fold(0.0, f32::min);
    let highest = above.iter().copied().fold(high, f32::max);
    // For a small bright object on an empty background, the percentile is background.
    let white = if high > low { high } else { highest };
    (low, white)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use nalgebra::Matrix3;

    /// One bright voxel at `bright` in 9 x 9 x 9 stored by `linear`.
    fn dot(linear: Matrix3<f64>, bright: [usize; 3]) -> Volume {
        let mut voxels = vec![0.0; 729];
        voxels[bright[0] + 9 * (bright[1] + 9 * bright[2])] = 1.0;
        Volume {
            shape: [9; 3],
            voxels,
            frame: VoxelToPatient::new(linear, Vec3::zeros()).unwrap(),
            integral: true,
        }
    }

    /// Whether the brightest pixel of panel `n` lies right of its middle, and below it.
    fn side(image: &Image<1>, n: usize) -> (bool, bool) {
        let panel = LONGEST_SIDE + SLICE_GAP_PX;
        let inside = |i: usize| (n * panel..n * panel + LONGEST_SIDE).contains(&(i % image.width));
        let pixels = image.pixels.iter().enumerate().filter(|(i, _)| inside(*i));
        let (i, _) = pixels.max_by_key(|(_, p)| **p).unwrap();
        (
            i % image.width - n * panel > LONGEST_SIDE / 2,
            i / image.width > LONGEST_SIDE / 2,
        )
    }

    #[test]
    fn left_back_and_head_are_where_radiology_puts_them() {
        let stored_lps = Matrix3::identity();
        let stored_ras = Matrix3::from_diagonal(&Vec3::new(-1.0, -1.0, 1.0));
        // Left in the axial and the coronal slice, back in the sagittal and the axial one,
        // head in the coronal one.
        for (linear, low, high) in [(stored_lps, 4, 8), (stored_ras, 4, 0)] {
            let left = preview(&dot(linear, [high, low, 4]));
            assert!(side(&left, 0).0 && side(&left, 1).0);
            let back = preview(&dot(linear, [low, high, 4]));
            assert!(side(&back, 0).1 && side(&back, 2).0);
            let head = preview(&dot(linear, [low, low, 8]));
            assert!(!side(&head, 1).1 && !side(&head, 2).1);
        }
    }

    #[test]
    fn permuted_axes_are_found() {
        // i to the head, j to the left, k to the back.
        let linear = Matrix3::new(0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0);
        let left = preview(&dot(linear, [4, 8, 4]));
        assert!(side(&left, 0).0 && side(&left, 1).0);
        let head = preview(&dot(linear, [8, 4, 4]));
        assert!(!side(&head, 1).1);
    }

    #[test]
    fn proportions_are_those_of_the_patient() {
        let volume = Volume {
            shape: [10, 20, 5],
            voxels: vec![f32::NAN; 1000],
            frame: VoxelToPatient::centred([10, 20, 5], [4.0, 1.0, 8.0], Vec3::zeros()).unwrap(),
            integral: false,
        };
        let image = preview(&volume);
        assert_eq!(
            (image.width, image.height),
            (256 + 256 + 128 + 2 * SLICE_GAP_PX, 256)
        );
        assert!(image.pixels.iter().all(|p| *p == [0]));
        assert!(preview_png(&volume).starts_with(b"\x89PNG"));
    }
}
