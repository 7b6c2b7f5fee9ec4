//! The sections of a model's report that sum a stage up.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::elements::{Shape, Smoothness};
use super::measure::Measures;
use crate::surface::denoise::SurfaceNoise;
use crate::surface::retile::Tiled;

/// The program that made a product.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Software))]
pub struct Program {
    /// The program: `ventriform`.
    pub name: String,
    /// Its version.
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

/// Figures of the iso-surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct SurfaceReport {
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
    /// Handles over all components.
    pub genus: i64,
    /// The iso-value as a share of the reference intensity.
    pub iso_fraction: f64,
    /// The object's maximum, which percentages refer to.
    pub reference_intensity: f64,
    /// Otsu's threshold.
    pub otsu: Option<f64>,
    /// Smallest and largest intensity.
    pub intensity_range: [f64; 2],
    /// `intensity`, `mask` or `labels`.
    pub kind: String,
    /// The object's label.
    pub label: Option<i64>,
    /// How much the object looks like a left ventricle.
    pub ventricle_score: Option<f64>,
    /// The noise that was measured and taken off the surface; null for masks and with denoise=off.
    pub noise: Option<SurfaceNoise>,
    /// Volume of the voxels that carry the label, millilitres, which the surface is made to enclose;
    /// null for intensities.
    pub mask_ml: Option<f64>,
    /// Volume of the object's voxels, millilitres.
    pub region_ml: f64,
    /// Whether the object touches the volume's border.
    pub touches_border: bool,
    /// Voxels that are NaN or infinite.
    pub not_finite_voxels: usize,
    /// Voxels of neighbouring organs that were cut off.
    pub neighbour_voxels_cut: usize,
    /// Area of that cut, mm².
    pub neighbour_cut_mm2: f64,
    /// Components before all but one were removed.
    pub components_before: usize,
    /// Enclosed cavities before they were filled.
    pub cavities_before: usize,
    /// Handles before they were removed.
    pub handles_before: usize,
    /// Voxels of dropped components.
    pub voxels_dropped: usize,
    /// Voxels cut to open handles.
    pub voxels_cut: usize,
    /// Voxels filled to close handles and cavities.
    pub voxels_filled: usize,
}

/// Figures of the mesh before optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct RetileReport {
    /// Seed of the kept model's random numbers.
    pub seed: u64,
    /// Rounds of repulsion.
    pub repulsion_rounds: usize,
    /// Repetitions of repulsion and tessellation.
    pub repeats: usize,
    /// Rounds of relaxation.
    pub relaxation_rounds: usize,
    /// Attempts until the mesh was a manifold.
    pub attempts: usize,
    /// The models of which the best was kept.
    pub starts: Vec<StartSummary>,
    /// Shape of the triangles.
    pub shape: Shape,
    /// Angles between neighbouring triangles.
    pub smoothness: Smoothness,
}

/// Figures of optimisation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct OptimiseReport {
    /// Edges flipped.
    pub flips: usize,
    /// Sweeps over all edges.
    pub sweeps: usize,
    /// Why it ended: `no_flip_gains`, `cycle` or `sweep_limit`.
    pub ended: String,
    /// Rounds of the least-squares fit.
    pub fit_rounds: usize,
    /// Edges flipped during the fit.
    pub fit_flips: usize,
    /// Steps of the fit that were shortened.
    pub fit_shortened: usize,
    /// Intersecting pairs of triangles before optimisation.
    pub self_intersections_before: usize,
}

/// The paper's fitness: mean over all edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessReport {
    /// The form in which `retiled`, `fitted` and `optimised` are given: the one that drove the flips.
    pub form: String,
    /// After re-tiling.
    pub retiled: f64,
    /// After the least-squares fit, before the last flips.
    pub fitted: f64,
    /// After optimisation.
    pub optimised: f64,
    /// From re-tiled to optimised, percent.
    pub gain_percent: f64,
    /// Weights of the four terms.
    pub weights: [f64; 4],
    /// Numerators and floors of every form.
    #[cfg_attr(feature = "schema", schema(value_type = BTreeMap<String, FitnessScales>))]
    pub scales: Map<String, Value>,
    /// All forms after each stage.
    pub forms: FitnessFormStages,
    /// Mean terms after each stage.
    pub terms: FitnessTermStages,
}

/// Numerators and floors of the four terms.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessScales {
    /// Numerators, in radians and millimetres.
    pub numerator: [f64; 4],
    /// Floors, in radians and millimetres.
    pub floor: [f64; 4],
}

/// All forms of the fitness after each stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessFormStages {
    /// After re-tiling.
    pub retiled: FitnessForms,
    /// After the least-squares fit.
    pub fitted: FitnessForms,
    /// After optimisation.
    pub optimised: FitnessForms,
}

/// Mean fitness in every form.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessForms {
    /// The paper's reciprocal terms, capped.
    pub raw: f64,
    /// Every term in (0, 1].
    pub normalised: f64,
    /// Angles in degrees floored at 1, distance in mm floored at 0.01, equal weights:
    /// comparable between tools.
    pub robust: f64,
}

/// Mean terms of the fitness after each stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessTermStages {
    /// After re-tiling.
    pub retiled: FitnessTerms,
    /// After the least-squares fit.
    pub fitted: FitnessTerms,
    /// After optimisation.
    pub optimised: FitnessTerms,
}

/// Means of the four terms over all edges.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct FitnessTerms {
    /// Angle between the normals of the edge's triangles, degrees.
    pub a_deg: f64,
    /// Mean angle to the four outer neighbours, degrees.
    pub b_deg: f64,
    /// R/(2r) of the two triangles, 1 = equilateral.
    pub c: f64,
    /// Distance of the edge's midpoint to the surface, mm.
    pub d_mm: f64,
}

/// One of the models of which the best was kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Start))]
pub struct StartSummary {
    /// Its seed.
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
