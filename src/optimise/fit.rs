//! Moves the vertices off the reference surface S so that the whole model lies closest to it.
//!
//! A model whose vertices stand on S cuts every bulge off and loses volume. Here the vertices
//! may leave S. Each round solves one sparse least-squares problem for their displacements:
//!
//! 1. distance: every sample of S is drawn to its partner on the model along S's normal;
//! 2. the model's own edge midpoints and triangle centres are drawn to S alike;
//! 3. shape: every triangle is drawn to the equilateral triangle that fits it best, within
//!    its own plane;
//! 4. damping: a little weight on staying put.
//!
//! Every second round flips edges where that betters triangle shapes and valences.
//!
//! Guaranteed: no triangle turns over in a round and none comes to pierce another; where a
//! step would do so, the vertices concerned make half of it, or less, or none.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::connectivity::Connectivity;
use super::equations::NormalEquations;
use super::samples::{Sample, find_partners, follow_partners, spread};
use super::{FitParameters, Reference, legality};
use crate::geometry::{Vec3, triangle};
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::progress::{Cancelled, Monitor, Stage};

/// How often a step is halved before the vertices concerned stay where they are.
const MOST_HALVINGS: usize = 5;

/// How many times the mean square a squared distance may count as, where peaks weigh more.
const PEAK_CAP: f64 = 20.0;

/// Relative residual at which a round's equations count as solved: the partners change by
/// more from round to round.
const TOLERANCE: f64 = 1e-3;

/// Share of their root mean square up to which midpoints' distances count squared.
const NEAR: f64 = 0.2;

/// Most steps of conjugate gradients in a round.
const MOST_STEPS: usize = 200;

/// The fitted mesh.
#[derive(Debug, Clone)]
pub struct Fitted {
    /// Moved vertices, flipped triangles.
    pub mesh: TriMesh,
    /// Rounds run.
    pub rounds: usize,
    /// Edges flipped for shape.
    pub flips: usize,
    /// Steps that had to be shortened.
    pub shortened: usize,
}

/// Fits the mesh of `connectivity` with vertices at `start` to `reference`; `sizing` is the wanted relative spacing at
/// each vertex.
///
/// # Errors
/// [`Cancelled`].
pub fn fit(
    start: &[Vec3],
    mut connectivity: Connectivity,
    sizing: &[f64],
    reference: &Reference,
    parameters: &FitParameters,
    monitor: &Monitor,
) -> Result<Fitted, Cancelled> {
    let mut vertices = start.to_vec();
    let count = parameters.samples_per_triangle * connectivity.triangles().len();
    let mut samples = spread(reference, count);
    find_partners(&mut samples, &vertices, connectivity.triangles());
    let (mut rounds, mut flips, mut shortened) = (0, 0, 0);
    while rounds < parameters.rounds {
        monitor.report(
            Stage::Optimise,
            rounds as f64 / (parameters.rounds + 1) as f64,
        )?;
        let step = displacement(
            &vertices,
            &connectivity,
            sizing,
            &samples,
            reference,
            parameters,
        );
        shortened += usize::from(advance(&mut vertices, &connectivity, &step));
        rounds += 1;
        if rounds % 2 == 0 && rounds < parameters.rounds {
            flips += flip_for_shape(&vertices, &mut connectivity);
        }
        follow_partners(&mut samples, &vertices, &connectivity);
    }
    Ok(Fitted {
        mesh: TriMesh {
            vertices,
            triangles: connectivity.into_triangles(),
        },
        rounds,
        flips,
        shortened,
    })
}

/// The displacement of every vertex that one round asks for.
fn displacement(
    vertices: &[Vec3],
    connectivity: &Connectivity,
    sizing: &[f64],
    samples: &[Sample],
    reference: &Reference,
    parameters: &FitParameters,
) -> Vec<Vec3> {
    let mut equations = NormalEquations::new(vertices.len(), connectivity);
    add_distances(&mut equations, vertices, connectivity, samples, parameters);
    add_midpoints(
        &mut equations,
        vertices,
        connectivity,
        reference,
        parameters,
    );
    add_shapes(&mut equations, vertices, connectivity, sizing, parameters);
    let damping = parameters.damping / vertices.len() as f64;
    for v in 0..vertices.len() as u32 {
        equations.add_anchor(v, &Vec3::zeros(), damping);
    }
    equations.solve(TOLERANCE, MOST_STEPS)
}

