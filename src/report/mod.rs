//! What a model is worth: measures, the report for machines and the page for people.
//!
//! [`measure`](measure::measure) looks at any mesh beside its reference surface S and says
//! what it is (counts, topology, self-intersections), how well-shaped (radius ratios,
//! angles, edge lengths, valences), how smooth (angles between neighbouring triangles) and
//! how close (two-sided distances, volume, area). [`Report::new`] joins these to what the
//! stages say of themselves. [`html()`] makes one self-contained page of it, coloured by
//! [`Closeness`]; [`html::segmentation()`] one of a segmentation's report.
//!
//! A report is JSON with stable names: lengths in millimetres, angles in degrees, volumes in
//! millilitres, as the names' endings say. Everything but `timings_ms` is the same for the
//! same input, parameters and seed, whatever the number of threads.

pub mod closeness;
pub mod distance;
pub mod elements;
mod facts;
pub mod html;
mod input;
pub mod measure;
pub mod summary;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

pub use closeness::Closeness;
pub use html::html;
pub use input::input;
pub use measure::{MeasureParameters, Measures, measure};

use crate::optimise::{FitnessSummary, OptimiseParameters, Optimised};
use crate::retile::Tiled;
use crate::surface::Surface;
use distance::Distance;
use elements::{Elements, Histograms, MeshFacts, Shape, Smoothness};

/// The report: `serde_json::to_value(&report)` is what the service answers. The page is made of
/// it when it is asked for, perhaps by a later version: a field that is added takes
/// `#[serde(default)]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Who made the model.
    pub software: Software,
    /// The volume it was made from.
    pub input: Value,
    /// Every parameter, defaults written out.
    pub parameters: Value,
    /// The iso-surface.
    pub surface: SurfaceSection,
    /// The re-tiled mesh, before optimisation.
    pub retile: RetileSection,
    /// What optimisation did.
    pub optimise: Map<String, Value>,
    /// The model: counts and topology.
    pub mesh: MeshFacts,
    /// The model: shape of its triangles.
    pub shape: Shape,
    /// The model: angles between neighbouring triangles.
    pub smoothness: Smoothness,
    /// The model beside the iso-surface.
    pub distance: Distance,
    /// The paper's fitness after each stage.
    pub fitness: Fitness,
    /// Distributions before and after optimisation.
    pub histograms: Histograms,
    /// Milliseconds of each stage and their `total`.
    pub timings_ms: Map<String, Value>,
    /// What a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Name and version.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Software {
    /// Always `ventriform`.
    pub name: String,
    /// The version.
    pub version: String,
}

impl Software {
    /// This program.
    pub fn this() -> Self {
        Self {
            name: env!("CARGO_PKG_NAME").into(),
            version: env!("CARGO_PKG_VERSION").into(),
        }
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
    /// What else the stage says of itself.
    #[serde(flatten)]
    pub facts: Map<String, Value>,
}

/// The re-tiled mesh's figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RetileSection {
    /// What the stage says of itself.
    #[serde(flatten)]
    pub facts: Map<String, Value>,
    /// Shape of the triangles before optimisation.
    pub shape: Shape,
    /// Angles between neighbouring triangles before optimisation.
    pub smoothness: Smoothness,
}

/// The paper's fitness: mean over all edges.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Fitness {
    /// The form that drove the flips; `retiled`, `fitted`, `optimised` speak it.
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
    pub forms: Stages<Forms>,
    /// Mean terms after each stage.
    pub terms: Stages<Terms>,
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
pub struct Forms {
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
pub struct Terms {
    /// A: angle between the edge's triangles' normals, degrees.
    pub a_deg: f64,
    /// B: mean angle to the four outer neighbours, degrees.
    pub b_deg: f64,
    /// C: R/(2r) of the two triangles, 1 = equilateral.
    pub c: f64,
    /// D: distance of the edge's midpoint to the surface, mm.
    pub d_mm: f64,
}

/// One of the models of which the best was kept.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Seed of its random choices.
    pub seed: u64,
    /// Mean 2r/R of its triangles.
    pub radius_ratio_mean: f64,
    /// Mean distance to the surface, two-sided, mm.
    pub distance_mean_mm: f64,
    /// Largest distance to the surface, two-sided, mm.
    pub hausdorff_mm: f64,
}

impl Start {
    /// The model made of `tiled`.
    pub fn new(tiled: &Tiled, measures: &Measures) -> Self {
        Self {
            seed: tiled.facts.seed,
            radius_ratio_mean: measures.shape.radius_ratio.mean,
            distance_mean_mm: measures.distance.mean_mm,
            hausdorff_mm: measures.distance.hausdorff_mm,
        }
    }
}

/// What [`Report::new`] joins.
#[derive(Debug)]
pub struct ReportInput<'a> {
    /// Facts about the volume, as the caller words them.
    pub input: Value,
    /// Every parameter by its name, defaults written out.
    pub parameters: Value,
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
    pub starts: Vec<Start>,
    /// Milliseconds by stage, in order.
    pub timings_ms: Vec<(String, f64)>,
}

