//! Where the heart was in each view, from the projections themselves.
//!
//! In: [`Projections`] and the share of every voxel that belongs to the heart, as a fit of the image tells it. Out: for
//! each view how far the patient lay from the mean place, along the axis of rotation and across it on the detector.
//!
//! 1. Frames are reduced to the rows about the heart, and to pixels of at least [`LEAST_PIXEL_MM`].
//! 2. An image is reconstructed of the frames, each shifted back by what is known of its shift, and projected again:
//!    the heart by itself, and everything else by itself.
//! 3. Each frame is compared with both: for every shift, the amounts of heart, of all else and of an even background are
//!    those of least squares, weighted by the counts expected. So attenuation, which takes as much of a view as it
//!    likes, does not move the heart, and bright gut beside it does not either. A parabola through the least squares
//!    gives the part of a pixel.
//! 4. Steps 2 and 3 are repeated: an image of moved frames shows the heart half-way, and gets sharper as the frames
//!    get together. It ends when no frame moves by more than [`SETTLED_PIXELS`].
//! 5. What the frames cannot tell is taken out: a shift of all of them along the axis, and one that goes as the cosine
//!    of the angle across it, are another place of the patient, not motion.
//!
//! Lee and Barber (Eur J Nucl Med 1998) and Matsumoto et al. (J Nucl Med 2001) compare frames with the projections of
//! their own image too; the heart by itself and its free amount are ours.
//!
//! Guaranteed: the same bytes on any number of threads. Not measured: turns of the patient, motion within a view, motion
//! that goes on as the camera turns once (it is a place), breathing.

use super::camera::{Camera, projected};
use super::parameters::{Filter, Method, Reconstruction};
use super::projections::{Projections, View};
use super::reconstruct;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::blur::{Kernel, blur};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rayon::prelude::*;

/// Edge of a pixel from which frames are compared as they are, mm; of smaller ones two by two are added.
const LEAST_PIXEL_MM: f64 = 5.0;
/// Rows beyond the heart that are compared, mm.
const MARGIN_MM: f64 = 40.0;
/// Farthest shift of a frame in one round, mm.
const FARTHEST_MM: f64 = 27.0;
/// Rounds of reconstruction and comparison.
const ROUNDS: usize = 10;
/// Shift below which a frame lies where it belongs, pixels.
const SETTLED_PIXELS: f64 = 0.03;
/// How much of what a comparison finds a frame is moved: an image of moved frames shows less than there is.
const RELAXATION: f64 = 1.3;
/// Blur of both frames of a comparison, sigma in pixels.
const BLUR_PIXELS: f64 = 0.9;
/// Share of the heart's greatest value in a view from which a pixel is compared.
const SEEN_SHARE: f32 = 0.08;
/// Pixels about those that are compared too.
const RIM_PIXELS: usize = 2;
/// Least share of the greatest expected counts by which a pixel is weighted.
const LEAST_EXPECTED_SHARE: f64 = 0.1;

/// How far the patient lies from the mean place in a view.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ViewShift {
    /// Towards the head, mm.
    pub along_mm: f64,
    /// On the detector, towards higher columns, mm.
    pub across_mm: f64,
}

/// What was measured in a view.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MeasuredShift {
    /// The shift.
    pub shift: ViewShift,
    /// How sharply the view tells it: by how much the weighted squares rise with the square of a shift along the axis
    /// of rotation and across it, per pixel². Comparable within one scan.
    pub sharpness: [f64; 2],
}

