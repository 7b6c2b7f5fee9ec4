//! Finds the left ventricle in a cardiac SPECT volume.
//!
//! In: the voxels. Out: [`Ventricle`], the cavity's centre and, for many directions, how far
//! the wall is and whether it was seen. Liver, gut and gallbladder may be hotter than the
//! heart and touch it; artefacts at the field's edge may be hotter than all of them.
//!
//! 1. [`crate::locate::component_tree`] lets the threshold sink from the maximum and offers every
//!    connected part, at every level, whose volume and spread could be a ventricle's.
//! 2. From the middle of each part, rays are cast into the grey values. A *wall* is met where
//!    the ray rises from a darker cavity to a peak and falls again within 27 mm: a solid organ
//!    has no cavity, a large one does not fall. A sphere fitted to the peaks moves the centre
//!    into the cavity; three rounds of this settle it.
//! 3. Where nothing scores well - a heart that is nowhere brighter than where it meets the liver
//!    is never a part by itself - the points of a 12 mm lattice are tried in the same way.
//!
//! The score multiplies: share of directions with a wall, evenness of the distance, whether
//! the missing directions lie together (the valve plane), size, contrast, and - weakly -
//! nearness to the middle of the field, where technologists put the heart.
//!
//! Not guaranteed: a right ventricle as bright and as round as the left is told apart by its
//! lower uptake only; hearts with less than a third of the wall visible are not found. The
//! score says how sure the search is.

use crate::locate::coarse::Coarse;
use rayon::prelude::*;

use crate::geometry::Vec3;
use crate::grid::survey::Survey;
use crate::grid::volume::Volume;
use crate::locate::component_tree::{Part, parts};
use crate::progress::{Cancelled, Monitor};

/// Number of directions that are looked into.
const DIRECTIONS: usize = 96;
/// Blocks in which rays are cast, mm: the wall must be resolved.
const RAY_BLOCK: f64 = 4.0;
/// Blocks in which parts are formed, mm: they only say where to look.
const PART_BLOCK: f64 = 7.0;
/// Spacing of the lattice that is searched when no part looks like a ventricle, mm.
const LATTICE: f64 = 12.0;
/// Points of the lattice that are judged in full.
const LATTICE_BEST: usize = 200;
/// Step along a ray, mm.
const STEP: f64 = 3.0;
/// Samples along a ray: up to 66 mm.
const SAMPLES: usize = 23;
/// Samples behind the peak in which the wall must end: 27 mm.
const BEHIND: usize = 9;

/// The ventricle's place in the volume.
#[derive(Debug, Clone)]
pub struct Ventricle {
    /// Middle of the cavity, millimetres along the array's axes from voxel (0, 0, 0).
    pub centre: Vec3,
    /// For each direction, the distance to the middle of the wall, mm (filled from the
    /// neighbours where none was seen).
    pub distances: Vec<f64>,
    /// For each direction, whether a wall was seen.
    pub seen: Vec<bool>,
    /// Typical brightness of the wall (upper quartile of the rays' peaks).
    pub level: f64,
    /// 0..1: how much like a ventricle it looks. Below [`PLAUSIBLE`] it is none.
    pub score: f64,
}

/// Score from which on a part counts as a ventricle.
pub const PLAUSIBLE: f64 = 0.2;
/// The same for candidates of the lattice, of which there are many more to be wrong.
const PLAUSIBLE_ON_LATTICE: f64 = 0.3;

/// Score below which the lattice is searched too and the user is told to look.
///
/// Of 133 distorted copies of the simulated patients (cropped, halved, noisy, mirrored, blurred,
/// with hotter organs) every heart was found, 131 with 0.29 or more; of 19 scans with the heart
/// painted over none reached 0.42.
pub const DOUBTFUL: f64 = 0.45;

/// Evenly spread unit vectors (Fibonacci lattice).
pub fn directions() -> Vec<Vec3> {
    let golden = std::f64::consts::PI * (3.0 - 5f64.sqrt());
    (0..DIRECTIONS)
        .map(|n| {
            let z = 1.0 - (2.0 * n as f64 + 1.0) / DIRECTIONS as f64;
            let r = (1.0 - z * z).sqrt();
            let angle = golden * n as f64;
            Vec3::new(r * angle.cos(), r * angle.sin(), z)
        })
        .collect()
}

