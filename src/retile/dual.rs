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
