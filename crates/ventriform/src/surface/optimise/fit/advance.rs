//! One step of the fit, shortened where it would damage the mesh.
//!
//! In: vertices, triangles and a displacement for each vertex. The step is tried in full; at the
//! vertices of damaged triangles it is halved and tried again, and after [`MAX_HALVINGS`]
//! halvings dropped there. A triangle is damaged if its normal turns by a right angle or more,
//! if its component turns inside out, or if it comes to intersect another triangle.

use crate::base::geometry::bvh::Bvh;
use crate::base::geometry::{Vec3, triangle};
use crate::mesh::intersections::self_intersections_by;
use crate::mesh::{FaceId, TriMesh, topology};

/// Most halvings of a step before the vertices concerned stay in place.
const MAX_HALVINGS: usize = 5;

/// Adds `step` to `vertices`, or as much of it as turns no triangle over and no component inside
/// out, and adds no pair of intersecting triangles. Returns whether the step was shortened. `tree` is one over as many
/// triangles, and follows those of the step.
pub fn advance(
    vertices: &mut [Vec3],
    triangles: &[[u32; 3]],
    step: &[Vec3],
    tree: &mut Bvh,
) -> bool {
    let component = topology::components(vertices.len(), triangles);
    let mut share = vec![1.0; vertices.len()];
    let mut shortened = false;
    for halving in 0..=MAX_HALVINGS + 1 {
        let moved: Vec<Vec3> = (0..vertices.len())
            .map(|v| vertices[v] + step[v] * share[v])
            .collect();
        let mut damaged = turned_over(vertices, &moved, triangles);
        if damaged.is_empty() {
            damaged = inside_out(vertices, &moved, triangles, &component);
        }
        if damaged.is_empty() {
            damaged = newly_intersecting(vertices, &moved, triangles, tree);
        }
        if damaged.is_empty() {
            vertices.copy_from_slice(&moved);
            return shortened;
        }
        shortened = true;
        let factor = if halving < MAX_HALVINGS { 0.5 } else { 0.0 };
        for v in damaged.into_iter().flat_map(|t| triangles[t.index()]) {
            share[v as usize] *= factor;
        }
    }
    // Even that did not help: no vertex moves.
    true
}

/// The triangles whose normal turns by a right angle or more.
fn turned_over(before: &[Vec3], after: &[Vec3], triangles: &[[u32; 3]]) -> Vec<FaceId> {
    let normal = |vertices: &[Vec3], t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| vertices[v as usize]);
        triangle::area_normal(&a, &b, &c)
    };
    FaceId::first(triangles.len())
        .zip(triangles)
        .filter(|(_, t)| !(normal(before, t).dot(&normal(after, t)) > 0.0))
        .map(|(face, _)| face)
        .collect()
}

/// The triangles of components whose volume changes its sign. In a flat component of few
/// vertices one side can pass through the other without any triangle turning by much.
fn inside_out(
    before: &[Vec3],
    after: &[Vec3],
    triangles: &[[u32; 3]],
    component: &[u32],
) -> Vec<FaceId> {
    let volumes = |vertices| topology::component_volumes(vertices, triangles, component);
    let (before, after) = (volumes(before), volumes(after));
    FaceId::first(triangles.len())
        .zip(triangles)
        .filter(|(_, t)| {
            let c = component[t[0] as usize] as usize;
            !(before[c] * after[c] > 0.0)
        })
        .map(|(face, _)| face)
        .collect()
}

/// The triangles of pairs that intersect after the step but not before.
fn newly_intersecting(
    before: &[Vec3],
    after: &[Vec3],
    triangles: &[[u32; 3]],
    tree: &mut Bvh,
) -> Vec<FaceId> {
    let mut pairs = |vertices: &[Vec3]| {
        tree.refit(vertices, triangles);
        let mesh = TriMesh {
            vertices: vertices.to_vec(),
            triangles: triangles.to_vec(),
        };
        self_intersections_by(&mesh, tree)
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
    fn a_flat_tetrahedron_does_not_turn_inside_out() {
        let mut mesh = shapes::tetrahedron(10.0);
        let apex = mesh.vertices[0];
        let base = (mesh.vertices[1] + mesh.vertices[2] + mesh.vertices[3]) / 3.0;
        mesh.vertices[0] = base + (apex - base) * 0.01;
        let mut step = vec![Vec3::zeros(); 4];
        step[0] = (base - apex) * 0.02;
        let mut moved = mesh.vertices.clone();
        for (v, s) in moved.iter_mut().zip(&step) {
            *v += s;
        }
        let mut tree = Bvh::new(&mesh.vertices, &mesh.triangles);
        assert!(turned_over(&mesh.vertices, &moved, &mesh.triangles).is_empty());
        assert!(newly_intersecting(&mesh.vertices, &moved, &mesh.triangles, &mut tree).is_empty());
        let volume = mesh.volume();
        assert!(volume > 0.0);
        assert!(advance(
            &mut mesh.vertices,
            &mesh.triangles,
            &step,
            &mut tree
        ));
        assert!(mesh.volume() > 0.0 && mesh.volume() < volume);
    }
}
