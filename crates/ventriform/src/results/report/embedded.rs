//! The data that a page embeds for its script, which draws them as the page of the service does (`web/src/report.tsx`).

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::{Value, json};

use super::closeness::Closeness;
use crate::base::geometry::Vec3;
use crate::mesh::TriMesh;

/// Most triangles of a mesh that a browser turns smoothly without WebGL.
const MOST_TRIANGLES: usize = 20_000;

/// A result as the script draws it.
pub(super) struct Embedded<'a> {
    /// The name of the result, for pictures taken of the page.
    pub name: &'a str,
    /// The mesh and the uncertainty of its vertices, mm (empty if it is not known).
    pub mesh: (&'a TriMesh, &'a [f64]),
    /// The wall by the other edge.
    pub other: Option<(&'a TriMesh, &'a [f64])>,
    /// Of a fit, the parts of its report that say where the heart lies, and which wall it shows.
    pub fit: Option<Value>,
    /// The polar map as JSON.
    pub polar: Option<&'a Value>,
    /// Of a model, the distances to its surface.
    pub closeness: Option<&'a Closeness>,
    /// The scan about the organ, a packed NIfTI file.
    pub region: Option<&'a [u8]>,
}

impl Embedded<'_> {
    /// As JSON; `None` of a mesh that is too large.
    pub fn json(self) -> Option<Value> {
        (self.mesh.0.triangles.len() <= MOST_TRIANGLES).then(|| {
            json!({
                "name": self.name,
                "mesh": mesh_json(self.mesh.0, self.mesh.1),
                "other": self.other.map(|(mesh, uncertainty)| mesh_json(mesh, uncertainty)),
                "fit": self.fit,
                "polar": self.polar,
                "distance": self.closeness.map(by_triangle),
                "region": self.region.map(|bytes| STANDARD.encode(bytes)),
            })
        })
    }
}

/// Coordinates and uncertainties in mm, rounded to 0.01.
fn mesh_json(mesh: &TriMesh, uncertainty: &[f64]) -> Value {
    let rounded = |x: f64| (100.0 * x).round() / 100.0;
    let places = mesh
        .vertices
        .iter()
        .flat_map(|v: &Vec3| <[f64; 3]>::from(*v));
    let corners: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    json!({
        "vertices": places.map(rounded).collect::<Vec<f64>>(),
        "triangles": corners,
        "uncertainty_mm": uncertainty.iter().copied().map(rounded).collect::<Vec<f64>>(),
    })
}

/// The mean distance of each triangle, mm, rounded to 0.001.
fn by_triangle(closeness: &Closeness) -> Value {
    let each = closeness.parts * closeness.parts;
    let mean = |parts: &[f32]| {
        let sum: f64 = parts.iter().copied().map(f64::from).sum();
        (1e3 * sum / each as f64).round() / 1e3
    };
    let means: Vec<f64> = closeness.distances_mm.chunks(each).map(mean).collect();
    json!({ "parts": 1, "distances_mm": means })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_triangle_has_the_mean_of_its_parts() {
        let closeness = Closeness {
            parts: 2,
            distances_mm: vec![1.0, 2.0, 3.0, 4.0, -1.0, -1.0, -1.0, 0.0],
        };
        let expected = json!({ "parts": 1, "distances_mm": [2.5, -0.75] });
        assert_eq!(by_triangle(&closeness), expected);
    }
}
