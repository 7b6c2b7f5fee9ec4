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
use crate::base::geometry::Vec2;
use crate::base::progress::Cancelled;
use crate::mesh::FaceId;

/// Fraction by which k has fallen after the last round.
const ANNEALED_FRACTION: f64 = 0.9;

/// Longest move in one round, as a fraction of the radius.
const LONGEST_MOVE: f64 = 0.5;

/// The end of a list of points.
const LIST_END: u32 = u32::MAX;

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
    parameters.repulsion_strength * (1.0 - ANNEALED_FRACTION * share)
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
        let mut first = vec![LIST_END; domain.half_edges.face_count()];
        let mut next = vec![LIST_END; points.len()];
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
                if self.first[t.index()] == LIST_END || t == own.triangle {
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
            if this == LIST_END {
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
    use crate::base::geometry::Vec3;
    use crate::mesh::shapes;
    use crate::surface::retile::placement;
    use crate::surface::retile::surface_samples::WeightedSamples;

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

    /// A regular tetrahedron with edges of 200 mm and at least that many vertices, and points all over its first side
    /// with the side's normal.
    fn points_on_a_side(vertices: usize) -> (Domain, Vec<SurfacePoint>, Vec3) {
        let coarse = shapes::tetrahedron(200.0);
        let fine = WeightedSamples::new(
            &coarse.vertices,
            &coarse.vertices,
            &coarse.triangles,
            vertices,
        );
        let domain = Domain::new(fine.working, fine.triangles).unwrap();
        let normal = coarse.area_normal(0).normalize();
        let triangles = domain.half_edges.triangles();
        let corner = coarse.corners(0)[0];
        let on_side = |t: &usize| {
            let corners = triangles[*t].map(|v| domain.vertices[v as usize]);
            corners
                .iter()
                .all(|p| (p - corner).dot(&normal).abs() < 1e-9)
        };
        let on_side: Vec<usize> = (0..triangles.len()).filter(on_side).collect();
        assert_eq!(on_side.len(), triangles.len() / 4);
        let points = (0..16).map(|k| SurfacePoint {
            triangle: FaceId::from_index(on_side[(2 * k + 1) * on_side.len() / 32]),
            barycentric: [0.2, 0.5, 0.3],
        });
        let points = points.collect();
        (domain, points, normal)
    }

    /// A step in the frame of a point's triangle as a vector in space.
    fn in_space(domain: &Domain, p: &SurfacePoint, normal: &Vec3, step: Vec2) -> Vec3 {
        let [a, b, _] = domain.half_edges.triangles()[p.triangle.index()];
        let [a, b] = [a, b].map(|v| domain.vertices[v as usize]);
        let along = (b - a).normalize();
        along * step.x + normal.cross(&along) * step.y
    }

    fn position(domain: &Domain, p: &SurfacePoint) -> Vec3 {
        p.position(&domain.vertices, domain.half_edges.triangles())
    }

    /// The moves by which the points push each other, by definition on a plane; the longest move is half of the radius.
    fn pushes(places: &[Vec3], radii: &[f64], strength: f64) -> Vec<Vec3> {
        let push = |p: usize| {
            let mut step = Vec3::zeros();
            for q in (0..places.len()).filter(|q| *q != p) {
                let away = places[p] - places[q];
                let missing = (radii[p] + radii[q]) / 2.0 - away.norm();
                step += away.normalize() * (strength * missing.max(0.0));
            }
            let limit = radii[p] / 2.0;
            if step.norm() > limit {
                step.normalize() * limit
            } else {
                step
            }
        };
        (0..places.len()).map(push).collect()
    }

    #[test]
    fn points_on_many_triangles_push_each_other_as_on_a_plane() {
        let (domain, points, normal) = points_on_a_side(8000);
        let places: Vec<Vec3> = points.iter().map(|p| position(&domain, p)).collect();
        let spacing: Vec<f64> = domain.vertices.iter().map(|x| 1.0 + x.x / 500.0).collect();
        let neighbourhood = Neighbourhood::new(&domain, &spacing, &points, 70.0);
        let radii: Vec<f64> = places.iter().map(|x| 70.0 * (1.0 + x.x / 500.0)).collect();
        let (mut map, mut capped, mut pushed) = (LogMap::over(&domain), 0, 0);
        for strength in [0.1, 2.0] {
            for (p, expected) in pushes(&places, &radii, strength).into_iter().enumerate() {
                let step = neighbourhood.push(&mut map, p, strength);
                let step = in_space(&domain, &points[p], &normal, step);
                assert!((step - expected).norm() < 1e-6, "{p}: {step} {expected}");
                pushed += usize::from(expected.norm() > 1.0);
                capped += usize::from(expected.norm() > 0.499 * radii[p]);
            }
        }
        assert!(pushed > 16 && capped > 4, "{pushed} {capped}");
    }

    /// The radius is two mean spacings, 2√(A/N), and every point moves by its push.
    #[test]
    fn a_round_moves_all_points_by_what_they_are_pushed() {
        let (domain, before, _) = points_on_a_side(400);
        let places: Vec<Vec3> = before.iter().map(|p| position(&domain, p)).collect();
        let radius = 2.0 * (3f64.sqrt() * 200.0 * 200.0 / before.len() as f64).sqrt();
        let even = vec![1.0; domain.vertices.len()];
        for geodesics in [Geodesics::Approximate, Geodesics::Exact] {
            let parameters = RetileParameters {
                repulsion_iterations: 1,
                repulsion_strength: 0.02,
                geodesics,
                ..RetileParameters::default()
            };
            let mut points = before.clone();
            repel(&domain, &even, &mut points, &parameters, |_| Ok(())).unwrap();
            let mut compared = 0;
            let steps = pushes(&places, &vec![radius; places.len()], 0.02);
            for (p, (place, step)) in points.iter().zip(places.iter().zip(steps)) {
                let end = place + step;
                // The triangles of the first side come first; steps beyond it are bent.
                if p.triangle.index() < domain.half_edges.face_count() / 4 {
                    // Points near the edge of a triangle are moved away from it a little.
                    assert!((position(&domain, p) - end).norm() < 0.02);
                    compared += 1;
                }
                assert!(step.norm() > 0.1, "{}", step.norm());
            }
            assert!(compared > 8, "{compared}");
        }
    }

    #[test]
    fn every_round_reports_its_share_and_may_be_cancelled() {
        let mesh = shapes::icosphere(30.0, 2);
        let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone()).unwrap();
        let even = vec![1.0; mesh.vertices.len()];
        let parameters = RetileParameters {
            repulsion_iterations: 4,
            ..RetileParameters::default()
        };
        let start = placement::place(&mesh, &domain, &even, 20, 1);
        let heard = std::sync::Mutex::new(Vec::new());
        let mut points = start.clone();
        let hear = |share: f64| {
            heard
                .lock()
                .expect("no test holds it")
                .push((share * 100.0) as u32);
            Ok(())
        };
        repel(&domain, &even, &mut points, &parameters, hear).unwrap();
        let mut heard = heard.into_inner().unwrap();
        heard.sort_unstable();
        heard.dedup();
        assert_eq!(heard, [0, 25, 50, 75]);
        let stop = |share: f64| if share > 0.4 { Err(Cancelled) } else { Ok(()) };
        assert_eq!(
            repel(&domain, &even, &mut points, &parameters, stop),
            Err(Cancelled)
        );
    }

    #[test]
    fn two_points_at_one_place_do_not_push_each_other() {
        let (domain, points, _) = points_on_a_side(400);
        let even = vec![1.0; domain.vertices.len()];
        // On a corner, where rounding leaves no distance between them.
        let twice = [SurfacePoint {
            triangle: points[3].triangle,
            barycentric: [1.0, 0.0, 0.0],
        }; 2];
        let neighbourhood = Neighbourhood::new(&domain, &even, &twice, 70.0);
        assert_eq!(
            neighbourhood.push(&mut LogMap::over(&domain), 0, 0.5),
            Vec2::zeros()
        );
    }
}
