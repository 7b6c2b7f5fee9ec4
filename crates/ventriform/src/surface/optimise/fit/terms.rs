//! The least-squares terms of one round of the fit: see the list in [`super`].
//!
//! In: the state of the fit. Out: a displacement for each vertex. The terms of one triangle are
//! summed into its [`Element`], triangle by triangle on any thread; the elements make up the
//! [`NormalEquations`].

use rayon::prelude::*;

use super::FitState;
use super::equations::{Element, NormalEquations};
use super::fairing::Fairing;
use super::samples::{MIN_FACING, SurfaceSample};
use crate::base::geometry::{Vec3, triangle};
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::{FaceId, VertexId};

/// Largest emphasis of a squared distance, as a multiple of the mean square.
const PEAK_CAP: f64 = 20.0;

/// Relative residual at which a round's equations count as solved; the partners change by more
/// from round to round.
const SOLVER_TOLERANCE: f64 = 1e-3;

/// Weight of the volume relative to that of all distances: leaves an error of a few hundredths
/// of a percent.
const VOLUME_WEIGHT: f64 = 1000.0;

/// Distance, relative to the root mean square, up to which midpoints count squared.
const HUBER_SHARE: f64 = 0.2;

/// Largest number of rounds of conjugate gradients per round of the fit.
const MAX_SOLVER_ROUNDS: usize = 200;

/// Number of the model's triangles from which on every other round keeps the planes of the midpoints.
const KEEPING_FROM_FACES: usize = 600;

/// Smallest number of triangles per parallel task.
const TRIANGLES_PER_TASK: usize = 16;

/// Whether the closest points of the midpoints are searched in a round of `rounds`, or the planes that the round before
/// found are kept: edges are flipped after every second round, and nothing moves far between two. Small models take
/// little time.
pub fn searches_midpoints(round: usize, rounds: usize, faces: usize) -> bool {
    round.is_multiple_of(2) || round + 1 >= rounds || faces < KEEPING_FROM_FACES
}

/// The displacement of every vertex that solves this round's least-squares problem, mm. `searches` as
/// [`searches_midpoints`] says.
///
/// # Errors
/// [`Cancelled`].
pub fn displacement(
    state: &mut FitState,
    searches: bool,
    monitor: &Monitor,
) -> Result<Vec<Vec3>, Cancelled> {
    let midpoints = Midpoints::new(state, searches);
    monitor.check()?;
    let distances = Distances::new(state);
    let shapes = Shapes::new(state);
    let fairing = Fairing::new(state);
    let elements: Vec<Element> = (0..state.half_edges.face_count() as u32)
        .into_par_iter()
        .with_min_len(TRIANGLES_PER_TASK)
        .map(|t| {
            let (t, mut element) = (FaceId(t), Element::default());
            distances.add_to(&mut element, t);
            midpoints.add_to(&mut element, t);
            shapes.add_to(&mut element, t);
            fairing.add_to(&mut element, t);
            element
        })
        .collect();
    monitor.check()?;
    let damping = state.parameters.damping / state.vertices.len() as f64;
    let mut equations = NormalEquations::new(&elements, &state.half_edges, damping);
    set_volume(&mut equations, state);
    equations.solve(SOLVER_TOLERANCE, MAX_SOLVER_ROUNDS, monitor)
}

/// Pulls the samples of S and their partners together.
struct Distances<'a> {
    samples: &'a [SurfaceSample],
    /// Indices of the admitted samples, sorted by their partners' triangles; those of triangle t
    /// are at `first[t]..first[t + 1]`.
    sorted: Vec<u32>,
    first: Vec<usize>,
    /// Mean square of the admitted samples' distances, mm².
    square: f64,
    peak_weight: f64,
}

impl<'a> Distances<'a> {
    fn new(state: &'a FitState) -> Self {
        let samples = &state.samples;
        let admitted = || (0..).zip(samples).filter(|(_, s)| s.admitted);
        let mut first = vec![0; state.half_edges.face_count() + 1];
        let mut square = 0.0;
        for (_, s) in admitted() {
            first[s.triangle.index() + 1] += 1;
            square += s.distance * s.distance;
        }
        for t in 1..first.len() {
            first[t] += first[t - 1];
        }
        let mut next = first.clone();
        let mut sorted = vec![0; first[first.len() - 1]];
        for (index, s) in admitted() {
            let place = &mut next[s.triangle.index()];
            sorted[*place] = index;
            *place += 1;
        }
        Self {
            samples,
            square: (square / sorted.len().max(1) as f64).max(f64::MIN_POSITIVE),
            sorted,
            first,
            peak_weight: state.parameters.peak_weight,
        }
    }

