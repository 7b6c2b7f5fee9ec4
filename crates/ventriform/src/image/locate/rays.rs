//! The ventricle's cavity by rays cast into the grey values.
//!
//! In: the voxels. Out: [`Cavity`] candidates: a centre and, for many directions, how far the
//! wall is and whether it was seen. Liver, gut and gallbladder may be hotter than the heart and
//! touch it; artefacts at the border of the field of view may be hotter than all of them.
//!
//! 1. [`component_tree`](super::component_tree) lowers a threshold from the maximum and lists
//!    every connected part, at every level, whose volume and spread could be a ventricle's.
//! 2. From the middle of each part, rays are cast into the grey values. A ray meets a *wall*
//!    where it rises from a darker cavity to a peak and falls again within 27 mm: a solid organ
//!    has no cavity, and a large one does not fall. A sphere fitted to the peaks moves the
//!    centre into the cavity; up to three moves settle it.
//! 3. A heart that is nowhere brighter than where it meets the liver is never a part by itself.
//!    [`RaySearch::lattice`] therefore starts from the points of a 12 mm lattice instead.
//!
//! The score is a product: share of directions with a wall, evenness of the distance, whether
//! the missing directions lie together (the valve plane), size, contrast, and, weakly, nearness
//! to the middle of the field of view, where technologists put the heart.
//!
//! Not guaranteed: rays know neither the long axis nor the shape of the wall. A right ventricle
//! as bright and as round as the left is told apart by its lower uptake only, and hearts with
//! less than a third of the wall visible are not found. [`super::find`] has cups judge them.

use rayon::prelude::*;

use super::component_tree::{Part, parts};
use super::directions::{DIRECTION_COUNT, directions};
use super::grey_blocks::GreyBlocks;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::volume::Volume;

/// Blocks in which rays are cast, mm: the wall must be resolved.
const RAY_BLOCK: f64 = 4.0;
/// Blocks in which parts are formed, mm: they only say where to look.
const PART_BLOCK: f64 = 7.0;
/// Spacing of the lattice that is searched when no part looks like a ventricle, mm.
const LATTICE_SPACING_MM: f64 = 12.0;
/// Points of the lattice that are judged in full.
const LATTICE_BEST: usize = 200;
/// Step along a ray, mm.
const RAY_STEP_MM: f64 = 3.0;
/// Samples along a ray: up to 66 mm.
const RAY_SAMPLES: usize = 23;
/// Farthest that a candidate's centre moves from its start, mm.
pub(super) const MAX_CENTRE_SHIFT_MM: f64 = 45.0;
/// Samples behind the peak in which the wall must end: 27 mm.
const WALL_END_SAMPLES: usize = 9;

/// A ventricle's cavity and the distance of the wall round it.
#[derive(Debug, Clone)]
pub struct Cavity {
    /// Middle of the cavity, millimetres along the array's axes from voxel (0, 0, 0).
    pub centre: Vec3,
    /// For each of [`directions`], the distance to the middle of the wall, mm (filled in from
    /// the neighbours where none was seen).
    pub distances: Vec<f64>,
    /// For each direction, whether a wall was seen.
    pub seen: Vec<bool>,
    /// Typical brightness of the wall (upper quartile of the rays' peaks).
    pub level: f64,
    /// 0 to 1: how much like a ventricle it looks. Below [`PLAUSIBLE_SCORE`] it is none.
    pub score: f64,
}

/// A centre that was judged. The distances in all directions ([`fill`]) take as long as the judgement, and only those
/// of the one that is chosen are needed.
#[derive(Debug, Clone)]
struct Candidate {
    /// Middle of the cavity, as in [`Cavity`].
    centre: Vec3,
    /// For each direction, the distance of the ray's peak, mm.
    peaks: Vec<f64>,
    /// Mean of those that are `seen`, mm.
    mean: f64,
    /// For each direction, whether a wall was seen.
    seen: Vec<bool>,
    level: f64,
    score: f64,
}

impl Candidate {
    /// The cavity, with the distances in the directions of `table`.
    fn cavity(&self, table: &[Vec3]) -> Cavity {
        Cavity {
            centre: self.centre,
            distances: fill(table, &self.peaks, &self.seen, self.mean),
            seen: self.seen.clone(),
            level: self.level,
            score: self.score,
        }
    }
}

