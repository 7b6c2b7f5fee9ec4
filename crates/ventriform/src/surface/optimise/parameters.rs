//! Parameters of the optimisation, their defaults and ranges.

use super::OptimiseError;
use super::fitness::{FitnessForm, FitnessFunction, Lengths};

/// The criterion by which a flip counts as an improvement.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gain {
    /// The flipped edge has a higher fitness than the old one (the paper's criterion).
    Local,
    /// The sum of the fitness over all edges rises.
    Total,
}

/// Parameters of [`optimise`](super::optimise).
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiseParameters {
    /// The form of the fitness that flips increase. Default [`FitnessForm::Normalised`].
    pub fitness: FitnessForm,
    /// Weights w1..w4 of the four terms A, B, C, D: not negative, not all zero. Default 1 each.
    pub weights: [f64; 4],
    /// The figure that a flip must increase. Default [`Gain::Total`].
    pub gain: Gain,
    /// Smallest radius ratio 2r/R, 0..=1, of a triangle that a flip may make, unless it replaces
    /// one that is as bad. If it is not 0, a flip may also not move its two triangles farther
    /// from the surface. 0 allows slivers and such flips, as the paper does. Default 0.9.
    pub guard: f64,
    /// Parameters of the least-squares fit.
    pub fit: LeastSquaresParameters,
}

/// Parameters of the least-squares fit of the vertices to the surface.
#[derive(Debug, Clone, PartialEq)]
pub struct LeastSquaresParameters {
    /// Number of rounds, 0..=200. 0 leaves the vertices on the surface, as the paper does.
    /// Default 10; six more make no model of a scan with noise nearer to the truth or more regular.
    pub rounds: usize,
    /// Weight of triangle shape relative to squared distance, (0, 10]. Default 0.06.
    pub shape_weight: f64,
    /// Additional weight of misshapen triangles: a triangle's weight is
    /// 1 + this · (R/(2r) - 1). 0..=100, default 3.
    pub worst_weight: f64,
    /// Freedom of triangles to choose their size, 0..=1: 0 pulls all towards one size (times the
    /// wanted relative spacing), 1 lets each keep its own. Default 1.
    pub free_size: f64,
    /// Additional weight of distant samples: a sample's weight is 1 + this · r²/mean r².
    /// It lowers the largest distance and, by less, the mean, at the expense of shape and
    /// fitness. 0..=10, default 0.02.
    pub peak_weight: f64,
    /// Weight of evenly changing dihedral angles relative to squared distance, for triangles
    /// about the size of a voxel; larger ones follow fewer facets of voxels and count proportionally
    /// less. Noise measured in the volume adds to it: as much for every 1/20 of an edge length.
    /// It lowers the largest distance and the dihedral angles at the same mean distance.
    /// 0..=10, default 0.07.
    pub bend_weight: f64,
    /// Fraction of the previous round's step that is added to each step, 0..=0.9. Default 0.6.
    pub momentum: f64,
    /// Weight of keeping the vertices in place, as a fraction of the weight of the distances
    /// spread over the vertices, (0, 1]. Default 0.0005.
    pub damping: f64,
    /// Samples of the surface per triangle of the model, 4..=200. Default 16. A model whose triangles are smaller than
    /// the surface's own has fewer, at least 6.
    pub samples_per_triangle: usize,
    /// Number of further flips, 0..=4, that the fit tries after each flip to move irregular
    /// vertices until they cancel; each takes several times as long as the one before. Default 3.
    pub glide: usize,
    /// Weight of the distances of the model's own edge midpoints (term D) and triangle centres
    /// relative to those of the surface's samples, 0..=10. Default 1.
    pub midpoint_weight: f64,
}

impl Default for LeastSquaresParameters {
    fn default() -> Self {
        Self {
            rounds: 10,
            shape_weight: 0.06,
            worst_weight: 3.0,
            free_size: 1.0,
            peak_weight: 0.02,
            bend_weight: 0.07,
            momentum: 0.6,
            damping: 0.0005,
            samples_per_triangle: 16,
            glide: 3,
            midpoint_weight: 1.0,
        }
    }
}

impl Default for OptimiseParameters {
    fn default() -> Self {
        Self {
            fitness: FitnessForm::Normalised,
            weights: [1.0; 4],
            gain: Gain::Total,
            guard: 0.9,
            fit: LeastSquaresParameters::default(),
        }
    }
}

impl OptimiseParameters {
    pub(super) fn fitness(&self, lengths: Lengths) -> FitnessFunction {
        FitnessFunction::new(self.fitness, self.weights, lengths)
    }

    /// Checks every field against its range.
    pub(super) fn check(&self) -> Result<(), OptimiseError> {
        let fit = &self.fit;
        let [w1, w2, w3, w4] = self.weights;
        for (field, value, least, most) in [
            ("weights.w1", w1, 0.0, 1e6),
            ("weights.w2", w2, 0.0, 1e6),
            ("weights.w3", w3, 0.0, 1e6),
            ("weights.w4", w4, 0.0, 1e6),
            (
                "the sum of the weights",
                self.weights.iter().sum(),
                1e-6,
                4e6,
            ),
            ("guard", self.guard, 0.0, 1.0),
            ("fit.rounds", fit.rounds as f64, 0.0, 200.0),
            ("fit.shape_weight", fit.shape_weight, 1e-6, 10.0),
            ("fit.worst_weight", fit.worst_weight, 0.0, 100.0),
            ("fit.free_size", fit.free_size, 0.0, 1.0),
            ("fit.peak_weight", fit.peak_weight, 0.0, 10.0),
            ("fit.bend_weight", fit.bend_weight, 0.0, 10.0),
            ("fit.momentum", fit.momentum, 0.0, 0.9),
            ("fit.glide", fit.glide as f64, 0.0, 4.0),
            ("fit.midpoint_weight", fit.midpoint_weight, 0.0, 10.0),
            ("fit.damping", fit.damping, 1e-6, 1.0),
            (
                "fit.samples_per_triangle",
                fit.samples_per_triangle as f64,
                4.0,
                200.0,
            ),
        ] {
            if !(least..=most).contains(&value) {
                return Err(OptimiseError::Parameter {
                    field,
                    value,
                    least,
                    most,
                });
            }
        }
        Ok(())
    }
}
