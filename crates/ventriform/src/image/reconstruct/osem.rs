//! Ordered subsets expectation maximisation (Hudson and Larkin 1994).
//!
//! For each subset of the views, the image is multiplied by what its expected counts lack of those measured, spread
//! back over the voxels, as a share of what the subset sees of them.

use super::camera::{Camera, LANES, Lanes, in_packs};
use super::parameters::Reconstruction;
use super::projections::Projections;
use crate::base::progress::{Cancelled, Monitor, Stage};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Expected counts, as a share of the greatest measured, below which a ray tells nothing.
const NO_COUNTS_SHARE: f32 = 4e-6;

/// Rays' lengths in a voxel, summed over a subset, below which the subset does not see it.
const NOT_SEEN: f32 = 1e-3;

/// Share of the reports of the whole that the iterations are; the rest is the filter.
const OF_ALL: f64 = 0.95;

/// The image before the filter.
pub(super) fn image(
    camera: &Camera,
    projections: &Projections,
    how: &Reconstruction,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let most = projections.counts.iter().copied().fold(0.0, f32::max);
    let subsets = Subsets::new(camera, projections, how);
    let done = AtomicUsize::new(0);
    let packs = projections.rows.div_ceil(LANES);
    let passes = how.iterations * subsets.views.len() * packs;
    in_packs(projections, |start, rows| {
        let counts: Vec<Vec<Lanes>> = (0..projections.views.len())
            .map(|view| camera.pack(projections.view(view), start, rows))
            .collect();
        let mut image = disc(camera);
        if !(most > 0.0) {
            return Ok(vec![[0.0; LANES]; image.len()]);
        }
        let mut change = vec![[0.0; LANES]; image.len()];
        let mut expected = vec![[0.0; LANES]; camera.count];
        for _ in 0..how.iterations {
            for (views, seen) in subsets.views.iter().zip(&subsets.seen) {
                let passed = done.fetch_add(1, Ordering::Relaxed);
                monitor.report(Stage::Read, OF_ALL * passed as f64 / passes as f64)?;
                change.fill([0.0; LANES]);
                for view in views {
                    camera.project(*view, &image, &mut expected);
                    to_quotients(&mut expected, &counts[*view], NO_COUNTS_SHARE * most);
                    camera.spread(*view, &expected, 1.0, &mut change);
                    monitor.check()?;
                }
                multiply(&mut image, &change, seen);
            }
        }
        Ok(image)
    })
}

/// Measured counts over the expected ones, in their place.
fn to_quotients(expected: &mut [Lanes], counts: &[Lanes], least: f32) {
    for (expected, counts) in expected.iter_mut().zip(counts) {
        for k in 0..LANES {
            let quotient = counts[k] / expected[k].max(least);
            expected[k] = if expected[k] > least { quotient } else { 0.0 };
        }
    }
}

fn multiply(image: &mut [Lanes], change: &[Lanes], seen: &[f32]) {
    for ((image, change), seen) in image.iter_mut().zip(change).zip(seen) {
        let per_seen = if *seen > NOT_SEEN { 1.0 / seen } else { 0.0 };
        for k in 0..LANES {
            image[k] *= change[k] * per_seen;
        }
    }
}

/// 1 in the disc that every view sees, 0 outside.
fn disc(camera: &Camera) -> Vec<Lanes> {
    let voxels = camera.count * camera.count;
    let value = |at: usize| if camera.sees(at) { 1.0 } else { 0.0 };
    (0..voxels).map(|at| [value(at); LANES]).collect()
}

/// The views of each subset, and what it sees of every voxel of a slice.
struct Subsets {
    views: Vec<Vec<usize>>,
    seen: Vec<Vec<f32>>,
}

impl Subsets {
    fn new(camera: &Camera, projections: &Projections, how: &Reconstruction) -> Self {
        let count = projections.views.len();
        let subsets = how.subsets_of(count);
        let of = |first: usize| (first..count).step_by(subsets).collect();
        let views: Vec<Vec<usize>> = (0..subsets).map(of).collect();
        let ones = vec![[1.0; LANES]; camera.count];
        let seen = views.iter().map(|views| {
            let mut sum = vec![[0.0; LANES]; camera.count * camera.count];
            for view in views {
                camera.spread(*view, &ones, 1.0, &mut sum);
            }
            sum.iter().map(|lanes| lanes[0]).collect()
        });
        Self {
            seen: seen.collect(),
            views,
        }
    }
}
