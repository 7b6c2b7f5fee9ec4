//! Distances of a mask's wall from a fitted one.
//!
//! In go a fit, the mask of its shown wall and a reader's mask on the same grid; out come three distances.
//!
//! 1. Each ray of the fitted wall is followed from the middle of the wall inward and outward, in steps of
//!    [`RAY_STEP_MM`], to where it leaves the mask (trilinear between voxels, half-way). The difference to where it
//!    leaves the fitted wall is one measurement.
//! 2. From the middle of the wall near its rim, a line along the axis to the base ends at the rim of the
//!    wall and at that of the mask.
//! 3. The medians of the differences, weighted by the area that a ray stands for. The median of the
//!    differences is the distance by which the masks overlap best. Voxels scatter single differences by
//!    half a voxel; over hundreds of rays that averages out.
//! 4. Between voxels a narrow cavity closes by up to half a millimetre. The medians for the mask of the fitted
//!    wall itself show by how much, and are subtracted.
//!
//! The level ([`measure_level`]) is the one whose drawn wall agrees best with the mask (E_J), sought on a grid of
//! [`COARSE_LEVEL_STEP`] and then of [`FINE_LEVEL_STEP`]: through the whole way of drawing, so that its smoothing is in
//! the level.
//!
//! A ray that does not start in the mask, or does not leave it within [`MAX_EDGE_DISTANCE_MM`], counts for nothing.

use super::level::WallImage;
use super::profile::{ReaderDrawing, ReaderOffsets};
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::heart::model::wall::{RAY_COLUMNS, RAY_ROWS};
use crate::image::grid::agreement::jaccard;
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::mesh::TriMesh;

/// Levels among which that of a mask is sought, and the distances of those tried.
const SOUGHT_LEVELS: [f64; 2] = [0.2, 0.8];
const COARSE_LEVEL_STEP: f64 = 0.05;
const FINE_LEVEL_STEP: f64 = 0.01;
/// Steps along a ray, mm.
const RAY_STEP_MM: f64 = 0.25;
/// Greatest distance of an edge from the middle of the wall, mm.
const MAX_EDGE_DISTANCE_MM: f64 = 25.0;
/// Height above the last row of the wall at which the line to the rim begins, rows.
const ABOVE_RIM: usize = 4;
/// Share of the rays that must be usable.
const LEAST_SEEN: f64 = 0.4;

/// The distances from the shown wall of `fit`, whose mask is `own`, to that of the mask `drawn`. The grid of
/// both is at `frame`. `None` if the two overlap in too little of the wall, or the organ is no ventricle.
pub fn measure(
    fit: &FittedModel,
    own: &Mask,
    drawn: &Mask,
    frame: &VoxelToPatient,
) -> Option<ReaderOffsets> {
    let [own, drawn] = [own, drawn].map(|mask| Some(medians(fit, mask, frame)?.to_array()));
    let (own, drawn) = (own?, drawn?);
    Some(ReaderOffsets::from_array(
        [0, 1, 2].map(|which| drawn[which] - own[which]),
    ))
}

/// The level at which the wall of `fit`, drawn on `image`, agrees best with the mask `drawn` on the grid at `frame`
/// (E_J).
///
/// # Errors
/// [`Cancelled`].
pub fn measure_level(
    fit: &FittedModel,
    image: &WallImage,
    drawn: &Mask,
    frame: &VoxelToPatient,
    monitor: &Monitor,
) -> Result<f64, Cancelled> {
    let agreement = |step: i32| {
        let level = f64::from(step) * FINE_LEVEL_STEP;
        let made = super::drawn(fit.clone(), &ReaderDrawing::Level(level), image, monitor)?;
        let mask = voxelise(&made.model.mesh, drawn.shape, frame, monitor)?;
        Ok::<_, Cancelled>((step, jaccard(&mask, drawn, monitor)?))
    };
    let coarse = (COARSE_LEVEL_STEP / FINE_LEVEL_STEP).round() as i32;
    let [low, high] = SOUGHT_LEVELS.map(|level| (level / FINE_LEVEL_STEP).round() as i32);
    let best_of = |steps: Vec<i32>| {
        let mut best = (low, f64::MIN);
        for step in steps {
            let own = agreement(step)?;
            if own.1 > best.1 {
                best = own;
            }
        }
        Ok::<_, Cancelled>(best.0)
    };
    let near = best_of((low..=high).step_by(coarse as usize).collect())?;
    let around = (near - coarse + 1).max(low)..(near + coarse).min(high + 1);
    let step = best_of(around.collect())?;
    Ok(f64::from(step) * FINE_LEVEL_STEP)
}

