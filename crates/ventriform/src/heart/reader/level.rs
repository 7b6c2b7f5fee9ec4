//! A fitted wall as a reader draws it who follows a level of the image, a share of the wall's own uptake.
//!
//! In: a fitted wall, its image, a level. Out: the wall's surface in smaller triangles, and for every node the distance
//! along its normal at which the image falls to the level.
//!
//! 1. The surface is subdivided until its edges are some [`EDGE_MM`] long: the edges of a model are three or four
//!    voxels long, and a level follows the image more closely.
//! 2. Every triangle is read at several places. Along the normal of each, from the middle of the wall outward (of the
//!    inner surface: towards the cavity), the image is followed from the brightest point inside the wall to where it
//!    falls to the level, at most [`BAND_MM`] beyond the fitted surface.
//! 3. Where it does not fall so far, as beside the liver, the wall ends at the least value on the way.
//! 4. Where the wall itself has less than [`INFARCT_SHARE_OF_LEVEL`] of the level, it keeps its fitted edge: an infarct
//!    is wall. Where it has more, but nowhere the level, it has its least thickness.
//! 5. A node moves by the mean over the places about it, weighted by area and nearness, so that mask and mesh stay one
//!    thing.
//!
//! Guaranteed: no node moves farther than [`BAND_MM`], nor past the middle of the wall.

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::numeric::order::upper_median;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::heart::model::wall::VentricleWall;
use crate::image::grid::Volume;
use crate::image::grid::field::Field;
use crate::mesh::TriMesh;
use crate::mesh::subdivide::Subdivided;
use rayon::prelude::*;

use super::wall_edges::{MIN_THICKNESS_MM, WallEdges};

/// Greatest distance of the drawn surface from the fitted one, mm.
pub const BAND_MM: f64 = 8.0;
/// Median length of the edges up to which a surface is subdivided, mm, and the most times.
const EDGE_MM: f64 = 5.0;
const MAX_SUBDIVISIONS: usize = 3;
/// Uptake of an infarct, as a share of the level: so that infarcts stay wall, more than the 0.6 that agrees best with
/// simulated readers who draw a level (docs/log/evaluation.md).
const INFARCT_SHARE_OF_LEVEL: f64 = 0.8;
/// Step along a line, mm.
const STEP_MM: f64 = 0.5;
/// Distance of the places at which a triangle is read, mm, and most of them along an edge.
const PLACE_SPACING_MM: f64 = 2.5;
const MOST_PLACES_ALONG_EDGE: usize = 6;

/// The image about a fitted wall, and the uptake that levels are shares of.
#[derive(Debug, Clone)]
pub struct WallImage {
    field: Field,
    reference: f64,
}

impl WallImage {
    /// The image about `fit`. `reference` is that of its polar map.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn about(
        fit: &FittedModel,
        volume: &Volume,
        reference: f64,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let mut region = Aabb::around(&fit.mesh.vertices);
        let margin = Vec3::repeat(2.0 * BAND_MM);
        region.min -= margin;
        region.max += margin;
        Ok(Self {
            field: Field::cut_out(volume, Some(&region), 0.0, monitor)?,
            reference,
        })
    }

    /// Value at a point, as a share of the reference; 0 where the wall has no uptake.
    fn at(&self, point: &Vec3) -> f64 {
        if self.reference > 0.0 {
            self.field.at(point) / self.reference
        } else {
            0.0
        }
    }
}

/// The surface of `mesh` with edges short enough to follow a level.
pub(super) fn subdivided(mesh: TriMesh) -> Subdivided {
    let mut finer = Subdivided::not_yet(mesh);
    for _ in 0..MAX_SUBDIVISIONS {
        // One edge of each triangle.
        let edges = (0..finer.mesh.triangles.len()).map(|triangle| {
            let [a, b, _] = finer.mesh.corners(triangle);
            (b - a).norm()
        });
        if upper_median(edges) <= EDGE_MM {
            break;
        }
        finer = finer.once_more();
    }
    finer
}

/// Displacement of every node of `mesh`, whose wall is `wall`, that puts its surface at `level`, LPS mm.
pub(super) fn displacements(
    mesh: &TriMesh,
    wall: &VentricleWall,
    image: &WallImage,
    level: f64,
) -> Vec<Vec3> {
    let edges = WallEdges::from_wall(wall);
    let normals = mesh.vertex_normals();
    let read: Vec<[[f64; 2]; 3]> = (0..mesh.triangles.len())
        .into_par_iter()
        .map(|triangle| {
            let nodes = mesh.triangles[triangle].map(|node| node as usize);
            let corners = mesh.corners(triangle);
            let longest = [0, 1, 2]
                .map(|side| (corners[side] - corners[(side + 1) % 3]).norm())
                .into_iter()
                .fold(0.0, f64::max);
            let along_edge = (longest / PLACE_SPACING_MM).ceil() as usize;
            let along_edge = along_edge.clamp(1, MOST_PLACES_ALONG_EDGE);
            let area = mesh.area_normal(triangle).norm() / (along_edge * along_edge) as f64;
            // Sums of weight times distance, and of weights, for each corner.
            let mut sums = [[0.0; 2]; 3];
            for weights in places(along_edge) {
                let blend = |of: [Vec3; 3]| -> Vec3 {
                    of[0] * weights[0] + of[1] * weights[1] + of[2] * weights[2]
                };
                let normal = blend(nodes.map(|node| normals[node]));
                let Some(normal) = normal.try_normalize(1e-9) else {
                    continue;
                };
                let point = blend(corners);
                let [inner, outer] = edges.about(wall, &point);
                let half = (outer - inner).max(MIN_THICKNESS_MM) / 2.0;
                let distance = edge_distance(|t| image.at(&(point + normal * t)), half, level);
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    sum[0] += area * weight * distance;
                    sum[1] += area * weight;
                }
            }
            sums
        })
        .collect();
    let mut sums = vec![[0.0; 2]; mesh.vertices.len()];
    for (triangle, own) in mesh.triangles.iter().zip(read) {
        for (node, own) in triangle.iter().zip(own) {
            let sum = &mut sums[*node as usize];
            sum[0] += own[0];
            sum[1] += own[1];
        }
    }
    (sums.iter().zip(normals))
        .map(|([distance, weight], normal)| normal * (distance / weight.max(1e-9)))
        .collect()
}

