//! Moves the vertices off the reference surface S so that the whole model lies close to it.
//!
//! A model whose vertices lie on S cuts off every bulge and loses volume. Here the vertices may
//! leave S. In: vertices, connectivity, the wanted relative spacing and S. Out: moved vertices
//! and, after some flips, new triangles. Each round solves one sparse least-squares problem for
//! the displacements of the vertices, with these terms:
//!
//! 1. distance: every sample of S is pulled to its partner on the model along the normal of S;
//! 2. midpoints: the model's edge midpoints and triangle centres are pulled to S in the same way;
//! 3. shape: every triangle is pulled to the best-fitting equilateral triangle in its plane;
//! 4. fairing: dihedral angles should change little from vertex to vertex ([`fairing`]);
//! 5. volume: the model should enclose the volume that S encloses;
//! 6. damping: a small weight on staying in place.
//!
//! Steps have momentum (Polyak's heavy ball method): along S the vertices move slowly, since
//! only shapes and distant samples pull them there, and momentum takes them farther in the same
//! number of rounds. The last rounds have none, so that the vertices come to rest.
//!
//! After every second round edges are flipped where that improves shapes and valences; in the
//! first half of the rounds irregular vertices are also moved until they cancel ([`polish`]).
//!
//! Guaranteed: in no round does a triangle turn over or come to intersect another one. Where a
//! step would cause that, the vertices concerned make half of it, less, or none ([`mod@advance`]).

mod advance;
mod equations;
mod fairing;
mod polish;
mod samples;
mod terms;

use advance::advance;
use samples::{SurfaceSample, find_partners, follow_partners, spread};

use super::{LeastSquaresParameters, Reference};
use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::mesh::TriMesh;
use crate::mesh::half_edges::HalfEdges;

/// Number of last rounds without momentum.
const ROUNDS_WITHOUT_MOMENTUM: usize = 5;

/// Samples of the surface for each of its own triangles above which more say nothing new.
const SAMPLES_PER_SURFACE_TRIANGLE: usize = 2;
/// Samples that each triangle of the model has nevertheless.
const LEAST_SAMPLES_PER_TRIANGLE: usize = 6;
/// Samples of the whole surface that take too little time to spare any.
const FEW_SAMPLES: usize = 10_000;

/// The number of samples for a model of `faces` triangles on a surface of `surface` triangles: as many for each of the
/// model's as `asked`, as long as they are few or not denser than the surface itself.
fn sample_count(faces: usize, surface: usize, asked: usize) -> usize {
    let least = asked.min(LEAST_SAMPLES_PER_TRIANGLE) * faces;
    let enough = least.max(SAMPLES_PER_SURFACE_TRIANGLE * surface);
    (asked * faces).min(enough.max(FEW_SAMPLES))
}

/// The model between two rounds, and what it is fitted to.
struct FitState<'a> {
    vertices: Vec<Vec3>,
    half_edges: HalfEdges,
    samples: Vec<SurfaceSample>,
    /// For the edge midpoints and the centre of each triangle, the point of S that was
    /// closest in the last search; the next one starts there.
    near: Vec<[Option<terms::NearPoint>; 4]>,
    /// Wanted relative spacing at each vertex.
    sizing: &'a [f64],
    reference: &'a Reference,
    /// Volume enclosed by S, mm³.
    volume: f64,
    /// Weight of the fairing, [`fairing::weight`].
    fairness: f64,
    parameters: &'a LeastSquaresParameters,
}

/// The result of [`fit`].
#[derive(Debug, Clone)]
pub struct FittedMesh {
    /// Moved vertices and, after flips, new triangles.
    pub mesh: TriMesh,
    /// Number of rounds.
    pub rounds: usize,
    /// Number of edges flipped.
    pub flips: usize,
    /// Number of steps that were shortened.
    pub shortened: usize,
}

