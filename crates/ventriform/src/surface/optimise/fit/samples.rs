//! Samples of the reference surface S, each with its partner: the closest point on the model.
//!
//! [`spread`] distributes the samples evenly by area. [`find_partners`] searches the whole model
//! for each partner once, at the start; after every round [`follow_partners`] walks from the old
//! partner to the nearest local minimum of the distance.

use rayon::prelude::*;

use super::FitState;
use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Bvh;
use crate::base::geometry::triangle::{self, unit_normal};
use crate::mesh::half_edges::HalfEdges;
use crate::mesh::{FaceId, HalfEdgeId};
use crate::surface::optimise::Reference;

/// Smallest cosine between the normals of a sample and of its partner's triangle. A triangle
/// that faces another way belongs to the opposite side of a thin wall.
pub const MIN_FACING: f64 = 0.2;

/// Largest number of triangles that a walk crosses; a longer one has reached a fold.
const LONGEST_WALK: usize = 64;

/// Number of samples per parallel task.
const SAMPLES_PER_TASK: usize = 256;

/// A sample of S and its partner on the model.
#[derive(Debug, Clone, Copy)]
pub struct SurfaceSample {
    /// Position on S, mm.
    pub point: Vec3,
    /// Interpolated unit normal of S at that position.
    pub normal: Vec3,
    /// Triangle of the model that contains the partner.
    pub triangle: FaceId,
    /// Barycentric coordinates of the partner.
    pub barycentric: [f64; 3],
    /// Whether the partner's triangle faces the same way; other samples are ignored.
    pub admitted: bool,
    /// Distance from the partner to the sample along the normal, signed, mm.
    pub distance: f64,
}

/// `count` samples at equal shares of the area of `reference`, in the order of its triangles,
/// still without partners. No random numbers are involved: positions within a triangle follow
/// the R2 sequence (Roberts 2018).
pub fn spread(reference: &Reference, count: usize) -> Vec<SurfaceSample> {
    let mesh = &reference.mesh;
    let normals = mesh.vertex_normals();
    let areas: Vec<f64> = (0..mesh.triangles.len())
        .map(|t| mesh.area_normal(t).norm() / 2.0)
        .collect();
    let share = areas.iter().sum::<f64>() / count as f64;
    let mut samples = Vec::with_capacity(count + 1);
    let mut passed = 0.0;
    for (t, area) in areas.iter().enumerate() {
        passed += area;
        while (samples.len() as f64 + 0.5) * share < passed && samples.len() < count {
            let i = samples.len() as f64;
            let root = (0.5 + i * 0.754_877_666_246_692_7).fract().sqrt();
            let v = (0.5 + i * 0.569_840_290_998_053_3).fract();
            let b = [1.0 - root, root * (1.0 - v), root * v];
            let ids = mesh.triangles[t];
            let blend =
                |values: &[Vec3]| -> Vec3 { (0..3).map(|k| values[ids[k] as usize] * b[k]).sum() };
            let normal = blend(&normals).try_normalize(0.0);
            samples.push(SurfaceSample {
                point: blend(&mesh.vertices),
                normal: normal.unwrap_or(reference.normals[t]),
                triangle: FaceId(0),
                barycentric: [1.0, 0.0, 0.0],
                admitted: false,
                distance: 0.0,
            });
        }
    }
    samples
}

/// Finds the partner of every sample among all triangles of the model that face the same way. Returns
/// the tree over the model.
pub fn find_partners(state: &mut FitState) -> Bvh {
    let (vertices, triangles) = (&state.vertices, state.half_edges.triangles());
    let bvh = Bvh::new(vertices, triangles);
    let normals: Vec<Vec3> = triangles
        .iter()
        .map(|t| unit_normal(&t.map(|v| vertices[v as usize])))
        .collect();
    // The search for one sample starts at the partner of the one before, which lies nearby. That
    // affects the time but not the result, so chunks may be processed on any thread.
    state
        .samples
        .par_chunks_mut(SAMPLES_PER_TASK)
        .for_each(|samples| {
            let mut last = None;
            for sample in samples {
                let faces = |t: u32| normals[t as usize].dot(&sample.normal) > MIN_FACING;
                let found = bvh.closest_from(&sample.point, last, faces);
                sample.admitted = found.is_some();
                if let Some(found) = found {
                    last = Some(found.triangle);
                    sample.triangle = FaceId(found.triangle);
                    sample.barycentric = found.barycentric;
                    sample.distance = sample.normal.dot(&(sample.point - found.point));
                }
            }
        });
    bvh
}

/// Updates the partner of every sample by a walk from its old triangle.
pub fn follow_partners(state: &mut FitState) {
    let (vertices, half_edges) = (&state.vertices, &state.half_edges);
    state
        .samples
        .par_iter_mut()
        .with_min_len(SAMPLES_PER_TASK)
        .for_each(|sample| {
            let (t, b) = walk(vertices, half_edges, &sample.point, sample.triangle);
            let corners = half_edges.corners(t).map(|v| vertices[v.index()]);
            sample.triangle = t;
            sample.barycentric = b;
            sample.admitted = unit_normal(&corners).dot(&sample.normal) > MIN_FACING;
            let place: Vec3 = (0..3).map(|k| corners[k] * b[k]).sum();
            sample.distance = sample.normal.dot(&(sample.point - place));
        });
}

/// Walks from triangle `t` to neighbours that are closer to `p`, until there are none. Returns
/// the triangle and the barycentric coordinates of its point closest to `p`.
fn walk(vertices: &[Vec3], half_edges: &HalfEdges, p: &Vec3, t: FaceId) -> (FaceId, [f64; 3]) {
    let closest = |t: FaceId| {
        let [a, b, c] = half_edges.corners(t).map(|v| vertices[v.index()]);
        let [u, v, w] = triangle::closest_barycentric(p, &a, &b, &c);
        ((a * u + b * v + c * w - p).norm_squared(), t, [u, v, w])
    };
    let mut here = closest(t);
    for _ in 0..LONGEST_WALK {
        let (_, t, b) = here;
        let mut best = here;
        let mut consider = |t: FaceId| {
            let there = closest(t);
            if there.0 < best.0 {
                best = there;
            }
        };
        let [at_0, at_1, at_2] = t.half_edges();
        let across = |h: HalfEdgeId| half_edges.twin(h).face();
        match [0, 1, 2].map(|k| b[k] > 0.0) {
            // Inside the triangle: no other one contains this point.
            [true, true, true] => {}
            // At a corner: all triangles around it contain the point.
            [true, false, false] => visit_others(half_edges, at_0, &mut consider),
            [false, true, false] => visit_others(half_edges, at_1, &mut consider),
            [false, false, true] => visit_others(half_edges, at_2, &mut consider),
            // On the edge opposite to the corner without weight: its other triangle does.
            [false, _, _] => consider(across(at_1)),
            [_, false, _] => consider(across(at_2)),
            [_, _, false] => consider(across(at_0)),
        }
        if best.1 == t {
            break;
        }
        here = best;
    }
    (here.1, here.2)
}

/// Calls `visit` with the triangles around the origin of `h`, except that of `h`.
fn visit_others(half_edges: &HalfEdges, h: HalfEdgeId, visit: &mut impl FnMut(FaceId)) {
    for g in half_edges.around_from(h).skip(1) {
        visit(g.face());
    }
}
