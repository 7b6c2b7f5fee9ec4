//! Whether a surface is closed and oriented.
//!
//! Every edge must be traversed as often in one direction as in the other. That is what makes inside and outside
//! well defined; an edge with four triangles, where a surface touches itself, is allowed.

use super::error::MeshFileError;
use crate::base::geometry::Vec3;
use crate::base::numeric::order::sort_watched;
use crate::base::progress::Monitor;
use crate::mesh::TriMesh;

/// Checks that `mesh` is closed and oriented.
///
/// # Errors
/// [`MeshFileError::Open`], otherwise [`MeshFileError::Orientation`]; [`MeshFileError::Cancelled`].
pub(super) fn check(mesh: &TriMesh, monitor: &Monitor<'_>) -> Result<(), MeshFileError> {
    let mut sides: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * mesh.triangles.len());
    for [a, b, c] in &mesh.triangles {
        for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
            sides.push(([from.min(to), from.max(to)], from < to));
        }
    }
    sort_watched(&mut sides, Ord::cmp, monitor)?;
    let (mut open, mut one_way) = (Vec::new(), Vec::new());
    for edge in sides.chunk_by(|a, b| a.0 == b.0) {
        let forward = edge.iter().filter(|side| side.1).count();
        if edge.len() == 1 {
            open.push(edge[0].0);
        } else if 2 * forward != edge.len() {
            one_way.push(edge[0].0);
        }
    }
    let ends = |edge: &[u32; 2]| edge.map(|v| shown(&mesh.vertices[v as usize]));
    if let Some(first) = open.first() {
        let [from, to] = ends(first);
        return Err(MeshFileError::Open {
            edges: open.len(),
            from,
            to,
        });
    }
    match one_way.first() {
        None => Ok(()),
        Some(first) => {
            let [from, to] = ends(first);
            Err(MeshFileError::Orientation {
                edges: one_way.len(),
                from,
                to,
            })
        }
    }
}

fn shown(p: &Vec3) -> String {
    format!("({:.4}, {:.4}, {:.4})", p.x, p.y, p.z)
}
