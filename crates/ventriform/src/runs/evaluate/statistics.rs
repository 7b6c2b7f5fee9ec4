//! Mean shape and principal modes of fits of one model.
//!
//! All fits of a model share nodes and triangles, so node i of one corresponds to node i of
//! every other. Generalised Procrustes alignment (shift and rotation; size is kept, because
//! the heart's size is part of its shape) brings them together; the principal components of
//! the 3N coordinates follow from the small matrix of inner products between the shapes
//! (S shapes have at most S - 1 modes).

use nalgebra::DMatrix;
use serde_json::{Value, json};

use crate::base::geometry::Vec3;
use crate::base::geometry::rotation::nearest_rotation;
use crate::mesh::TriMesh;

/// Mean and modes.
#[derive(Debug, Clone)]
pub struct Statistics {
    /// The mean shape, centred at the origin.
    pub mean: TriMesh,
    /// The modes, greatest variance first.
    pub modes: Vec<Mode>,
    /// Sum of all variances, mm² (summed over coordinates).
    pub total_variance: f64,
}

/// One principal mode.
#[derive(Debug, Clone)]
pub struct Mode {
    /// Variance along the mode, mm².
    pub variance: f64,
    /// Displacement of every node at one standard deviation, mm.
    pub displacement: Vec<Vec3>,
    /// Coordinate of each fit along the mode in standard deviations.
    pub scores: Vec<f64>,
}

/// Why fits cannot be compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum StatisticsError {
    /// Fewer than two fits.
    #[error("{count} fits were given; at least two are needed")]
    TooFew {
        /// Their number.
        count: usize,
    },
    /// A fit has other nodes or triangles than the first one.
    #[error("fit {index} has other triangles than the first: all must be fits of one model")]
    OtherModel {
        /// Place in the list, from 0.
        index: usize,
    },
}

/// Rounds of the Procrustes alignment, which converges in three or four.
const PROCRUSTES_ROUNDS: usize = 10;

/// Aligns `fits` and finds their mean and modes.
///
/// # Errors
/// [`StatisticsError`].
pub fn statistics(fits: &[TriMesh]) -> Result<Statistics, StatisticsError> {
    let Some(first) = fits.first().filter(|_| fits.len() >= 2) else {
        return Err(StatisticsError::TooFew { count: fits.len() });
    };
    let differs =
        |m: &TriMesh| m.triangles != first.triangles || m.vertices.len() != first.vertices.len();
    if let Some(index) = fits.iter().position(differs) {
        return Err(StatisticsError::OtherModel { index });
    }
    let mut shapes: Vec<Vec<Vec3>> = fits.iter().map(|m| centred(&m.vertices)).collect();
    let mut mean = shapes[0].clone();
    for _ in 0..PROCRUSTES_ROUNDS {
        for shape in &mut shapes {
            turn_onto(shape, &mean);
        }
        mean = average(&shapes);
    }
    let modes = principal_modes(&shapes, &mean);
    Ok(Statistics {
        total_variance: modes.iter().map(|m| m.variance).sum(),
        modes,
        mean: TriMesh {
            vertices: mean,
            triangles: first.triangles.clone(),
        },
    })
}

impl Statistics {
    /// The mean shape moved by `deviations` standard deviations along mode `mode`.
    pub fn along(&self, mode: usize, deviations: f64) -> TriMesh {
        let mut mesh = self.mean.clone();
        for (p, d) in mesh.vertices.iter_mut().zip(&self.modes[mode].displacement) {
            *p += d * deviations;
        }
        mesh
    }

    /// The variances of the modes with their shares of the total, the share of all modes up to
    /// each one (compactness), and the scores, as JSON.
    pub fn to_json(&self) -> Value {
        let mut so_far = 0.0;
        let modes: Vec<Value> = self
            .modes
            .iter()
            .map(|mode| {
                so_far += mode.variance;
                json!({
                    "variance_mm2": mode.variance,
                    "share": mode.variance / self.total_variance,
                    "compactness": so_far / self.total_variance,
                    "scores": mode.scores,
                })
            })
            .collect();
        json!({
            "nodes": self.mean.vertices.len(),
            "total_variance_mm2": self.total_variance,
            "modes": modes,
        })
    }
}

