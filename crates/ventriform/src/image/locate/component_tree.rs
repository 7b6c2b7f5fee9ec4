//! The connected parts of a volume at every threshold.
//!
//! A component tree (max-tree; Salembier, Oliveras & Garrido, IEEE TIP 1998) on some fifty levels,
//! built by lowering a threshold: voxels are sorted by level with a counting sort and united with
//! their 6-neighbours (union-find). The tree itself is not kept; parts whose volume and spread are
//! within bounds are listed as the threshold passes.

use super::grey_blocks::GreyBlocks;
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};

/// Ratio of neighbouring levels.
const LEVEL_RATIO: f64 = 0.93;
/// Number of levels: down to 4 % of the maximum.
const LEVEL_COUNT: usize = 44;
/// The threshold is not lowered further once more than this lies above it, mm³: twice a heart,
/// liver and gut together. Below that is background.
const MOST_ABOVE: f64 = 8e6;
/// Volumes of the parts listed, mm³.
const PART_VOLUMES_MM3: std::ops::Range<f64> = 15e3..500e3;
/// Root-mean-square distances from the centroid of the parts listed, mm.
const PART_SPREADS_MM: std::ops::Range<f64> = 12.0..55.0;

/// A part is listed again once it has grown by this factor.
const RELISTED_GROWTH: f64 = 1.4;

/// A connected part above a threshold.
#[derive(Debug, Clone, Copy)]
pub struct Part {
    /// The threshold.
    pub level: f64,
    /// Centroid, mm along the array's axes.
    pub centroid: Vec3,
}

/// Sums over the voxels of a part.
#[derive(Debug, Clone, Copy)]
struct Sums {
    count: f64,
    position: Vec3,
    square: f64,
    /// Count when the part was last listed.
    listed: f64,
}

/// The parts that could be a ventricle, from the highest threshold down.
///
/// # Errors
/// [`Cancelled`].
pub fn parts(blocks: &GreyBlocks, monitor: &Monitor) -> Result<Vec<Part>, Cancelled> {
    if !(blocks.maximum > 0.0) {
        return Ok(Vec::new());
    }
    let (order, ends) = sort_by_level(blocks, monitor)?;
    let [nx, ny, nz] = blocks.shape;
    // The place in `order` of every voxel that the threshold has passed.
    let mut rank = vec![u32::MAX; blocks.values.len()];
    let mut parent: Vec<u32> = (0..order.len() as u32).collect();
    let mut sums: Vec<Sums> = Vec::with_capacity(order.len());
    let mut roots: Vec<u32> = Vec::new();
    let mut listed = Vec::new();
    let voxel = blocks.spacing.iter().product::<f64>();
    let mut begin = 0;
    for (level, &end) in ends.iter().enumerate() {
        for here in begin..end {
            monitor.check()?;
            let at = order[here] as usize;
            let (i, j, k) = (at % nx, at / nx % ny, at / (nx * ny));
            let position = blocks.position([i, j, k]);
            sums.push(Sums {
                count: 1.0,
                position,
                square: position.norm_squared(),
                listed: 0.0,
            });
            rank[at] = here as u32;
            let mut neighbours = [usize::MAX; 6];
            if i > 0 {
                neighbours[0] = at - 1;
            }
            if i + 1 < nx {
                neighbours[1] = at + 1;
            }
            if j > 0 {
                neighbours[2] = at - nx;
            }
            if j + 1 < ny {
                neighbours[3] = at + nx;
            }
            if k > 0 {
                neighbours[4] = at - nx * ny;
            }
            if k + 1 < nz {
                neighbours[5] = at + nx * ny;
            }
            for other in neighbours {
                if other != usize::MAX && rank[other] != u32::MAX {
                    unite(&mut parent, &mut sums, here as u32, rank[other]);
                }
            }
        }
        roots.extend(begin as u32..end as u32);
        roots.retain(|&r| parent[r as usize] == r);
        for &r in &roots {
            let s = &mut sums[r as usize];
            if !PART_VOLUMES_MM3.contains(&(s.count * voxel))
                || s.count < RELISTED_GROWTH * s.listed
            {
                continue;
            }
            let centroid = s.position / s.count;
            let spread = (s.square / s.count - centroid.norm_squared())
                .max(0.0)
                .sqrt();
            if PART_SPREADS_MM.contains(&spread) {
                s.listed = s.count;
                listed.push(Part {
                    level: f64::from(blocks.maximum) * LEVEL_RATIO.powi(level as i32 + 1),
                    centroid,
                });
            }
        }
        begin = end;
    }
    Ok(listed)
}