/// Searches the ventricle; the best candidate whatever its score, or `None` where no part of
/// the volume has a ventricle's size at all.
///
/// # Errors
/// [`Cancelled`].
pub fn find(
    volume: &Volume,
    survey: &Survey,
    monitor: &Monitor,
) -> Result<Option<Ventricle>, Cancelled> {
    let blocks = Coarse::new(volume, PART_BLOCK, survey, monitor)?;
    if !(blocks.maximum > 0.0) {
        return Ok(None);
    }
    let (parts, grid) = rayon::join(
        || parts(&blocks, monitor),
        || Coarse::new(volume, RAY_BLOCK, survey, monitor),
    );
    let (parts, grid) = (parts?, grid?);
    let table = directions();
    let best = best_of(&grid, &table, &parts, monitor)?;
    if best.as_ref().is_some_and(|b| b.score >= DOUBTFUL) {
        return Ok(best);
    }
    // A wall that is nowhere brighter than where it meets the liver is never a part by itself.
    let scanned = best_of(&grid, &table, &lattice(&grid, &table), monitor)?;
    let scanned = scanned.filter(|s| s.score >= PLAUSIBLE_ON_LATTICE);
    let better = scanned.as_ref().map(|s| s.score) > best.as_ref().map(|b| b.score);
    Ok(if better { scanned } else { best })
}

/// The candidate of the highest score; of equals the first.
fn best_of(
    grid: &Coarse,
    table: &[Vec3],
    parts: &[Part],
    monitor: &Monitor,
) -> Result<Option<Ventricle>, Cancelled> {
    let candidates: Vec<Option<Ventricle>> = parts
        .par_iter()
        .map(|part| {
            monitor.check()?;
            Ok(judge(grid, table, part))
        })
        .collect::<Result<_, Cancelled>>()?;
    let mut best: Option<Ventricle> = None;
    for candidate in candidates.into_iter().flatten() {
        if best.as_ref().is_none_or(|b| candidate.score > b.score) {
            best = Some(candidate);
        }
    }
    Ok(best)
}

/// The [`LATTICE_BEST`] points of a lattice of [`LATTICE`] mm from which most of every fourth
/// ray meet a wall, at least half of them.
fn lattice(grid: &Coarse, table: &[Vec3]) -> Vec<Part> {
    let size = Vec3::from_fn(|r, _| grid.shape[r] as f64 * grid.spacing[r]);
    let steps = [0, 1, 2].map(|r| (size[r] / LATTICE) as usize + 1);
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
            let centroid = Vec3::from_fn(|r, _| (index[r] as f64 + 0.5) * LATTICE);
            let here = grid.at_mm(&centroid);
            // In the dark around the body there is no cavity.
            if here < 0.02 * f64::from(grid.maximum) {
                return None;
            }
            let part = Part {
                level: (1.3 * here).max(floor),
                centroid,
            };
            let rays = table.iter().step_by(4);
            let hits = rays
                .filter(|d| look(grid, &centroid, d, part.level).weight == 1.0)
                .count();
            (8 * hits >= DIRECTIONS).then_some((hits, part))
        })
        .collect();
    // Stable: of equals the first of the lattice.
    hit.sort_by_key(|(hits, _)| std::cmp::Reverse(*hits));
    hit.truncate(LATTICE_BEST);
    hit.into_iter().map(|(_, part)| part).collect()
}

/// Finds the direction nearest to an offset in constant time, by a cube whose faces are
/// divided into cells.
#[derive(Debug, Clone)]
pub struct Compass {
    cells: Vec<u8>,
}

impl Compass {
    /// Cells along the side of a face: about 5 degrees each, a quarter of the directions'
    /// spacing.
    const SIDE: usize = 18;

    /// The compass of [`directions`].
    pub fn new() -> Self {
        let table = directions();
        let side = Self::SIDE;
        let cells = (0..6 * side * side)
            .map(|cell| {
                let (face, u, v) = (cell / (side * side), cell / side % side, cell % side);
                let coordinate = |c: usize| (2.0 * c as f64 + 1.0) / side as f64 - 1.0;
                let axis = face / 2;
                let mut offset = Vec3::zeros();
                offset[axis] = if face % 2 == 0 { 1.0 } else { -1.0 };
                offset[(axis + 1) % 3] = coordinate(u);
                offset[(axis + 2) % 3] = coordinate(v);
                let along = |n: &usize| table[*n].dot(&offset);
                let best = (0..DIRECTIONS).max_by(|a, b| along(a).total_cmp(&along(b)));
                best.unwrap_or(0) as u8
            })
            .collect();
        Self { cells }
    }

    /// The number of the direction nearest to `offset` (to within a cell).
    pub fn nearest(&self, offset: &Vec3) -> usize {
        let axis = offset.iamax();
        let height = offset[axis].abs();
        if height == 0.0 {
            return 0;
        }
        let face = 2 * axis + usize::from(offset[axis] < 0.0);
        let cell = |r: usize| {
            let c = (offset[r % 3] / height + 1.0) / 2.0 * Self::SIDE as f64;
            (c as usize).min(Self::SIDE - 1)
        };
        let at = (face * Self::SIDE + cell(axis + 1)) * Self::SIDE + cell(axis + 2);
        usize::from(self.cells[at])
    }
}