fn add_distances(
    equations: &mut NormalEquations,
    vertices: &[Vec3],
    connectivity: &Connectivity,
    samples: &[Sample],
    parameters: &FitParameters,
) {
    let residual = |s: &Sample| {
        let corners = connectivity.triangles()[s.triangle as usize];
        let place: Vec3 = (0..3)
            .map(|k| vertices[corners[k] as usize] * s.barycentric[k])
            .sum();
        s.normal.dot(&(s.point - place))
    };
    let residuals: Vec<f64> = samples.iter().map(residual).collect();
    let admitted = samples.iter().filter(|s| s.admitted).count().max(1) as f64;
    let square = samples
        .iter()
        .zip(&residuals)
        .filter(|(s, _)| s.admitted)
        .map(|(_, r)| r * r)
        .sum::<f64>()
        / admitted;
    for (s, r) in samples.iter().zip(&residuals) {
        if s.admitted {
            let emphasis = (r * r / square.max(f64::MIN_POSITIVE)).min(PEAK_CAP);
            let weight = (1.0 + parameters.peak_weight * emphasis) / admitted;
            equations.add_plane(s.triangle, &s.barycentric, &s.normal, *r, weight);
        }
    }
}

/// Draws the model's own points, its edges' midpoints and triangles' centres, to S: samples of
/// S alone would not notice a triangle that strays.
fn add_midpoints(
    equations: &mut NormalEquations,
    vertices: &[Vec3],
    connectivity: &Connectivity,
    reference: &Reference,
    parameters: &FitParameters,
) {
    let edges = connectivity.edges().map(|h| {
        let mut b = [0.5; 3];
        b[(h as usize + 2) % 3] = 0.0;
        (h / 3, b)
    });
    let centres = (0..connectivity.triangles().len() as u32).map(|t| (t, [1.0 / 3.0; 3]));
    let places: Vec<(u32, [f64; 3])> = edges.chain(centres).collect();
    let rows: Vec<Option<(Vec3, f64)>> = places
        .par_iter()
        .with_min_len(64)
        .map(|(t, b)| {
            let ids = connectivity.triangles()[*t as usize];
            let corners = ids.map(|v| vertices[v as usize]);
            let place: Vec3 = (0..3).map(|k| corners[k] * b[k]).sum();
            let facing =
                triangle::area_normal(&corners[0], &corners[1], &corners[2]).try_normalize(0.0)?;
            let normals = &reference.normals;
            let found = reference
                .bvh
                .closest_where(&place, |s| normals[s as usize].dot(&facing) > 0.2)?;
            let n = normals[found.triangle as usize];
            Some((n, n.dot(&(found.point - place))))
        })
        .collect();
    let weight = parameters.midpoint_weight / places.len() as f64;
    let square: f64 = rows.iter().flatten().map(|(_, r)| r * r).sum();
    let near = NEAR * (square / places.len() as f64).sqrt();
    for ((t, b), row) in places.iter().zip(rows) {
        if let Some((n, r)) = row {
            // Beyond `near` the distance itself counts, no longer its square: term D rewards
            // the midpoints that come very close, and the others must not outvote them.
            let flattened = if r.abs() > near { near / r.abs() } else { 1.0 };
            equations.add_plane(*t, b, &n, r, weight * flattened);
        }
    }
}

fn add_shapes(
    equations: &mut NormalEquations,
    vertices: &[Vec3],
    connectivity: &Connectivity,
    sizing: &[f64],
    parameters: &FitParameters,
) {
    let triangles = connectivity.triangles();
    let corners = |t: &[u32; 3]| t.map(|v| vertices[v as usize]);
    let size = |t: &[u32; 3]| t.iter().map(|&v| sizing[v as usize]).sum::<f64>() / 3.0;
    let area: f64 = triangles
        .iter()
        .map(|t| {
            let [a, b, c] = corners(t);
            triangle::area_normal(&a, &b, &c).norm() / 2.0
        })
        .sum();
    let squares: f64 = triangles.iter().map(|t| size(t).powi(2)).sum();
    // Edge length of equilateral triangles that cover the same area at these sizes.
    let unit = (4.0 * area / (3f64.sqrt() * squares)).sqrt();
    for (index, t) in (0..).zip(triangles) {
        let p = corners(t);
        let Some(target) = equilateral(&p, unit * size(t), parameters.free_size) else {
            continue;
        };
        let badness = 1.0 / triangle::radius_ratio(&p[0], &p[1], &p[2]).max(0.05) - 1.0;
        let weight = parameters.shape_weight / triangles.len() as f64
            * (1.0 + parameters.worst_weight * badness);
        equations.add_shape(index, &target.change, &target.projection, weight);
    }
}

struct Target {
    /// What must be added to the corners (less their mean).
    change: [Vec3; 3],
    /// Onto the triangle's plane.
    projection: Matrix3<f64>,
}

