//! Centroidal geodesic Voronoi points.
//!
//! Lloyd's algorithm along the surface: every point moves straight to the weighted mean of its
//! cell in its own polar coordinates. The points end with even cells; three neighbours form
//! nearly equilateral triangles.

use super::SurfacePoint;
use super::domain::Domain;
use super::sizing::Sizing;
use super::trace::walk;
use super::voronoi::Voronoi;
use crate::geometry::Vec2;
use crate::progress::Cancelled;

/// Runs `rounds` rounds on `points`, moving `factor` times the way to the mean; leaves the
/// diagram of the points as they end in `voronoi`.
pub(crate) fn relax(
    domain: &Domain,
    sizing: &Sizing,
    points: &mut [SurfacePoint],
    voronoi: &mut Voronoi,
    (rounds, factor): (usize, f64),
    tick: impl Fn(f64) -> Result<(), Cancelled>,
) -> Result<(), Cancelled> {
    voronoi.spread(domain, points);
    for round in 0..rounds {
        tick(round as f64 / rounds as f64)?;
        let means = means(domain, sizing, voronoi, points.len());
        for (point, mean) in points.iter_mut().zip(means) {
            *point = walk(domain, point, mean * factor).0;
        }
        voronoi.spread(domain, points);
    }
    Ok(())
}

/// The weighted mean of every cell in the frame of its point's triangle.
fn means(domain: &Domain, sizing: &Sizing, voronoi: &Voronoi, count: usize) -> Vec<Vec2> {
    let mut sums = vec![(Vec2::zeros(), 0.0); count];
    for (v, (&label, reach)) in voronoi.label.iter().zip(&voronoi.reach).enumerate() {
        if let Some(sum) = sums.get_mut(label as usize) {
            let weight = sizing.weight(domain, v);
            sum.0 += reach.vector * weight;
            sum.1 += weight;
        }
    }
    sums.iter()
        .map(|(sum, weight)| {
            if *weight > 0.0 {
                sum / *weight
            } else {
                Vec2::zeros()
            }
        })
        .collect()
}

/// N/A² Σ a_v d_v²: 5/(18√3) = 0.1604 for a lattice of regular hexagons, more for anything
/// else.
pub(crate) fn energy(domain: &Domain, voronoi: &Voronoi, count: usize) -> f64 {
    let sum: f64 = voronoi
        .reach
        .iter()
        .zip(&domain.vertex_areas)
        .map(|(r, a)| a * r.distance * r.distance)
        .sum();
    sum * count as f64 / (domain.area * domain.area)
}