/// The shift of every view. `heart` is the share of each voxel of [`Projections::shape`] that is heart, from 0 to 1.
///
/// # Errors
/// [`Cancelled`].
pub fn view_shifts(
    projections: &Projections,
    axis_offset_mm: f64,
    heart: &[f32],
    monitor: &Monitor,
) -> Result<Vec<MeasuredShift>, Cancelled> {
    let views = projections.views.len();
    let mut sharpness = vec![[0.0; 2]; views];
    let Some((projections, heart)) = about_heart(projections, heart) else {
        return Ok(vec![MeasuredShift::default(); views]);
    };
    let how = Reconstruction {
        method: Method::Osem,
        iterations: 2,
        filter: Filter::None,
        axis_offset_mm,
        ..Reconstruction::default()
    };
    let camera = Camera::new(&projections, axis_offset_mm);
    let mut shifts = vec![ViewShift::default(); views];
    let mut farthest = (FARTHEST_MM / projections.pixel_mm).round() as usize;
    for round in 0..ROUNDS {
        let part = monitor.part(round, ROUNDS);
        let together = shifted_back(&projections, &shifts);
        let image = reconstruct(&together, &how, &part)?;
        let parts = image.iter().zip(&heart);
        let (own, rest): (Vec<f32>, Vec<f32>) = parts
            .map(|(value, share)| (value * share, value * (1.0 - share)))
            .unzip();
        let halves = [own, rest].map(|part| projected(&camera, &part, projections.rows));
        let found: Vec<Result<Found, Cancelled>> = (0..views)
            .into_par_iter()
            .map(|view| {
                let frames = Compared::new(&together, &halves, view, monitor)?;
                Ok(frames.found(farthest))
            })
            .collect();
        let mut greatest: f64 = 0.0;
        for ((shift, found), sharpness) in shifts.iter_mut().zip(found).zip(&mut sharpness) {
            let found = found?;
            let [along, across] = found.pixels;
            *sharpness = found.sharpness;
            greatest = greatest.max(across.abs()).max(along.abs());
            shift.across_mm += RELAXATION * across * projections.pixel_mm;
            shift.along_mm += RELAXATION * along * projections.pixel_mm;
        }
        without_place(&projections.views, &mut shifts);
        if greatest < SETTLED_PIXELS {
            break;
        }
        farthest = farthest.min(2).max((0.5 * farthest as f64) as usize);
    }
    let measured = shifts.into_iter().zip(sharpness);
    Ok(measured
        .map(|(shift, sharpness)| MeasuredShift { shift, sharpness })
        .collect())
}

/// `projections` with every view shifted back to the mean place.
pub fn shifted_back(projections: &Projections, shifts: &[ViewShift]) -> Projections {
    let Projections {
        columns,
        rows,
        pixel_mm,
        ..
    } = *projections;
    let mut counts = vec![0.0; projections.counts.len()];
    let frames = counts.par_chunks_mut(rows * columns).enumerate();
    frames.for_each(|(view, out)| {
        let shift = shifts[view];
        // Rows run to the feet.
        let (du, dr) = (shift.across_mm / pixel_mm, -shift.along_mm / pixel_mm);
        let frame = projections.view(view);
        for row in 0..rows {
            for column in 0..columns {
                out[row * columns + column] =
                    between(frame, [columns, rows], column as f64 + du, row as f64 + dr);
            }
        }
    });
    Projections {
        counts,
        views: projections.views.clone(),
        ..*projections
    }
}

/// The value of a frame between its pixels, linearly; beyond the border that of the border.
fn between(frame: &[f32], [columns, rows]: [usize; 2], column: f64, row: f64) -> f32 {
    let split = |at: f64, count: usize| {
        let at = at.clamp(0.0, count as f64 - 1.0);
        let first = (at as usize).min(count.saturating_sub(2));
        (
            first,
            (first + 1).min(count - 1),
            (at - first as f64) as f32,
        )
    };
    let (c0, c1, f) = split(column, columns);
    let (r0, r1, g) = split(row, rows);
    let of_row = |r: usize| frame[r * columns + c0] * (1.0 - f) + frame[r * columns + c1] * f;
    of_row(r0) * (1.0 - g) + of_row(r1) * g
}

/// The rows about the heart, in pixels of at least [`LEAST_PIXEL_MM`], and its share of their voxels; `None` without a
/// heart.
fn about_heart(projections: &Projections, heart: &[f32]) -> Option<(Projections, Vec<f32>)> {
    let (columns, rows) = (projections.columns, projections.rows);
    let plane = columns * columns;
    let holds = |row: &usize| {
        let slice = rows - 1 - row;
        heart[slice * plane..(slice + 1) * plane]
            .iter()
            .any(|share| *share > 0.5)
    };
    let first = (0..rows).find(holds)?;
    let last = (0..rows).rev().find(holds)?;
    let margin = (MARGIN_MM / projections.pixel_mm).ceil() as usize;
    let (first, end) = (first.saturating_sub(margin), (last + 1 + margin).min(rows));
    let kept = end - first;
    let counts = (0..projections.views.len()).flat_map(|view| {
        let frame = projections.view(view);
        frame[first * columns..end * columns].iter().copied()
    });
    let mut reduced = Projections {
        counts: counts.collect(),
        rows: kept,
        views: projections.views.clone(),
        ..*projections
    };
    let slices = (rows - end) * plane..(rows - first) * plane;
    let mut share = heart[slices].to_vec();
    if reduced.pixel_mm < LEAST_PIXEL_MM && columns.is_multiple_of(2) {
        (reduced, share) = halved(&reduced, &share);
    }
    Some((reduced, share))
}

