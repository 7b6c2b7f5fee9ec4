//! Cavity candidates: places where a hollow ball agrees with the picture.
//!
//! In: a coarse picture. Out: the centres of the best balls, best first. A ball is a bright shell
//! with a darker middle and darker surroundings, in three radii. It is correlated with the picture
//! every 8 mm, and the local maxima are kept. Balls have no direction, which makes them a hundred
//! times cheaper than cups; any hollow structure can match one.
//!
//! Guaranteed: the hinted centre is among the places. Not guaranteed: that the ventricle is; it was
//! among the first 60 in every simulated and clinical scan tried.

use rayon::prelude::*;

use super::cup::Moments;
use super::hints::Hints;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::field::Field;
use crate::mesh::shapes;

/// Spacing of the places where hollow balls are tried, mm.
const SEARCH_STRIDE_MM: f64 = 8.0;
/// Radii of the balls' shells, mm: those of the middle of the wall.
const RADII_MM: [f64; 3] = [22.0, 27.0, 33.0];
/// The same with a ball for hearts of 300 ml and more, mm.
const RADII_WITH_VERY_LARGE_MM: [f64; 4] = [22.0, 27.0, 33.0, 42.0];
/// Distance of a ball's outer samples from its shell, mm.
const OUTSIDE_MM: f64 = 17.0;
/// Most places returned.
const MAX_CANDIDATES: usize = 60;
/// Balls whose shell is darker than this share of the brightest value are left out.
const MIN_SHELL_SHARE: f64 = 0.08;

/// Positions where hollow balls fit best: local maxima of their correlation, best first.
///
/// # Errors
/// [`Cancelled`].
pub fn places(
    field: &Field,
    hints: &Hints,
    brightest: f64,
    monitor: &Monitor,
) -> Result<Vec<Vec3>, Cancelled> {
    let radii: &[f64] = match hints.infarcted {
        true => &RADII_WITH_VERY_LARGE_MM,
        false => &RADII_MM,
    };
    let largest = radii.iter().copied().fold(0.0, f64::max);
    let padded = Padded::new(field, largest);
    let balls: Vec<Ball> = (radii.iter())
        .map(|radius| Ball::new(*radius, field, &padded))
        .collect();
    let [nx, ny, nz] = field.shape();
    let mut scores = vec![f32::NEG_INFINITY; nx * ny * nz];
    let stride = [0, 1, 2].map(|a| {
        let n = (SEARCH_STRIDE_MM / field.spacing()[a]).round();
        if n >= 1.0 { n as usize } else { 1 }
    });
    let least = (MIN_SHELL_SHARE * brightest) as f32;
    let planes = scores.par_chunks_mut(nx * ny).enumerate();
    planes
        .step_by(stride[2])
        .try_for_each_init(Row::default, |row, (k, plane)| {
            monitor.check()?;
            for j in (0..ny).step_by(stride[1]) {
                let place = |i: usize| field.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                let admitted = |i: &usize| hints.admit(&place(*i));
                let asked: Vec<usize> = (0..nx).step_by(stride[0]).filter(admitted).collect();
                let (Some(first), Some(last)) = (asked.first(), asked.last()) else {
                    continue;
                };
                let at = padded.index(*first, j, k);
                row.correlate(&balls, &padded.values, at, 1 + last - first, least);
                for i in &asked {
                    plane[i + nx * j] = row.best[i - first];
                }
            }
            Ok(())
        })?;
    let mut maxima: Vec<(f32, Vec3)> = Vec::new();
    for k in 0..nz {
        for j in 0..ny {
            monitor.check()?;
            for i in 0..nx {
                let own = scores[i + nx * (j + ny * k)];
                if own > f32::NEG_INFINITY && is_maximum(&scores, [nx, ny, nz], [i, j, k], stride) {
                    let p = field.to_patient(&Vec3::new(i as f64, j as f64, k as f64));
                    maxima.push((own, p));
                }
            }
        }
    }
    maxima.sort_by(|a, b| b.0.total_cmp(&a.0));
    maxima.truncate(MAX_CANDIDATES);
    let mut places: Vec<Vec3> = maxima.into_iter().map(|m| m.1).collect();
    places.extend(hints.centre);
    Ok(places)
}

