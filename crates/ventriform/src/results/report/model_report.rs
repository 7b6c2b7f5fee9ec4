//! The report of a model: the stages' facts and the model's measures as one JSON document.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::distance::Distance;
use super::elements::{Elements, Histograms, MeshFacts, Shape, Smoothness};
use super::input::FileFacts;
use super::measure::Measures;
use super::sections::{
    FitnessReport, OptimiseReport, Program, RetileReport, StartSummary, SurfaceReport,
};
use super::stage_facts;
use super::summaries::{ModelSummary, object};
use crate::surface::optimise::{OptimiseParameters, Optimised};
use crate::surface::retile::Tiled;
use crate::surface::{Surface, SurfaceFacts};

// The page is made from a stored report, perhaps by a later version: a new field needs `#[serde(default)]`.
/// The report of a model. Lengths are millimetres in the patient frame LPS.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct ModelReport {
    /// The program that made the model.
    pub software: Program,
    /// The volume's file.
    pub input: FileFacts,
    /// Every parameter, defaults written out.
    #[cfg_attr(feature = "schema", schema(value_type = crate::parameters::ModelParameters))]
    pub parameters: Map<String, Value>,
    /// The iso-surface.
    pub surface: SurfaceReport,
    /// The mesh before optimisation.
    pub retile: RetileReport,
    /// Figures of optimisation.
    pub optimise: OptimiseReport,
    /// The model: counts and topology.
    pub mesh: MeshFacts,
    /// The model: shape of its triangles.
    pub shape: Shape,
    /// The model: angles between neighbouring triangles.
    pub smoothness: Smoothness,
    /// The model beside the iso-surface.
    pub distance: Distance,
    /// The paper's fitness after each stage.
    pub fitness: FitnessReport,
    /// Distributions before and after optimisation.
    pub histograms: Histograms,
    /// Milliseconds of each stage and their `total`.
    #[cfg_attr(feature = "schema", schema(value_type = BTreeMap<String, f64>))]
    pub timings_ms: Map<String, Value>,
    /// Sentences about the input and the model that a user should know.
    pub warnings: Vec<String>,
}

/// The parts of a [`ModelReport`].
#[derive(Debug)]
pub struct ReportInput<'a> {
    /// Facts about the volume's file.
    pub input: FileFacts,
    /// Every parameter by its name, defaults written out.
    pub parameters: Map<String, Value>,
    /// Result of the surface stage.
    pub surface: &'a Surface,
    /// Result of re-tiling.
    pub tiled: &'a Tiled,
    /// Result of optimisation.
    pub optimised: &'a Optimised,
    /// The parameters that drove it.
    pub optimise_parameters: &'a OptimiseParameters,
    /// Measures of `optimised.mesh`.
    pub measures: Measures,
    /// The models of which it is the best, itself among them.
    pub starts: Vec<StartSummary>,
    /// Milliseconds by stage, in order.
    pub timings_ms: Vec<(String, f64)>,
}

impl ModelReport {
    /// Joins the stages' facts and the model's measures.
    pub fn new(input: ReportInput) -> Self {
        let retiled = Elements::measure(&input.tiled.mesh);
        let measures = input.measures;
        let surface = stage_facts::surface(input.surface);
        let mut warnings = stage_facts::warnings(input.surface, input.tiled, input.optimised);
        warnings.extend(flags(&measures.mesh, &surface, input.tiled));
        warnings.extend(coarseness(&measures));
        warnings.extend(volume_lost(&input.surface.facts, &measures.mesh));
        Self {
            software: Program::this(),
            input: input.input,
            parameters: input.parameters,
            surface,
            retile: stage_facts::retile(input.tiled, &retiled, input.starts),
            optimise: stage_facts::optimise(&input.optimised.facts),
            histograms: Histograms::new(&retiled, &measures.elements),
            mesh: measures.mesh,
            shape: measures.shape,
            smoothness: measures.smoothness,
            distance: measures.distance,
            fitness: stage_facts::fitness(input.optimised, input.optimise_parameters),
            timings_ms: timings(input.timings_ms),
            warnings,
        }
    }

    /// Whether the model keeps its promises: a closed, oriented manifold that faces outward
    /// (walls of cavities inward, as on the surface), with the surface's topology and no
    /// self-intersection.
    pub fn is_sound(&self) -> bool {
        let mesh = &self.mesh;
        mesh.manifold.defect.is_none()
            && mesh.manifold.outward
            && mesh.self_intersections == 0
            && mesh.euler_characteristic == self.surface.euler_characteristic
            && mesh.components == self.surface.components
            && mesh.manifold.outward_components == self.surface.outward_components
    }