impl Report {
    /// Joins the stages' facts and the model's measures.
    pub fn new(input: ReportInput) -> Self {
        let retiled = Elements::of(&input.tiled.mesh);
        let measures = input.measures;
        let surface = facts::surface(input.surface);
        let mut warnings = facts::warnings(input.surface, input.tiled, input.optimised);
        warnings.extend(doubts(&measures.mesh, &surface, input.tiled));
        warnings.extend(coarseness(&measures));
        Self {
            software: Software::this(),
            input: input.input,
            parameters: input.parameters,
            surface,
            retile: RetileSection {
                facts: facts::retile(&input.tiled.facts, &input.starts),
                shape: Shape::of(&retiled),
                smoothness: Smoothness::of(&retiled),
            },
            optimise: facts::optimise(&input.optimised.facts),
            histograms: Histograms::of(&retiled, &measures.elements),
            mesh: measures.mesh,
            shape: measures.shape,
            smoothness: measures.smoothness,
            distance: measures.distance,
            fitness: Fitness::new(input.optimised, input.optimise_parameters),
            timings_ms: timings(input.timings_ms),
            warnings,
        }
    }

    /// Whether the model is what was promised: a closed, oriented manifold that faces
    /// outward (walls of cavities inward, as on the surface), with the surface's topology and no
    /// self-intersection.
    pub fn is_sound(&self) -> bool {
        let mesh = &self.mesh;
        mesh.defect.is_none()
            && mesh.outward
            && mesh.self_intersections == 0
            && mesh.euler_characteristic == self.surface.euler_characteristic
            && mesh.components == self.surface.components
            && mesh.outward_components == self.surface.outward_components
    }

    /// The report as indented JSON text.
    pub fn to_json_text(&self) -> String {
        serde_json::to_string_pretty(self).expect("every key of the report is a string")
    }

    /// The figures that a person looks at first, one sentence a line.
    pub fn headlines(&self) -> Vec<String> {
        let (mesh, shape, distance) = (&self.mesh, &self.shape, &self.distance);
        vec![
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
        ]
    }

    /// The figures that a mesh file carries with it.
    pub fn quality_summary(&self) -> Map<String, Value> {
        let figures = [
            ("radius_ratio_mean", self.shape.radius_ratio.mean),
            ("radius_ratio_min", self.shape.radius_ratio.min),
            ("dihedral_mean_deg", self.smoothness.dihedral_deg.mean),
            ("distance_mean_mm", self.distance.mean_mm),
            ("hausdorff_mm", self.distance.hausdorff_mm),
            ("volume_error_percent", self.distance.volume_error_percent),
            ("fitness", self.fitness.optimised),
        ];
        let mut summary = Map::new();
        summary.insert("vertices".into(), self.mesh.vertices.into());
        let euler = self.mesh.euler_characteristic;
        summary.insert("euler_characteristic".into(), euler.into());
        let crossings = self.mesh.self_intersections;
        summary.insert("self_intersections".into(), crossings.into());
        summary.extend(figures.map(|(name, x)| (name.to_owned(), x.into())));
        summary
    }
}

/// Sentences about a model that is not what was promised.
fn doubts(mesh: &MeshFacts, surface: &SurfaceSection, tiled: &Tiled) -> Vec<String> {
    let mut doubts = Vec::new();
    if let Some(defect) = &mesh.defect {
        doubts.push(format!("The model is no closed manifold: {defect}."));
    }
    if mesh.self_intersections > 0 {
        let n = mesh.self_intersections;
        doubts.push(format!(
            "The model intersects itself: {n} pairs of triangles."
        ));
    }
    if mesh.euler_characteristic != surface.euler_characteristic {
        doubts.push(format!(
            "The model's Euler characteristic is {}, the surface's {}.",
            mesh.euler_characteristic, surface.euler_characteristic
        ));
    }
    if mesh.outward_components != surface.outward_components {
        doubts.push(format!(
            "Components of the model that face outward: {}, of the surface: {}.",
            mesh.outward_components, surface.outward_components
        ));
    }
    if mesh.vertices != tiled.mesh.vertices.len() {
        doubts.push(format!(
            "The model has {} vertices, the re-tiled surface {}.",
            mesh.vertices,
            tiled.mesh.vertices.len()
        ));
    }
    doubts
}

/// Percent of the surface's volume by which a model may differ without a word. Models of left
/// ventricles differ by less than a tenth of one.
const VOLUME_DOUBT_PERCENT: f64 = 10.0;

/// What a sound model lacks that has too few points for its surface: plates and rods of a
/// thousand voxels fall in between points that are farther apart than they are thick.
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

impl Fitness {
    fn new(optimised: &Optimised, parameters: &OptimiseParameters) -> Self {
        let stages = Stages {
            retiled: &optimised.retiled,
            fitted: &optimised.fitted,
            optimised: &optimised.optimised,
        };
        let driving = stages.map(|s| facts::driving_form(s, parameters.fitness));
        Self {
            form: facts::form_name(parameters.fitness).to_owned(),
            retiled: driving.retiled,
            fitted: driving.fitted,
            optimised: driving.optimised,
            gain_percent: 100.0 * (driving.optimised / driving.retiled - 1.0),
            weights: parameters.weights,
            scales: facts::scales(optimised.lengths),
            forms: stages.map(facts::forms),
            terms: stages.map(Terms::of),
        }
    }
}

impl<T> Stages<T> {
    fn map<U>(&self, f: impl Fn(&T) -> U) -> Stages<U> {
        Stages {
            retiled: f(&self.retiled),
            fitted: f(&self.fitted),
            optimised: f(&self.optimised),
        }
    }
}

impl Terms {
    fn of(summary: &&FitnessSummary) -> Self {
        Self {
            a_deg: summary.a_mean.to_degrees(),
            b_deg: summary.b_mean.to_degrees(),
            c: summary.c_mean,
            d_mm: summary.d_mean,
        }
    }
}