impl Default for Compass {
    fn default() -> Self {
        Self::new()
    }
}

/// What one ray met.
#[derive(Debug, Clone, Copy, Default)]
struct Wall {
    /// Distance of the peak, mm.
    distance: f64,
    /// Value at the peak.
    peak: f64,
    /// 1 for a wall with both edges, 0.5 without a fall behind it, 0 for none.
    weight: f64,
    /// Darkest value before the peak, as a share of it.
    cavity: f64,
}

fn look(coarse: &Coarse, centre: &Vec3, direction: &Vec3, level: f64) -> Wall {
    let value = |n: usize| coarse.at_mm(&(centre + direction * (STEP * n as f64)));
    // Five samples in a row: v is the middle one.
    let mut window = [value(0), value(1), value(2), value(3), 0.0];
    let mut darkest = window[0].min(window[1]);
    for n in 2..SAMPLES {
        window[4] = value(n + 2);
        let v = window[2];
        let is_peak = v >= 0.7 * level && window.iter().all(|other| v >= *other);
        if is_peak && darkest <= 0.8 * v {
            let limit = 0.7 * v;
            let ends = (n + 1..n + BEHIND).any(|m| value(m) <= limit);
            return Wall {
                distance: STEP * n as f64,
                peak: v,
                weight: if ends { 1.0 } else { 0.4 },
                cavity: darkest / v,
            };
        }
        darkest = darkest.min(v);
        window.rotate_left(1);
    }
    Wall::default()
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

fn judge(coarse: &Coarse, table: &[Vec3], part: &Part) -> Option<Ventricle> {
    let mut centre = part.centroid;
    let mut best: Option<Ventricle> = None;
    for _ in 0..4 {
        let walls: Vec<Wall> = table
            .iter()
            .map(|d| look(coarse, &centre, d, part.level))
            .collect();
        let Some(candidate) = rate(coarse, table, centre, &walls) else {
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
        if !(12.0..55.0).contains(&radius) || (fitted - part.centroid).norm() > 45.0 {
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
fn rate(coarse: &Coarse, table: &[Vec3], centre: Vec3, walls: &[Wall]) -> Option<Ventricle> {
    let hits: Vec<&Wall> = walls.iter().filter(|w| w.weight > 0.0).collect();
    if hits.len() < DIRECTIONS / 4 {
        return None;
    }
    let mut distances: Vec<f64> = hits.iter().map(|w| w.distance).collect();
    distances.sort_by(f64::total_cmp);
    let median = distances[distances.len() / 2];
    let mut peaks: Vec<f64> = hits.iter().map(|w| w.peak).collect();
    peaks.sort_by(f64::total_cmp);
    let bright = peaks[peaks.len() * 3 / 4];
    // A wall belongs to the same shell: about as far as the others and not much dimmer.
    let belongs = |w: &Wall| {
        w.weight > 0.0
            && (0.5 * median..1.8 * median).contains(&w.distance)
            && w.peak > 0.35 * bright
            && w.peak < 2.5 * bright
    };
    let seen: Vec<bool> = walls.iter().map(belongs).collect();
    let kept: Vec<&Wall> = walls.iter().filter(|w| belongs(w)).collect();
    let n = kept.len() as f64;
    if n < DIRECTIONS as f64 / 4.0 {
        return None;
    }
    let mean = kept.iter().map(|w| w.distance).sum::<f64>() / n;
    let variance = kept
        .iter()
        .map(|w| (w.distance - mean).powi(2))
        .sum::<f64>()
        / n;
    let coverage = kept.iter().map(|w| w.weight).sum::<f64>() / DIRECTIONS as f64;
    let evenness = (-variance / (0.35 * mean).powi(2)).exp();
    let contrast = 1.0 - kept.iter().map(|w| w.cavity).sum::<f64>() / n;
    let missing = DIRECTIONS as f64 - n;
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
    let off_centre = (centre - coarse.middle()).norm() / coarse.half_extent();
    let score = coverage
        * evenness
        * (0.4 + 0.6 * together)
        * near(mean, 28.0, 0.6)
        * contrast.clamp(0.0, 0.7)
        / 0.7
        * (-off_centre * off_centre).exp();
    Some(Ventricle {
        centre,
        distances: fill(table, walls, &seen, mean),
        seen,
        level: bright,
        score,
    })
}

/// Distances in every direction: the median of the seen ones within 40 degrees.
fn fill(table: &[Vec3], walls: &[Wall], seen: &[bool], mean: f64) -> Vec<f64> {
    let cosine = 40f64.to_radians().cos();
    table
        .iter()
        .map(|d| {
            let mut close: Vec<f64> = (0..walls.len())
                .filter(|&n| seen[n] && table[n].dot(d) > cosine)
                .map(|n| walls[n].distance)
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