/// Pixels two by two as one, and the mean share of their voxels. An odd last row is left out.
fn halved(projections: &Projections, heart: &[f32]) -> (Projections, Vec<f32>) {
    let (columns, rows) = (projections.columns, projections.rows);
    let (wide, high) = (columns / 2, rows / 2);
    let views = projections.views.len();
    let mut counts = vec![0.0; views * wide * high];
    for view in 0..views {
        let frame = projections.view(view);
        for row in 0..2 * high {
            for column in 0..columns {
                counts[(view * high + row / 2) * wide + column / 2] +=
                    frame[row * columns + column];
            }
        }
    }
    let mut share = vec![0.0; wide * wide * high];
    // Slices run to the head: the last row is the first slice.
    let left_out = rows - 2 * high;
    for slice in 0..2 * high {
        for at in 0..columns * columns {
            let (y, x) = (at / columns / 2, at % columns / 2);
            share[(slice / 2 * wide + y) * wide + x] +=
                heart[(slice + left_out) * columns * columns + at] / 8.0;
        }
    }
    let halved = Projections {
        counts,
        columns: wide,
        rows: high,
        pixel_mm: 2.0 * projections.pixel_mm,
        views: projections.views.clone(),
    };
    (halved, share)
}

/// The terms of a comparison: the heart, all else, and an even background.
type Terms = Vector3<f64>;

/// How far a frame lies off, pixels to the head and towards higher columns, and how sharply it tells so.
#[derive(Clone, Copy, Default)]
struct Found {
    pixels: [f64; 2],
    sharpness: [f64; 2],
}

/// A frame beside the projections of the heart and of all else.
struct Compared {
    columns: usize,
    rows: usize,
    measured: Vec<f32>,
    /// The pixels that are compared: their number, the terms times the root of the weight, and the root.
    pixels: Vec<(usize, Terms, f64)>,
}

impl Compared {
    fn new(
        together: &Projections,
        halves: &[Vec<f32>; 2],
        view: usize,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let (columns, rows) = (together.columns, together.rows);
        let of_view = view * rows * columns..(view + 1) * rows * columns;
        let kernels = [BLUR_PIXELS, BLUR_PIXELS, 0.0].map(|sigma| Kernel::gaussian(sigma, 4.0));
        let blurred = |frame: &[f32]| -> Result<Vec<f32>, Cancelled> {
            let mut frame = frame.to_vec();
            blur(&mut frame, [columns, rows, 1], &kernels, monitor)?;
            Ok(frame)
        };
        let measured = blurred(together.view(view))?;
        let [heart, other] = halves
            .each_ref()
            .map(|half| blurred(&half[of_view.clone()]));
        let (heart, other) = (heart?, other?);
        let most = heart.iter().copied().fold(0.0, f32::max);
        let seen: Vec<bool> = heart.iter().map(|h| *h > SEEN_SHARE * most).collect();
        let near = widened(&seen, columns, rows);
        let expected = |at: usize| f64::from(heart[at] + other[at]);
        let greatest = (0..heart.len()).map(expected).fold(0.0, f64::max);
        let least = LEAST_EXPECTED_SHARE * greatest;
        let pixels = (0..heart.len()).filter(|at| near[*at] && greatest > 0.0);
        let pixels = pixels.map(|at| {
            let root = 1.0 / expected(at).max(least).sqrt();
            let terms = Terms::new(f64::from(heart[at]), f64::from(other[at]), greatest);
            (at, terms * root, root)
        });
        Ok(Self {
            pixels: pixels.collect(),
            columns,
            rows,
            measured,
        })
    }

