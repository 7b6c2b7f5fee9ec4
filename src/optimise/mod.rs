//! A better mesh of the same points: least-squares fit and greedy edge flips.
//!
//! In goes the re-tiled surface and the [`Reference`] it was made from; out comes a mesh with
//! as many vertices and the same topology, and what was gained.
//!
//! 1. [`fit`] moves the vertices off the surface so that the whole model, not just its
//!    vertices, lies closest to it, and evens the triangles. The paper has no such step:
//!    [`FitParameters::rounds`] = 0 leaves it out, and the vertices stay where they are.
//! 2. [`flips`] flips edges greedily by the four-term [`fitness`] (the paper's Algorithms 1
//!    and 2) as long as that gains and [`legality`] lets it.
//!
//! Guaranteed: flips never lower the mean fitness in the form that drives them; with
//! [`Gain::Total`] every flip raises it. The fit never lowers it in that form and the robust
//! one both. The mesh stays a closed manifold of
//! the same genus; no two triangles come to pierce each other that did not before (exact
//! tests); the outcome does not depend on the number of threads.
//!
//! Not guaranteed: a good shape under [`FitnessForm::Raw`]. Its reciprocals reward pairs that
//! are nearly flat beyond all measure, and flips buy such pairs with slivers: the radius ratio
//! 2r/R falls to 0.03 in places unless the `guard` forbids it. Its gain in percent says how
//! bad the start was, so look at shape beside it.

mod configurations;
mod connectivity;
mod fit;
pub mod fitness;
mod flips;
mod legality;

use configurations::Configurations;
use connectivity::Connectivity;
use fitness::{Fitness, Lengths};
use flips::{FlipRules, Flipped};

use crate::geometry::Vec3;
use crate::geometry::bvh::Bvh;
use crate::mesh::TriMesh;
use crate::mesh::intersections::self_intersections;
use crate::mesh::topology::Defect;
use crate::progress::{Cancelled, Monitor, Stage};
use crate::retile::Tiled;
use crate::surface::Surface;

/// Which form of the fitness drives the flips.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FitnessForm {
    /// The paper's reciprocal terms, capped.
    Raw,
    /// Each term in (0, 1].
    Normalised,
    /// Reciprocals of angles in degrees and of millimetres: for comparison between tools.
    Robust,
}

/// What a flip must gain.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gain {
    /// The paper's: the flipped pair's own fitness.
    Local,
    /// The sum over every edge whose fitness changes.
    Total,
}

/// Parameters of [`optimise`].
#[derive(Debug, Clone, PartialEq)]
pub struct OptimiseParameters {
    /// Default [`FitnessForm::Normalised`].
    pub fitness: FitnessForm,
    /// Weights w1..w4 of the four terms A, B, C, D; not negative, not all zero. Default 1.
    pub weights: [f64; 4],
    /// Default [`Gain::Total`].
    pub gain: Gain,
    /// Radius ratio 2r/R, 0..=1, below which no flip may make a triangle unless it replaces
    /// one as bad; nor may a flip move its pair further from the surface. 0 lets slivers and
    /// stray pairs pass, as the paper does. Default 0.9.
    pub guard: f64,
    /// The least-squares fit.
    pub fit: FitParameters,
}