/// Score from which on a candidate that starts at a part counts as a ventricle.
pub const PLAUSIBLE_SCORE: f64 = 0.2;
/// The same for candidates of the lattice, of which there are many more to be wrong.
const PLAUSIBLE_ON_LATTICE: f64 = 0.3;

/// Score below which rays alone do not decide, and the user is warned.
///
/// Of 133 distorted copies of the simulated patients (cropped, halved, noisy, mirrored, blurred,
/// with hotter organs) every heart was found, 131 with 0.29 or more; of 19 scans with the heart
/// painted over none reached 0.42.
pub const UNCERTAIN_SCORE: f64 = 0.45;

/// The ray search in one volume.
pub(super) struct RaySearch<'v> {
    blocks: GreyBlocks<'v>,
    directions: Vec<Vec3>,
    /// The candidates that start at bright parts, from the highest threshold down.
    candidates: Vec<Candidate>,
}

impl<'v> RaySearch<'v> {
    /// Casts rays from the middle of every bright part of `volume`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(volume: &'v Volume, monitor: &Monitor) -> Result<Self, Cancelled> {
        let blocks = GreyBlocks::new(volume, RAY_BLOCK, monitor)?;
        let (parts, blocks) = if GreyBlocks::alike(volume, PART_BLOCK, RAY_BLOCK) {
            (parts(&blocks, monitor)?, blocks)
        } else {
            let coarse = GreyBlocks::new(volume, PART_BLOCK, monitor)?;
            (parts(&coarse, monitor)?, blocks)
        };
        let mut search = Self {
            blocks,
            directions: directions(),
            candidates: Vec::new(),
        };
        search.candidates = search.judge_all(&parts, monitor)?;
        Ok(search)
    }

    /// The candidate of the highest score, of equals the first, among those whose centre is
    /// `admitted` (millimetres along the array's axes).
    pub fn best(&self, admitted: impl Fn(&Vec3) -> bool) -> Option<Cavity> {
        let found = best(self.candidates.iter().filter(|c| admitted(&c.centre)));
        found.map(|candidate| candidate.cavity(&self.directions))
    }

    /// The best candidate that starts at a point of the lattice and whose centre is `admitted`,
    /// if its score is good enough for one of so many. No candidate lies farther than
    /// [`MAX_CENTRE_SHIFT_MM`] from its start, so only starts that near to something admitted are tried.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn lattice(
        &self,
        starts: impl Fn(&Vec3) -> bool + Sync,
        admitted: impl Fn(&Vec3) -> bool,
        monitor: &Monitor,
    ) -> Result<Option<Cavity>, Cancelled> {
        if !(self.blocks.maximum > 0.0) {
            return Ok(None);
        }
        let found = self.judge_all(&self.lattice_points(starts), monitor)?;
        let found = best(found.iter().filter(|c| admitted(&c.centre)));
        let found = found.filter(|c| c.score >= PLAUSIBLE_ON_LATTICE);
        Ok(found.map(|candidate| candidate.cavity(&self.directions)))
    }

    fn judge_all(&self, parts: &[Part], monitor: &Monitor) -> Result<Vec<Candidate>, Cancelled> {
        let judged: Vec<Option<Candidate>> = parts
            .par_iter()
            .map(|part| {
                monitor.check()?;
                Ok(judge(&self.blocks, &self.directions, part))
            })
            .collect::<Result<_, Cancelled>>()?;
        Ok(judged.into_iter().flatten().collect())
    }

    /// The [`LATTICE_BEST`] points of a lattice of [`LATTICE_SPACING_MM`] mm from which most of every
    /// fourth ray meet a wall, at least half of them.
    fn lattice_points(&self, starts: impl Fn(&Vec3) -> bool + Sync) -> Vec<Part> {
        let grid = &self.blocks;
        let size = Vec3::from_fn(|r, _| grid.shape[r] as f64 * grid.spacing[r]);
        let steps = [0, 1, 2].map(|r| (size[r] / LATTICE_SPACING_MM) as usize + 1);
        let floor = 0.08 * f64::from(grid.maximum);
        let points: Vec<usize> = (0..steps.iter().product()).collect();
        let mut hit: Vec<(usize, Part)> = points
            .par_iter()
            .filter_map(|&n| {
                let index = [
                    n % steps[0],
                    n / steps[0] % steps[1],
                    n / (steps[0] * steps[1]),
                ];
                let centroid = Vec3::from_fn(|r, _| (index[r] as f64 + 0.5) * LATTICE_SPACING_MM);
                let here = grid.at_mm(&centroid);
                // In the dark around the body there is no cavity.
                if !starts(&centroid) || here < 0.02 * f64::from(grid.maximum) {
                    return None;
                }
                let part = Part {
                    level: (1.3 * here).max(floor),
                    centroid,
                };
                let rays = self.directions.iter().step_by(4);
                let hits = rays
                    .filter(|d| look(grid, &centroid, d, part.level).weight == 1.0)
                    .count();
                (8 * hits >= DIRECTION_COUNT).then_some((hits, part))
            })
            .collect();
        // Stable: of equals the first of the lattice.
        hit.sort_by_key(|(hits, _)| std::cmp::Reverse(*hits));
        hit.truncate(LATTICE_BEST);
        hit.into_iter().map(|(_, part)| part).collect()
    }
}

