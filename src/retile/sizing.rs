//! The wanted spacing of the points, as a function of curvature.
//!
//! In: samples of the surface and the number of points. Out: a relative spacing h at each sample,
//! scaled so that the total density is that of even spacing.
//!
//! Spacing falls with curvedness, h ∝ κ^-γ with κ = sqrt((κ1² + κ2²)/2) (Koenderink and van
//! Doorn 1992). κ is estimated as the root mean square of |Δn|/|Δx| over the edges of a vertex,
//! smoothed over the surface and limited to its 5th and 97th percentile, so that points do not
//! accumulate at noise and corners. Where evenly spaced points resolve the surface, that is,
//! where the arc over one edge rises by less than a given fraction of the surface's size,
//! spacing stays even. Few points therefore concentrate where curvature is high; many are
//! spaced evenly.

use super::RetileParameters;
use super::surface_samples::WeightedSamples;
use crate::mesh::vertex_normals;

/// Largest ratio of two spacings.
const LARGEST_RATIO: f64 = 2.5;

/// Number of times that the curvature is averaged over neighbours.
const SMOOTHING_ROUNDS: usize = 10;

/// The relative spacing at every sample: 1 on average; 1 everywhere for γ = 0.
pub(super) fn spacing(
    samples: &WeightedSamples,
    parameters: &RetileParameters,
    points: usize,
) -> Vec<f64> {
    let gamma = parameters.adaptive;
    if gamma == 0.0 {
        return vec![1.0; samples.len()];
    }
    let area: f64 = samples.area.iter().sum();
    // Edge length of evenly spaced points: each has two equilateral triangles.
    let edge = (2.0 * area / (3f64.sqrt() * points as f64)).sqrt();
    // An arc of curvature k rises by k/8 of its squared chord.
    let rise = parameters.adaptive_from / 100.0 * area.sqrt();
    let resolved = 8.0 * rise / (edge * edge);
    let mut curvature = curvedness(samples);
    for _ in 0..SMOOTHING_ROUNDS {
        curvature = (0..samples.len())
            .map(|v| {
                let around = samples.around(v);
                let sum: f64 = around.iter().map(|&n| curvature[n as usize]).sum();
                (sum / around.len() as f64 + curvature[v]) / 2.0
            })
            .collect();
    }
    let mut sorted = curvature.clone();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let (low, high) = (at(0.05).max(resolved), at(0.97));
    if !(low > 0.0) {
        return vec![1.0; samples.len()];
    }
    let high = high.clamp(low, low * LARGEST_RATIO.powf(1.0 / gamma));
    let mut spacing: Vec<f64> = curvature
        .iter()
        .map(|k| k.clamp(low, high).powf(-gamma))
        .collect();
    // The same number of points as with even spacing: the sum of area/h² must be the area.
    let needed: f64 = (0..samples.len())
        .map(|v| samples.area[v] / spacing[v].powi(2))
        .sum();
    let scale = (needed / area).sqrt();
    spacing.iter_mut().for_each(|h| *h *= scale);
    spacing
}

/// The curvedness κ at every sample of W, 1/mm.
fn curvedness(samples: &WeightedSamples) -> Vec<f64> {
    let normals = vertex_normals(&samples.working, &samples.triangles);
    (0..samples.len())
        .map(|v| {
            let around = samples.around(v);
            let squares = around.iter().map(|&n| {
                let step = samples.working[n as usize] - samples.working[v];
                let turn = normals[n as usize] - normals[v];
                turn.norm_squared() / step.norm_squared().max(f64::MIN_POSITIVE)
            });
            (squares.sum::<f64>() / around.len() as f64).sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_sphere_is_evenly_curved_and_a_torus_denser_inside() {
        let sphere = shapes::icosphere(20.0, 4);
        let samples =
            WeightedSamples::new(&sphere.vertices, &sphere.vertices, &sphere.triangles, 0);
        for k in curvedness(&samples) {
            // The estimate is worst at the twelve vertices of valence 5.
            assert!((k * 20.0 - 1.0).abs() < 0.07, "{k}");
        }
        let torus = shapes::torus(30.0, 12.0, 80, 40);
        let samples = WeightedSamples::new(&torus.vertices, &torus.vertices, &torus.triangles, 0);
        for (v, k) in curvedness(&samples).into_iter().enumerate() {
            let p = samples.working[v];
            let from_axis = p.xy().norm();
            let (k1, k2) = (1.0 / 12.0, (from_axis - 30.0) / 12.0 / from_axis);
            let exact = f64::midpoint(k1 * k1, k2 * k2).sqrt();
            assert!((k / exact - 1.0).abs() < 0.1, "{k} {exact}");
        }
        let with = |adaptive, adaptive_from| RetileParameters {
            adaptive,
            adaptive_from,
            ..RetileParameters::default()
        };
        let h = spacing(&samples, &with(0.5, 0.0), 100);
        let density: f64 = (0..samples.len())
            .map(|v| samples.area[v] / h[v].powi(2))
            .sum();
        assert!((density / torus.area() - 1.0).abs() < 1e-9);
        assert!(h.iter().any(|h| *h > 1.01) && h.iter().any(|h| *h < 0.99));
        // Without adaptation, or if the curvature is too low for it, spacing is even.
        for (parameters, points) in [(with(0.0, 0.0), 100), (with(0.5, 1.0), 10_000)] {
            let h = spacing(&samples, &parameters, points);
            assert!(h.iter().all(|h| (h - 1.0).abs() < 1e-12));
        }
    }
}
