//! The sections of a model's report that sum a stage up.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::elements::{Shape, Smoothness};
use super::measure::Measures;
use crate::retile::Tiled;

/// The program that made a report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Program {
    /// Always `ventriform`.
    pub name: String,
    /// The version.
    pub version: String,
}

impl Program {
    /// This version of ventriform.
    pub fn this() -> Self {
        Self {
            name: env!("CARGO_PKG_NAME").into(),
            version: env!("CARGO_PKG_VERSION").into(),
        }
    }

    /// The last line of a page.
    pub fn footer(&self) -> String {
        format!(
            "{} {}. Lengths in millimetres, patient frame LPS (left, posterior, superior). \
             Research software: not a medical device.",
            self.name, self.version
        )
    }
}

/// The iso-surface's figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SurfaceSection {
    /// The iso-value, in the volume's units.
    pub iso_value: f64,
    /// Number of vertices.
    pub vertices: usize,
    /// Number of triangles.
    pub triangles: usize,
    /// V - E + F.
    pub euler_characteristic: i64,
    /// Connected components.
    pub components: usize,
    /// Components that face outward; the others bound cavities.
    pub outward_components: usize,
    /// Enclosed volume, millilitres.
    pub volume_ml: f64,
    /// Area, mm².
    pub area_mm2: f64,
    /// Smallest voxel spacing, mm.
    pub voxel_mm: f64,
    /// Further facts of the stage.
    #[serde(flatten)]
    pub facts: Map<String, Value>,
}

/// The re-tiled mesh's figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RetileSection {
    /// Facts of the stage.
    #[serde(flatten)]
    pub facts: Map<String, Value>,
    /// Shape of the triangles before optimisation.
    pub shape: Shape,
    /// Angles between neighbouring triangles before optimisation.
    pub smoothness: Smoothness,
}

/// The paper's fitness: mean over all edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FitnessSection {
    /// The form that drove the flips, in which `retiled`, `fitted` and `optimised` are given.
    pub form: String,
    /// After re-tiling.
    pub retiled: f64,
    /// After the least-squares fit, before the last flips.
    pub fitted: f64,
    /// After optimisation.
    pub optimised: f64,
    /// From re-tiled to optimised, percent.
    pub gain_percent: f64,
    /// Weights w1..w4 of A, B, C, D.
    pub weights: [f64; 4],
    /// Numerators and floors of every form, in radians and millimetres.
    pub scales: Map<String, Value>,
    /// All forms after each stage.
    pub forms: Stages<FitnessForms>,
    /// Mean terms after each stage.
    pub terms: Stages<FitnessTermsSection>,
}

/// The same figures after each stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Stages<T> {
    /// After re-tiling.
    pub retiled: T,
    /// After the least-squares fit.
    pub fitted: T,
    /// After optimisation.
    pub optimised: T,
}

/// Mean fitness in every form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FitnessForms {
    /// The paper's reciprocal terms, capped.
    pub raw: f64,
    /// Every term in (0, 1].
    pub normalised: f64,
    /// Angles in degrees floored at 1, distance in mm floored at 0.01, equal weights:
    /// comparable between tools.
    pub robust: f64,
}

/// Means of the four terms over all edges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FitnessTermsSection {
    /// A: angle between the edge's triangles' normals, degrees.
    pub a_deg: f64,
    /// B: mean angle to the four outer neighbours, degrees.
    pub b_deg: f64,
    /// C: R/(2r) of the two triangles, 1 = equilateral.
    pub c: f64,
    /// D: distance of the edge's midpoint to the surface, mm.
    pub d_mm: f64,
}

/// One of the models of which the best was kept, each from another seed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct StartSummary {
    /// Seed of its random choices.
    pub seed: u64,
    /// Mean 2r/R of its triangles.
    pub radius_ratio_mean: f64,
    /// Mean distance to the surface, two-sided, mm.
    pub distance_mean_mm: f64,
    /// Largest distance to the surface, two-sided, mm.
    pub hausdorff_mm: f64,
}

impl StartSummary {
    /// The figures of the model made from `tiled`.
    pub fn new(tiled: &Tiled, measures: &Measures) -> Self {
        Self {
            seed: tiled.facts.seed,
            radius_ratio_mean: measures.shape.radius_ratio.mean,
            distance_mean_mm: measures.distance.mean_mm,
            hausdorff_mm: measures.distance.hausdorff_mm,
        }
    }
}

impl<T> Stages<T> {
    /// `f` of the figure after each stage.
    pub(super) fn map<U>(&self, f: impl Fn(&T) -> U) -> Stages<U> {
        Stages {
            retiled: f(&self.retiled),
            fitted: f(&self.fitted),
            optimised: f(&self.optimised),
        }
    }
}