/// The medians of the distances from the surface of `fit` to a mask.
fn medians(fit: &FittedModel, drawn: &Mask, frame: &VoxelToPatient) -> Option<ReaderOffsets> {
    let (wall, cup) = (fit.wall.as_ref()?, fit.cup?);
    let drawn = MaskField { mask: drawn, frame };
    let (mut inner, mut outer, mut rim) = (Vec::new(), Vec::new(), Vec::new());
    let mut met = 0;
    for column in 0..RAY_COLUMNS {
        let rows: Vec<usize> = (0..RAY_ROWS)
            .filter(|row| wall.rays[row * RAY_COLUMNS + column].wall.is_some())
            .collect();
        for (place, row) in rows.iter().enumerate() {
            let ray = &wall.rays[row * RAY_COLUMNS + column];
            let Some([enters, leaves]) = ray.wall else {
                continue;
            };
            let half = (leaves - enters) / 2.0;
            let middle = ray.start + ray.direction * (enters + half);
            if place + ABOVE_RIM == rows.len() {
                let to_base = -cup.axis;
                let own = exit(&fit.mesh, &middle, &to_base);
                rim.extend(
                    own.zip(drawn.leaves(&middle, &to_base))
                        .map(|(o, d)| (d - o, 1.0)),
                );
            }
            // Rays near the rim may leave through it.
            if place + ABOVE_RIM >= rows.len() {
                continue;
            }
            met += 1;
            let from_axis = |distance: f64| {
                let p = ray.start + ray.direction * distance - cup.centre;
                (p - cup.axis * p.dot(&cup.axis)).norm()
            };
            // Inward is against the ray: what the mask reaches farther in is nearer to the axis.
            if enters > 0.0 {
                let inward = drawn.leaves(&middle, &-ray.direction);
                inner.extend(inward.map(|d| (half - d, from_axis(enters))));
            }
            let outward = drawn.leaves(&middle, &ray.direction);
            outer.extend(outward.map(|d| (d - half, from_axis(leaves))));
        }
    }
    let least = LEAST_SEEN * met as f64;
    if met == 0 || (inner.len() as f64) < least || (outer.len() as f64) < least {
        return None;
    }
    Some(ReaderOffsets {
        endocardium: weighted_median(inner)?,
        epicardium: weighted_median(outer)?,
        rim: weighted_median(rim)?,
    })
}

/// Distance from `start`, inside `mesh`, at which a line first meets it.
fn exit(mesh: &TriMesh, start: &Vec3, direction: &Vec3) -> Option<f64> {
    let met = (0..mesh.triangles.len()).filter_map(|t| {
        let [a, b, c] = mesh.corners(t);
        triangle::ray_distance(start, direction, &a, &b, &c)
    });
    met.min_by(f64::total_cmp)
}

/// A mask as a field: the share of set voxels among the eight about a point.
struct MaskField<'a> {
    mask: &'a Mask,
    frame: &'a VoxelToPatient,
}

impl MaskField<'_> {
    /// The distance from `start` at which a line leaves the mask, mm. `None` if it does not start in it, or does
    /// not leave it.
    fn leaves(&self, start: &Vec3, direction: &Vec3) -> Option<f64> {
        let value = |distance: f64| self.at(&(start + direction * distance));
        let mut before = value(0.0);
        if before < 0.5 {
            return None;
        }
        let steps = (MAX_EDGE_DISTANCE_MM / RAY_STEP_MM) as usize;
        for step in 1..=steps {
            let here = value(step as f64 * RAY_STEP_MM);
            if here < 0.5 {
                let share = (before - 0.5) / (before - here);
                return Some((step as f64 - 1.0 + share) * RAY_STEP_MM);
            }
            before = here;
        }
        None
    }

    fn at(&self, p: &Vec3) -> f64 {
        let index = self.frame.to_voxel(p);
        let low = index.map(f64::floor);
        let share = index - low;
        let mut sum = 0.0;
        for corner in 0..8usize {
            let mut weight = 1.0;
            let mut flat = 0;
            let mut stride = 1;
            let mut inside = true;
            for axis in 0..3 {
                let up = corner >> axis & 1;
                weight *= if up == 1 {
                    share[axis]
                } else {
                    1.0 - share[axis]
                };
                let place = low[axis] + up as f64;
                inside &= place >= 0.0 && place < self.mask.shape[axis] as f64;
                flat += if inside { place as usize * stride } else { 0 };
                stride *= self.mask.shape[axis];
            }
            if inside && self.mask.voxels[flat] {
                sum += weight;
            }
        }
        sum
    }
}

fn weighted_median(mut values: Vec<(f64, f64)>) -> Option<f64> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let half = values.iter().map(|v| v.1).sum::<f64>() / 2.0;
    let mut sum = 0.0;
    values.into_iter().find_map(|(value, weight)| {
        sum += weight;
        (sum >= half).then_some(value)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_counts_areas() {
        let values = vec![(3.0, 1.0), (-1.0, 1.0), (0.5, 3.0), (9.0, 0.5)];
        assert_eq!(weighted_median(values), Some(0.5));
        assert_eq!(weighted_median(Vec::new()), None);
    }
}
