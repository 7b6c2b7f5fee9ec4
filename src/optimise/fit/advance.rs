//! One step, made only as far as it does no harm.

use crate::geometry::{Vec3, triangle};
use crate::mesh::intersections::self_intersections;
use crate::mesh::{TriMesh, topology};
use crate::optimise::connectivity::Connectivity;

/// How often a step is halved before the vertices concerned stay where they are.
const MOST_HALVINGS: usize = 5;

/// Adds `step` to `vertices`, as much of it as turns no triangle over and no component inside
/// out, and makes no triangle pierce another that it did not pierce before. Returns whether that
/// was less than asked for.
pub fn advance(vertices: &mut [Vec3], connectivity: &Connectivity, step: &[Vec3]) -> bool {
    let triangles = connectivity.triangles();
    let component = topology::components(vertices.len(), triangles);
    let mut share = vec![1.0; vertices.len()];
    let mut shortened = false;
    for halving in 0..=MOST_HALVINGS + 1 {
        let moved: Vec<Vec3> = (0..vertices.len())
            .map(|v| vertices[v] + step[v] * share[v])
            .collect();
        let mut harmed = turned(vertices, &moved, triangles);
        if harmed.is_empty() {
            harmed = inside_out(vertices, &moved, triangles, &component);
        }
        if harmed.is_empty() {
            harmed = newly_pierced(vertices, &moved, triangles);
        }
        if harmed.is_empty() {
            vertices.copy_from_slice(&moved);
            return shortened;
        }
        shortened = true;
        let factor = if halving < MOST_HALVINGS { 0.5 } else { 0.0 };
        for v in harmed.into_iter().flat_map(|t| triangles[t as usize]) {
            share[v as usize] *= factor;
        }
    }
    // Not even that helped: nobody moves.
    true
}

/// The triangles whose normal turns by a right angle or more.
fn turned(before: &[Vec3], after: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let normal = |vertices: &[Vec3], t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        triangle::area_normal(&a, &b, &c)
    };
    (0..)
        .zip(triangles)
        .filter(|(_, t)| !(normal(before, t).dot(&normal(after, t)) > 0.0))
        .map(|(index, _)| index)
        .collect()
}

/// The triangles of components whose volume changes its sign. A flat one, of few points, can:
/// one of its sides goes through the other, and no triangle turns by much.
fn inside_out(
    before: &[Vec3],
    after: &[Vec3],
    triangles: &[[u32; 3]],
    component: &[u32],
) -> Vec<u32> {
    let volumes = |vertices| topology::component_volumes(vertices, triangles, component);
    let (before, after) = (volumes(before), volumes(after));
    (0..)
        .zip(triangles)
        .filter(|(_, t)| {
            let c = component[t[0] as usize] as usize;
            !(before[c] * after[c] > 0.0)
        })
        .map(|(index, _)| index)
        .collect()
}

/// The triangles of pairs that pierce each other after the step but did not before.
fn newly_pierced(before: &[Vec3], after: &[Vec3], triangles: &[[u32; 3]]) -> Vec<u32> {
    let pairs = |vertices: &[Vec3]| {
        self_intersections(&TriMesh {
            vertices: vertices.to_vec(),
            triangles: triangles.to_vec(),
        })
    };
    let found = pairs(after);
    if found.is_empty() {
        return Vec::new();
    }
    let known = pairs(before);
    found
        .into_iter()
        .filter(|pair| known.binary_search(pair).is_err())
        .flatten()
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_flat_tetrahedron_does_not_go_through_itself() {
        let mut mesh = shapes::tetrahedron(10.0);
        let apex = mesh.vertices[0];
        let base = (mesh.vertices[1] + mesh.vertices[2] + mesh.vertices[3]) / 3.0;
        mesh.vertices[0] = base + (apex - base) * 0.01;
        let connectivity = Connectivity::new(4, mesh.triangles.clone()).unwrap();
        let mut step = vec![Vec3::zeros(); 4];
        step[0] = (base - apex) * 0.02;
        let mut moved = mesh.vertices.clone();
        for (v, s) in moved.iter_mut().zip(&step) {
            *v += s;
        }
        assert!(turned(&mesh.vertices, &moved, &mesh.triangles).is_empty());
        assert!(newly_pierced(&mesh.vertices, &moved, &mesh.triangles).is_empty());
        let volume = mesh.volume();
        assert!(volume > 0.0);
        assert!(advance(&mut mesh.vertices, &connectivity, &step));
        assert!(mesh.volume() > 0.0 && mesh.volume() < volume);
    }
}