/// Parameters of the least-squares fit.
#[derive(Debug, Clone, PartialEq)]
pub struct FitParameters {
    /// Rounds, 0..=200; 0 leaves the vertices on the surface, as the paper does. Default 16: four
    /// more change no figure of shape or distance by 1 %.
    pub rounds: usize,
    /// Weight of triangle shape against squared distance, (0, 10]. Default 0.06.
    pub shape_weight: f64,
    /// How much more a misshapen triangle counts: its weight is 1 + this · (R/(2r) - 1), 0..=100.
    /// Default 3.
    pub worst_weight: f64,
    /// How far triangles may choose their own size, 0..=1: 0 draws all to one size (times the
    /// wanted relative spacing), 1 to the size that each has. Default 1.
    pub free_size: f64,
    /// How much more a distant sample counts: its weight is 1 + this · r²/mean r², 0..=10.
    /// Lowers the largest distance and, by less, the mean, at the cost of shapes and F. Default 0.02.
    pub peak_weight: f64,
    /// Weight of an even bend against squared distance, for triangles as small as a voxel; larger
    /// ones follow less noise and weigh in proportion less. 0..=10, default 0.07: lowers the
    /// largest distance and the angles between neighbours at the same mean distance.
    pub bend_weight: f64,
    /// Share of the last round's step that a round adds to its own, 0..=0.9. Default 0.6.
    pub momentum: f64,
    /// Weight of staying put, a share of the distances' weight spread over the vertices,
    /// (0, 1]. Default 0.0005.
    pub damping: f64,
    /// Samples of the surface for each of the model's triangles, 4..=200. Default 16.
    pub samples_per_triangle: usize,
    /// How many flips the fit looks ahead, 0..=4, to move irregular vertices together until they
    /// cancel; each more costs several times as much. Default 3.
    pub glide: usize,
    /// Weight of the distances of the model's own edge midpoints (term D) and triangle centres
    /// against those of the surface's samples, 0..=10. Default 1.
    pub midpoint_weight: f64,
}

impl Default for FitParameters {
    fn default() -> Self {
        Self {
            rounds: 16,
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
            fit: FitParameters::default(),
        }
    }
}

/// The reference surface with its search tree.
#[derive(Debug, Clone)]
pub struct Reference {
    /// S.
    pub mesh: TriMesh,
    /// Unit normal of every triangle of S.
    pub normals: Vec<Vec3>,
    /// Closest-point tree over S.
    pub bvh: Bvh,
    /// Smallest voxel spacing, mm: the unit of term D.
    pub spacing: f64,
}

impl Reference {
    /// Prepares `surface` for distance queries.
    pub fn new(surface: &Surface) -> Self {
        let mesh = surface.mesh.clone();
        let normals = (0..mesh.triangles.len())
            .map(|t| {
                mesh.area_normal(t)
                    .try_normalize(0.0)
                    .unwrap_or_else(Vec3::zeros)
            })
            .collect();
        let bvh = Bvh::new(&mesh.vertices, &mesh.triangles);
        Self {
            mesh,
            normals,
            bvh,
            spacing: surface.spacing,
        }
    }
}

impl Reference {
    /// What the distances of a mesh of so many triangles are held against.
    pub fn lengths(&self, triangles: usize) -> Lengths {
        let each = self.mesh.area() / triangles.max(1) as f64;
        Lengths {
            voxel: self.spacing,
            edge: (4.0 * each / 3f64.sqrt()).sqrt(),
        }
    }
}

/// Mean fitness over all edges, in the form that drove the flips and in both forms.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct FitnessSummary {
    /// Mean fitness in the raw form.
    pub raw: f64,
    /// Mean fitness in the normalised form, 0..=1.
    pub normalised: f64,
    /// Mean fitness in the robust form, equal weights.
    pub robust: f64,
    /// Mean of A, the angle between the two triangles' normals, radians.
    pub a_mean: f64,
    /// Mean of B, the angles to the outer neighbours, radians.
    pub b_mean: f64,
    /// Mean of C, R/(2r), 1 = equilateral.
    pub c_mean: f64,
    /// Mean of D, distance of the edge's midpoint to S, mm.
    pub d_mean: f64,
}

/// The optimised mesh.
#[derive(Debug, Clone)]
pub struct Optimised {
    /// As many vertices, the same topology.
    pub mesh: TriMesh,
    /// Fitness of the mesh that came in.
    pub retiled: FitnessSummary,
    /// Fitness after the fit, before the last flips; equals `retiled` without a fit.
    pub fitted: FitnessSummary,
    /// Fitness of the mesh that goes out.
    pub optimised: FitnessSummary,
    /// What distances were held against.
    pub lengths: Lengths,
    /// What was done.
    pub facts: OptimiseFacts,
}

/// Why the sweeps of flips ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ended {
    /// No legal flip gains.
    #[default]
    NoFlipGains,
    /// An earlier triangulation came back ([`Gain::Local`] only); the best one is returned.
    Cycle,
    /// The most sweeps allowed were run; the best triangulation is returned.
    SweepLimit,
}