    fn add_to(&self, element: &mut Element, t: FaceId) {
        let range = self.first[t.index()]..self.first[t.index() + 1];
        for &index in &self.sorted[range] {
            let s = &self.samples[index as usize];
            let emphasis = (s.distance * s.distance / self.square).min(PEAK_CAP);
            let weight = (1.0 + self.peak_weight * emphasis) / self.sorted.len() as f64;
            element.add_plane(&s.barycentric, &s.normal, s.distance, weight);
        }
    }
}

/// A tangent plane of S: its unit normal and its distance from a point of the model, mm.
type TangentPlane = (Vec3, f64);

/// The triangle of S that was closest to a midpoint, and the closest point.
#[derive(Debug, Clone, Copy)]
pub struct NearPoint {
    triangle: u32,
    point: Vec3,
}

/// Pulls the midpoints of the model's edges and the centres of its triangles to S. The samples
/// of S alone would not register a triangle that none of them has as its partner.
struct Midpoints {
    /// For each triangle the plane at each of its [`SAMPLE_BARYCENTRICS`]; `None` for a midpoint that belongs
    /// to the other triangle of the edge, or if S has no triangle that faces the same way.
    planes: Vec<[Option<TangentPlane>; 4]>,
    weight: f64,
    /// Distance up to which distances count squared, mm.
    near: f64,
}

/// The midpoints of a triangle's edges and its centre, in barycentric coordinates. The midpoint
/// of an edge belongs to the lower half-edge.
const SAMPLE_BARYCENTRICS: [[f64; 3]; 4] = [
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
    [1.0 / 3.0; 3],
];

impl Midpoints {
    fn new(state: &mut FitState, searches: bool) -> Self {
        let FitState {
            half_edges,
            vertices,
            reference,
            parameters,
            near: guesses,
            ..
        } = state;
        let normals = &reference.normals;
        guesses.resize(half_edges.face_count(), [None; 4]);
        let planes: Vec<[Option<TangentPlane>; 4]> = half_edges
            .triangles()
            .par_iter()
            .zip(guesses)
            .enumerate()
            .with_min_len(TRIANGLES_PER_TASK)
            .map(|(t, (ids, guesses))| {
                let [a, b, c] = ids.map(|v| vertices[v as usize]);
                let Some(facing) = triangle::area_normal(&a, &b, &c).try_normalize(0.0) else {
                    return [None; 4];
                };
                let faces = |s: u32| normals[s as usize].dot(&facing) > MIN_FACING;
                std::array::from_fn(|k| {
                    if k < 3 {
                        let h = FaceId::from_index(t).half_edge(k);
                        if half_edges.edge(h) != h {
                            return None;
                        }
                    }
                    let place = a * SAMPLE_BARYCENTRICS[k][0]
                        + b * SAMPLE_BARYCENTRICS[k][1]
                        + c * SAMPLE_BARYCENTRICS[k][2];
                    let known = guesses[k].filter(|near| !searches && faces(near.triangle));
                    let near = match known {
                        Some(known) => known,
                        None => {
                            let guess = guesses[k].map(|near| near.triangle);
                            let found = reference.bvh.closest_from(&place, guess, faces)?;
                            NearPoint {
                                triangle: found.triangle,
                                point: found.point,
                            }
                        }
                    };
                    guesses[k] = Some(near);
                    let n = normals[near.triangle as usize];
                    Some((n, n.dot(&(near.point - place))))
                })
            })
            .collect();
        let places = (5 * planes.len() / 2) as f64;
        let all = planes.iter().flatten().flatten();
        let square: f64 = all.map(|(_, r)| r * r).sum();
        Self {
            planes,
            weight: parameters.midpoint_weight / places,
            near: HUBER_SHARE * (square / places).sqrt(),
        }
    }

    fn add_to(&self, element: &mut Element, t: FaceId) {
        for (b, plane) in SAMPLE_BARYCENTRICS.iter().zip(&self.planes[t.index()]) {
            if let Some((n, r)) = plane {
                // Beyond `near` the distance counts linearly: term D of the fitness rewards
                // midpoints very close to S, and the distant ones must not outweigh them.
                let far = r.abs() > self.near;
                let flattened = if far { self.near / r.abs() } else { 1.0 };
                element.add_plane(b, n, *r, self.weight * flattened);
            }
        }
    }
}