    /// How far the measured frame lies off; 0 where nothing tells.
    fn found(&self, farthest: usize) -> Found {
        let squares = self
            .pixels
            .iter()
            .map(|(_, terms, _)| terms * terms.transpose());
        let squares: Matrix3<f64> = squares.sum();
        let ridge = Matrix3::identity() * (1e-9 * squares.trace());
        let Some(inverse) = (squares + ridge).try_inverse() else {
            return Found::default();
        };
        let far = farthest as isize;
        let side = 2 * farthest + 1;
        let lacks: Vec<f64> = (0..side * side)
            .map(|at| {
                let (du, dr) = ((at % side) as isize - far, (at / side) as isize - far);
                self.lack(&inverse, du, dr)
            })
            .collect();
        let least = (0..lacks.len()).min_by(|a, b| lacks[*a].total_cmp(&lacks[*b]));
        let Some(best) = least.filter(|at| lacks[*at].is_finite()) else {
            return Found::default();
        };
        let (u, r) = (best % side, best / side);
        let at = |u: Option<usize>, r: Option<usize>| {
            let (u, r) = (u?, r?);
            (u < side && r < side).then(|| lacks[r * side + u])
        };
        // The parabola through three values: where it is least, and how it bends.
        let parabola = |before: Option<f64>, after: Option<f64>| {
            let Some((before, after)) = before.zip(after) else {
                return [0.0; 2];
            };
            let bend = before + after - 2.0 * lacks[best];
            if bend > 0.0 && bend.is_finite() {
                [(0.5 * (before - after) / bend).clamp(-0.5, 0.5), 0.5 * bend]
            } else {
                [0.0; 2]
            }
        };
        let [across, sharp_across] =
            parabola(at(u.checked_sub(1), Some(r)), at(Some(u + 1), Some(r)));
        let [down, sharp_along] = parabola(at(Some(u), r.checked_sub(1)), at(Some(u), Some(r + 1)));
        let steps = |at: usize| at as f64 - farthest as f64;
        Found {
            pixels: [-(steps(r) + down), steps(u) + across],
            sharpness: [sharp_along, sharp_across],
        }
    }

    /// The weighted squares that are left of the frame, moved back by columns and rows; infinite if the heart would
    /// have less than no counts.
    fn lack(&self, inverse: &Matrix3<f64>, du: isize, dr: isize) -> f64 {
        let (columns, rows) = (self.columns as isize, self.rows as isize);
        let mut products = Terms::zeros();
        let mut all = 0.0;
        for (at, terms, root) in &self.pixels {
            let (column, row) = ((at % self.columns) as isize, (at / self.columns) as isize);
            let (column, row) = (
                (column + du).clamp(0, columns - 1),
                (row + dr).clamp(0, rows - 1),
            );
            let value = f64::from(self.measured[(row * columns + column) as usize]) * root;
            products += terms * value;
            all += value * value;
        }
        let amounts = inverse * products;
        if amounts.x > 0.0 {
            all - amounts.dot(&products)
        } else {
            f64::INFINITY
        }
    }
}

/// Pixels within [`RIM_PIXELS`] of those that are set, along columns and rows.
fn widened(seen: &[bool], columns: usize, rows: usize) -> Vec<bool> {
    let mut near = vec![false; seen.len()];
    for (at, _) in seen.iter().enumerate().filter(|(_, seen)| **seen) {
        let (column, row) = (at % columns, at / columns);
        for r in row.saturating_sub(RIM_PIXELS)..(row + RIM_PIXELS + 1).min(rows) {
            let from = r * columns + column.saturating_sub(RIM_PIXELS);
            let to = r * columns + (column + RIM_PIXELS + 1).min(columns);
            near[from..to].fill(true);
        }
    }
    near
}

/// Takes out of the shifts what is another place of the patient: the mean along the axis; across it, the part that goes
/// with the columns' directions.
pub fn without_place(views: &[View], shifts: &mut [ViewShift]) {
    let count = shifts.len().max(1) as f64;
    let mean = shifts.iter().map(|shift| shift.along_mm).sum::<f64>() / count;
    let terms = views.iter().map(|view| Vector2::from(view.columns()));
    let squares: Matrix2<f64> = terms.clone().map(|d| d * d.transpose()).sum();
    let products: Vector2<f64> = terms
        .clone()
        .zip(shifts.iter())
        .map(|(d, shift)| d * shift.across_mm)
        .sum();
    let place = squares
        .try_inverse()
        .map_or_else(Vector2::zeros, |inverse| inverse * products);
    for (shift, direction) in shifts.iter_mut().zip(terms) {
        shift.along_mm -= mean;
        shift.across_mm -= place.dot(&direction);
    }
}