/// What [`optimise`] did; goes into the report.
#[derive(Debug, Clone, Default)]
pub struct OptimiseFacts {
    /// Edges flipped by the greedy sweeps.
    pub flips: usize,
    /// Sweeps run.
    pub sweeps: usize,
    /// Why the sweeps ended.
    pub ended: Ended,
    /// Rounds of the fit run.
    pub fit_rounds: usize,
    /// Edges flipped for shape during the fit.
    pub fit_flips: usize,
    /// Rounds whose step was shortened, so that no triangle turned over or pierced another.
    pub fit_shortened: usize,
    /// Pairs of triangles that pierced each other in the mesh that came in.
    pub self_intersections_before: usize,
    /// Pairs of triangles that pierce each other in the mesh that goes out; never more pairs
    /// than came in, and none new.
    pub self_intersections: usize,
    /// Things a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Why there is no optimised mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptimiseError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// A parameter outside of its range.
    #[error("{field} is {value}; it must lie in {least}..={most}")]
    Parameter {
        /// Its name.
        field: &'static str,
        /// What was given.
        value: f64,
        /// Smallest value allowed.
        least: f64,
        /// Largest value allowed.
        most: f64,
    },
    /// The mesh that came in is no closed manifold.
    #[error("the mesh to optimise is not a closed manifold: {0}")]
    NotClosed(#[from] Defect),
}

/// Optimises `tiled` against `reference`: the fit, if rounds are asked for, then the flips.
///
/// # Errors
/// See [`OptimiseError`].
pub fn optimise(
    tiled: &Tiled,
    reference: &Reference,
    parameters: &OptimiseParameters,
    monitor: &Monitor,
) -> Result<Optimised, OptimiseError> {
    parameters.check()?;
    let mut facts = OptimiseFacts {
        self_intersections_before: self_intersections(&tiled.mesh).len(),
        ..OptimiseFacts::default()
    };
    let start = configurations(&tiled.mesh, reference)?;
    let retiled = start.summary(parameters.weights);

    let moved = fit_if_better(tiled, &start, reference, parameters, &mut facts, monitor)?;
    let state = configurations(&moved, reference)?;
    let fitted = state.summary(parameters.weights);

    let lengths = reference.lengths(tiled.mesh.triangles.len());
    let rules = FlipRules {
        fitness: parameters.fitness(lengths),
        gain: parameters.gain,
        guard: parameters.guard,
    };
    let mut flipped = flips::sweep(state, &rules, monitor)?;
    let unmoved = moved.vertices == tiled.mesh.vertices;
    if unmoved && flipped.flips == 0 && parameters.guard > 0.0 {
        let eased = sweep_with_eased_guard(&moved, reference, rules, &mut facts, monitor)?;
        flipped = eased.unwrap_or(flipped);
    }
    facts.flips = flipped.flips;
    facts.sweeps = flipped.sweeps;
    facts.ended = flipped.ended;
    let mesh = TriMesh {
        vertices: moved.vertices,
        triangles: flipped.triangles,
    };
    let optimised = configurations(&mesh, reference)?.summary(parameters.weights);
    facts.self_intersections = self_intersections(&mesh).len();
    monitor.report(Stage::Optimise, 1.0)?;
    Ok(Optimised {
        mesh,
        retiled,
        fitted,
        optimised,
        lengths,
        facts,
    })
}

/// The fitness of any closed mesh against `reference`, with the weights w1..w4.
///
/// # Errors
/// The first [`Defect`] of a mesh that is no closed manifold.
pub fn assess(
    mesh: &TriMesh,
    reference: &Reference,
    weights: [f64; 4],
) -> Result<FitnessSummary, Defect> {
    Ok(configurations(mesh, reference)?.summary(weights))
}

/// Shares of the guard that are tried, in this order, where neither fit nor flips could better
/// the mesh: on rugged surfaces every gain costs some shape.
const EASED_GUARDS: [f64; 4] = [0.75, 0.5, 0.25, 0.0];

/// The flips under the first eased guard under which there are any; `None` if under none.
fn sweep_with_eased_guard(
    mesh: &TriMesh,
    reference: &Reference,
    mut rules: FlipRules,
    facts: &mut OptimiseFacts,
    monitor: &Monitor,
) -> Result<Option<Flipped>, OptimiseError> {
    let asked = rules.guard;
    for share in EASED_GUARDS {
        rules.guard = asked * share;
        let tried = flips::sweep(configurations(mesh, reference)?, &rules, monitor)?;
        if tried.flips > 0 {
            facts.warnings.push(format!(
                "no flip gained under the guard of {asked}; it was eased to {:.2}",
                rules.guard
            ));
            return Ok(Some(tried));
        }
    }
    Ok(None)
}

/// The fitted mesh, or the one that came in where the fit would lower the mean fitness in the
/// form that drives *and* in the robust one. One alone may fall for reasons that are no fault:
/// the normalised form is blind to distances below a hundredth of an edge and sees only that a
/// close fit to a noisy surface is less flat; the robust one takes a start whose vertices lie
/// on a flat part of the surface for perfect there.
fn fit_if_better(
    tiled: &Tiled,
    start: &Configurations,
    reference: &Reference,
    parameters: &OptimiseParameters,
    facts: &mut OptimiseFacts,
    monitor: &Monitor,
) -> Result<TriMesh, OptimiseError> {
    if parameters.fit.rounds == 0 {
        return Ok(tiled.mesh.clone());
    }
    let moved = fit::fit(
        &tiled.mesh.vertices,
        start.connectivity().clone(),
        &tiled.sizing,
        reference,
        &parameters.fit,
        monitor,
    )?;
    facts.fit_rounds = moved.rounds;
    let state = configurations(&moved.mesh, reference)?;
    let lengths = reference.lengths(tiled.mesh.triangles.len());
    let robust = Fitness::new(FitnessForm::Robust, [1.0; 4], lengths);
    let falls = |fitness: &Fitness| state.mean(fitness) < start.mean(fitness);
    if falls(&parameters.fitness(lengths)) && falls(&robust) {
        let warning = "the least-squares fit would have lowered the fitness and was not used";
        facts.warnings.push(warning.to_owned());
        return Ok(tiled.mesh.clone());
    }
    facts.fit_flips = moved.flips;
    facts.fit_shortened = moved.shortened;
    Ok(moved.mesh)
}

fn configurations<'a>(
    mesh: &'a TriMesh,
    reference: &'a Reference,
) -> Result<Configurations<'a>, Defect> {
    let connectivity = Connectivity::new(mesh.vertices.len(), mesh.triangles.clone())?;
    Ok(Configurations::new(&mesh.vertices, connectivity, reference))
}

