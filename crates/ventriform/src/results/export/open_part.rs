//! One part of a ventricle's wall as an open surface.

use super::{Metadata, VertexField};
use crate::mesh::TriMesh;
use crate::mesh::part::Part;

/// The triangles of `mesh` that are of `part`, with the vertices they use, in their order, and what `metadata`
/// says of these. `None` if it does not say which triangles they are.
pub fn open_part(mesh: &TriMesh, metadata: &Metadata, part: Part) -> Option<(TriMesh, Metadata)> {
    let parts = metadata.parts_of(mesh)?;
    let of_part = mesh.triangles.iter().zip(parts);
    let of_part = of_part.filter(|(_, of)| **of == part);
    let triangles: Vec<[u32; 3]> = of_part.map(|(triangle, _)| *triangle).collect();
    if triangles.is_empty() {
        return None;
    }
    let mut used = vec![false; mesh.vertices.len()];
    triangles
        .iter()
        .flatten()
        .for_each(|v| used[*v as usize] = true);
    let kept: Vec<usize> = (0..used.len()).filter(|v| used[*v]).collect();
    let mut place = vec![0_u32; mesh.vertices.len()];
    for (new, old) in kept.iter().enumerate() {
        place[*old] = new as u32;
    }
    let open = TriMesh {
        vertices: kept.iter().map(|v| mesh.vertices[*v]).collect(),
        triangles: triangles
            .iter()
            .map(|triangle| triangle.map(|v| place[v as usize]))
            .collect(),
    };
    let field = metadata.field_of(mesh).map(|field| VertexField {
        name: field.name,
        values: kept.iter().map(|v| field.values[*v]).collect(),
        colours: kept.iter().map(|v| field.colours[*v]).collect(),
    });
    let uncertainty = metadata.uncertainty_of(mesh);
    let metadata = Metadata {
        title: format!("{}, {}", metadata.title, part.as_str()),
        uncertainty: uncertainty
            .map_or_else(Vec::new, |all| kept.iter().map(|v| all[*v]).collect()),
        field,
        parts: vec![part; open.triangles.len()],
        ..metadata.clone()
    };
    Some((open, metadata))
}