/// The equilateral triangle that lies best on `p` in its plane. Its edge is `edge`, or, as far
/// as `free` (0..=1) goes, that which fits best. `None` for a degenerate triangle.
fn equilateral(p: &[Vec3; 3], edge: f64, free: f64) -> Option<Target> {
    let centre = (p[0] + p[1] + p[2]) / 3.0;
    let n = triangle::area_normal(&p[0], &p[1], &p[2]).try_normalize(0.0)?;
    let e1 = (p[0] - centre).try_normalize(0.0)?;
    let e2 = n.cross(&e1);
    // In the plane as complex numbers: corner k of the unit triangle is ω^k/√3; the best
    // similarity takes it to α ω^k/√3 with α = Σ z_k ω^-k / √3.
    let unit = [0, 1, 2].map(|k| {
        let turn = std::f64::consts::TAU * f64::from(k) / 3.0;
        (turn.cos() / 3f64.sqrt(), turn.sin() / 3f64.sqrt())
    });
    let (mut re, mut im) = (0.0, 0.0);
    for k in 0..3 {
        let d = p[k] - centre;
        let (x, y) = (d.dot(&e1), d.dot(&e2));
        re += x * unit[k].0 + y * unit[k].1;
        im += y * unit[k].0 - x * unit[k].1;
    }
    let fitting = re.hypot(im);
    if !(fitting > 0.0) {
        return None;
    }
    let scale = (edge + free * (fitting - edge)) / fitting;
    let change = [0, 1, 2].map(|k| {
        let (ux, uy) = unit[k];
        let corner = e1 * (scale * (re * ux - im * uy)) + e2 * (scale * (re * uy + im * ux));
        corner - (p[k] - centre)
    });
    Some(Target {
        change,
        projection: Matrix3::identity() - n * n.transpose(),
    })
}

/// Adds `step` to `vertices`, as much of it as turns no triangle over and makes none pierce
/// another that it did not pierce before. Returns whether that was less than asked for.
fn advance(vertices: &mut [Vec3], connectivity: &Connectivity, step: &[Vec3]) -> bool {
    let triangles = connectivity.triangles();
    let normal = |v: &[Vec3], t: usize| {
        let [a, b, c] = triangles[t].map(|i| v[i as usize]);
        triangle::area_normal(&a, &b, &c)
    };
    let mut share = vec![1.0; vertices.len()];
    let mut shortened = false;
    let mut before: Option<Vec<[u32; 2]>> = None;
    for halving in 0..=MOST_HALVINGS + 1 {
        let moved: Vec<Vec3> = (0..vertices.len())
            .map(|v| vertices[v] + step[v] * share[v])
            .collect();
        let mut bad: Vec<u32> = (0..triangles.len())
            .filter(|&t| !(normal(vertices, t).dot(&normal(&moved, t)) > 0.0))
            .map(|t| t as u32)
            .collect();
        if bad.is_empty() {
            let pairs = self_intersections(&TriMesh {
                vertices: moved.clone(),
                triangles: triangles.to_vec(),
            });
            if !pairs.is_empty() {
                let known = before.get_or_insert_with(|| {
                    self_intersections(&TriMesh {
                        vertices: vertices.to_vec(),
                        triangles: triangles.to_vec(),
                    })
                });
                bad = pairs
                    .into_iter()
                    .filter(|pair| known.binary_search(pair).is_err())
                    .flatten()
                    .collect();
            }
        }
        if bad.is_empty() {
            vertices.copy_from_slice(&moved);
            return shortened;
        }
        shortened = true;
        for v in bad.iter().flat_map(|&t| triangles[t as usize]) {
            let factor = if halving < MOST_HALVINGS { 0.5 } else { 0.0 };
            share[v as usize] *= factor;
        }
    }
    // Not even that helped: nobody moves.
    true
}

/// Weight of Σ (valence - 6)² against Σ R/(2r) in flips for shape.
const VALENCE_WEIGHT: f64 = 0.05;

/// Passes over all edges in one call.
const MOST_PASSES: usize = 4;

/// Flips edges, in order, wherever that lowers Σ R/(2r) + 0.05 Σ (valence - 6)² over the mesh
/// and is legal, until a pass finds none. Returns the number of flips.
fn flip_for_shape(vertices: &[Vec3], connectivity: &mut Connectivity) -> usize {
    let mut index = super::flips::intersection_index(vertices, connectivity);
    let mut flips = 0;
    for _ in 0..MOST_PASSES {
        let mut flipped = 0;
        for h in 0..connectivity.halfedges() {
            if h < connectivity.twin(h)
                && shape_gain(vertices, connectivity, h) > 1e-9
                && connectivity.can_flip(h)
                && !legality::pierces(vertices, connectivity, &index, h)
            {
                let pair = [h / 3, connectivity.twin(h) / 3];
                connectivity.flip(h);
                legality::reindex(vertices, connectivity, &mut index, pair);
                flipped += 1;
            }
        }
        flips += flipped;
        if flipped == 0 {
            break;
        }
    }
    flips
}