/// Fits the mesh of `half_edges` with its vertices at `start` (LPS mm) to `reference`; `sizing`
/// is the wanted relative spacing at each vertex.
///
/// # Errors
/// [`Cancelled`].
pub fn fit(
    start: &[Vec3],
    half_edges: HalfEdges,
    sizing: &[f64],
    reference: &Reference,
    parameters: &LeastSquaresParameters,
    monitor: &Monitor,
) -> Result<FittedMesh, Cancelled> {
    let count = sample_count(
        half_edges.face_count(),
        reference.mesh.triangles.len(),
        parameters.samples_per_triangle,
    );
    let lengths = reference.lengths(half_edges.face_count());
    let mut state = FitState {
        vertices: start.to_vec(),
        half_edges,
        samples: spread(reference, count),
        near: Vec::new(),
        sizing,
        reference,
        volume: reference.mesh.volume(),
        fairness: fairing::weight(parameters, &lengths, reference.noise),
        parameters,
    };
    let mut tree = find_partners(&mut state);
    let (mut flips, mut shortened) = (0, 0);
    let mut velocity = vec![Vec3::zeros(); start.len()];
    for round in 0..parameters.rounds {
        let fraction = round as f64 / (parameters.rounds + 1) as f64;
        monitor.report(Stage::Optimise, fraction)?;
        let searches =
            terms::searches_midpoints(round, parameters.rounds, state.half_edges.face_count());
        let mut step = terms::displacement(&mut state, searches, monitor)?;
        if round + ROUNDS_WITHOUT_MOMENTUM < parameters.rounds {
            for (step, velocity) in step.iter_mut().zip(&velocity) {
                *step += velocity * parameters.momentum;
            }
        }
        velocity.copy_from_slice(&state.vertices);
        let triangles = state.half_edges.triangles();
        let was_shortened = advance(&mut state.vertices, triangles, &step, &mut tree);
        shortened += usize::from(was_shortened);
        for (velocity, vertex) in velocity.iter_mut().zip(&state.vertices) {
            *velocity = vertex - *velocity;
        }
        monitor.check()?;
        if round % 2 == 1 && round + 1 < parameters.rounds {
            // Only early, so that enough rounds remain to regularise the triangles.
            let early = 2 * round < parameters.rounds;
            let glide = if early { parameters.glide } else { 0 };
            flips += polish::polish(&mut state, glide, monitor)?;
            monitor.check()?;
        }
        follow_partners(&mut state);
    }
    Ok(FittedMesh {
        mesh: TriMesh {
            vertices: state.vertices,
            triangles: state.half_edges.into_triangles(),
        },
        rounds: parameters.rounds,
        flips,
        shortened,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::bvh::Bvh;
    use crate::mesh::intersections::self_intersections;
    use crate::mesh::{HalfEdgeId, VertexId, shapes};
    use crate::surface::Surface;

    fn reference(mesh: TriMesh) -> Reference {
        Reference::new(&Surface::exact(mesh, 2.0))
    }

    fn fitted(start: &TriMesh, reference: &Reference) -> FittedMesh {
        fitted_with(start, reference, &LeastSquaresParameters::default())
    }

    fn fitted_with(
        start: &TriMesh,
        reference: &Reference,
        parameters: &LeastSquaresParameters,
    ) -> FittedMesh {
        let n = start.vertices.len();
        let half_edges = HalfEdges::new(n, start.triangles.clone()).unwrap();
        let (monitor, sizing) = (Monitor::silent(), vec![1.0; n]);
        let start = &start.vertices;
        fit(start, half_edges, &sizing, reference, parameters, &monitor).unwrap()
    }

    /// Mean radius ratio 2r/R.
    fn regularity(mesh: &TriMesh) -> f64 {
        mesh.radius_ratios().sum::<f64>() / mesh.triangles.len() as f64
    }

    /// The regularity that a fit of the rough cup gives with these parameters.
    fn regularity_with(parameters: &LeastSquaresParameters) -> f64 {
        let (start, reference) = irregular();
        regularity(&fitted_with(&start, &reference, parameters).mesh)
    }

    /// A rough cup, and a coarse one whose vertices were moved at random.
    fn irregular() -> (TriMesh, Reference) {
        let jolted = |mut mesh: TriMesh, by: f64| {
            for (k, v) in (0..).zip(&mut mesh.vertices) {
                let k = f64::from(k);
                *v += Vec3::new((k * k).sin(), (k * k * 1.3).sin(), (k * k * 1.7).sin()) * by;
            }
            mesh
        };
        let start = jolted(shapes::cup(60.0, 30.0, 10.0, 16), 1.5);
        (
            start,
            reference(jolted(shapes::cup(60.0, 30.0, 10.0, 90), 0.6)),
        )
    }

    /// Every round of a small model; of a large one every other round and the last.
    #[test]
    fn midpoints_are_searched_after_flips_and_at_the_end() {
        let searched = |rounds: usize, faces: usize| -> Vec<usize> {
            let searches = |round: &usize| terms::searches_midpoints(*round, rounds, faces);
            (0..rounds).filter(searches).collect()
        };
        assert_eq!(searched(10, 296), (0..10).collect::<Vec<_>>());
        assert_eq!(searched(10, 2000), [0, 2, 4, 6, 8, 9]);
        assert_eq!(searched(5, 2000), [0, 2, 4]);
        assert_eq!(searched(1, 2000), [0]);
    }

    #[test]
    fn samples_are_no_denser_than_the_surface_where_there_are_many() {
        // Few, more than the surface has triangles; as many as asked; limited by the surface; at least six; fewer
        // asked.
        let cases = [
            (296, 1000, 16, 4736),
            (2000, 19_000, 16, 32_000),
            (10_000, 19_000, 16, 60_000),
        ];
        let limited = [
            (4000, 19_000, 16, 38_000),
            (40_000, 19_000, 4, 160_000),
            (40_000, 19_000, 200, 240_000),
        ];
        for (faces, surface, asked, expected) in cases.into_iter().chain(limited) {
            assert_eq!(sample_count(faces, surface, asked), expected);
        }
    }

    #[test]
    fn the_weight_of_shape_makes_triangles_regular() {
        let with = |shape_weight: f64| {
            regularity_with(&LeastSquaresParameters {
                shape_weight,
                ..LeastSquaresParameters::default()
            })
        };
        let (none, usual) = (with(1e-6), with(0.06));
        assert!(usual > 0.94 && none < usual - 0.15, "{none} {usual}");
    }

    /// Along the surface only shapes pull the vertices: the same number of rounds takes them
    /// farther with momentum.
    #[test]
    fn momentum_makes_triangles_regular_sooner() {
        let with = |momentum: f64| {
            regularity_with(&LeastSquaresParameters {
                momentum,
                glide: 0,
                rounds: 16,
                ..LeastSquaresParameters::default()
            })
        };
        let (without, usual) = (with(0.0), with(0.6));
        assert!(usual > without + 0.002, "{without} {usual}");
    }

    /// A vertex above the sphere is pulled down, its neighbours up, and one below the other way.
    #[test]
    fn fairing_levels_what_stands_out() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let (parameters, sizing) = (LeastSquaresParameters::default(), Vec::new());
        let raised = VertexId(100);
        for height in [1.0, -1.0] {
            let mut mesh = shapes::icosphere(30.0, 2);
            mesh.vertices[raised.index()] *= (30.0 + height) / 30.0;
            let state = state(&mesh, &reference, &parameters, &sizing);
            let rises = fairing::Fairing::new(&state).rises;
            // A twelfth of the height or so is lost to the curvature of the sphere and its facets.
            let own = rises[raised.index()] / -height;
            assert!((0.8..1.2).contains(&own), "{own}");
            for v in state.half_edges.neighbours(raised) {
                let share = rises[v.index()] / height;
                assert!((0.1..0.6).contains(&share), "{share}");
            }
        }
    }

    fn stretched(mut mesh: TriMesh, axes: [f64; 3]) -> TriMesh {
        for v in &mut mesh.vertices {
            v.component_mul_assign(&Vec3::from(axes));
        }
        mesh
    }

    #[test]
    fn spheres_and_ellipsoids_get_their_volume_back() {
        for axes in [[1.0, 1.0, 1.0], [1.0, 1.3, 0.8]] {
            let reference = reference(stretched(shapes::icosphere(30.0, 5), axes));
            let start = stretched(shapes::icosphere(30.0, 2), axes);
            let exact = reference.mesh.volume();
            assert!(start.volume() / exact < 0.98);
            let found = fitted(&start, &reference);
            let error = found.mesh.volume() / exact - 1.0;
            assert!(error.abs() < 1e-3, "{error}");
        }
    }

    #[test]
    fn the_fitted_mesh_lies_closer_to_the_surface_than_one_with_vertices_on_it() {
        let reference = reference(shapes::cup(60.0, 30.0, 10.0, 90));
        let start = shapes::cup(60.0, 30.0, 10.0, 16);
        let found = fitted(&start, &reference);
        let (parameters, sizing) = (LeastSquaresParameters::default(), Vec::new());
        let mean_distance = |mesh: &TriMesh| {
            let state = state(mesh, &reference, &parameters, &sizing);
            let distance = |s: &SurfaceSample| {
                let ids = mesh.corner_ids(s.triangle);
                let place: Vec3 = (0..3)
                    .map(|k| mesh.vertices[ids[k].index()] * s.barycentric[k])
                    .sum();
                (place - s.point).norm()
            };
            state.samples.iter().map(distance).sum::<f64>() / state.samples.len() as f64
        };
        let (before, after) = (mean_distance(&start), mean_distance(&found.mesh));
        assert!(after < 0.5 * before, "{before} {after}");
    }

    /// The walls are much thinner than the triangles are long: their two sides must stay apart.
    #[test]
    fn thin_shells_do_not_intersect_themselves() {
        for wall in [1.5, 3.0, 6.0] {
            let reference = reference(shapes::cup(60.0, 30.0, wall, 90));
            let start = shapes::cup(60.0, 30.0, wall, 14);
            let known = self_intersections(&start);
            let found = fitted(&start, &reference);
            let pairs = self_intersections(&found.mesh);
            assert!(pairs.len() <= known.len(), "wall {wall}: {pairs:?}");
            crate::mesh::topology::check(&found.mesh).unwrap();
            for t in 0..found.mesh.triangles.len() {
                let [a, b, c] = found.mesh.corners(t);
                let nearest = reference.bvh.closest(&((a + b + c) / 3.0)).unwrap();
                let distance = nearest.squared_distance.sqrt();
                assert!(distance < 4.0, "wall {wall}: {t} is {distance} mm off");
            }
        }
    }

    #[test]
    fn a_step_through_the_opposite_wall_is_shortened() {
        let mesh = shapes::cup(60.0, 30.0, 4.0, 24);
        let n = mesh.vertices.len();
        let mut vertices = mesh.vertices.clone();
        let mut step = vec![Vec3::zeros(); n];
        // The outer apex moves 20 mm up, through the floor of the cavity.
        step[0].z = 20.0;
        let mut tree = Bvh::new(&vertices, &mesh.triangles);
        assert!(advance(&mut vertices, &mesh.triangles, &step, &mut tree));
        assert!(vertices[0].z - mesh.vertices[0].z < 4.0);
        let moved = TriMesh {
            vertices,
            triangles: mesh.triangles,
        };
        assert!(self_intersections(&moved).is_empty());
    }

    fn state<'a>(
        mesh: &TriMesh,
        reference: &'a Reference,
        parameters: &'a LeastSquaresParameters,
        sizing: &'a [f64],
    ) -> FitState<'a> {
        let mut state = FitState {
            vertices: mesh.vertices.clone(),
            half_edges: HalfEdges::new(mesh.vertices.len(), mesh.triangles.clone()).unwrap(),
            samples: spread(reference, 5000),
            near: Vec::new(),
            sizing,
            reference,
            volume: reference.mesh.volume(),
            fairness: 0.014,
            parameters,
        };
        find_partners(&mut state);
        state
    }

    #[test]
    fn polishing_flips_repair_a_disturbed_sphere() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let mesh = shapes::icosphere(30.0, 2);
        let n = mesh.vertices.len();
        let (parameters, sizing) = (LeastSquaresParameters::default(), vec![1.0; n]);
        let mut state = state(&mesh, &reference, &parameters, &sizing);
        for h in [10, 100, 200, 300, 400] {
            state.half_edges.flip(HalfEdgeId(h));
        }
        follow_partners(&mut state);
        assert!(irregularity(&state.half_edges) > 12);
        assert!(polish::polish(&mut state, 0, &Monitor::silent()).unwrap() >= 5);
        assert_eq!(irregularity(&state.half_edges), 12);
    }

    /// Σ (valence - 6)²: 12 on a sphere whose only irregular vertices are twelve fives.
    fn irregularity(mesh: &HalfEdges) -> u32 {
        mesh.half_edges()
            .map(|h| mesh.valence(mesh.origin(h)))
            // Every vertex occurs once for each triangle around it.
            .map(|valence| 420 * valence.abs_diff(6).pow(2) / valence)
            .sum::<u32>()
            / 420
    }

    /// Two pairs of irregular vertices that have moved apart: no single flip helps.
    #[test]
    fn gliding_brings_separated_irregular_vertices_together() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let mesh = shapes::icosphere(30.0, 3);
        let n = mesh.vertices.len();
        let (parameters, sizing) = (LeastSquaresParameters::default(), vec![1.0; n]);
        let fresh = state(&mesh, &reference, &parameters, &sizing);
        let after = |half_edges: &HalfEdges, h: HalfEdgeId| {
            let mut flipped = half_edges.clone();
            let legal = flipped.can_flip(h)
                && super::super::legality::replacement(&mesh.vertices, &flipped.quad(h), 0.0)
                    .is_some();
            legal.then(|| {
                flipped.flip(h);
                flipped
            })
        };
        let stuck = |half_edges: &HalfEdges| {
            let now = irregularity(half_edges);
            let mut flips = half_edges.edges().filter_map(|h| after(half_edges, h));
            flips.all(|flipped| irregularity(&flipped) >= now)
        };
        let torn = fresh.half_edges.edges().find_map(|first| {
            let pair = after(&fresh.half_edges, first)?;
            let near = pair.around(pair.origin(first)).collect::<Vec<_>>();
            near.into_iter().find_map(|second| {
                let apart = after(&pair, second)?;
                (irregularity(&apart) == irregularity(&pair) && stuck(&apart)).then_some(apart)
            })
        });
        let mut state = fresh;
        state.half_edges = torn.unwrap();
        follow_partners(&mut state);
        assert!(irregularity(&state.half_edges) > 12);
        polish::polish(&mut state, 3, &Monitor::silent()).unwrap();
        assert_eq!(irregularity(&state.half_edges), 12);
    }

    /// Samples stand for equal shares of the area, in the order of the triangles.
    #[test]
    fn samples_are_spread_by_area() {
        let mesh = stretched(shapes::icosphere(30.0, 1), [1.0, 1.6, 0.5]);
        let reference = reference(mesh.clone());
        let count = 3000;
        let samples = spread(&reference, count);
        assert_eq!(samples.len(), count);
        let share = mesh.area() / count as f64;
        let mut on = vec![Vec::new(); mesh.triangles.len()];
        let (mut last, mut passed, mut before) = (0, 0.0, 0);
        for sample in &samples {
            let near = reference.bvh.closest(&sample.point).unwrap();
            assert!(near.squared_distance < 1e-18);
            let t = near.triangle as usize;
            assert!(t >= last);
            last = t;
            on[t].push(sample.point);
            assert!(sample.normal.dot(&reference.normals[t]) > 0.5);
            assert!((sample.normal.norm() - 1.0).abs() < 1e-9);
        }
        for (t, points) in on.iter().enumerate() {
            passed += mesh.area_normal(t).norm() / 2.0;
            before += points.len();
            assert!((before as f64 - passed / share).abs() <= 0.5 + 1e-6, "{t}");
            // Within a triangle they are even: their mean is near its centroid.
            let [a, b, c] = mesh.corners(t);
            let mean = points.iter().sum::<Vec3>() / points.len() as f64;
            let size = mesh.area_normal(t).norm().sqrt();
            assert!((mean - (a + b + c) / 3.0).norm() < 0.15 * size, "{t}");
        }
    }

    /// After a small move the walk from the old partner ends at the nearest point of the whole model.
    #[test]
    fn the_walk_finds_what_the_search_of_the_whole_model_finds() {
        let reference = reference(shapes::icosphere(30.0, 4));
        let mesh = shapes::icosphere(30.0, 2);
        let (parameters, sizing) = (LeastSquaresParameters::default(), Vec::new());
        let mut walked = state(&mesh, &reference, &parameters, &sizing);
        for (k, v) in (0..).zip(&mut walked.vertices) {
            let k = f64::from(k);
            *v += Vec3::new((k * k).sin(), (k * k * 1.3).sin(), (k * k * 1.7).sin()) * 1.5;
        }
        let mut searched = state(&mesh, &reference, &parameters, &sizing);
        searched.vertices.clone_from(&walked.vertices);
        let stale = walked.samples.clone();
        follow_partners(&mut walked);
        find_partners(&mut searched);
        let (mut moved, mut differ) = (0, 0);
        let samples = walked.samples.iter().zip(&searched.samples).zip(&stale);
        for ((walk, search), stale) in samples {
            let place = |s: &SurfaceSample| -> Vec3 {
                let corners = walked.half_edges.corners(s.triangle);
                (0..3)
                    .map(|k| walked.vertices[corners[k].index()] * s.barycentric[k])
                    .sum()
            };
            moved += usize::from(walk.triangle != stale.triangle);
            differ += usize::from((place(walk) - place(search)).norm() > 1e-9);
            assert!((walk.barycentric.iter().sum::<f64>() - 1.0).abs() < 1e-9);
            let distance = walk.normal.dot(&(walk.point - place(walk)));
            assert!(walk.admitted && (walk.distance - distance).abs() < 1e-12);
        }
        // A few end in another local minimum.
        assert!(moved > 100 && differ < 300, "{moved} {differ}");
    }

    /// The gain of a flip is the fall of the sum of R/2r and of (valence - 6)² over the whole mesh.
    #[test]
    fn polishing_predicts_what_a_flip_gains() {
        let (mesh, reference) = irregular();
        let (parameters, sizing) = (LeastSquaresParameters::default(), Vec::new());
        let state = state(&mesh, &reference, &parameters, &sizing);
        let objective = |half_edges: &HalfEdges| {
            let shapes = half_edges.triangles().iter().map(|t| {
                let [a, b, c] = t.map(|v| mesh.vertices[v as usize]);
                1.0 / crate::base::geometry::triangle::radius_ratio(&a, &b, &c)
            });
            let valences = half_edges
                .vertices()
                .map(|v| (f64::from(half_edges.valence(v)) - 6.0).powi(2));
            shapes.sum::<f64>() + valences.sum::<f64>()
        };
        let before = objective(&state.half_edges);
        let mut judged = 0;
        for h in state.half_edges.edges() {
            let gain = polish::gain(&state, h);
            if !state.half_edges.can_flip(h) {
                continue;
            }
            let mut flipped = state.half_edges.clone();
            flipped.flip(h);
            let exact = before - objective(&flipped);
            if gain.is_finite() {
                assert!((gain - exact).abs() < 1e-9, "{gain} {exact}");
                judged += 1;
            } else {
                let quad = state.half_edges.quad(h);
                let legal = super::super::legality::replacement(&mesh.vertices, &quad, 0.0);
                assert!(legal.is_none() || exact <= 1e-9, "{exact}");
            }
        }
        assert!(judged > 20, "{judged}");
    }
}
