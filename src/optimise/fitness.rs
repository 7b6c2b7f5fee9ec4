//! The four-term fitness of an edge configuration.
//!
//! A configuration p is an edge (a, b) with its two triangles. The paper judges it by
//!
//! * A, the angle between the two triangles' normals (0 = flat);
//! * B, the mean of the four angles between those triangles and their outer neighbours: the
//!   mean of A over the configuration's four sides;
//! * C, the mean of R/(2r) over the two triangles (1 = equilateral);
//! * D, the distance of the edge's midpoint to the reference surface S,
//!
//! and rates it F(p) = Σ wᵢ/w · sᵢ / max(Xᵢ, fᵢ), the model by the mean of F over all edges.
//! The paper states neither units nor floors, so that its absolute figures cannot be compared
//! with anybody's; ours are stated in [`Scales`]. A floor fᵢ says below which value a term is
//! as good as perfect; without one a single flat pair would outweigh the whole mesh.

use super::FitnessForm;

/// The four terms of one configuration: A and B in radians, C a ratio, D in millimetres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Terms {
    /// Angle between the normals of the edge's two triangles.
    pub a: f64,
    /// Mean angle to the four outer neighbours.
    pub b: f64,
    /// Mean R/(2r) of the two triangles.
    pub c: f64,
    /// Distance of the edge's midpoint to S.
    pub d: f64,
}

/// Numerators and floors of the four terms, in the units of [`Terms`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// sᵢ.
    pub numerator: [f64; 4],
    /// fᵢ.
    pub floor: [f64; 4],
}

impl Scales {
    /// The scales of `form` for voxels of `spacing` mm.
    pub fn new(form: FitnessForm, spacing: f64) -> Self {
        let degree = 1f64.to_radians();
        match form {
            // Angles in radians, D in voxels, no term above 20: the paper's reciprocals.
            FitnessForm::Raw => Self {
                numerator: [1.0, 1.0, 1.0, spacing],
                floor: [0.05, 0.05, 1.0, 0.05 * spacing],
            },
            // Flat within 10 degrees and within a quarter of a voxel counts as perfect: 1.
            FitnessForm::Normalised => Self {
                numerator: [10.0 * degree, 10.0 * degree, 1.0, 0.25 * spacing],
                floor: [10.0 * degree, 10.0 * degree, 1.0, 0.25 * spacing],
            },
            // Angles in degrees, D in mm: comparable between tools and voxel sizes.
            FitnessForm::Robust => Self {
                numerator: [degree, degree, 1.0, 1.0],
                floor: [degree, degree, 1.0, 0.01],
            },
        }
    }
}

/// The rating F of a configuration.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fitness {
    weighted: [f64; 4],
    floor: [f64; 4],
}

impl Fitness {
    /// `form` with `weights` w1..w4 (not negative, not all zero), D measured in voxels of
    /// `spacing` mm where the form says so.
    pub fn new(form: FitnessForm, weights: [f64; 4], spacing: f64) -> Self {
        let scales = Scales::new(form, spacing);
        let sum: f64 = weights.iter().sum();
        let weighted = [0, 1, 2, 3].map(|i| weights[i] / sum * scales.numerator[i]);
        Self {
            weighted,
            floor: scales.floor,
        }
    }

    /// F of one configuration.
    pub fn of(&self, terms: &Terms) -> f64 {
        let x = [terms.a, terms.b, terms.c, terms.d];
        (0..4)
            .map(|i| self.weighted[i] / x[i].max(self.floor[i]))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_configuration_rates_one_in_the_normalised_form() {
        let fitness = Fitness::new(FitnessForm::Normalised, [1.0, 2.0, 3.0, 4.0], 3.2);
        let perfect = Terms {
            c: 1.0,
            ..Terms::default()
        };
        assert!((fitness.of(&perfect) - 1.0).abs() < 1e-15);
        let worse = Terms { d: 1.6, ..perfect };
        // D is twice as far as its quarter-voxel scale... 1.6 mm = half a voxel.
        assert!((fitness.of(&worse) - (0.6 + 0.4 / 2.0)).abs() < 1e-15);
    }

    #[test]
    fn raw_and_robust_forms_follow_their_units_and_floors() {
        let terms = Terms {
            a: 0.2,
            b: 0.5,
            c: 1.25,
            d: 0.5,
        };
        let raw = Fitness::new(FitnessForm::Raw, [1.0; 4], 2.0).of(&terms);
        assert!((raw - (5.0 + 2.0 + 0.8 + 4.0) / 4.0).abs() < 1e-12);
        let robust = Fitness::new(FitnessForm::Robust, [1.0; 4], 2.0).of(&terms);
        let expected = 1.0 / 0.2f64.to_degrees() + 1.0 / 0.5f64.to_degrees() + 0.8 + 2.0;
        assert!((robust - expected / 4.0).abs() < 1e-12);
        let flat = Terms {
            c: 1.0,
            ..Terms::default()
        };
        let capped = Fitness::new(FitnessForm::Raw, [1.0; 4], 2.0).of(&flat);
        assert!((capped - (20.0 + 20.0 + 1.0 + 20.0) / 4.0).abs() < 1e-12);
    }
}
