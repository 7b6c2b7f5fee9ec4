//! How far apart points shall lie, place by place.
//!
//! Spacing h falls with curvedness: h ∝ κ^-γ, where κ = sqrt((κ1² + κ2²)/2) (Koenderink and van
//! Doorn 1992) is the root mean square of |Δn|/|Δx| over the edges of a vertex, smoothed over
//! the surface and held between its 5th and 97th percentile, so that noise and corners do
//! not pile points up. Where even points resolve the surface, that is where the arc over one
//! edge between them rises by less than a given share of the whole's size, spacing stays even.
//! So few points gather where the surface bends, while many stay as even as they can be.
//! h is relative: its area-weighted mean density is that of even spacing.

use super::RetileParameters;
use super::samples::Samples;
use crate::geometry::Vec3;
use crate::geometry::triangle::area_normal;

/// Largest over smallest spacing.
const LARGEST_RATIO: f64 = 2.5;
/// Umbrella averages of the curvature.
const SMOOTHING_ROUNDS: usize = 10;

/// Relative spacing at every sample: 1 on average; all 1 for γ = 0.
pub(super) fn spacing(samples: &Samples, parameters: &RetileParameters, points: usize) -> Vec<f64> {
    let gamma = parameters.adaptive;
    if gamma == 0.0 {
        return vec![1.0; samples.len()];
    }
    let area: f64 = samples.area.iter().sum();
    // Each of even points has two equilateral triangles.
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
    // As many points as even spacing takes: the sum of area/h² is the area.
    let needed: f64 = (0..samples.len())
        .map(|v| samples.area[v] / spacing[v].powi(2))
        .sum();
    let scale = (needed / area).sqrt();
    spacing.iter_mut().for_each(|h| *h *= scale);
    spacing
}

fn curvedness(samples: &Samples) -> Vec<f64> {
    let mut normals = vec![Vec3::zeros(); samples.len()];
    for t in &samples.triangles {
        let [a, b, c] = t.map(|v| &samples.working[v as usize]);
        let n = area_normal(a, b, c);
        for v in t {
            normals[*v as usize] += n;
        }
    }
    for n in &mut normals {
        *n = n.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
    }
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
        let samples = Samples::new(&sphere.vertices, &sphere.vertices, &sphere.triangles, 0);
        for k in curvedness(&samples) {
            // At the twelve corners of valence 5 area normals and chords differ most.
            assert!((k * 20.0 - 1.0).abs() < 0.07, "{k}");
        }
        let torus = shapes::torus(30.0, 12.0, 80, 40);
        let samples = Samples::new(&torus.vertices, &torus.vertices, &torus.triangles, 0);
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
        // Without adaptation, or where no place bends enough for it, spacing is even.
        for (parameters, points) in [(with(0.0, 0.0), 100), (with(0.5, 1.0), 10_000)] {
            let h = spacing(&samples, &parameters, points);
            assert!(h.iter().all(|h| (h - 1.0).abs() < 1e-12));
        }
    }
}