/// By how much flipping `h` would lower the shape objective; minus infinity if it may not.
fn shape_gain(vertices: &[Vec3], connectivity: &Connectivity, h: u32) -> f64 {
    let quad = connectivity.quad(h);
    let excess = |v: u32, change: f64| {
        let now = f64::from(connectivity.valence(v)) - 6.0;
        now.powi(2) - (now + change).powi(2)
    };
    let valences =
        excess(quad.a, -1.0) + excess(quad.b, -1.0) + excess(quad.c, 1.0) + excess(quad.d, 1.0);
    let shape = |t: [u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        1.0 / triangle::radius_ratio(&a, &b, &c).max(1e-12)
    };
    let now = shape([quad.a, quad.b, quad.c]) + shape([quad.b, quad.a, quad.d]);
    // No new pair has a sum below 2: most edges are settled here.
    if now - 2.0 + VALENCE_WEIGHT * valences <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let Some(new) = legality::replacement(vertices, &quad, 0.0) else {
        return f64::NEG_INFINITY;
    };
    let then: f64 = new.radius_ratios.iter().map(|r| 1.0 / r.max(1e-12)).sum();
    now - then + VALENCE_WEIGHT * valences
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::{Surface, SurfaceFacts};

    fn reference(mesh: TriMesh) -> Reference {
        Reference::new(&Surface {
            working: mesh.vertices.clone(),
            mesh,
            spacing: 2.0,
            facts: SurfaceFacts::default(),
        })
    }

    fn fitted(start: &TriMesh, reference: &Reference, parameters: &FitParameters) -> Fitted {
        let n = start.vertices.len();
        let connectivity = Connectivity::new(n, start.triangles.clone()).unwrap();
        let monitor = Monitor::silent();
        let sizing = vec![1.0; n];
        fit(
            &start.vertices,
            connectivity,
            &sizing,
            reference,
            parameters,
            &monitor,
        )
        .unwrap()
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
            let found = fitted(&start, &reference, &FitParameters::default());
            let error = found.mesh.volume() / exact - 1.0;
            assert!(error.abs() < 1e-3, "{error}");
        }
    }

    #[test]
    fn the_fitted_mesh_lies_closer_to_the_surface_than_one_with_vertices_on_it() {
        let reference = reference(shapes::cup(60.0, 30.0, 10.0, 90));
        let start = shapes::cup(60.0, 30.0, 10.0, 16);
        let found = fitted(&start, &reference, &FitParameters::default());
        let mean_distance = |mesh: &TriMesh| {
            let mut samples = spread(&reference, 5000);
            find_partners(&mut samples, &mesh.vertices, &mesh.triangles);
            let distance = |s: &Sample| {
                let ids = mesh.triangles[s.triangle as usize];
                let place: Vec3 = (0..3)
                    .map(|k| mesh.vertices[ids[k] as usize] * s.barycentric[k])
                    .sum();
                (place - s.point).norm()
            };
            samples.iter().map(distance).sum::<f64>() / samples.len() as f64
        };
        let (before, after) = (mean_distance(&start), mean_distance(&found.mesh));
        assert!(after < 0.5 * before, "{before} {after}");
    }

    /// Walls much thinner than the triangles are long: the sheets must stay apart.
    #[test]
    fn thin_shells_are_not_pierced() {
        for wall in [1.5, 3.0, 6.0] {
            let reference = reference(shapes::cup(60.0, 30.0, wall, 90));
            let start = shapes::cup(60.0, 30.0, wall, 14);
            let known = self_intersections(&start);
            let parameters = FitParameters::default();
            let found = fitted(&start, &reference, &parameters);
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
        let connectivity = Connectivity::new(n, mesh.triangles.clone()).unwrap();
        let mut vertices = mesh.vertices.clone();
        let mut step = vec![Vec3::zeros(); n];
        // The outer apex jumps 20 mm up, through the cavity's floor.
        step[0].z = 20.0;
        assert!(advance(&mut vertices, &connectivity, &step));
        assert!(vertices[0].z - mesh.vertices[0].z < 4.0);
        let moved = TriMesh {
            vertices,
            triangles: mesh.triangles,
        };
        assert!(self_intersections(&moved).is_empty());
    }

    #[test]
    fn flips_for_shape_mend_a_disturbed_sphere() {
        let mesh = shapes::icosphere(30.0, 2);
        let n = mesh.vertices.len();
        let mut connectivity = Connectivity::new(n, mesh.triangles.clone()).unwrap();
        for h in [10, 100, 200, 300, 400] {
            connectivity.flip(h);
        }
        assert_eq!(flip_for_shape(&mesh.vertices, &mut connectivity), 5);
        let valences = (0..n as u32).map(|v| connectivity.valence(v));
        assert_eq!(valences.filter(|&v| v == 5).count(), 12);
    }
}
