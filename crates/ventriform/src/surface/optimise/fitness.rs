//! The four-term fitness of an edge and its neighbourhood.
//!
//! A configuration p is an edge (a, b) with its two triangles. The paper assesses it by
//!
//! * A, the dihedral angle: the angle between the normals of the two triangles (0 = flat);
//! * B, the mean dihedral angle at the other four sides of the two triangles;
//! * C, the mean of R/(2r) over the two triangles (1 = equilateral);
//! * D, the distance of the edge's midpoint from the reference surface S,
//!
//! and its fitness is F(p) = Σ wᵢ/w · sᵢ / max(Xᵢ, fᵢ), where w is the sum of the weights. The
//! fitness of a model is the mean of F over all edges.
//!
//! The paper states neither the units of the terms nor the floors fᵢ, so its absolute values
//! cannot be compared with any others; ours are in [`Scales`]. Below its floor a term counts as
//! perfect; without floors a single flat pair of triangles would outweigh the whole mesh.

/// The form of the fitness: in which units, and up to which value, its terms count.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitnessForm {
    /// The paper's reciprocal terms, limited to 20.
    Raw,
    /// Every term in (0, 1].
    Normalised,
    /// Reciprocals of angles in degrees and of millimetres, for comparisons between programs.
    Robust,
}

/// The four terms of one configuration: A and B in radians, C a ratio, D in millimetres.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FitnessTerms {
    /// Dihedral angle at the edge.
    pub a: f64,
    /// Mean dihedral angle at the other four sides of the two triangles.
    pub b: f64,
    /// Mean R/(2r) of the two triangles.
    pub c: f64,
    /// Distance of the edge's midpoint from S.
    pub d: f64,
}

/// Means of the fitness and of its terms over all edges of a mesh.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FitnessSummary {
    /// Mean fitness in the raw form.
    pub raw: f64,
    /// Mean fitness in the normalised form, 0..=1.
    pub normalised: f64,
    /// Mean fitness in the robust form with equal weights.
    pub robust: f64,
    /// Mean of A, the dihedral angle, radians.
    pub a_mean: f64,
    /// Mean of B, the dihedral angles at the neighbouring edges, radians.
    pub b_mean: f64,
    /// Mean of C, R/(2r); 1 = equilateral.
    pub c_mean: f64,
    /// Mean of D, the distance of the edge's midpoint from S, mm.
    pub d_mean: f64,
}

/// The lengths to which distances are related, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lengths {
    /// Smallest voxel spacing.
    pub voxel: f64,
    /// Edge length of equilateral triangles of which as many as the mesh has would cover S.
    pub edge: f64,
}

/// Numerators and floors of the four terms, in the units of [`FitnessTerms`].
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// sᵢ.
    pub numerator: [f64; 4],
    /// fᵢ.
    pub floor: [f64; 4],
}

impl Scales {
    /// The scales of `form`.
    pub fn new(form: FitnessForm, lengths: Lengths) -> Self {
        let degree = 1f64.to_radians();
        match form {
            // The paper's reciprocals: angles in radians, D in voxels, no term above 20.
            FitnessForm::Raw => Self {
                numerator: [1.0, 1.0, 1.0, lengths.voxel],
                floor: [0.05, 0.05, 1.0, 0.05 * lengths.voxel],
            },
            // Angles up to 10 degrees and distances up to a hundredth of an edge count as
            // perfect, 1. A chord of a curve of curvature k is off by k/8 of its squared
            // length: measured in voxels, a finer mesh would count as perfect too early.
            FitnessForm::Normalised => Self {
                numerator: [10.0 * degree, 10.0 * degree, 1.0, 0.01 * lengths.edge],
                floor: [10.0 * degree, 10.0 * degree, 1.0, 0.01 * lengths.edge],
            },
            // Angles in degrees, D in mm: comparable between tools and voxel sizes.
            FitnessForm::Robust => Self {
                numerator: [degree, degree, 1.0, 1.0],
                floor: [degree, degree, 1.0, 0.01],
            },
        }
    }
}

/// The fitness F with its weights and scales.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitnessFunction {
    weighted: [f64; 4],
    floor: [f64; 4],
}

impl FitnessFunction {
    /// The fitness in `form` with `weights` w1..w4 (not negative, not all zero); `lengths` scale D
    /// in the forms that relate it to them.
    pub fn new(form: FitnessForm, weights: [f64; 4], lengths: Lengths) -> Self {
        let scales = Scales::new(form, lengths);
        let sum: f64 = weights.iter().sum();
        let weighted = [0, 1, 2, 3].map(|i| weights[i] / sum * scales.numerator[i]);
        Self {
            weighted,
            floor: scales.floor,
        }
    }

    /// F of one configuration.
    pub fn value(&self, terms: &FitnessTerms) -> f64 {
        let x = [terms.a, terms.b, terms.c, terms.d];
        (0..4)
            .map(|i| self.weighted[i] / x[i].max(self.floor[i]))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MESH_LENGTHS: Lengths = Lengths {
        voxel: 2.0,
        edge: 12.0,
    };

    #[test]
    fn a_perfect_configuration_has_fitness_one_in_the_normalised_form() {
        let fitness =
            FitnessFunction::new(FitnessForm::Normalised, [1.0, 2.0, 3.0, 4.0], MESH_LENGTHS);
        let perfect = FitnessTerms {
            c: 1.0,
            ..FitnessTerms::default()
        };
        assert!((fitness.value(&perfect) - 1.0).abs() < 1e-15);
        // Twice as far as a hundredth of an edge of 12 mm.
        let worse = FitnessTerms { d: 0.24, ..perfect };
        assert!((fitness.value(&worse) - (0.6 + 0.4 / 2.0)).abs() < 1e-15);
    }

    #[test]
    fn raw_and_robust_forms_follow_their_units_and_floors() {
        let terms = FitnessTerms {
            a: 0.2,
            b: 0.5,
            c: 1.25,
            d: 0.5,
        };
        let raw = FitnessFunction::new(FitnessForm::Raw, [1.0; 4], MESH_LENGTHS).value(&terms);
        assert!((raw - (5.0 + 2.0 + 0.8 + 4.0) / 4.0).abs() < 1e-12);
        let robust =
            FitnessFunction::new(FitnessForm::Robust, [1.0; 4], MESH_LENGTHS).value(&terms);
        let expected = 1.0 / 0.2f64.to_degrees() + 1.0 / 0.5f64.to_degrees() + 0.8 + 2.0;
        assert!((robust - expected / 4.0).abs() < 1e-12);
        let flat = FitnessTerms {
            c: 1.0,
            ..FitnessTerms::default()
        };
        let capped = FitnessFunction::new(FitnessForm::Raw, [1.0; 4], MESH_LENGTHS).value(&flat);
        assert!((capped - (20.0 + 20.0 + 1.0 + 20.0) / 4.0).abs() < 1e-12);
    }
}
