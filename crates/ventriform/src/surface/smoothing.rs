//! Taubin smoothing (SIGGRAPH 1995): the working surface W.
//!
//! Passes alternate between a shrinking and a growing umbrella step, which removes the staircase
//! and the noise without shrinking the surface.

use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor};

/// Weight of the shrinking step.
const SHRINKING_WEIGHT: f64 = 0.5;
/// Weight of the growing step.
const GROWING_WEIGHT: f64 = -0.53;

/// Smooths the vertices of a closed mesh by `passes` pairs of steps.
///
/// # Errors
/// [`Cancelled`].
pub fn taubin(
    vertices: &[Vec3],
    triangles: &[[u32; 3]],
    passes: usize,
    monitor: &Monitor,
) -> Result<Vec<Vec3>, Cancelled> {
    let mut current = vertices.to_vec();
    // In a closed, oriented mesh every neighbour of a vertex follows it in exactly one
    // triangle: the umbrella's sum and count need no adjacency.
    let mut valence = vec![0u32; vertices.len()];
    for &v in triangles.iter().flatten() {
        valence[v as usize] += 1;
    }
    let mut sums = vec![Vec3::zeros(); vertices.len()];
    for pass in 0..2 * passes {
        monitor.check()?;
        let weight = if pass % 2 == 0 {
            SHRINKING_WEIGHT
        } else {
            GROWING_WEIGHT
        };
        sums.fill(Vec3::zeros());
        for &[a, b, c] in triangles {
            sums[a as usize] += current[b as usize];
            sums[b as usize] += current[c as usize];
            sums[c as usize] += current[a as usize];
        }
        for v in 0..current.len() {
            if valence[v] > 0 {
                let mean = sums[v] / f64::from(valence[v]);
                let here = current[v];
                current[v] = here + (mean - here) * weight;
            }
        }
    }
    Ok(current)
}

#[cfg(test)]
mod tests {
    use crate::mesh::shapes;
    use crate::surface::smoothing::*;

    #[test]
    fn a_noisy_sphere_becomes_smooth_and_keeps_its_volume() {
        let mut mesh = shapes::icosphere(20.0, 4);
        let exact = mesh.volume();
        for (n, v) in mesh.vertices.iter_mut().enumerate() {
            *v *= 1.0 + 0.01 * if n % 2 == 0 { 1.0 } else { -1.0 };
        }
        let spread = |vertices: &[Vec3]| {
            let sum: f64 = vertices.iter().map(|v| (v.norm() - 20.0).powi(2)).sum();
            (sum / vertices.len() as f64).sqrt()
        };
        let before = spread(&mesh.vertices);
        mesh.vertices = taubin(&mesh.vertices, &mesh.triangles, 15, &Monitor::silent()).unwrap();
        assert!(spread(&mesh.vertices) < 0.4 * before);
        assert!((mesh.volume() / exact - 1.0).abs() < 0.01);
    }
}