fn centred(points: &[Vec3]) -> Vec<Vec3> {
    let centre: Vec3 = points.iter().sum::<Vec3>() / points.len() as f64;
    points.iter().map(|p| p - centre).collect()
}

fn turn_onto(shape: &mut [Vec3], mean: &[Vec3]) {
    let moment = mean
        .iter()
        .zip(&*shape)
        .map(|(m, p)| m * p.transpose())
        .sum();
    let turn = nearest_rotation(&moment);
    shape.iter_mut().for_each(|p| *p = turn * *p);
}

fn average(shapes: &[Vec<Vec3>]) -> Vec<Vec3> {
    (0..shapes[0].len())
        .map(|i| shapes.iter().map(|s| s[i]).sum::<Vec3>() / shapes.len() as f64)
        .collect()
}

fn principal_modes(shapes: &[Vec<Vec3>], mean: &[Vec3]) -> Vec<Mode> {
    let count = shapes.len();
    let residuals: Vec<Vec<Vec3>> = shapes
        .iter()
        .map(|s| s.iter().zip(mean).map(|(p, m)| p - m).collect())
        .collect();
    let inner = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(x, y)| x.dot(y)).sum::<f64>();
    let gram = DMatrix::from_fn(count, count, |a, b| inner(&residuals[a], &residuals[b]));
    let eigen = gram.symmetric_eigen();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let total = eigen.eigenvalues.sum();
    order
        .into_iter()
        .take(count - 1)
        // Smaller eigenvalues are rounding errors.
        .filter(|e| eigen.eigenvalues[*e] > 1e-10 * total)
        .map(|e| {
            let value = eigen.eigenvalues[e];
            let vector = eigen.eigenvectors.column(e);
            let deviation = (value / (count - 1) as f64).sqrt();
            // The unit mode is Σ vector_s residual_s / sqrt(value).
            let scale = deviation / value.sqrt();
            let displacement = (0..mean.len())
                .map(|i| {
                    (0..count)
                        .map(|s| residuals[s][i] * vector[s])
                        .sum::<Vec3>()
                        * scale
                })
                .collect();
            Mode {
                variance: deviation * deviation,
                displacement,
                scores: vector
                    .iter()
                    .map(|v| v * value.sqrt() / deviation)
                    .collect(),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use nalgebra::Rotation3;

    /// Spheres that are longer or shorter along z, moved and turned at will.
    fn family() -> Vec<TriMesh> {
        [-2.0f64, -1.0, 0.0, 1.0, 2.0]
            .iter()
            .enumerate()
            .map(|(i, t)| {
                let mut mesh = shapes::icosphere(20.0, 2);
                let t_i = i as f64;
                let turn = Rotation3::from_euler_angles(0.1 * t_i, -0.2 * t_i, 0.05 * t_i);
                for p in &mut mesh.vertices {
                    p.z *= 1.0 + 0.1 * t;
                    *p = turn * *p + Vec3::new(t_i, -3.0 * t_i, 7.0);
                }
                mesh
            })
            .collect()
    }

    #[test]
    fn one_parameter_gives_one_mode_and_its_scores() {
        let found = statistics(&family()).unwrap();
        let share = found.modes[0].variance / found.total_variance;
        assert!(share > 0.999, "{share}");
        let scores = &found.modes[0].scores;
        let unit = scores[4] - scores[3];
        for pair in scores.windows(2) {
            assert!(
                ((pair[1] - pair[0]) / unit - 1.0).abs() < 1e-6,
                "{scores:?}"
            );
        }
        let far = found.along(0, scores[4]);
        assert!((far.volume() / family()[4].volume() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn fits_of_other_models_are_refused() {
        let mut fits = family();
        fits[2] = shapes::icosphere(20.0, 1);
        assert_eq!(
            statistics(&fits).unwrap_err(),
            StatisticsError::OtherModel { index: 2 }
        );
        assert_eq!(
            statistics(&fits[..1]).unwrap_err(),
            StatisticsError::TooFew { count: 1 }
        );
    }
}
