//! The orientation of the components of a mesh: outward or inward.
//!
//! In: a mesh and, for each component, the signed volume that it has on the surface. A component
//! with very few points may come out inside out although its triangles have the order of the
//! surface's: four points on a small ball make one tetrahedron only, which may have the opposite
//! orientation. A tetrahedron is simply reversed; a larger component with the wrong orientation
//! has too few points for its shape.

use crate::mesh::TriMesh;
use crate::mesh::topology::component_volumes;

/// Gives every component of `mesh` the orientation that it has on the surface. `wanted` are the
/// signed volumes of the surface's components, `component` is the component of every vertex of
/// `mesh`.
///
/// # Errors
/// The vertices of the components with the wrong orientation that are not tetrahedra, ascending.
pub(super) fn face_alike(
    mesh: &mut TriMesh,
    component: &[u32],
    wanted: &[f64],
) -> Result<(), Vec<u32>> {
    let found = component_volumes(&mesh.vertices, &mesh.triangles, component);
    let is_reversed = |c: u32| !(found[c as usize] * wanted[c as usize] > 0.0);
    let mut vertices = vec![0; found.len()];
    for &c in component {
        vertices[c as usize] += 1;
    }
    for t in &mut mesh.triangles {
        let c = component[t[0] as usize];
        if is_reversed(c) && vertices[c as usize] == 4 {
            t.swap(1, 2);
        }
    }
    let irreparable = |v: &u32| {
        let c = component[*v as usize];
        is_reversed(c) && (vertices[c as usize] != 4 || found[c as usize] == 0.0)
    };
    let wrong: Vec<u32> = (0..component.len() as u32).filter(irreparable).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::mesh::shapes;
    use crate::surface::retile::tessellate::test_surfaces::{moved, together};

    #[test]
    fn tetrahedra_are_reversed_and_larger_components_reported() {
        let (mut ball, mut small) = (shapes::icosphere(3.0, 1), shapes::tetrahedron(1.0));
        let count = ball.vertices.len() as u32;
        small.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        ball.vertices.extend(&small.vertices);
        let moved = small.triangles.iter().map(|t| t.map(|v| v + count));
        ball.triangles.extend(moved);
        let component: Vec<u32> = (0..count + 4).map(|v| u32::from(v >= count)).collect();
        let mut outward = ball.clone();
        assert_eq!(face_alike(&mut outward, &component, &[1.0, 1.0]), Ok(()));
        assert!(
            component_volumes(&outward.vertices, &outward.triangles, &component)
                .iter()
                .all(|v| *v > 0.0)
        );
        let right = outward.clone();
        assert_eq!(face_alike(&mut outward, &component, &[1.0, 1.0]), Ok(()));
        assert_eq!(outward, right);
        // A cavity faces inward.
        let all: Vec<u32> = (0..count).collect();
        assert_eq!(face_alike(&mut ball, &component, &[-1.0, 1.0]), Err(all));
    }

    /// Of several components only those with the wrong orientation are touched or named.
    #[test]
    fn components_that_face_rightly_are_left_alone() {
        let count = 5;
        let mut parts = Vec::new();
        let mut component = Vec::new();
        for c in 0..count {
            let part = if c % 2 == 0 {
                shapes::tetrahedron(2.0)
            } else {
                shapes::icosphere(1.0, 0)
            };
            component.extend(vec![c; part.vertices.len()]);
            parts.push(moved(part, Vec3::repeat(10.0 * f64::from(c))));
        }
        let mut mesh = together(&parts);
        // The middle one, a tetrahedron, is a cavity of the surface; then also the ball after it.
        let mut reversed = mesh.clone();
        assert_eq!(
            face_alike(&mut reversed, &component, &[1.0, 1.0, -1.0, 1.0, 1.0]),
            Ok(())
        );
        let volumes = component_volumes(&reversed.vertices, &reversed.triangles, &component);
        let before = component_volumes(&mesh.vertices, &mesh.triangles, &component);
        for c in 0..count as usize {
            let sign = if c == 2 { -1.0 } else { 1.0 };
            assert!((volumes[c] - sign * before[c]).abs() < 1e-12);
        }
        let wrong = face_alike(&mut mesh, &component, &[1.0, 1.0, -1.0, -1.0, 1.0]);
        let ball = (0..component.len() as u32).filter(|v| component[*v as usize] == 3);
        assert_eq!(wrong, Err(ball.collect()));
    }

    #[test]
    fn a_flat_tetrahedron_cannot_be_turned_round() {
        let mut flat = shapes::tetrahedron(2.0);
        flat.vertices.iter_mut().for_each(|v| v.z = 0.0);
        assert_eq!(
            face_alike(&mut flat, &[0; 4], &[1.0]),
            Err(vec![0, 1, 2, 3])
        );
    }
}
