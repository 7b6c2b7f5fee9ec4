//! Repulsion between points on the surface: the second step of Turk's method (1992).
//!
//! In: points on the surface and the wanted relative spacing. Out: the same points, evenly
//! distributed. In each round every point is pushed by its neighbours within r = 2√(A/N) along
//! the surface: one at geodesic distance d < r pushes by k (r - d), away along the direction in
//! which its geodesic leaves the point. Then all points move at once, along straight paths, by
//! at most r/2. Unlike in the paper, k falls linearly to a tenth over the rounds; with a
//! constant k the points keep oscillating by a tenth of their spacing.
//!
//! Distances are measured along the surface because r exceeds the thickness of a ventricle's
//! wall, and points on its opposite side must not push.

use rayon::prelude::*;

use super::domain::Domain;
use super::geodesics::{ExactMap, GeodesicMap, Geodesics, LogMap};
use super::trace::walk;
use super::{RetileParameters, SurfacePoint};
use crate::geometry::Vec2;
use crate::mesh::FaceId;
use crate::progress::Cancelled;

/// Fraction by which k has fallen after the last round.
const ANNEALED: f64 = 0.9;

/// Longest move in one round, as a fraction of the radius.
const LONGEST_MOVE: f64 = 0.5;

/// The end of a list of points.
const NONE: u32 = u32::MAX;

/// Moves `points` apart for the relative `spacing` at every vertex. `tick` is called with the
/// fraction done and may cancel.
pub(crate) fn repel(
    domain: &Domain,
    spacing: &[f64],
    points: &mut Vec<SurfacePoint>,
    parameters: &RetileParameters,
    tick: impl Fn(f64) -> Result<(), Cancelled> + Sync,
) -> Result<(), Cancelled> {
    match parameters.geodesics {
        Geodesics::Approximate => repel_by::<LogMap>(domain, spacing, points, parameters, tick),
        Geodesics::Exact => repel_by::<ExactMap>(domain, spacing, points, parameters, tick),
    }
}

fn repel_by<M: GeodesicMap>(
    domain: &Domain,
    spacing: &[f64],
    points: &mut Vec<SurfacePoint>,
    parameters: &RetileParameters,
    tick: impl Fn(f64) -> Result<(), Cancelled> + Sync,
) -> Result<(), Cancelled> {
    let rounds = parameters.repulsion_iterations;
    let radius = 2.0 * (domain.area / points.len() as f64).sqrt();
    for round in 0..rounds {
        let share = round as f64 / rounds as f64;
        let strength = strength(parameters, share);
        let neighbourhood = Neighbourhood::new(domain, spacing, points, radius);
        *points = (0..points.len())
            .into_par_iter()
            .map_init(
                || M::over(domain),
                |map, p| {
                    tick(share)?;
                    let step = neighbourhood.push(map, p, strength);
                    Ok(walk(domain, &points[p], step).0)
                },
            )
            .collect::<Result<_, Cancelled>>()?;
    }
    Ok(())
}

/// The strength k after a `share` of the rounds.
fn strength(parameters: &RetileParameters, share: f64) -> f64 {
    parameters.repulsion_strength * (1.0 - ANNEALED * share)
}

/// The points with their radii, as one linked list per triangle.
struct Neighbourhood<'a> {
    domain: &'a Domain,
    points: &'a [SurfacePoint],
    /// Radius r of each point, mm.
    radii: Vec<f64>,
    largest: f64,
    /// First point on each triangle.
    first: Vec<u32>,
    /// The next point on the same triangle.
    next: Vec<u32>,
}

impl<'a> Neighbourhood<'a> {
    fn new(domain: &'a Domain, spacing: &[f64], points: &'a [SurfacePoint], radius: f64) -> Self {
        let radii: Vec<f64> = points
            .iter()
            .map(|p| radius * domain.interpolate(spacing, p))
            .collect();
        let mut first = vec![NONE; domain.half_edges.face_count()];
        let mut next = vec![NONE; points.len()];
        for (i, p) in points.iter().enumerate().rev() {
            next[i] = first[p.triangle.index()];
            first[p.triangle.index()] = i as u32;
        }
        let largest = radii.iter().copied().fold(0.0, f64::max);
        Self {
            domain,
            points,
            radii,
            largest,
            first,
            next,
        }
    }

    /// The move of point `p`, mm in the frame of its triangle.
    fn push(&self, map: &mut impl GeodesicMap, p: usize, strength: f64) -> Vec2 {
        let own = &self.points[p];
        let reach = (self.radii[p] + self.largest) / 2.0;
        map.spread(self.domain, own, reach * 1.05);
        let mut step = Vec2::zeros();
        let mut add = |q: u32, towards: Vec2| {
            let distance = towards.norm();
            let range = (self.radii[p] + self.radii[q as usize]) / 2.0;
            if q as usize != p && distance > 0.0 && distance < range {
                step -= towards * (strength * (range - distance) / distance);
            }
        };
        let mut add_all_on = |t: FaceId| {
            for q in self.on_triangle(t) {
                if let Some(towards) = map.reach_point(self.domain, &self.points[q as usize]) {
                    add(q, towards.vector);
                }
            }
        };
        add_all_on(own.triangle);
        for &v in map.visited() {
            if map.reach(v).is_none() {
                continue;
            }
            for h in self.domain.half_edges.around(v) {
                let t = h.face();
                if self.first[t.index()] == NONE || t == own.triangle {
                    continue;
                }
                // Each triangle once, and only those entirely within the radius.
                let corners = self.domain.half_edges.corners(t);
                if corners.iter().all(|c| *c >= v && map.reach(*c).is_some()) {
                    add_all_on(t);
                }
            }
        }
        let longest = LONGEST_MOVE * self.radii[p];
        let length = step.norm();
        if length > longest {
            step *= longest / length;
        }
        step
    }

