//! Triangles from cells: the dual of the discrete geodesic Voronoi diagram.
//!
//! Where three cells meet in one triangle of the surface, their points form a triangle of the
//! model, turned the same way. The surface's triangles meet three by three at most, so no
//! four cells ever share a corner and no predicate is needed. The dual is homeomorphic to the
//! surface if the cells are discs that meet in single arcs (the closed-ball property; Edels-
//! brunner & Shah 1997). For labels on vertices that is what [`check`] asks of the dual
//! itself: every cell used, every edge twice and in opposite directions, no triangle twice,
//! one cycle round every vertex, and components and Euler characteristic as the surface's.

use super::voronoi::UNLABELLED;
use crate::mesh::topology::{self, Census, Defect};

/// The triangles where three cells meet.
pub(crate) fn dual(triangles: &[[u32; 3]], label: &[u32]) -> Vec<[u32; 3]> {
    triangles
        .iter()
        .map(|t| t.map(|v| label[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a && ![a, b, c].contains(&&UNLABELLED))
        .collect()
}

/// Why a dual does not carry the surface's topology.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Flaw {
    /// At these cells the dual is no closed manifold.
    Cells(Vec<u32>),
    /// The dual is a closed manifold, but another one.
    Characteristic,
}

/// Compares the dual of `points` cells with the surface it stands for.
pub(crate) fn check(points: usize, triangles: &[[u32; 3]], surface: &Census) -> Result<(), Flaw> {
    match topology::check_triangles(points, triangles) {
        Ok(census)
            if census.components == surface.components
                && census.euler_characteristic == surface.euler_characteristic =>
        {
            Ok(())
        }
        Ok(_) => Err(Flaw::Characteristic),
        Err(first) => Err(Flaw::Cells(offenders(points, triangles, first))),
    }
}

/// Every cell at which something is wrong, ascending.
fn offenders(points: usize, triangles: &[[u32; 3]], first: Defect) -> Vec<u32> {
    let mut edges: Vec<[u32; 3]> = Vec::with_capacity(3 * triangles.len());
    let mut corners = vec![0u32; points];
    for t in triangles {
        for k in 0..3 {
            let (a, b) = (t[k], t[(k + 1) % 3]);
            edges.push([a.min(b), a.max(b), u32::from(a < b)]);
            corners[t[k] as usize] += 1;
        }
    }
    edges.sort_unstable();
    let mut wrong: Vec<u32> = (0..points as u32)
        .filter(|p| corners[*p as usize] == 0)
        .collect();
    for group in edges.chunk_by(|x, y| x[..2] == y[..2]) {
        if !matches!(group, [x, y] if x[2] != y[2]) {
            wrong.extend(&group[0][..2]);
        }
    }
    // A vertex with several fans or a doubled triangle leaves every edge in order.
    match first {
        Defect::NonManifoldVertex { vertex } => wrong.push(vertex),
        Defect::DoubledTriangle { triangle } => wrong.extend(triangles[triangle as usize]),
        _ => {}
    }
    wrong.sort_unstable();
    wrong.dedup();
    wrong
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn every_vertex_its_own_cell_gives_the_surface_back() {
        let mesh = shapes::torus(9.0, 3.0, 9, 6);
        let label: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
        let triangles = dual(&mesh.triangles, &label);
        assert_eq!(triangles, mesh.triangles);
        let census = topology::check(&mesh).unwrap();
        assert_eq!(check(mesh.vertices.len(), &triangles, &census), Ok(()));
    }

    #[test]
    fn ring_shaped_cells_are_refused() {
        // Cells that run all round the tube have no corners at all.
        let mesh = shapes::torus(9.0, 3.0, 12, 6);
        let label: Vec<u32> = (0..mesh.vertices.len() as u32).map(|v| v / 18).collect();
        let census = topology::check(&mesh).unwrap();
        let triangles = dual(&mesh.triangles, &label);
        assert_eq!(
            check(4, &triangles, &census),
            Err(Flaw::Cells(vec![0, 1, 2, 3]))
        );
    }

    #[test]
    fn a_closed_dual_of_another_kind_is_refused() {
        let torus = topology::check(&shapes::torus(9.0, 3.0, 12, 6)).unwrap();
        let sphere = shapes::icosphere(1.0, 0);
        assert_eq!(check(12, &sphere.triangles, &torus), Err(Flaw::Characteristic));
    }
}
