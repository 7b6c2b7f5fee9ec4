//! The least-squares terms of one round.

use rayon::prelude::*;

use super::Model;
use super::bends::Bends;
use super::equations::{Element, NormalEquations};
use super::samples::{LEAST_FACING, Sample};
use crate::geometry::{Vec3, triangle};
use crate::progress::{Cancelled, Monitor};

/// How many times the mean square a squared distance may count as, where peaks weigh more.
const PEAK_CAP: f64 = 20.0;

/// Relative residual at which a round's equations count as solved: the partners change by
/// more from round to round.
const TOLERANCE: f64 = 1e-3;

/// Weight of the volume against that of all distances: enough to leave an error of a few
/// hundredths of a percent.
const VOLUME_WEIGHT: f64 = 1000.0;

/// Share of their root mean square up to which midpoints' distances count squared.
const NEAR: f64 = 0.2;

/// Most steps of conjugate gradients in a round.
const MOST_STEPS: usize = 200;

/// Triangles that one task looks at, at least.
const TRIANGLES_PER_TASK: usize = 16;

/// The displacement of every vertex that one round asks for.
///
/// # Errors
/// [`Cancelled`].
pub fn displacement(model: &mut Model, monitor: &Monitor) -> Result<Vec<Vec3>, Cancelled> {
    let midpoints = Midpoints::new(model);
    monitor.check()?;
    let distances = Distances::new(model);
    let shapes = Shapes::new(model);
    let bends = Bends::new(model);
    // A triangle's terms are its own: which thread sums them up does not matter.
    let elements: Vec<Element> = (0..model.connectivity.triangles().len())
        .into_par_iter()
        .with_min_len(TRIANGLES_PER_TASK)
        .map(|t| {
            let mut element = Element::default();
            distances.add_to(&mut element, t);
            midpoints.add_to(&mut element, t);
            shapes.add_to(&mut element, t);
            bends.add_to(&mut element, t);
            element
        })
        .collect();
    monitor.check()?;
    let damping = model.parameters.damping / model.vertices.len() as f64;
    let mut equations = NormalEquations::new(&elements, &model.connectivity, damping);
    set_volume(&mut equations, model);
    equations.solve(TOLERANCE, MOST_STEPS, monitor)
}

/// Draws the samples of S to their partners.
struct Distances<'a> {
    samples: &'a [Sample],
    /// The admitted samples in the order of their partners' triangles; those of triangle t
    /// stand at `first[t]..first[t + 1]`.
    sorted: Vec<u32>,
    first: Vec<usize>,
    /// Mean square of their distances, mm².
    square: f64,
    peak_weight: f64,
}

impl<'a> Distances<'a> {
    fn new(model: &'a Model) -> Self {
        let samples = &model.samples;
        let admitted = || (0..).zip(samples).filter(|(_, s)| s.admitted);
        let mut first = vec![0; model.connectivity.triangles().len() + 1];
        let mut square = 0.0;
        for (_, s) in admitted() {
            first[s.triangle as usize + 1] += 1;
            square += s.distance * s.distance;
        }
        for t in 1..first.len() {
            first[t] += first[t - 1];
        }
        let mut next = first.clone();
        let mut sorted = vec![0; first[first.len() - 1]];
        for (index, s) in admitted() {
            let place = &mut next[s.triangle as usize];
            sorted[*place] = index;
            *place += 1;
        }
        Self {
            samples,
            square: (square / sorted.len().max(1) as f64).max(f64::MIN_POSITIVE),
            sorted,
            first,
            peak_weight: model.parameters.peak_weight,
        }
    }

    fn add_to(&self, element: &mut Element, t: usize) {
        for &index in &self.sorted[self.first[t]..self.first[t + 1]] {
            let s = &self.samples[index as usize];
            let emphasis = (s.distance * s.distance / self.square).min(PEAK_CAP);
            let weight = (1.0 + self.peak_weight * emphasis) / self.sorted.len() as f64;
            element.add_plane(&s.barycentric, &s.normal, s.distance, weight);
        }
    }
}

/// A plane of S, its unit normal and how far it lies from a point, mm.
type Plane = (Vec3, f64);

/// Draws the model's own points, its edges' midpoints and triangles' centres, to S: samples of
/// S alone would not notice a triangle that strays.
struct Midpoints {
    /// For each triangle those of its points that have one: see [`PLACES`].
    planes: Vec<[Option<Plane>; 4]>,
    weight: f64,
    /// Distances up to this count squared, mm.
    near: f64,
}

/// The midpoints of a triangle's edges and its centre, in barycentric coordinates. A midpoint
/// belongs to the lower half-edge.
const PLACES: [[f64; 3]; 4] = [
    [0.5, 0.5, 0.0],
    [0.0, 0.5, 0.5],
    [0.5, 0.0, 0.5],
    [1.0 / 3.0; 3],
];