    /// The report as indented JSON text.
    pub fn to_json_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("every key of the report is a string")
    }

    /// The main figures, one sentence a line.
    pub fn headlines(&self) -> Vec<String> {
        let (mesh, shape, distance) = (&self.mesh, &self.shape, &self.distance);
        let mask = self.surface.mask_ml.map(|mask| {
            let model = self.mesh.volume_ml;
            let off = 100.0 * (model / mask - 1.0);
            let [mask, model] = [mask, model].map(millilitres);
            format!("mask {mask} ml, model {model} ml ({off:+.2} %)")
        });
        let lines = vec![
            format!(
                "{} points, {} triangles, Euler characteristic {}, {} self-intersections",
                mesh.vertices, mesh.triangles, mesh.euler_characteristic, mesh.self_intersections
            ),
            format!(
                "fitness {:.3} after re-tiling, {:.3} optimised ({:+.1} %)",
                self.fitness.retiled, self.fitness.optimised, self.fitness.gain_percent
            ),
            format!(
                "radius ratio 2r/R {:.3} mean, {:.3} least; {:.1}° mean angle between neighbours",
                shape.radius_ratio.mean, shape.radius_ratio.min, self.smoothness.dihedral_deg.mean
            ),
            format!(
                "{:.2} mm mean and {:.2} mm largest distance to the surface, volume {:+.2} %",
                distance.mean_mm, distance.hausdorff_mm, distance.volume_error_percent
            ),
        ];
        lines.into_iter().chain(mask).collect()
    }

    /// The main figures.
    pub fn summary(&self) -> ModelSummary {
        ModelSummary {
            vertices: self.mesh.vertices,
            triangles: self.mesh.triangles,
            euler_characteristic: self.mesh.euler_characteristic,
            self_intersections: self.mesh.self_intersections,
            radius_ratio_mean: self.shape.radius_ratio.mean,
            radius_ratio_min: self.shape.radius_ratio.min,
            dihedral_mean_deg: self.smoothness.dihedral_deg.mean,
            distance_mean_mm: self.distance.mean_mm,
            hausdorff_mm: self.distance.hausdorff_mm,
            volume_error_percent: self.distance.volume_error_percent,
            fitness: self.fitness.optimised,
        }
    }

    /// The figures that mesh files carry: the summary without the number of triangles.
    pub fn quality_summary(&self) -> Map<String, Value> {
        let mut figures = object(&self.summary());
        figures.shift_remove("triangles");
        figures
    }
}

/// Deviation of a model's volume from its mask's above which there is a warning.
const VOLUME_SLACK: f64 = 0.02;

/// A volume with enough digits for objects of any size.
fn millilitres(volume: f64) -> String {
    match (1e-2..1e6).contains(&volume) {
        true => format!("{volume:.3}"),
        false => format!("{volume:.3e}"),
    }
}

/// A sentence if the model of a mask does not have the volume of the mask's voxels.
fn volume_lost(surface: &SurfaceFacts, mesh: &MeshFacts) -> Option<String> {
    let mask = surface.mask_ml?;
    let off = mesh.volume_ml / mask - 1.0;
    (off.abs() > VOLUME_SLACK).then(|| {
        format!(
            "The model encloses {} ml and the mask's voxels have {} ml ({:+.1} %): parts left out, cavities \
             and handles removed, an `iso` of one's own, or too few `points`.",
            millilitres(mesh.volume_ml),
            millilitres(mask),
            100.0 * off
        )
    })
}

/// Sentences about the promises that a model breaks.
fn flags(mesh: &MeshFacts, surface: &SurfaceReport, tiled: &Tiled) -> Vec<String> {
    let mut flags = Vec::new();
    if let Some(defect) = &mesh.manifold.defect {
        flags.push(format!("The model is not a closed manifold: {defect}."));
    }
    if mesh.self_intersections > 0 {
        let n = mesh.self_intersections;
        flags.push(format!(
            "The model intersects itself: {n} pairs of triangles."
        ));
    }
    if mesh.euler_characteristic != surface.euler_characteristic {
        flags.push(format!(
            "The model's Euler characteristic is {}, the surface's {}.",
            mesh.euler_characteristic, surface.euler_characteristic
        ));
    }
    if mesh.manifold.outward_components != surface.outward_components {
        flags.push(format!(
            "Components of the model that face outward: {}, of the surface: {}.",
            mesh.manifold.outward_components, surface.outward_components
        ));
    }
    if mesh.vertices != tiled.mesh.vertices.len() {
        flags.push(format!(
            "The model has {} vertices, the re-tiled surface {}.",
            mesh.vertices,
            tiled.mesh.vertices.len()
        ));
    }
    flags
}

/// Percent of the surface's volume beyond which a difference of the model's is a warning. Models
/// of left ventricles differ by less than 0.1 %.
const VOLUME_DOUBT_PERCENT: f64 = 10.0;

/// A warning where a sound model has too few points for its surface: parts of the surface that are
/// thinner than the points' spacing are lost.
fn coarseness(measures: &Measures) -> Option<String> {
    let percent = measures.distance.volume_error_percent;
    let points = measures.mesh.vertices;
    (percent.abs() > VOLUME_DOUBT_PERCENT).then(|| {
        format!(
            "The model's volume differs from the surface's by {percent:+.0} %: {points} points \
             are too few to follow this surface."
        )
    })
}

fn timings(stages: Vec<(String, f64)>) -> Map<String, Value> {
    let total: f64 = stages.iter().map(|(_, ms)| ms).sum();
    let mut timings: Map<String, Value> = stages
        .into_iter()
        .map(|(stage, ms)| (stage, ms.into()))
        .collect();
    timings.insert("total".into(), total.into());
    timings
}
