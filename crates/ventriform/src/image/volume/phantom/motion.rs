//! Motion during the scan: the views after it show the patient in another place.
//!
//! In: the uptake, a displacement along k, the share of the scan after it, and the number of the camera's heads.
//! Out: what the views of both places together give.
//!
//! The camera sees half a turn, from the right in front over the left to the left behind, as is usual for
//! the heart. One head moves over all of it. Two heads at a right angle see a quarter turn each at the same time,
//! so that the views after the motion are two runs, a quarter turn apart. Filtered backprojection is
//! linear, so the image is the uptake before the motion, plus what the views
//! after it say of the difference. For each slice the difference is projected at the angles of those views, filtered
//! by the ramp (Ramachandran and Lakshminarayanan, PNAS 1971; sampled as in Kak and Slaney, 1988, eq. 3-61), and
//! projected back from these angles alone. If most views are after the motion, both places change their roles.
//!
//! Guaranteed: the uptake itself for a share of 0, the displaced one for 1, and the same values on any number of
//! threads. Not guaranteed: values of 0 or more; views that contradict each other leave dark streaks.

use super::parameters::PhantomParameters;
use rayon::prelude::*;
use std::f64::consts::PI;

/// Views over half a turn.
pub(super) const VIEW_COUNT: usize = 60;
/// Angle of the first view's rows (towards the patient's left and right), from i to j.
const FIRST_VIEW_RAD: f64 = 0.75 * PI;

/// The image of a patient who moves along k during the scan, as `p` says. What comes in from outside continues
/// the first or last slice.
pub(super) fn moved(voxels: &[f32], p: &PhantomParameters) -> Vec<f32> {
    let (shape, spacing_mm) = (p.shape, p.spacing_mm);
    let after = displaced(voxels, shape, p.motion_mm / spacing_mm[2]);
    let (of_a_head, first_after) = views_of_a_head(p);
    let few_after = first_after > of_a_head / 2;
    let (mut image, other) = if few_after {
        (voxels.to_vec(), after.as_slice())
    } else {
        (after, voxels)
    };
    let views: Vec<View> = (0..VIEW_COUNT)
        .filter(|n| (n % of_a_head >= first_after) == few_after)
        .map(|n| View::new(n, shape, spacing_mm))
        .collect();
    let slice = shape[0] * shape[1];
    let pairs = image.par_chunks_mut(slice).zip(other.par_chunks(slice));
    pairs.for_each(|(image, other)| {
        let difference: Vec<f64> = other
            .iter()
            .zip(&*image)
            .map(|(b, a)| f64::from(b - a))
            .collect();
        if difference.iter().any(|d| *d != 0.0) {
            for view in &views {
                view.add(&difference, image);
            }
        }
    });
    image
}

/// The number of views of a head, and that of the first one after the motion.
pub(super) fn views_of_a_head(p: &PhantomParameters) -> (usize, usize) {
    let count = VIEW_COUNT / usize::from(p.heads);
    (
        count,
        ((1.0 - p.motion_share) * count as f64).round() as usize,
    )
}

/// The voxels moved along k, linearly interpolated.
pub(super) fn displaced(voxels: &[f32], shape: [usize; 3], slices: f64) -> Vec<f32> {
    let slice = shape[0] * shape[1];
    let last = shape[2] as f64 - 1.0;
    (0..shape[2])
        .into_par_iter()
        .flat_map_iter(|k| {
            let from = (k as f64 - slices).clamp(0.0, last);
            let below = from.floor() as usize;
            let above = (below + 1).min(shape[2] - 1);
            let part = (from - from.floor()) as f32;
            (0..slice).map(move |n| {
                let [a, b] = [below, above].map(|k| voxels[k * slice + n]);
                a + (b - a) * part
            })
        })
        .collect()
}

/// One view of a slice.
struct View {
    /// Voxels along i.
    width: usize,
    /// Bins along the row by one voxel along i and along j.
    step: [f64; 2],
    /// The place of the first voxel, bins.
    start: f64,
    bins: usize,
    /// The weight of a voxel in a bin, times that of a filtered bin in a voxel.
    weight: f64,
}

impl View {
    fn new(number: usize, shape: [usize; 3], spacing_mm: [f64; 3]) -> Self {
        let bin = spacing_mm[0].min(spacing_mm[1]);
        let (sin, cos) = (FIRST_VIEW_RAD + PI * number as f64 / VIEW_COUNT as f64).sin_cos();
        let step = [spacing_mm[0] / bin * cos, spacing_mm[1] / bin * sin];
        let half = [0, 1].map(|axis| 0.5 * (shape[axis] - 1) as f64);
        let reach = step[0].abs() * half[0] + step[1].abs() * half[1];
        let middle = reach.ceil() + 1.0;
        Self {
            width: shape[0],
            step,
            start: middle - step[0] * half[0] - step[1] * half[1],
            bins: 2 * middle as usize + 2,
            weight: spacing_mm[0] * spacing_mm[1] / bin.powi(2) * PI / VIEW_COUNT as f64,
        }
    }

    /// The bin before a voxel, and how far beyond it the voxel lies.
    fn place(&self, n: usize) -> (usize, f64) {
        let [i, j] = [n % self.width, n / self.width].map(|n| n as f64);
        let at = self.start + self.step[0] * i + self.step[1] * j;
        (at as usize, at.fract())
    }

    /// Adds to the image what this view says of a slice.
    fn add(&self, slice: &[f64], image: &mut [f32]) {
        let mut row = vec![0.0; self.bins];
        for (n, value) in slice.iter().enumerate() {
            let (bin, part) = self.place(n);
            row[bin] += (1.0 - part) * value;
            row[bin + 1] += part * value;
        }
        let filtered: Vec<f64> = (0..self.bins)
            .map(|to| self.weight * ramp(&row, to))
            .collect();
        for (n, value) in image.iter_mut().enumerate() {
            let (bin, part) = self.place(n);
            *value += ((1.0 - part) * filtered[bin] + part * filtered[bin + 1]) as f32;
        }
    }
}

/// The row, filtered by the ramp, at one bin.
fn ramp(row: &[f64], to: usize) -> f64 {
    let far: f64 = row
        .iter()
        .enumerate()
        .filter(|(from, _)| from.abs_diff(to) % 2 == 1)
        .map(|(from, value)| value / (from.abs_diff(to) as f64).powi(2))
        .sum();
    0.25 * row[to] - far / PI.powi(2)
}
