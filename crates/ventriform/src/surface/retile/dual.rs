//! The dual mesh of a partition of the surface into cells.
//!
//! In: the cell of every sample. Out: triangles over the sites of the cells. Where three cells
//! meet in one triangle of the samples, their sites are joined by a triangle of the same
//! orientation (the dual of a discrete Voronoi diagram; Valette and Chassery, Computer Graphics
//! Forum 2004). This needs no geometric predicates and has no co-circular case.
//!
//! The dual is accepted only if all sites are used and it is closed, edge- and vertex-manifold,
//! with the surface's Euler characteristic and number of components. Otherwise the sites
//! concerned are returned.

use super::surface_samples::WeightedSamples;
use crate::mesh::topology::{self, MeshDefect};

/// The reason why the cells have no valid dual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct InvalidDual {
    /// Sites whose cells are too large for the shape of the surface there; may be empty.
    pub sites: Vec<u32>,
}

/// The dual of the cells given by `labels`, with `sites` sites.
pub(super) fn triangulate(
    samples: &WeightedSamples,
    labels: &[u32],
    sites: usize,
) -> Result<Vec<[u32; 3]>, InvalidDual> {
    let rings = cells_with_holes(samples, labels, sites);
    if !rings.is_empty() {
        return Err(InvalidDual { sites: rings });
    }
    let dual: Vec<[u32; 3]> = samples
        .triangles
        .iter()
        .map(|t| t.map(|v| labels[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let census = topology::check_triangles(sites, &dual).map_err(|defect| InvalidDual {
        sites: sites_at(defect, &dual),
    })?;
    let wanted = topology::components(samples.len(), &samples.triangles);
    let components = topology::component_count(&wanted);
    let edges = samples.triangles.len() as i64 * 3 / 2;
    let euler = samples.len() as i64 - edges + samples.triangles.len() as i64;
    if census.euler_characteristic != euler || census.components != components {
        return Err(InvalidDual { sites: Vec::new() });
    }
    Ok(dual)
}

/// Cells that are not discs: V - E + F of the samples, edges and triangles inside is not 1.
fn cells_with_holes(samples: &WeightedSamples, labels: &[u32], sites: usize) -> Vec<u32> {
    let mut euler = vec![0i32; sites];
    for v in 0..samples.len() {
        let own = labels[v];
        let inner_edges = samples
            .around(v)
            .iter()
            .filter(|&&n| n as usize > v && labels[n as usize] == own)
            .count();
        euler[own as usize] += 1 - inner_edges as i32;
    }
    for t in &samples.triangles {
        let [a, b, c] = t.map(|v| labels[v as usize]);
        if a == b && b == c {
            euler[a as usize] += 1;
        }
    }
    (0..sites as u32)
        .filter(|&site| euler[site as usize] != 1)
        .collect()
}

/// The sites at a defect of the dual.
fn sites_at(defect: MeshDefect, dual: &[[u32; 3]]) -> Vec<u32> {
    match defect {
        MeshDefect::OpenEdge { edge }
        | MeshDefect::NonManifoldEdge { edge }
        | MeshDefect::OrientationConflict { edge } => edge.map(|v| v.0).to_vec(),
        MeshDefect::NonManifoldVertex { vertex } | MeshDefect::UnusedVertex { vertex } => {
            vec![vertex.0]
        }
        MeshDefect::DegenerateTriangle { triangle }
        | MeshDefect::DuplicateTriangle { triangle } => dual[triangle.index()].to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{FaceId, TriMesh, VertexId, shapes};
    use crate::surface::retile::cells::Cells;

    fn samples(mesh: &TriMesh) -> WeightedSamples {
        WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0)
    }

    /// A list of triangles, each from its lowest vertex on.
    fn sorted(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
        let from_lowest = |t: &[u32; 3]| {
            let lowest = (0..3).min_by_key(|&k| t[k]).unwrap_or(0);
            [0, 1, 2].map(|k| t[(lowest + k) % 3])
        };
        let mut all: Vec<_> = triangles.iter().map(from_lowest).collect();
        all.sort_unstable();
        all
    }

    /// Cells about the corners of an icosahedron have its triangles as their dual.
    #[test]
    fn the_dual_of_cells_about_the_corners_of_an_icosahedron_is_the_icosahedron() {
        let samples = samples(&shapes::icosphere(10.0, 3));
        let cells = Cells::grow(&samples, &(0..12).collect::<Vec<_>>());
        let dual = triangulate(&samples, &cells.labels, 12).unwrap();
        assert_eq!(sorted(&dual), sorted(&shapes::icosphere(1.0, 0).triangles));
    }

    #[test]
    fn cells_that_are_no_discs_are_named() {
        let samples = samples(&shapes::icosphere(10.0, 3));
        let belt = |v: usize| match samples.working[v].z {
            z if z > 4.0 => 0,
            z if z < -4.0 => 1,
            _ => 2,
        };
        let labels: Vec<u32> = (0..samples.len()).map(belt).collect();
        assert_eq!(cells_with_holes(&samples, &labels, 3), [2]);
        // An island, a cell without samples, and a hole around the island.
        let mut cells = Cells::grow(&samples, &(0..12).collect::<Vec<_>>());
        assert!(cells_with_holes(&samples, &cells.labels, 12).is_empty());
        let inner = |v: &usize| {
            let own = cells.labels[*v];
            own == 7
                && samples
                    .around(*v)
                    .iter()
                    .all(|n| cells.labels[*n as usize] == own)
        };
        let island = (0..samples.len()).find(inner).unwrap();
        cells.labels[island] = 3;
        assert_eq!(cells_with_holes(&samples, &cells.labels, 13), [3, 7, 12]);
        let invalid = triangulate(&samples, &cells.labels, 13).unwrap_err();
        assert_eq!(invalid.sites, [3, 7, 12]);
    }

    /// Three lunes meet in two points only: their dual is one triangle twice.
    #[test]
    fn a_dual_that_is_no_manifold_names_the_sites_of_the_defect() {
        let samples = samples(&shapes::icosphere(10.0, 3));
        let lune = |v: usize| {
            let p = samples.working[v];
            let turns = p.y.atan2(p.x) / std::f64::consts::TAU + 0.5;
            (turns * 3.0).min(2.0) as u32
        };
        let labels: Vec<u32> = (0..samples.len()).map(lune).collect();
        let mut sites = triangulate(&samples, &labels, 3).unwrap_err().sites;
        sites.sort_unstable();
        assert_eq!(sites, [0, 1, 2]);
    }

    /// Four cells of a ball and four of a ring: closed, but the ring's handle is lost if its cells are not discs.
    #[test]
    fn a_dual_needs_the_topology_of_the_surface() {
        let mesh = shapes::torus(30.0, 10.0, 36, 18);
        let samples = samples(&mesh);
        let seeds: Vec<u32> = (0..40).map(|k| k * 16).collect();
        let mut cells = Cells::grow(&samples, &seeds);
        let weights = samples.area.clone();
        let silent = crate::base::progress::Monitor::silent();
        cells.relax(&samples, &weights, (30, 10), &silent).unwrap();
        cells.tidy(&samples);
        let dual = triangulate(&samples, &cells.labels, 40).unwrap();
        let census = topology::check_triangles(40, &dual).unwrap();
        assert_eq!((census.euler_characteristic, census.components), (0, 1));
        assert_eq!(dual.len(), 80);
    }

    #[test]
    fn the_sites_of_a_defect_are_its_vertices() {
        let dual = [[4, 5, 6], [7, 8, 9]];
        let edge = [VertexId(3), VertexId(9)];
        for defect in [
            MeshDefect::OpenEdge { edge },
            MeshDefect::NonManifoldEdge { edge },
            MeshDefect::OrientationConflict { edge },
        ] {
            assert_eq!(sites_at(defect, &dual), [3, 9]);
        }
        let vertex = VertexId(2);
        for defect in [
            MeshDefect::NonManifoldVertex { vertex },
            MeshDefect::UnusedVertex { vertex },
        ] {
            assert_eq!(sites_at(defect, &dual), [2]);
        }
        let triangle = FaceId(1);
        for defect in [
            MeshDefect::DegenerateTriangle { triangle },
            MeshDefect::DuplicateTriangle { triangle },
        ] {
            assert_eq!(sites_at(defect, &dual), [7, 8, 9]);
        }
    }
}