impl OptimiseParameters {
    fn fitness(&self, lengths: Lengths) -> Fitness {
        Fitness::new(self.fitness, self.weights, lengths)
    }

    /// Refuses what no stage could work with.
    fn check(&self) -> Result<(), OptimiseError> {
        let fit = &self.fit;
        for (index, weight) in self.weights.into_iter().enumerate() {
            let field = ["weights.w1", "weights.w2", "weights.w3", "weights.w4"][index];
            within(field, weight, 0.0, 1e6)?;
        }
        within(
            "the sum of the weights",
            self.weights.iter().sum(),
            1e-6,
            4e6,
        )?;
        within("guard", self.guard, 0.0, 1.0)?;
        within("fit.rounds", fit.rounds as f64, 0.0, 200.0)?;
        within("fit.shape_weight", fit.shape_weight, 1e-6, 10.0)?;
        within("fit.worst_weight", fit.worst_weight, 0.0, 100.0)?;
        within("fit.free_size", fit.free_size, 0.0, 1.0)?;
        within("fit.peak_weight", fit.peak_weight, 0.0, 10.0)?;
        within("fit.bend_weight", fit.bend_weight, 0.0, 10.0)?;
        within("fit.momentum", fit.momentum, 0.0, 0.9)?;
        within("fit.glide", fit.glide as f64, 0.0, 4.0)?;
        within("fit.midpoint_weight", fit.midpoint_weight, 0.0, 10.0)?;
        within("fit.damping", fit.damping, 1e-6, 1.0)?;
        within(
            "fit.samples_per_triangle",
            fit.samples_per_triangle as f64,
            4.0,
            200.0,
        )
    }
}

fn within(field: &'static str, value: f64, least: f64, most: f64) -> Result<(), OptimiseError> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(OptimiseError::Parameter {
            field,
            value,
            least,
            most,
        })
    }
}