/// Voxels in order of falling level, and where each level ends.
fn sort_by_level(
    blocks: &GreyBlocks,
    monitor: &Monitor,
) -> Result<(Vec<u32>, Vec<usize>), Cancelled> {
    // A fine linear table instead of a logarithm for each voxel.
    const BISECTION_STEPS: usize = 2048;
    let scale = BISECTION_STEPS as f32 / blocks.maximum;
    let table: Vec<u8> = (0..=BISECTION_STEPS)
        .map(|step| {
            let share = (step as f64 + 0.5) / BISECTION_STEPS as f64;
            (share.ln() / LEVEL_RATIO.ln()).clamp(0.0, LEVEL_COUNT as f64) as u8
        })
        .collect();
    let step_of = |v: f32| ((v * scale) as usize).min(BISECTION_STEPS);
    let voxel = blocks.spacing.iter().product::<f64>();
    let floor = table
        .iter()
        .position(|&l| l < LEVEL_COUNT as u8)
        .unwrap_or(BISECTION_STEPS);
    let floor = floor.max(lowest_step(
        blocks,
        BISECTION_STEPS,
        step_of,
        (MOST_ABOVE / voxel) as usize,
        monitor,
    )?);
    let floor_value = floor as f32 / scale;
    let mut counts = vec![0; LEVEL_COUNT + 1];
    let mut passed: Vec<(u32, u8)> = Vec::new();
    for (at, &v) in blocks.values.iter().enumerate() {
        monitor.check()?;
        if v >= floor_value {
            let level = table[step_of(v)].min(LEVEL_COUNT as u8 - 1);
            counts[level as usize + 1] += 1;
            passed.push((at as u32, level));
        }
    }
    for level in 0..LEVEL_COUNT {
        counts[level + 1] += counts[level];
    }
    let ends = counts[1..].to_vec();
    let mut order = vec![0; passed.len()];
    for (at, level) in passed {
        monitor.check()?;
        let place = &mut counts[level as usize];
        order[*place] = at;
        *place += 1;
    }
    Ok((order, ends))
}

/// The lowest step that no more than `most` voxels reach.
fn lowest_step(
    blocks: &GreyBlocks,
    steps: usize,
    step_of: impl Fn(f32) -> usize,
    most: usize,
    monitor: &Monitor,
) -> Result<usize, Cancelled> {
    let mut histogram = vec![0usize; steps + 1];
    for &v in blocks.values.iter().filter(|v| **v > 0.0) {
        monitor.check()?;
        histogram[step_of(v)] += 1;
    }
    let mut above = 0;
    for step in (0..=steps).rev() {
        above += histogram[step];
        if above > most {
            return Ok((step + 1).min(steps));
        }
    }
    Ok(0)
}

fn unite(parent: &mut [u32], sums: &mut [Sums], a: u32, b: u32) {
    use crate::base::numeric::disjoint_sets::root;
    let (a, b) = (root(parent, a), root(parent, b));
    if a == b {
        return;
    }
    // The larger part keeps its root; of equals the one met first.
    let larger_is_a = (sums[a as usize].count, b) > (sums[b as usize].count, a);
    let (keep, join) = if larger_is_a { (a, b) } else { (b, a) };
    parent[join as usize] = keep;
    let joined = sums[join as usize];
    let kept = &mut sums[keep as usize];
    kept.count += joined.count;
    kept.position += joined.position;
    kept.square += joined.square;
    kept.listed = kept.listed.max(joined.listed);
}