/// The candidate of the highest score; of equals the first.
fn best<'c>(candidates: impl Iterator<Item = &'c Candidate>) -> Option<&'c Candidate> {
    candidates.fold(None, |best: Option<&Candidate>, c| match best {
        Some(b) if b.score >= c.score => Some(b),
        _ => Some(c),
    })
}

/// The profile along one ray.
#[derive(Debug, Clone, Copy, Default)]
struct RayHit {
    /// Distance of the peak, mm.
    distance: f64,
    /// Value at the peak.
    peak: f64,
    /// 1 for a wall with both edges, 0.4 without a fall behind it, 0 for none.
    weight: f64,
    /// Darkest value before the peak, as a share of it.
    cavity: f64,
}

fn look(blocks: &GreyBlocks, centre: &Vec3, direction: &Vec3, level: f64) -> RayHit {
    let value = |n: usize| blocks.at_mm(&(centre + direction * (RAY_STEP_MM * n as f64)));
    // Five samples in a row: v is the middle one.
    let mut window = [value(0), value(1), value(2), value(3), 0.0];
    let mut darkest = window[0].min(window[1]);
    for n in 2..RAY_SAMPLES {
        window[4] = value(n + 2);
        let v = window[2];
        let is_peak = v >= 0.7 * level && window.iter().all(|other| v >= *other);
        if is_peak && darkest <= 0.8 * v {
            let limit = 0.7 * v;
            let ends = (n + 1..n + WALL_END_SAMPLES).any(|m| value(m) <= limit);
            return RayHit {
                distance: RAY_STEP_MM * n as f64,
                peak: v,
                weight: if ends { 1.0 } else { 0.4 },
                cavity: darkest / v,
            };
        }
        darkest = darkest.min(v);
        window.rotate_left(1);
    }
    RayHit::default()
}

/// Centre and radius of the sphere with least algebraic error.
fn fit_sphere(points: &[Vec3]) -> Option<(Vec3, f64)> {
    if points.len() < 8 {
        return None;
    }
    let mean = points.iter().sum::<Vec3>() / points.len() as f64;
    let mut matrix = nalgebra::Matrix3::zeros();
    let mut right = Vec3::zeros();
    let spread = points
        .iter()
        .map(|p| (p - mean).norm_squared())
        .sum::<f64>()
        / points.len() as f64;
    for p in points {
        let q = p - mean;
        matrix += 2.0 * q * q.transpose();
        right += q * (q.norm_squared() - spread);
    }
    let offset = matrix.try_inverse()? * right;
    Some((mean + offset, (offset.norm_squared() + spread).sqrt()))
}

