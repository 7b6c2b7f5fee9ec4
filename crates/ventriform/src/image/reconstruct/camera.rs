//! Where the rays of each view go through a slice, and sums along them.
//!
//! Slices are worked on [`LANES`] at once: the places and weights of a ray are computed once for all of them, and the
//! processor's vectors hold one value of each.

use super::projections::{Projections, View};
use crate::base::progress::Cancelled;
use rayon::prelude::*;

/// Slices of a pack.
pub(super) const LANES: usize = 16;

/// The values of a pack of slices at one place.
pub(super) type Lanes = [f32; LANES];

/// The detector's direction and the columns', in x and y.
#[derive(Debug, Clone, Copy)]
struct Turn {
    detector: [f64; 2],
    columns: [f64; 2],
}

impl Turn {
    fn new(view: View) -> Self {
        let columns = view.columns();
        Self {
            detector: [columns[1], -columns[0]],
            columns,
        }
    }
}

/// The views of a camera, for slices of `count` x `count` voxels.
pub(super) struct Camera {
    turns: Vec<Turn>,
    /// Columns of a frame, and voxels along x and y.
    pub count: usize,
    /// The middle of a slice.
    middle: f64,
    /// The column of the axis of rotation.
    axis: f64,
}

impl Camera {
    pub(super) fn new(projections: &Projections, axis_offset_mm: f64) -> Self {
        let middle = 0.5 * (projections.columns as f64 - 1.0);
        Self {
            turns: projections
                .views
                .iter()
                .map(|view| Turn::new(*view))
                .collect(),
            count: projections.columns,
            middle,
            axis: middle + axis_offset_mm / projections.pixel_mm,
        }
    }

    /// The image's sums along the rays of a view, one for each column, into `sums`.
    pub(super) fn project(&self, view: usize, image: &[Lanes], sums: &mut [Lanes]) {
        let turn = self.turns[view];
        let n = self.count;
        sums.fill([0.0; LANES]);
        for plane in 0..n {
            let toward = self.middle - plane as f64;
            for (column, sum) in sums.iter_mut().enumerate() {
                let across = column as f64 - self.axis;
                let x = toward * turn.detector[0] + across * turn.columns[0] + self.middle;
                let y = toward * turn.detector[1] + across * turn.columns[1] + self.middle;
                let Some((at, [w0, w1, w2, w3])) = self.corner(x, y) else {
                    continue;
                };
                let ([a, b], [c, d]) = (
                    [&image[at], &image[at + 1]],
                    [&image[at + n], &image[at + n + 1]],
                );
                for k in 0..LANES {
                    sum[k] += w0 * a[k] + w1 * b[k] + w2 * c[k] + w3 * d[k];
                }
            }
        }
    }

    /// The first of the four voxels about (x, y) and their weights, x the fastest; `None` outside.
    fn corner(&self, x: f64, y: f64) -> Option<(usize, [f32; 4])> {
        // Conversion to whole numbers makes 0 of what is below.
        let (i, j) = (x as usize, y as usize);
        if x < 0.0 || y < 0.0 || i + 1 >= self.count || j + 1 >= self.count {
            return None;
        }
        let (f, g) = ((x - i as f64) as f32, (y - j as f64) as f32);
        let weights = [(1.0 - f) * (1.0 - g), f * (1.0 - g), (1.0 - f) * g, f * g];
        Some((j * self.count + i, weights))
    }

    /// Adds the columns of a view times `share` to the voxels that they see.
    pub(super) fn spread(&self, view: usize, columns: &[Lanes], share: f32, image: &mut [Lanes]) {
        let turn = self.turns[view];
        let n = self.count;
        for (j, row) in image.chunks_exact_mut(n).enumerate() {
            let of_row = (j as f64 - self.middle) * turn.columns[1] + self.axis;
            for (i, voxel) in row.iter_mut().enumerate() {
                let column = (i as f64 - self.middle) * turn.columns[0] + of_row;
                let first = column as usize;
                if column < 0.0 || first + 1 >= n {
                    continue;
                }
                let f = (column - first as f64) as f32;
                let (near, far) = ((1.0 - f) * share, f * share);
                let [a, b] = [&columns[first], &columns[first + 1]];
                for k in 0..LANES {
                    voxel[k] += near * a[k] + far * b[k];
                }
            }
        }
    }

    /// Whether the rays of all views go through a voxel: the disc within the frames.
    pub(super) fn sees(&self, at: usize) -> bool {
        let off = |index: usize| (index as f64 - self.middle).powi(2);
        let radius = self.middle - (self.axis - self.middle).abs();
        off(at % self.count) + off(at / self.count) < radius * radius
    }

    /// The rows of a view's frame from `start` on, `rows` of them, as a pack by columns.
    pub(super) fn pack(&self, frame: &[f32], start: usize, rows: usize) -> Vec<Lanes> {
        let mut pack = vec![[0.0; LANES]; self.count];
        let rows = frame.chunks_exact(self.count).skip(start).take(rows);
        for (lane, row) in rows.enumerate() {
            for (pack, value) in pack.iter_mut().zip(row) {
                pack[lane] = *value;
            }
        }
        pack
    }
}

/// The frames of all views of an image on [`Projections::shape`], view after view, rows from the head to the feet.
pub(super) fn projected(camera: &Camera, image: &[f32], rows: usize) -> Vec<f32> {
    let plane = camera.count * camera.count;
    let pack = |start: &usize| {
        let mut pack = vec![[0.0; LANES]; plane];
        for lane in 0..LANES.min(rows - start) {
            let slice = &image[(rows - 1 - start - lane) * plane..][..plane];
            for (lanes, value) in pack.iter_mut().zip(slice) {
                lanes[lane] = *value;
            }
        }
        pack
    };
    let starts: Vec<usize> = (0..rows).step_by(LANES).collect();
    let packs: Vec<Vec<Lanes>> = starts.par_iter().map(pack).collect();
    let mut frames = vec![0.0; camera.turns.len() * rows * camera.count];
    let by_view = frames.par_chunks_mut(rows * camera.count).enumerate();
    by_view.for_each(|(view, frame)| {
        let mut sums = vec![[0.0; LANES]; camera.count];
        for (start, pack) in starts.iter().zip(&packs) {
            camera.project(view, pack, &mut sums);
            let rows = frame.chunks_exact_mut(camera.count).skip(*start);
            for (lane, row) in rows.take(LANES).enumerate() {
                for (value, sum) in row.iter_mut().zip(&sums) {
                    *value = sum[lane];
                }
            }
        }
    });
    frames
}

/// The volume whose packs of slices `make` makes of the rows from a number on, so many of them. Rows of frames run to
/// the feet and slices to the head.
pub(super) fn in_packs(
    projections: &Projections,
    make: impl Fn(usize, usize) -> Result<Vec<Lanes>, Cancelled> + Sync,
) -> Result<Vec<f32>, Cancelled> {
    let (rows, plane) = (projections.rows, projections.columns * projections.columns);
    let starts: Vec<usize> = (0..rows).step_by(LANES).collect();
    let made: Vec<Result<Vec<Lanes>, Cancelled>> = starts
        .par_iter()
        .map(|start| make(*start, LANES.min(rows - start)))
        .collect();
    let mut image = vec![0.0; plane * rows];
    for (start, pack) in starts.iter().zip(made) {
        for (at, lanes) in pack?.into_iter().enumerate() {
            for (lane, value) in lanes.into_iter().enumerate().take(rows - start) {
                image[(rows - 1 - start - lane) * plane + at] = value;
            }
        }
    }
    Ok(image)
}