fn is_maximum(
    scores: &[f32],
    [nx, ny, nz]: [usize; 3],
    [i, j, k]: [usize; 3],
    reach: [usize; 3],
) -> bool {
    let own = i + nx * (j + ny * k);
    for z in k.saturating_sub(reach[2])..(k + reach[2] + 1).min(nz) {
        for y in j.saturating_sub(reach[1])..(j + reach[1] + 1).min(ny) {
            for x in i.saturating_sub(reach[0])..(i + reach[0] + 1).min(nx) {
                let other = x + nx * (y + ny * z);
                // Equal neighbours: the first one counts.
                if scores[other] > scores[own] || (scores[other] == scores[own] && other < own) {
                    return false;
                }
            }
        }
    }
    true
}

/// The coarse picture, its border values continued so that every ball fits everywhere.
struct Padded {
    shape: [usize; 3],
    margin: [usize; 3],
    values: Vec<f32>,
}

impl Padded {
    /// `field` with room for balls whose shells have radii of up to `largest` mm.
    fn new(field: &Field, largest: f64) -> Self {
        let inner = field.shape();
        let reach = largest + OUTSIDE_MM;
        let margin = [0, 1, 2].map(|a| (reach / field.spacing()[a] * 1.5).ceil() as usize + 1);
        let shape = [0, 1, 2].map(|a| inner[a] + 2 * margin[a]);
        let clamped = |x: usize, a: usize| x.saturating_sub(margin[a]).min(inner[a] - 1);
        let mut values = Vec::with_capacity(shape.iter().product());
        for k in 0..shape[2] {
            for j in 0..shape[1] {
                let row = inner[0] * (clamped(j, 1) + inner[1] * clamped(k, 2));
                values.extend((0..shape[0]).map(|i| field.values()[row + clamped(i, 0)]));
            }
        }
        Self {
            shape,
            margin,
            values,
        }
    }

    fn index(&self, i: usize, j: usize, k: usize) -> usize {
        i + self.margin[0]
            + self.shape[0] * (j + self.margin[1] + self.shape[1] * (k + self.margin[2]))
    }
}

/// A hollow ball as lists of voxel offsets.
struct Ball {
    groups: [Vec<isize>; 3],
}

/// Expected value of the shell, the middle and the outside of a ball, shell = 1.
const EXPECTED_BALL_VALUES: [f64; 3] = [1.0, 0.45, 0.3];
/// Values above this share of the wall's mean are cut off.
const VALUE_CAP_SHARE: f32 = 1.3;

impl Ball {
    fn new(radius: f64, field: &Field, padded: &Padded) -> Self {
        let directions = shapes::icosphere(1.0, 1).vertices;
        let few = shapes::icosphere(1.0, 0).vertices;
        let offset = |p: &Vec3| {
            let step = field.step(p);
            let n = |a: usize| {
                let reach = padded.margin[a] as f64;
                step[a].round().clamp(-reach, reach) as isize
            };
            n(0) + padded.shape[0] as isize * (n(1) + padded.shape[1] as isize * n(2))
        };
        let shell = |directions: &[Vec3], r: f64| -> Vec<isize> {
            directions.iter().map(|d| offset(&(d * r))).collect()
        };
        let mut hollow = shell(&few, 0.4 * radius);
        hollow.push(0);
        Self {
            groups: [
                shell(&directions, radius),
                hollow,
                shell(&directions, radius + OUTSIDE_MM),
            ],
        }
    }
}

/// Correlations of balls about neighbouring places in a row of the picture. A whole row is
/// computed at once because its places read neighbouring values: every offset is one run along
/// memory.
#[derive(Default)]
struct Row {
    cap: Vec<f32>,
    sum: Vec<f32>,
    squares: Vec<f32>,
    moments: Vec<Moments>,
    best: Vec<f32>,
}

