//! Whether volumes, in their order, show a heart that beats.
//!
//! In: 6 to 32 volumes, coarsely. Out: how their greatest change at one place goes through them ([`Course`]). Method,
//! Gaussians being given by their standard deviation:
//!
//! 1. At every place the mean within [`NARROW_MM`] less that within [`WIDE_MM`], over the square root of the latter:
//!    what the place has more than its surroundings. In a cavity it rises as the walls close in, and it falls where
//!    they were. Places darker than [`BRIGHT_SHARE`] of the brightest do not count.
//! 2. The place where this differs most between the volumes, with all within [`REACH_MM`]: the choice knows nothing of
//!    the order.
//! 3. The changes there, over the cycle: the share that comes and goes once (the first harmonic), once or twice, and
//!    the largest step of the main course (the first principal component) as a share of its range.
//!
//! A beat comes and goes once, mostly, in steps. People come in no order. A ladder of filters has a step from its end
//! to its beginning that is as large as its range, and so have scans at rest after scans under stress.
//!
//! Guaranteed: volumes in another order that is the same cycle, forwards or backwards, have the same course. Not
//! guaranteed: that volumes in a chance order are refused; by chance one of 30 to 100 orders passes. The bounds are
//! those of `scripts/measure/gate_look.py`, figures are in `docs/log/beat.md`.

use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::blur::{Kernel, blur};
use std::f64::consts::TAU;

/// Gaussians of the contrast of a place, mm.
const NARROW_MM: f64 = 15.0;
const WIDE_MM: f64 = 30.0;
/// Gaussians are cut off beyond so many standard deviations.
const CUT: f64 = 3.0;
/// Brightness of a place that counts, as a share of the brightest.
const BRIGHT_SHARE: f64 = 0.25;
/// Distance from the place that changes most, mm.
const REACH_MM: f64 = 20.0;
/// Least change where it is greatest, as a share of the brightness: the root of its mean square. Less is that of
/// rounding.
const LEAST_CHANGE: f64 = 1e-3;
/// Steps of the power iteration for the main course.
const ITERATIONS: usize = 200;

/// Gates from which on chance makes less of a share.
const MANY_GATES: usize = 10;
/// Least share of a beat's change that comes and goes once: of fewer than [`MANY_GATES`], and of as many or more.
const LEAST_ONCE: [f64; 2] = [0.75, 0.65];
/// Least share that comes and goes once or twice, of the same.
const LEAST_TWICE: [f64; 2] = [0.85, 0.8];
/// Largest step of a beat, as a share of its range.
const LARGEST_STEP: f64 = 0.75;

/// Volumes as blocks on one grid, i fastest.
pub(super) struct Blocks<'a> {
    pub volumes: Vec<&'a [f32]>,
    pub shape: [usize; 3],
    pub spacing_mm: [f64; 3],
}

/// How the greatest change goes through the volumes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Course {
    /// The volumes.
    pub count: usize,
    /// Share of the change that comes and goes once.
    pub once: f64,
    /// Share that comes and goes once or twice.
    pub twice: f64,
    /// The largest step from one volume to the next, the last being before the first, as a share of the range.
    pub step: f64,
}

impl Course {
    /// Whether it is that of a beat.
    pub(super) fn is_beat(&self) -> bool {
        let [once, twice] = self.least();
        self.once >= once && self.twice >= twice && self.step <= LARGEST_STEP
    }

    /// The least shares of a beat of so many gates.
    fn least(&self) -> [f64; 2] {
        let many = usize::from(self.count >= MANY_GATES);
        [LEAST_ONCE[many], LEAST_TWICE[many]]
    }

    /// What it is, and what that of a beat is.
    pub(super) fn text(&self) -> String {
        let percent = |share: f64| 100.0 * share;
        let [once, twice] = self.least();
        format!(
            "where they differ most, {:.0} % of the change comes and goes once in their order and {:.0} % once or \
             twice (in a beat {:.0} and {:.0} % or more), with a step of {:.0} % of the whole way (in a beat at most \
             {:.0} %)",
            percent(self.once),
            percent(self.twice),
            percent(once),
            percent(twice),
            percent(self.step),
            percent(LARGEST_STEP)
        )
    }