fn judge(blocks: &GreyBlocks, table: &[Vec3], part: &Part) -> Option<Candidate> {
    let mut centre = part.centroid;
    let mut best: Option<Candidate> = None;
    for _ in 0..4 {
        let walls: Vec<RayHit> = table
            .iter()
            .map(|d| look(blocks, &centre, d, part.level))
            .collect();
        let Some(candidate) = rate(blocks, table, centre, &walls) else {
            break;
        };
        if best.as_ref().is_none_or(|b| candidate.score > b.score) {
            best = Some(candidate);
        }
        let points: Vec<Vec3> = walls
            .iter()
            .zip(table)
            .filter(|(w, _)| w.weight > 0.0 && w.distance < 54.0)
            .map(|(w, d)| centre + d * w.distance)
            .collect();
        let Some((fitted, radius)) = fit_sphere(&points) else {
            break;
        };
        if !(12.0..55.0).contains(&radius) || (fitted - part.centroid).norm() > MAX_CENTRE_SHIFT_MM
        {
            break;
        }
        let moved = (fitted - centre).norm();
        centre = fitted;
        if moved < 1.0 {
            break;
        }
    }
    best
}

/// 1 at `best`, falling with the logarithm of the ratio.
fn near(value: f64, best: f64, width: f64) -> f64 {
    (-((value / best).ln() / width).powi(2)).exp()
}

/// Scores a centre, or `None` where fewer than a quarter of the rays meet a wall.
fn rate(blocks: &GreyBlocks, table: &[Vec3], centre: Vec3, walls: &[RayHit]) -> Option<Candidate> {
    let hits: Vec<&RayHit> = walls.iter().filter(|w| w.weight > 0.0).collect();
    if hits.len() < DIRECTION_COUNT / 4 {
        return None;
    }
    let mut distances: Vec<f64> = hits.iter().map(|w| w.distance).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances[distances.len() / 2];
    let mut peaks: Vec<f64> = hits.iter().map(|w| w.peak).collect();
    peaks.sort_by(f64::total_cmp);
    let bright = peaks[peaks.len() * 3 / 4];
    // A wall belongs to the same shell: about as far as the others and not much dimmer.
    let belongs = |w: &RayHit| {
        w.weight > 0.0
            && (0.5 * median..1.8 * median).contains(&w.distance)
            && w.peak > 0.35 * bright
            && w.peak < 2.5 * bright
    };
    let seen: Vec<bool> = walls.iter().map(belongs).collect();
    let kept: Vec<&RayHit> = walls.iter().filter(|w| belongs(w)).collect();
    let n = kept.len() as f64;
    if n < DIRECTION_COUNT as f64 / 4.0 {
        return None;
    }
    let mean = kept.iter().map(|w| w.distance).sum::<f64>() / n;
    let variance = kept
        .iter()
        .map(|w| (w.distance - mean).powi(2))
        .sum::<f64>()
        / n;
    let coverage = kept.iter().map(|w| w.weight).sum::<f64>() / DIRECTION_COUNT as f64;
    let evenness = (-variance / (0.35 * mean).powi(2)).exp();
    let contrast = 1.0 - kept.iter().map(|w| w.cavity).sum::<f64>() / n;
    let missing = DIRECTION_COUNT as f64 - n;
    let open: Vec3 = table
        .iter()
        .zip(&seen)
        .filter(|(_, seen)| !**seen)
        .map(|(d, _)| *d)
        .sum();
    let together = if missing > 4.0 {
        open.norm() / missing
    } else {
        0.7
    };
    let off_centre = (centre - blocks.middle()).norm() / blocks.half_extent();
    let score = coverage
        * evenness
        * (0.4 + 0.6 * together)
        * near(mean, 28.0, 0.6)
        * contrast.clamp(0.0, 0.7)
        / 0.7
        * (-off_centre * off_centre).exp();
    Some(Candidate {
        centre,
        peaks: walls.iter().map(|w| w.distance).collect(),
        mean,
        seen,
        level: bright,
        score,
    })
}

/// Distances in every direction: the median of the seen ones within 40 degrees.
fn fill(table: &[Vec3], peaks: &[f64], seen: &[bool], mean: f64) -> Vec<f64> {
    let cosine = 40f64.to_radians().cos();
    table
        .iter()
        .map(|d| {
            let mut close: Vec<f64> = (0..peaks.len())
                .filter(|&n| seen[n] && table[n].dot(d) > cosine)
                .map(|n| peaks[n])
                .collect();
            close.sort_by(f64::total_cmp);
            if close.len() < 3 {
                mean
            } else {
                close[close.len() / 2]
            }
        })
        .collect()
}