impl Row {
    /// Sets `best` to the best ball's correlation at each of `count` places from `first` on;
    /// minus infinity where the wall is darker than `least`.
    fn correlate(
        &mut self,
        balls: &[Ball],
        values: &[f32],
        first: usize,
        count: usize,
        least: f32,
    ) {
        refill(&mut self.best, count, f32::NEG_INFINITY);
        let run = |o: &isize| {
            let from = first.wrapping_add_signed(*o);
            &values[from..from + count]
        };
        for ball in balls {
            let wall = &ball.groups[0];
            refill(&mut self.cap, count, 0.0);
            for o in wall {
                self.cap.iter_mut().zip(run(o)).for_each(|(c, v)| *c += v);
            }
            let mean = 1.0 / wall.len() as f32;
            self.cap.iter_mut().for_each(|c| *c *= mean);
            // Places with a dark wall stay out, in one piece at either end of the row.
            let bright = |mean: &f32| *mean >= least;
            let ends = (
                self.cap.iter().position(bright),
                self.cap.iter().rposition(bright),
            );
            let (Some(low), Some(high)) = ends else {
                continue;
            };
            let cap = &mut self.cap[low..=high];
            let run = |o: &isize| &run(o)[low..=high];
            // Hot neighbours are cut off, as in `Cup::match_score`.
            cap.iter_mut().for_each(|c| *c *= VALUE_CAP_SHARE);
            refill(&mut self.moments, cap.len(), Moments::default());
            for (group, expected) in ball.groups.iter().zip(EXPECTED_BALL_VALUES) {
                refill(&mut self.sum, cap.len(), 0.0);
                refill(&mut self.squares, cap.len(), 0.0);
                for o in group {
                    let sums = self.sum.iter_mut().zip(&mut self.squares);
                    for ((v, cap), (sum, squares)) in run(o).iter().zip(&*cap).zip(sums) {
                        let value = if v < cap { *v } else { *cap };
                        *sum += value;
                        *squares += value * value;
                    }
                }
                let weight = 1.0 / group.len() as f64;
                let sums = self.sum.iter().zip(&self.squares);
                for (m, (sum, squares)) in self.moments.iter_mut().zip(sums) {
                    let [sum, squares] = [sum, squares].map(|s| f64::from(*s) * weight);
                    m.add_group(expected, sum, squares);
                }
            }
            let best = self.best[low..=high].iter_mut();
            for ((best, m), cap) in best.zip(&self.moments).zip(&*cap) {
                if *cap >= least * VALUE_CAP_SHARE {
                    *best = best.max(m.correlation() as f32);
                }
            }
        }
    }
}

fn refill<T: Copy>(list: &mut Vec<T>, count: usize, value: T) {
    list.clear();
    list.resize(count, value);
}

#[cfg(test)]
mod tests {
    use crate::image::locate::cavity_candidates::*;
    use crate::image::volume::phantom::{PhantomParameters, phantom};

    /// One ball at one place, sample by sample.
    fn correlation(ball: &Ball, values: &[f32], at: usize, least: f32) -> f64 {
        let value = |o: &isize| f64::from(values[at.wrapping_add_signed(*o)]);
        let wall = &ball.groups[0];
        let mean = wall.iter().map(value).sum::<f64>() / wall.len() as f64;
        if mean < f64::from(least) {
            return f64::NEG_INFINITY;
        }
        let mut moments = Moments::default();
        for (group, expected) in ball.groups.iter().zip(EXPECTED_BALL_VALUES) {
            let weight = 1.0 / group.len() as f64;
            for o in group {
                moments.add(
                    weight,
                    expected,
                    value(o).min(f64::from(VALUE_CAP_SHARE) * mean),
                );
            }
        }
        moments.correlation()
    }

    #[test]
    fn a_row_at_once_answers_as_sample_by_sample() {
        let parameters = PhantomParameters {
            shape: [48; 3],
            spacing_mm: [5.0; 3],
            ..PhantomParameters::default()
        };
        let scan = phantom(&parameters, &Monitor::silent()).expect("a usual phantom");
        let mut field = Field::coarse(&scan.volume, None, 5.0, &Monitor::silent()).unwrap();
        field.blur(4.0, &Monitor::silent()).unwrap();
        let padded = Padded::new(&field, 33.0);
        let balls = [22.0, 33.0].map(|radius| Ball::new(radius, &field, &padded));
        let least = (MIN_SHELL_SHARE as f32) * field.values().iter().fold(0f32, |a, b| a.max(*b));
        let mut row = Row::default();
        let (mut seen, mut dark) = (0, 0);
        for (j, k) in [(10, 20), (24, 24), (30, 17), (47, 0)] {
            let first = padded.index(3, j, k);
            row.correlate(&balls, &padded.values, first, 44, least);
            for (i, found) in row.best.iter().enumerate() {
                let each = balls
                    .iter()
                    .map(|b| correlation(b, &padded.values, first + i, least));
                let wanted = each.fold(f64::NEG_INFINITY, f64::max);
                if wanted.is_finite() {
                    assert!(
                        (f64::from(*found) - wanted).abs() < 1e-3,
                        "{found} {wanted}"
                    );
                    seen += 1;
                } else {
                    assert_eq!(*found, f32::NEG_INFINITY);
                    dark += 1;
                }
            }
        }
        assert!(seen > 20 && dark > 10, "{seen} {dark}");
    }
}
