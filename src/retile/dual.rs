//! Triangles from cells: the dual of a partition of the surface.
//!
//! Where three cells meet in one triangle of the samples, their sites are joined by a triangle
//! of the same orientation (the dual of a discrete Voronoi diagram; Valette and Chassery,
//! Computer Graphics Forum 2004). No predicate decides, and no co-circular case exists. The
//! dual is accepted only if it *is* what was asked for: every site used, closed, edge- and
//! vertex-manifold, with the surface's Euler characteristic and number of components. Where
//! it is not, the offending sites are named.

use super::samples::Samples;
use crate::mesh::topology::{self, Defect};

/// Why the cells have no usable dual.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Offence {
    /// Sites whose cells are too large for the shape of the surface there; may be empty.
    pub sites: Vec<u32>,
}

/// The dual of the cells given by `labels` over `sites` sites.
pub(super) fn triangulate(
    samples: &Samples,
    labels: &[u32],
    sites: usize,
) -> Result<Vec<[u32; 3]>, Offence> {
    let rings = cells_with_holes(samples, labels, sites);
    if !rings.is_empty() {
        return Err(Offence { sites: rings });
    }
    let dual: Vec<[u32; 3]> = samples
        .triangles
        .iter()
        .map(|t| t.map(|v| labels[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let census = topology::check_triangles(sites, &dual).map_err(|defect| Offence {
        sites: offenders(defect, &dual),
    })?;
    let wanted = topology::components(samples.len(), &samples.triangles);
    let components = wanted.iter().max().map_or(0, |m| *m as usize + 1);
    let edges = samples.triangles.len() as i64 * 3 / 2;
    let euler = samples.len() as i64 - edges + samples.triangles.len() as i64;
    if census.euler_characteristic != euler || census.components != components {
        return Err(Offence { sites: Vec::new() });
    }
    Ok(dual)
}

/// Cells that are no discs: V - E + F of the samples, edges and triangles inside is not 1.
fn cells_with_holes(samples: &Samples, labels: &[u32], sites: usize) -> Vec<u32> {
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

fn offenders(defect: Defect, dual: &[[u32; 3]]) -> Vec<u32> {
    match defect {
        Defect::OpenEdge { edge }
        | Defect::NonManifoldEdge { edge }
        | Defect::TurnedTriangles { edge } => edge.to_vec(),
        Defect::NonManifoldVertex { vertex } | Defect::UnusedVertex { vertex } => vec![vertex],
        Defect::DegenerateTriangle { triangle } | Defect::DoubledTriangle { triangle } => {
            dual[triangle as usize].to_vec()
        }
    }
}
