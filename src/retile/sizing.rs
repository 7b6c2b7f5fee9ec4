//! How large the cells shall be where: even, or finer where the surface bends.
//!
//! Target spacing h ∝ κ^-γ with κ the larger principal curvature in magnitude, h's largest
//! and smallest at most [`LARGEST_RATIO`] apart, scaled so that h = 1 means the spacing of
//! evenly spread points: Σ area/h² = area.

use super::curvature::curvature;
use super::domain::{Domain, ancestor};

/// The finest and the coarsest spacing differ at most by this factor: steeper changes cost
/// triangle shape and gain no distance (measured on phantoms with γ of 0.5 and more).
const LARGEST_RATIO: f64 = 2.5;

/// Relative target spacing at every vertex of a domain.
#[derive(Debug, Clone)]
pub(crate) struct Sizing {
    /// h per vertex; `None` is 1 everywhere.
    spacing: Option<Vec<f64>>,
}

impl Sizing {
    /// The same spacing everywhere.
    pub fn even(_: &Domain) -> Self {
        Self { spacing: None }
    }

    /// Spacing that falls with curvature to the power `gamma`; 0 is even.
    pub fn adaptive(domain: &Domain, gamma: f64) -> Self {
        if !(gamma > 0.0) {
            return Self::even(domain);
        }
        let kappa = curvature(domain);
        let mut sorted = kappa.clone();
        sorted.sort_by(f64::total_cmp);
        let percentile = |p: f64| sorted[((sorted.len() - 1) as f64 * p) as usize];
        let (low, high) = (percentile(0.05), percentile(0.97));
        if !(low > 0.0) {
            return Self::even(domain);
        }
        let middle = (low * high).sqrt();
        // Spread of h over the clamped range of κ, and the share of γ that keeps it in bounds.
        let spread = gamma * (high / low).ln();
        let gamma = gamma * (LARGEST_RATIO.ln() / spread).min(1.0);
        let raw: Vec<f64> = kappa
            .iter()
            .map(|k| (k.clamp(low, high) / middle).powf(-gamma))
            .collect();
        let measure: f64 = raw
            .iter()
            .zip(&domain.vertex_areas)
            .map(|(h, a)| a / (h * h))
            .sum();
        let scale = (measure / domain.area).sqrt();
        Self {
            spacing: Some(raw.iter().map(|h| h * scale).collect()),
        }
    }

    /// The same sizing on the domain cut in four.
    pub fn subdivided(&self, coarse: &Domain, fine: &Domain) -> Self {
        let Some(h) = &self.spacing else {
            return Self { spacing: None };
        };
        let mut spacing = vec![0.0; fine.vertices.len()];
        for (t, corners) in fine.triangles.iter().enumerate() {
            for (k, &v) in corners.iter().enumerate() {
                let mut b = [0.0; 3];
                b[k] = 1.0;
                let (parent, b) = ancestor(t as u32, b, 1);
                let p = coarse.triangles[parent as usize];
                spacing[v as usize] = (0..3).map(|k| b[k] * h[p[k] as usize]).sum();
            }
        }
        Self {
            spacing: Some(spacing),
        }
    }

    /// h at `vertex`.
    pub fn at_vertex(&self, vertex: u32) -> f64 {
        self.spacing.as_ref().map_or(1.0, |h| h[vertex as usize])
    }

    /// h at a point of triangle `corners`.
    pub fn at(&self, corners: [u32; 3], barycentric: [f64; 3]) -> f64 {
        match &self.spacing {
            None => 1.0,
            Some(h) => (0..3).map(|k| barycentric[k] * h[corners[k] as usize]).sum(),
        }
    }

    /// Weight of a vertex in centroids: its area times the density h⁻⁴, whose optimal cells
    /// have diameters ∝ h (Gersho: cell size ∝ density^-1/4 in the plane).
    pub fn weight(&self, domain: &Domain, vertex: usize) -> f64 {
        let h = self.at_vertex(vertex as u32);
        domain.vertex_areas[vertex] / (h * h * h * h)
    }

    /// Points to expect on triangle `t`, up to a common factor: area / h².
    pub fn expected_points(&self, domain: &Domain, t: usize) -> f64 {
        let [a, b, c] = domain.triangles[t].map(|v| domain.vertices[v as usize]);
        let h = self.at(domain.triangles[t], [1.0 / 3.0; 3]);
        (b - a).cross(&(c - a)).norm() / (2.0 * h * h)
    }
}