/// Adds the term for the volume of S. To first order a displacement x changes the volume by
/// Σ_v c_v·x_v, where c_v is a third of the sum of the area vectors around v. Divided by the area,
/// the term is a squared mean distance.
fn set_volume(equations: &mut NormalEquations, state: &FitState) {
    let (half_edges, vertices) = (&state.half_edges, &state.vertices);
    let origin = vertices[0];
    let mut coefficients = vec![Vec3::zeros(); vertices.len()];
    let (mut volume, mut area) = (0.0, 0.0);
    for t in half_edges.triangles() {
        let [a, b, c] = t.map(|v| vertices[v as usize] - origin);
        let normal = triangle::area_normal(&a, &b, &c);
        area += normal.norm() / 2.0;
        volume += a.dot(&b.cross(&c)) / 6.0;
        for &v in t {
            coefficients[v as usize] += normal / 6.0;
        }
    }
    for c in &mut coefficients {
        *c /= area;
    }
    equations.set_global(coefficients, (state.volume - volume) / area, VOLUME_WEIGHT);
}

/// Pulls every triangle towards the equilateral triangle that fits it best, in its own plane.
struct Shapes<'a> {
    state: &'a FitState<'a>,
    /// Edge length of a triangle of relative size 1, mm, such that equilateral triangles of the
    /// wanted relative sizes cover the model's area.
    unit: f64,
}

impl<'a> Shapes<'a> {
    fn new(state: &'a FitState) -> Self {
        let mut shapes = Self { state, unit: 0.0 };
        let triangles = state.half_edges.faces();
        let doubled_area = |t| {
            let [a, b, c] = shapes.corners(t);
            triangle::area_normal(&a, &b, &c).norm()
        };
        let area = triangles.clone().map(doubled_area).sum::<f64>() / 2.0;
        let squares: f64 = triangles.map(|t| shapes.size(t).powi(2)).sum();
        shapes.unit = (4.0 * area / (3f64.sqrt() * squares)).sqrt();
        shapes
    }

    fn corners(&self, t: FaceId) -> [Vec3; 3] {
        let position = |v: VertexId| self.state.vertices[v.index()];
        self.state.half_edges.corners(t).map(position)
    }

    /// The wanted relative size of triangle `t`.
    fn size(&self, t: FaceId) -> f64 {
        let corners = self.state.half_edges.corners(t);
        let sizes = corners.map(|v| self.state.sizing[v.index()]);
        sizes.iter().sum::<f64>() / 3.0
    }

    fn add_to(&self, element: &mut Element, t: FaceId) {
        let parameters = self.state.parameters;
        let p = self.corners(t);
        let Some(target) = equilateral(&p, self.unit * self.size(t), parameters.free_size) else {
            return;
        };
        let badness = 1.0 / triangle::radius_ratio(&p[0], &p[1], &p[2]).max(0.05) - 1.0;
        let triangles = self.state.half_edges.face_count() as f64;
        let weight =
            parameters.shape_weight / triangles * (1.0 + parameters.worst_weight * badness);
        element.add_shape(&target.change, &target.normal, weight);
    }
}

/// The change that would make a triangle equilateral.
struct EquilateralTarget {
    /// Displacement of each corner, relative to the mean displacement, mm.
    change: [Vec3; 3],
    /// Unit normal of the triangle's plane.
    normal: Vec3,
}

/// The equilateral triangle in the plane of `p` that fits `p` best. Its edge length lies between
/// `edge` (for `free` = 0) and the best-fitting one (for `free` = 1). `None` for a degenerate
/// triangle.
fn equilateral(p: &[Vec3; 3], edge: f64, free: f64) -> Option<EquilateralTarget> {
    let centre = (p[0] + p[1] + p[2]) / 3.0;
    let n = triangle::area_normal(&p[0], &p[1], &p[2]).try_normalize(0.0)?;
    let e1 = (p[0] - centre).try_normalize(0.0)?;
    let e2 = n.cross(&e1);
    // With positions in the plane as complex numbers, corner k of the unit triangle is ω^k/√3;
    // the best similarity maps it to α ω^k/√3 with α = Σ z_k ω^-k / √3.
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
    Some(EquilateralTarget { change, normal: n })
}