    /// The points on triangle `t`.
    fn on_triangle(&self, t: FaceId) -> impl Iterator<Item = u32> + '_ {
        let mut q = self.first[t.index()];
        std::iter::from_fn(move || {
            let this = q;
            if this == NONE {
                return None;
            }
            q = self.next[this as usize];
            Some(this)
        })
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::retile::placement;

    #[test]
    fn the_force_falls_to_a_tenth() {
        let parameters = RetileParameters::default();
        let at = |share| strength(&parameters, share) / parameters.repulsion_strength;
        assert_eq!(at(0.0), 1.0);
        assert!((at(0.5) - 0.55).abs() < 1e-12);
        assert!((at(1.0) - 0.1).abs() < 1e-12);
    }

    /// In the last round the points move by less than 0.3 % of their spacing; with the full force to
    /// the end they would still move by 1 %.
    #[test]
    fn the_points_come_to_rest() {
        let mesh = shapes::icosphere(30.0, 4);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let even = vec![1.0; mesh.vertices.len()];
        let spread = |rounds: usize| {
            let mut points = placement::place(&mesh, &domain, &even, 150, 1);
            let parameters = RetileParameters {
                repulsion_iterations: rounds,
                ..RetileParameters::default()
            };
            repel(&domain, &even, &mut points, &parameters, |_| Ok(())).unwrap();
            points
        };
        let spacing = (domain.area / 150.0).sqrt();
        let rest = |points: &[SurfacePoint]| {
            let neighbourhood = Neighbourhood::new(&domain, &even, points, 2.0 * spacing);
            let mut map = LogMap::over(&domain);
            // The move that the force of the last round would still make.
            let last = strength(&RetileParameters::default(), 1.0);
            let squares = (0..points.len()).map(|p| {
                let step = neighbourhood.push(&mut map, p, last);
                step.norm_squared()
            });
            (squares.sum::<f64>() / points.len() as f64).sqrt() / spacing
        };
        let moves = rest(&spread(40));
        assert!(moves < 0.003, "{moves}");
    }

    /// Points on one flat triangle: each is pushed away from those nearer than the mean of the two radii, by the
    /// strength times what is missing, and by half of its radius at most.
    #[test]
    fn points_are_pushed_by_what_their_distance_lacks() {
        let mesh = shapes::tetrahedron(200.0);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let flat = domain.flat(FaceId(0));
        let at = |x: f64, y: f64| {
            let w = y / flat[2].y;
            let v = (x - w * flat[2].x) / flat[1].x;
            SurfacePoint {
                triangle: FaceId(0),
                barycentric: [1.0 - v - w, v, w],
            }
        };
        let points = [
            at(100.0, 50.0),
            at(106.0, 50.0),
            at(100.0, 58.0),
            at(100.0, 39.0),
        ];
        let even = [1.0; 4];
        let neighbourhood = Neighbourhood::new(&domain, &even, &points, 10.0);
        let mut map = LogMap::over(&domain);
        let mut push = |n: &Neighbourhood, p: usize, k: f64| n.push(&mut map, p, k);
        // Neighbours at distances 6 and 8; the last one is too far away.
        let wanted = Vec2::new(-4.0, -2.0) * 0.5;
        assert!((push(&neighbourhood, 0, 0.5) - wanted).norm() < 1e-9);
        // The second one sees the first at 6 and the third at 10.
        assert!((push(&neighbourhood, 1, 0.5) - Vec2::new(2.0, 0.0)).norm() < 1e-9);
        assert_eq!(push(&neighbourhood, 3, 0.5), Vec2::zeros());
        let strong = push(&neighbourhood, 0, 100.0);
        assert!((strong - Vec2::new(-4.0, -2.0).normalize() * 5.0).norm() < 1e-9);
        // Radii grow with the wanted spacing, here along x: 12 and 12.36 mm for the first two points.
        let along: Vec<f64> = (0..4u32)
            .map(|v| {
                let corners = domain.half_edges.corners(FaceId(0));
                corners
                    .iter()
                    .position(|c| c.0 == v)
                    .map_or(1.0, |k| 0.6 + 0.006 * flat[k].x)
            })
            .collect();
        let wide = Neighbourhood::new(&domain, &along, &points[..2], 10.0);
        let missing = (12.0 + 12.36) / 2.0 - 6.0;
        assert!((push(&wide, 0, 0.5) - Vec2::new(-0.5 * missing, 0.0)).norm() < 1e-9);
        let listed: Vec<u32> = neighbourhood.on_triangle(FaceId(0)).collect();
        assert_eq!(listed, [0, 1, 2, 3]);
        assert_eq!(neighbourhood.on_triangle(FaceId(1)).count(), 0);
    }
}