impl Midpoints {
    fn new(model: &mut Model) -> Self {
        let Model {
            connectivity,
            vertices,
            reference,
            parameters,
            near: guesses,
            ..
        } = model;
        let normals = &reference.normals;
        guesses.resize(connectivity.triangles().len(), [None; 4]);
        let planes: Vec<[Option<Plane>; 4]> = connectivity
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
                let faces = |s: u32| normals[s as usize].dot(&facing) > LEAST_FACING;
                std::array::from_fn(|k| {
                    let h = (3 * t + k) as u32;
                    if k < 3 && connectivity.edge(h) != h {
                        return None;
                    }
                    let place = a * PLACES[k][0] + b * PLACES[k][1] + c * PLACES[k][2];
                    let found = reference.bvh.closest_from(&place, guesses[k], faces)?;
                    guesses[k] = Some(found.triangle);
                    let n = normals[found.triangle as usize];
                    Some((n, n.dot(&(found.point - place))))
                })
            })
            .collect();
        let places = (5 * planes.len() / 2) as f64;
        let all = planes.iter().flatten().flatten();
        let square: f64 = all.map(|(_, r)| r * r).sum();
        Self {
            planes,
            weight: parameters.midpoint_weight / places,
            near: NEAR * (square / places).sqrt(),
        }
    }

    fn add_to(&self, element: &mut Element, t: usize) {
        for (b, plane) in PLACES.iter().zip(&self.planes[t]) {
            if let Some((n, r)) = plane {
                // Beyond `near` the distance itself counts, no longer its square: term D
                // rewards the midpoints that come very close, and the others must not
                // outvote them.
                let far = r.abs() > self.near;
                let flattened = if far { self.near / r.abs() } else { 1.0 };
                element.add_plane(b, n, *r, self.weight * flattened);
            }
        }
    }
}

/// Asks for S's volume: to first order a displacement x changes the volume by Σ_v c_v·x_v, where
/// c_v is a third of the area normals round v. Scaled so that the row reads as a mean distance.
fn set_volume(equations: &mut NormalEquations, model: &Model) {
    let Model {
        connectivity,
        vertices,
        ..
    } = model;
    let origin = vertices[0];
    let mut coefficients = vec![Vec3::zeros(); vertices.len()];
    let (mut volume, mut area) = (0.0, 0.0);
    for t in connectivity.triangles() {
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
    equations.set_global(coefficients, (model.volume - volume) / area, VOLUME_WEIGHT);
}

/// Draws every triangle to the equilateral one that fits it best, within its own plane.
struct Shapes<'a> {
    model: &'a Model<'a>,
    /// Edge length of equilateral triangles that cover the same area at the wanted relative
    /// sizes, for size 1, mm.
    unit: f64,
}

impl<'a> Shapes<'a> {
    fn new(model: &'a Model) -> Self {
        let mut shapes = Self { model, unit: 0.0 };
        let triangles = 0..model.connectivity.triangles().len();
        let doubled_area = |t| {
            let [a, b, c] = shapes.corners(t);
            triangle::area_normal(&a, &b, &c).norm()
        };
        let area = triangles.clone().map(doubled_area).sum::<f64>() / 2.0;
        let squares: f64 = triangles.map(|t| shapes.size(t).powi(2)).sum();
        shapes.unit = (4.0 * area / (3f64.sqrt() * squares)).sqrt();
        shapes
    }

    fn corners(&self, t: usize) -> [Vec3; 3] {
        self.model.connectivity.triangles()[t].map(|v| self.model.vertices[v as usize])
    }

    /// The wanted relative size of triangle `t`.
    fn size(&self, t: usize) -> f64 {
        let sizes = self.model.connectivity.triangles()[t].map(|v| self.model.sizing[v as usize]);
        sizes.iter().sum::<f64>() / 3.0
    }

    fn add_to(&self, element: &mut Element, t: usize) {
        let parameters = self.model.parameters;
        let p = self.corners(t);
        let Some(target) = equilateral(&p, self.unit * self.size(t), parameters.free_size) else {
            return;
        };
        let badness = 1.0 / triangle::radius_ratio(&p[0], &p[1], &p[2]).max(0.05) - 1.0;
        let triangles = self.model.connectivity.triangles().len() as f64;
        let weight =
            parameters.shape_weight / triangles * (1.0 + parameters.worst_weight * badness);
        element.add_shape(&target.change, &target.normal, weight);
    }
}

struct Target {
    /// What must be added to the corners (less their mean).
    change: [Vec3; 3],
    /// Unit normal of the triangle's plane.
    normal: Vec3,
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
    Some(Target { change, normal: n })
}
