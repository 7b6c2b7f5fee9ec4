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
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::vertex_normals;

/// Largest ratio of two spacings.
const LARGEST_RATIO: f64 = 2.5;

/// Number of times that the curvature is averaged over neighbours.
const SMOOTHING_ROUNDS: usize = 10;

/// The relative spacing at every sample: 1 on average; 1 everywhere for γ = 0.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn spacing(
    samples: &WeightedSamples,
    parameters: &RetileParameters,
    points: usize,
    monitor: &Monitor,
) -> Result<Vec<f64>, Cancelled> {
    let gamma = parameters.adaptive;
    if gamma == 0.0 {
        return Ok(vec![1.0; samples.len()]);
    }
    let area: f64 = samples.area.iter().sum();
    // Edge length of evenly spaced points: each has two equilateral triangles.
    let edge = (2.0 * area / (3f64.sqrt() * points as f64)).sqrt();
    // An arc of curvature k rises by k/8 of its squared chord.
    let rise = parameters.adaptive_from / 100.0 * area.sqrt();
    let resolved = 8.0 * rise / (edge * edge);
    let mut curvature = curvedness(samples);
    for _ in 0..SMOOTHING_ROUNDS {
        monitor.check()?;
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
    monitor.check()?;
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let (low, high) = (at(0.05).max(resolved), at(0.97));
    if !(low > 0.0) {
        return Ok(vec![1.0; samples.len()]);
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
    Ok(spacing)
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
    use crate::base::geometry::Vec3;
    use crate::mesh::{TriMesh, shapes};
    use crate::surface::retile::tessellate::test_surfaces::together;

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
        let h = spacing(&samples, &with(0.5, 0.0), 100, &Monitor::silent()).unwrap();
        let density: f64 = (0..samples.len())
            .map(|v| samples.area[v] / h[v].powi(2))
            .sum();
        assert!((density / torus.area() - 1.0).abs() < 1e-9);
        assert!(h.iter().any(|h| *h > 1.01) && h.iter().any(|h| *h < 0.99));
        // Without adaptation, or if the curvature is too low for it, spacing is even.
        for (parameters, points) in [(with(0.0, 0.0), 100), (with(0.5, 1.0), 10_000)] {
            let h = spacing(&samples, &parameters, points, &Monitor::silent()).unwrap();
            assert!(h.iter().all(|h| (h - 1.0).abs() < 1e-12));
        }
    }

    fn on(mesh: &TriMesh) -> WeightedSamples {
        WeightedSamples::new(&mesh.vertices, &mesh.vertices, &mesh.triangles, 0)
    }

    fn adapted(adaptive: f64, adaptive_from: f64) -> RetileParameters {
        RetileParameters {
            adaptive,
            adaptive_from,
            ..RetileParameters::default()
        }
    }

    /// Curvedness of a torus at a place.
    fn exact(p: &Vec3, major: f64, minor: f64) -> f64 {
        let from_axis = p.xy().norm();
        let (k1, k2) = (1.0 / minor, (from_axis - major) / minor / from_axis);
        f64::midpoint(k1 * k1, k2 * k2).sqrt()
    }

    fn extent(h: &[f64]) -> (f64, f64) {
        let least = h.iter().copied().fold(f64::INFINITY, f64::min);
        (least, h.iter().copied().fold(0.0, f64::max))
    }

    /// Between the limits: spacing times curvedness to the power γ is the same everywhere.
    #[test]
    fn spacing_falls_with_the_power_of_the_curvedness() {
        let samples = on(&shapes::torus(30.0, 15.0, 120, 60));
        for gamma in [0.25, 0.5, 1.0] {
            let h = spacing(&samples, &adapted(gamma, 0.0), 100, &Monitor::silent()).unwrap();
            let (least, most) = extent(&h);
            let product = |v: usize| h[v] * exact(&samples.working[v], 30.0, 15.0).powf(gamma);
            let within = (0..h.len()).filter(|v| h[*v] > least * 1.001 && h[*v] < most / 1.001);
            let products: Vec<f64> = within.map(product).collect();
            assert!(products.len() > h.len() / 2);
            let (low, high) = extent(&products);
            assert!(high / low < 1.0 + 0.12 * gamma, "{gamma}: {low} {high}");
        }
    }

    /// The twentieth part of the samples with the least curvature and the 3 % with the most share a spacing.
    #[test]
    fn the_flattest_and_the_most_curved_samples_are_limited() {
        let mesh = shapes::icosphere(20.0, 4);
        let bumpy = mesh
            .vertices
            .iter()
            .map(|p| p * (1.0 + 0.05 * (p.x * 0.31 + p.z * 0.17).sin()));
        let mesh = TriMesh {
            vertices: bumpy.collect(),
            triangles: mesh.triangles,
        };
        let samples = on(&mesh);
        let h = spacing(&samples, &adapted(0.5, 0.0), 100, &Monitor::silent()).unwrap();
        let (least, most) = extent(&h);
        assert!(most / least < LARGEST_RATIO);
        let share = |limit: f64| {
            let at_limit = h.iter().filter(|h| (*h / limit - 1.0).abs() < 1e-12);
            at_limit.count() as f64 / h.len() as f64
        };
        assert!((share(most) - 0.05).abs() < 0.002, "{}", share(most));
        assert!((share(least) - 0.03).abs() < 0.002, "{}", share(least));
    }

    #[test]
    fn two_spacings_differ_by_the_largest_ratio_at_most() {
        // A fat ring is a hundred times more curved than the thin one beside it is.
        let fat = shapes::torus(500.0, 200.0, 40, 20);
        let samples = on(&together(&[fat, shapes::torus(5.0, 2.0, 40, 20)]));
        for gamma in [0.3, 1.0] {
            let (least, most) =
                extent(&spacing(&samples, &adapted(gamma, 0.0), 100, &Monitor::silent()).unwrap());
            assert!((most / least / LARGEST_RATIO - 1.0).abs() < 1e-9, "{gamma}");
        }
    }

    /// Evenly spaced points have triangles with edges e; an arc of curvature κ over such an edge rises by κe²/8.
    /// Where that is less than the given share of the root of the area, spacing is even.
    #[test]
    fn spacing_is_even_where_even_points_resolve_the_surface() {
        let mesh = shapes::torus(30.0, 15.0, 120, 60);
        let samples = on(&mesh);
        let of_all: Vec<f64> = samples
            .working
            .iter()
            .map(|p| exact(p, 30.0, 15.0))
            .collect();
        let (flattest, most_curved) = extent(&of_all);
        let limit = f64::midpoint(flattest, most_curved);
        for points in [50, 200] {
            // Each point has two triangles.
            let triangle = mesh.area() / (2 * points) as f64;
            let squared_edge = triangle * 4.0 / 3f64.sqrt();
            let percent = 100.0 * limit * squared_edge / 8.0 / mesh.area().sqrt();
            let h = spacing(&samples, &adapted(0.5, percent), points, &Monitor::silent()).unwrap();
            let (_, most) = extent(&h);
            let mut seen = [0; 2];
            for (v, h) in h.iter().enumerate() {
                let ratio = exact(&samples.working[v], 30.0, 15.0) / limit;
                if ratio < 0.93 {
                    assert_eq!(*h, most);
                    seen[0] += 1;
                } else if ratio > 1.07 {
                    assert!(*h < most);
                    seen[1] += 1;
                }
            }
            assert!(seen.iter().all(|n| *n > 300), "{seen:?}");
        }
    }

    /// Noise at single samples is averaged away: one spike in a ball changes its own spacing little.
    #[test]
    fn the_curvature_is_smoothed_before_it_counts() {
        let mut mesh = shapes::icosphere(20.0, 4);
        mesh.vertices[1000] *= 1.03;
        let samples = on(&mesh);
        let raw = curvedness(&samples)[1000] * 20.0;
        assert!(raw > 2.0, "{raw}");
        let h = spacing(&samples, &adapted(1.0, 0.0), 100, &Monitor::silent()).unwrap();
        let (least, most) = extent(&h);
        assert!(most / least < 1.3, "{least} {most}");
    }
}
