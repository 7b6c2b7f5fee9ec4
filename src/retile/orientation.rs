//! Which way the components of a mesh face.
//!
//! A component with very few points may come out inside out, although its triangles run as
//! the surface's do: four points about a small ball are joined in one way only, whether or
//! not the ball's order of them is that of the tetrahedron. A tetrahedron is simply turned;
//! anything larger that faces the wrong way has too few points for its shape.

use crate::mesh::TriMesh;
use crate::mesh::topology::component_volumes;

/// Makes every component of `mesh` face as the surface's does, whose volumes are `wanted`;
/// `component` gives the component on the surface of every vertex of `mesh`.
///
/// # Errors
/// The vertices of the components that face the wrong way and are no tetrahedra, ascending.
pub(super) fn face_alike(
    mesh: &mut TriMesh,
    component: &[u32],
    wanted: &[f64],
) -> Result<(), Vec<u32>> {
    let found = component_volumes(&mesh.vertices, &mesh.triangles, component);
    let is_turned = |c: u32| !(found[c as usize] * wanted[c as usize] > 0.0);
    let mut vertices = vec![0; found.len()];
    for &c in component {
        vertices[c as usize] += 1;
    }
    for t in &mut mesh.triangles {
        let c = component[t[0] as usize];
        if is_turned(c) && vertices[c as usize] == 4 {
            t.swap(1, 2);
        }
    }
    let stray = |v: &u32| {
        let c = component[*v as usize];
        is_turned(c) && (vertices[c as usize] != 4 || found[c as usize] == 0.0)
    };
    let wrong: Vec<u32> = (0..component.len() as u32).filter(stray).collect();
    if wrong.is_empty() { Ok(()) } else { Err(wrong) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn tetrahedra_are_turned_and_larger_ones_named() {
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
        // A cavity faces inward.
        let all: Vec<u32> = (0..count).collect();
        assert_eq!(face_alike(&mut ball, &component, &[-1.0, 1.0]), Err(all));
    }
}