    /// The course of `blocks`; `None` if nothing changes.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn from_blocks(
        blocks: &Blocks<'_>,
        monitor: &Monitor,
    ) -> Result<Option<Self>, Cancelled> {
        let contrasts = contrasts(blocks, monitor)?;
        Ok(products(&contrasts, blocks).and_then(|products| Self::of_products(&products)))
    }

    /// The course of volumes with these products of their changes, each with each.
    fn of_products(products: &[Vec<f64>]) -> Option<Self> {
        let count = products.len();
        let total: f64 = (0..count).map(|n| products[n][n]).sum();
        if !(total > 0.0) {
            return None;
        }
        let harmonic = |times: usize| {
            let share = |a: usize, b: usize| {
                let turn = (times * (a + count - b)) as f64 / count as f64;
                products[a][b] * (TAU * turn).cos()
            };
            let all = (0..count).flat_map(|a| (0..count).map(move |b| (a, b)));
            2.0 / count as f64 * all.map(|(a, b)| share(a, b)).sum::<f64>() / total
        };
        let main = main_course(products);
        let step = |n: usize| (main[(n + 1) % count] - main[n]).abs();
        let largest = (0..count).map(step).fold(0.0, f64::max);
        let greatest = main.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let least = main.iter().copied().fold(f64::INFINITY, f64::min);
        let once = harmonic(1);
        Some(Self {
            count,
            once,
            twice: once + harmonic(2),
            step: largest / (greatest - least),
        })
    }
}

/// For each volume what each bright place has more than its surroundings, and 0 at all others.
fn contrasts(blocks: &Blocks<'_>, monitor: &Monitor) -> Result<Vec<Vec<f32>>, Cancelled> {
    let kernels = |sigma_mm: f64| {
        let sigma = blocks.spacing_mm.map(|mm| sigma_mm / mm);
        sigma.map(|sigma| Kernel::gaussian(sigma, CUT))
    };
    let [narrow, wide] = [NARROW_MM, WIDE_MM].map(kernels);
    let mut surroundings = vec![0.0_f32; blocks.shape.iter().product()];
    let share = 1.0 / blocks.volumes.len() as f32;
    let mut contrasts = Vec::with_capacity(blocks.volumes.len());
    for volume in &blocks.volumes {
        let [mut near, mut about] = [volume.to_vec(), volume.to_vec()];
        blur(&mut near, blocks.shape, &narrow, monitor)?;
        blur(&mut about, blocks.shape, &wide, monitor)?;
        for ((near, about), mean) in near.iter_mut().zip(&about).zip(&mut surroundings) {
            *near -= about;
            *mean += share * about;
        }
        contrasts.push(near);
    }
    let brightest = surroundings.iter().copied().fold(0.0, f32::max);
    let least = BRIGHT_SHARE as f32 * brightest;
    for contrast in &mut contrasts {
        for (contrast, mean) in contrast.iter_mut().zip(&surroundings) {
            *contrast = match *mean > least {
                true => *contrast / (mean * brightest).sqrt(),
                false => 0.0,
            };
        }
    }
    Ok(contrasts)
}

