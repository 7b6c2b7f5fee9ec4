//! Pairs of nodes across the wall, which keep its thickness.

use super::area_shares;
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;

/// A pair of nodes across the wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Strut {
    /// The nodes.
    pub nodes: [u32; 2],
    /// Share of the model's area that the pair stands for.
    pub share: f64,
}

/// Finds the pairs of nodes across the wall, sorted by node. The partner of a node lies on the
/// inward side, has an opposite normal, and is nearest by length over squared cosine. Pairs longer
/// than 2.5 times the median span something else than the wall and are left out.
///
/// # Errors
/// [`Cancelled`].
pub fn struts(mesh: &TriMesh, monitor: &Monitor) -> Result<Vec<Strut>, Cancelled> {
    let normals = mesh.vertex_normals();
    let shares = area_shares(mesh);
    let mut found: Vec<(f64, Strut)> = Vec::new();
    for (i, (p, n)) in mesh.vertices.iter().zip(&normals).enumerate() {
        monitor.check()?;
        let opposite = mesh
            .vertices
            .iter()
            .zip(&normals)
            .enumerate()
            .filter_map(|(j, (q, m))| {
                let d = q - p;
                let length = d.norm();
                let cos = -n.dot(&d) / length;
                (n.dot(m) < -0.3 && cos > 0.6).then(|| (length / (cos * cos), length, j))
            })
            .min_by(|a, b| a.0.total_cmp(&b.0));
        if let Some((_, length, j)) = opposite {
            let nodes = [i.min(j) as u32, i.max(j) as u32];
            let share = shares[i];
            found.push((length, Strut { nodes, share }));
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let limit = found.get(found.len() / 2).map_or(0.0, |f| 2.5 * f.0);
    let mut struts: Vec<Strut> = found
        .into_iter()
        .filter(|f| f.0 <= limit)
        .map(|f| f.1)
        .collect();
    struts.sort_by_key(|s| s.nodes);
    struts.dedup_by(|later, kept| {
        let same = later.nodes == kept.nodes;
        if same {
            kept.share += later.share;
        }
        same
    });
    Ok(struts)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn struts_span_the_wall() {
        let mesh = shapes::cup(70.0, 30.0, 12.0, 16);
        let struts = struts(&mesh, &Monitor::silent()).unwrap();
        let spanning = struts.iter().map(|s| s.share).sum::<f64>();
        assert!(spanning > 0.6, "{spanning}");
        for s in struts {
            let [a, b] = s.nodes.map(|v| mesh.vertices[v as usize]);
            let length = (a - b).norm();
            assert!((10.0..30.0).contains(&length), "{length}");
        }
    }
}
