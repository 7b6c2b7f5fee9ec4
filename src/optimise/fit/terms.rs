//! The least-squares terms of one round.

use nalgebra::Matrix3;
use rayon::prelude::*;

use super::Model;
use super::equations::NormalEquations;
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

/// The displacement of every vertex that one round asks for.
///
/// # Errors
/// [`Cancelled`].
pub fn displacement(model: &mut Model, monitor: &Monitor) -> Result<Vec<Vec3>, Cancelled> {
    let vertices = model.vertices.len();
    let mut equations = NormalEquations::new(vertices, &model.connectivity);
    add_distances(&mut equations, model);
    monitor.check()?;
    add_midpoints(&mut equations, model);
    monitor.check()?;
    add_shapes(&mut equations, model);
    set_volume(&mut equations, model);
    let damping = model.parameters.damping / vertices as f64;
    for v in 0..vertices as u32 {
        equations.add_anchor(v, &Vec3::zeros(), damping);
    }
    equations.solve(TOLERANCE, MOST_STEPS, monitor)
}

fn add_distances(equations: &mut NormalEquations, model: &Model) {
    let Model {
        connectivity,
        vertices,
        samples,
        parameters,
        ..
    } = model;
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
fn add_midpoints(equations: &mut NormalEquations, model: &mut Model) {
    let Model {
        connectivity,
        vertices,
        reference,
        parameters,
        near: guesses,
        ..
    } = model;
    let edges = connectivity.edges().map(|h| {
        let mut b = [0.5; 3];
        b[(h as usize + 2) % 3] = 0.0;
        (h / 3, b)
    });
    let centres = (0..connectivity.triangles().len() as u32).map(|t| (t, [1.0 / 3.0; 3]));
    let places: Vec<(u32, [f64; 3])> = edges.chain(centres).collect();
    guesses.resize(places.len(), None);
    let rows: Vec<Option<(Vec3, f64)>> = places
        .par_iter()
        .zip(guesses)
        .with_min_len(64)
        .map(|((t, b), guess)| {
            let ids = connectivity.triangles()[*t as usize];
            let corners = ids.map(|v| vertices[v as usize]);
            let place: Vec3 = (0..3).map(|k| corners[k] * b[k]).sum();
            let facing =
                triangle::area_normal(&corners[0], &corners[1], &corners[2]).try_normalize(0.0)?;
            let normals = &reference.normals;
            let faces = |s: u32| normals[s as usize].dot(&facing) > LEAST_FACING;
            let found = reference.bvh.closest_from(&place, *guess, faces)?;
            *guess = Some(found.triangle);
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

fn add_shapes(equations: &mut NormalEquations, model: &Model) {
    let Model {
        connectivity,
        vertices,
        sizing,
        parameters,
        ..
    } = model;
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