/// Barycentric coordinates of the centres of `along_edge`² equal parts of a triangle.
fn places(along_edge: usize) -> impl Iterator<Item = [f64; 3]> {
    let n = along_edge as f64;
    let upright = (0..along_edge).flat_map(move |a| (0..along_edge - a).map(move |b| (a, b, 1.0)));
    let turned = (1..along_edge).flat_map(move |a| (1..=along_edge - a).map(move |b| (a, b, -1.0)));
    upright.chain(turned).map(move |(a, b, way)| {
        let [u, v] = [a, b].map(|of| (of as f64 + way / 3.0) / n);
        [u, v, 1.0 - u - v]
    })
}

/// The distance from a surface, positive outward, at which `value` falls to `level` on the way out of the wall. `half`
/// is half of the wall's thickness, mm.
fn edge_distance(value: impl Fn(f64) -> f64, half: f64, level: f64) -> f64 {
    let steps_inside = (half / STEP_MM) as i64;
    let at = |step: i64| value(step as f64 * STEP_MM);
    let (brightest, most) =
        (-steps_inside..=0)
            .map(|step| (step, at(step)))
            .fold(
                (0, f64::MIN),
                |best, own| if own.1 > best.1 { own } else { best },
            );
    let innermost = -(half - MIN_THICKNESS_MM / 2.0);
    if most < INFARCT_SHARE_OF_LEVEL * level {
        return 0.0;
    }
    if most < level {
        return innermost;
    }
    let steps_outside = (BAND_MM / STEP_MM) as i64;
    let (mut before, mut least) = (most, (brightest, most));
    for step in brightest + 1..=steps_outside {
        let here = at(step);
        if here < level {
            let share = (before - level) / (before - here);
            return ((step as f64 - 1.0 + share) * STEP_MM).max(innermost);
        }
        if here < least.1 {
            least = (step, here);
        }
        before = here;
    }
    (least.0 as f64 * STEP_MM).max(0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_places_of_a_triangle_are_even() {
        for along_edge in 1..=MOST_PLACES_ALONG_EDGE {
            let all: Vec<[f64; 3]> = places(along_edge).collect();
            assert_eq!(all.len(), along_edge * along_edge);
            for corner in 0..3 {
                let mean = all.iter().map(|place| place[corner]).sum::<f64>() / all.len() as f64;
                assert!((mean - 1.0 / 3.0).abs() < 1e-12);
            }
            assert!(all.iter().flatten().all(|w| (0.0..1.0).contains(w)));
        }
    }

    /// A wall of Gaussian profile, the surface 5 mm from its middle: the level is met where the Gaussian has it.
    #[test]
    fn the_edge_lies_where_the_image_has_the_level() {
        const SIGMA_MM: f64 = 6.0;
        let value = |t: f64| (-(t + 5.0).powi(2) / (2.0 * SIGMA_MM * SIGMA_MM)).exp();
        for level in [0.3_f64, 0.5, 0.7] {
            let wanted = SIGMA_MM * (-2.0 * level.ln()).sqrt() - 5.0;
            let found = edge_distance(value, 5.0, level);
            assert!((found - wanted).abs() < 0.03, "{found} {wanted}");
        }
    }

    #[test]
    fn dark_wall_keeps_its_edge_and_the_liver_is_not_wall() {
        assert_eq!(edge_distance(|_| 0.2, 5.0, 0.5), 0.0);
        // Not so dark: its least thickness.
        let faint = edge_distance(|_| 0.45, 5.0, 0.5);
        assert_eq!(faint, MIN_THICKNESS_MM / 2.0 - 5.0);
        // A valley 4 mm out, above the level.
        let beside_liver = |t: f64| 0.6 + 0.02 * (t - 4.0).abs();
        assert_eq!(edge_distance(beside_liver, 5.0, 0.5), 4.0);
        // The wall is bright on and on: the end of the band.
        assert_eq!(edge_distance(|t| 1.0 - 0.01 * t, 5.0, 0.5), BAND_MM);
        // The level lies inside: no thinner than the least thickness.
        let found = edge_distance(|t| if t < -4.4 { 1.0 } else { 0.0 }, 5.0, 0.5);
        assert!(
            (found + 5.0 - MIN_THICKNESS_MM / 2.0).abs() < 1e-9,
            "{found}"
        );
    }
}