/// The products of the volumes' changes about the place that changes most, each with each; `None` if none changes.
fn products(contrasts: &[Vec<f32>], blocks: &Blocks<'_>) -> Option<Vec<Vec<f64>>> {
    let count = contrasts.len() as f64;
    let mean = |at: usize| contrasts.iter().map(|c| f64::from(c[at])).sum::<f64>() / count;
    let change = |at: usize| {
        let mean = mean(at);
        let square = |c: &Vec<f32>| (f64::from(c[at]) - mean).powi(2);
        contrasts.iter().map(square).sum::<f64>()
    };
    let places = 0..contrasts.first()?.len();
    let (peak, largest) = places
        .clone()
        .map(|at| (at, change(at)))
        .fold(
            (0, 0.0),
            |most, own| if own.1 > most.1 { own } else { most },
        );
    if (largest / count).sqrt() < LEAST_CHANGE {
        return None;
    }
    let index = |at: usize| {
        let [nx, ny, _] = blocks.shape;
        [at % nx, at / nx % ny, at / nx / ny]
    };
    let middle = index(peak);
    let near = |at: &usize| {
        let own = index(*at);
        let apart = [0, 1, 2]
            .map(|axis| blocks.spacing_mm[axis] * (own[axis] as f64 - middle[axis] as f64));
        apart.iter().map(|mm| mm * mm).sum::<f64>() <= REACH_MM * REACH_MM
    };
    let about: Vec<usize> = places.filter(near).collect();
    let changes = |contrast: &Vec<f32>| -> Vec<f64> {
        let own = about.iter().map(|at| f64::from(contrast[*at]) - mean(*at));
        own.collect()
    };
    let changes: Vec<Vec<f64>> = contrasts.iter().map(changes).collect();
    let product = |a: &Vec<f64>, b: &Vec<f64>| a.iter().zip(b).map(|(a, b)| a * b).sum();
    let row = |a| changes.iter().map(|b| product(a, b)).collect();
    Some(changes.iter().map(row).collect())
}

/// The first principal component of volumes with these products, in units of its own.
fn main_course(products: &[Vec<f64>]) -> Vec<f64> {
    let largest = |a: &&Vec<f64>, b: &&Vec<f64>| {
        let size = |row: &Vec<f64>| row.iter().map(|x| x * x).sum::<f64>();
        size(a).total_cmp(&size(b))
    };
    let mut course = products.iter().max_by(largest).cloned().unwrap_or_default();
    for _ in 0..ITERATIONS {
        let dot = |row: &Vec<f64>| row.iter().zip(&course).map(|(a, b)| a * b).sum();
        let next: Vec<f64> = products.iter().map(dot).collect();
        let size = next.iter().map(|x| x * x).sum::<f64>().sqrt();
        if !(size > 0.0) {
            break;
        }
        course = next.iter().map(|x| x / size).collect();
    }
    course
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Products of volumes of which each is these numbers.
    fn course(volumes: &[Vec<f64>]) -> Course {
        let mean = |at: usize| volumes.iter().map(|v| v[at]).sum::<f64>() / volumes.len() as f64;
        let product = |a: &Vec<f64>, b: &Vec<f64>| {
            let one = |at: usize| (a[at] - mean(at)) * (b[at] - mean(at));
            (0..a.len()).map(one).sum()
        };
        let row = |a| volumes.iter().map(|b| product(a, b)).collect();
        let products: Vec<Vec<f64>> = volumes.iter().map(row).collect();
        Course::of_products(&products).unwrap()
    }

    #[test]
    fn a_cosine_comes_and_goes_once_and_a_ladder_goes_back_in_one_step() {
        for count in 6..=32 {
            let turn = |n: usize| TAU * n as f64 / count as f64;
            let cosine: Vec<Vec<f64>> = (0..count)
                .map(|n| {
                    vec![
                        turn(n).cos(),
                        0.3 * turn(n).sin() + 0.1 * (2.0 * turn(n)).cos(),
                    ]
                })
                .collect();
            let own = course(&cosine);
            assert!(own.once > 0.95 && own.twice > 0.999, "{count}: {own:?}");
            assert!(own.step <= 0.55 && own.is_beat(), "{count}: {own:?}");
            // The cycle has no beginning and no direction.
            for shift in 0..count {
                let mut turned = cosine.clone();
                turned.rotate_left(shift);
                turned.reverse();
                let turned = course(&turned);
                assert!(
                    (turned.once - own.once).abs() < 1e-9 && (turned.step - own.step).abs() < 1e-6
                );
            }
            let ladder: Vec<Vec<f64>> = (0..count).map(|n| vec![n as f64]).collect();
            let ladder = course(&ladder);
            assert!((ladder.step - 1.0).abs() < 1e-6 && !ladder.is_beat());
        }
    }

    #[test]
    fn equal_volumes_have_no_course() {
        assert_eq!(Course::of_products(&vec![vec![0.0; 8]; 8]), None);
    }
}
