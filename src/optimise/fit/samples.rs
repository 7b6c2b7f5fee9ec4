//! Points spread evenly over the reference surface, each with its closest point on the model.

use rayon::prelude::*;

use super::Model;
use crate::geometry::bvh::Bvh;
use crate::geometry::{Vec3, triangle};
use crate::mesh::adjacency::previous;
use crate::optimise::Reference;
use crate::optimise::connectivity::Connectivity;

/// The closest point must lie on a triangle that faces the same way by at least this cosine:
/// else it belongs to the opposite side of a thin wall.
pub const LEAST_FACING: f64 = 0.2;

/// Triangles that a walk may cross; one that is still going then has met a fold.
const LONGEST_WALK: usize = 64;

/// Samples that one task looks at.
const SAMPLES_PER_TASK: usize = 256;

/// A sample of S and its partner on the model M.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// Position on S.
    pub point: Vec3,
    /// Interpolated unit normal of S there.
    pub normal: Vec3,
    /// Triangle of M with the closest point.
    pub triangle: u32,
    /// The closest point's barycentric coordinates.
    pub barycentric: [f64; 3],
    /// Whether the partner faces the same way.
    pub admitted: bool,
    /// How far the sample lies from its partner along the normal, mm.
    pub distance: f64,
}

/// `count` samples of `reference` at equal shares of its area, in the order of its triangles,
/// with partners yet to be found. Needs no random numbers: places within a triangle follow
/// the R2 sequence (Roberts 2018).
pub fn spread(reference: &Reference, count: usize) -> Vec<Sample> {
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
            samples.push(Sample {
                point: blend(&mesh.vertices),
                normal: normal.unwrap_or(reference.normals[t]),
                triangle: 0,
                barycentric: [1.0, 0.0, 0.0],
                admitted: false,
                distance: 0.0,
            });
        }
    }
    samples
}

/// Finds every sample's partner among all triangles that face the same way.
pub fn find_partners(model: &mut Model) {
    let (vertices, triangles) = (&model.vertices, model.connectivity.triangles());
    let bvh = Bvh::new(vertices, triangles);
    let normals: Vec<Vec3> = triangles
        .iter()
        .map(|t| unit_normal(&t.map(|v| vertices[v as usize])))
        .collect();
    // Each sample is judged by itself; only the time depends on its neighbours' answers.
    model
        .samples
        .par_chunks_mut(SAMPLES_PER_TASK)
        .for_each(|samples| {
            // Samples follow each other over S: the last partner is near the next.
            let mut last = None;
            for sample in samples {
                let faces = |t: u32| normals[t as usize].dot(&sample.normal) > LEAST_FACING;
                let found = bvh.closest_from(&sample.point, last, faces);
                sample.admitted = found.is_some();
                if let Some(found) = found {
                    last = Some(found.triangle);
                    sample.triangle = found.triangle;
                    sample.barycentric = found.barycentric;
                    sample.distance = sample.normal.dot(&(sample.point - found.point));
                }
            }
        });
}

/// Follows every sample's partner over the mesh to the nearest place that a walk
/// downhill from its old triangle leads to.
pub fn follow_partners(model: &mut Model) {
    let (vertices, connectivity) = (&model.vertices, &model.connectivity);
    model
        .samples
        .par_iter_mut()
        .with_min_len(SAMPLES_PER_TASK)
        .for_each(|sample| {
            let (t, b) = walk(vertices, connectivity, &sample.point, sample.triangle);
            let corners = connectivity.triangles()[t as usize].map(|v| vertices[v as usize]);
            sample.triangle = t;
            sample.barycentric = b;
            sample.admitted = unit_normal(&corners).dot(&sample.normal) > LEAST_FACING;
            let place: Vec3 = (0..3).map(|k| corners[k] * b[k]).sum();
            sample.distance = sample.normal.dot(&(sample.point - place));
        });
}

/// The triangle and barycentric coordinates where the distance to `p` has a local minimum
/// over the mesh, walking downhill from triangle `t`.
fn walk(vertices: &[Vec3], connectivity: &Connectivity, p: &Vec3, t: u32) -> (u32, [f64; 3]) {
    let closest = |t: u32| {
        let [a, b, c] = connectivity.triangles()[t as usize].map(|v| vertices[v as usize]);
        let [u, v, w] = triangle::closest_barycentric(p, &a, &b, &c);
        ((a * u + b * v + c * w - p).norm_squared(), t, [u, v, w])
    };
    let mut here = closest(t);
    for _ in 0..LONGEST_WALK {
        let (_, t, b) = here;
        let mut best = here;
        let mut consider = |t: u32| {
            let there = closest(t);
            if there.0 < best.0 {
                best = there;
            }
        };
        match [0, 1, 2].map(|k| b[k] > 0.0) {
            // Inside the triangle: no other one holds this point.
            [true, true, true] => {}
            // At a corner: every triangle round it does.
            [true, false, false] => around(connectivity, 3 * t, &mut consider),
            [false, true, false] => around(connectivity, 3 * t + 1, &mut consider),
            [false, false, true] => around(connectivity, 3 * t + 2, &mut consider),
            // On the edge opposite of the corner without weight: its neighbour does.
            [false, _, _] => consider(connectivity.twin(3 * t + 1) / 3),
            [_, false, _] => consider(connectivity.twin(3 * t + 2) / 3),
            [_, _, false] => consider(connectivity.twin(3 * t) / 3),
        }
        if best.1 == t {
            break;
        }
        here = best;
    }
    (here.1, here.2)
}

fn around(connectivity: &Connectivity, h: u32, visit: &mut impl FnMut(u32)) {
    let mut g = connectivity.twin(previous(h));
    while g != h {
        visit(g / 3);
        g = connectivity.twin(previous(g));
    }
}

fn unit_normal([a, b, c]: &[Vec3; 3]) -> Vec3 {
    triangle::area_normal(a, b, c)
        .try_normalize(0.0)
        .unwrap_or_else(Vec3::zeros)
}
