//! Improves a mesh with a fixed number of vertices: least-squares fit and greedy edge flips.
//!
//! In: the re-tiled surface and the [`Reference`] surface it was made from. Out: a mesh with
//! the same number of vertices and the same topology, and its fitness before and after.
//!
//! 1. [`fit`] moves the vertices off the surface so that the whole model, not just its
//!    vertices, lies as close to it as possible, and makes the triangles more regular. The
//!    paper has no such step; with [`LeastSquaresParameters::rounds`] = 0 it is skipped and the
//!    vertices stay where they are.
//! 2. [`flips`] flips edges greedily by the four-term [`fitness`] (Algorithms 1 and 2 of the
//!    paper) as long as there are flips that gain and that [`legality`] allows.
//!
//! Guaranteed:
//! - Flips never lower the mean fitness in the form that they increase; with [`Gain::Total`]
//!   every flip raises it. The fit never lowers both that form and the robust one.
//! - The mesh stays a closed manifold of the same genus.
//! - No two triangles intersect that did not before (exact tests).
//! - The result does not depend on the number of threads.
//!
//! Not guaranteed: good triangles under [`FitnessForm::Raw`]. Its reciprocals reward nearly
//! flat pairs of triangles without bound, and flips make such pairs at the expense of slivers:
//! the radius ratio 2r/R falls to 0.03 in places unless the `guard` prevents it. Its gain in
//! percent mainly reflects how bad the start was, so consider it together with shape.

mod configurations;
mod fit;
pub mod fitness;
mod flips;
mod legality;
mod parameters;
mod reference;

use configurations::Configurations;
use flips::{FlipRules, SweepResult};

use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::mesh::TriMesh;
use crate::mesh::half_edges::HalfEdges;
use crate::mesh::intersections::self_intersections;
use crate::mesh::topology::MeshDefect;
use crate::surface::retile::Tiled;

pub use fitness::{FitnessForm, FitnessFunction, FitnessSummary, Lengths};
pub use parameters::{Gain, LeastSquaresParameters, OptimiseParameters};
pub use reference::Reference;

/// The optimised mesh.
#[derive(Debug, Clone)]
pub struct Optimised {
    /// As many vertices as before, the same topology.
    pub mesh: TriMesh,
    /// The mesh after the fit and before the flips.
    pub fitted_mesh: TriMesh,
    /// Fitness of the re-tiled mesh.
    pub retiled: FitnessSummary,
    /// Fitness after the fit and before the flips; equals `retiled` if there was no fit.
    pub fitted: FitnessSummary,
    /// Fitness of the optimised mesh.
    pub optimised: FitnessSummary,
    /// The lengths to which distances were related.
    pub lengths: Lengths,
    /// The facts of the optimisation.
    pub facts: OptimiseFacts,
}

/// Facts of [`optimise`]; part of the report.
#[derive(Debug, Clone, Default)]
pub struct OptimiseFacts {
    /// Number of edges flipped by the greedy sweeps.
    pub flips: usize,
    /// Number of sweeps.
    pub sweeps: usize,
    /// Why the sweeps ended.
    pub ended: Ended,
    /// Number of rounds of the fit.
    pub fit_rounds: usize,
    /// Number of edges flipped during the fit.
    pub fit_flips: usize,
    /// Number of rounds whose step was shortened because triangles would have turned over or
    /// intersected.
    pub fit_shortened: usize,
    /// Number of intersecting pairs of triangles in the re-tiled mesh.
    pub self_intersections_before: usize,
    /// Number of intersecting pairs of triangles in the optimised mesh; none of them is new.
    pub self_intersections: usize,
    /// Warnings for the user, as sentences.
    pub warnings: Vec<String>,
}

/// Why the sweeps of flips ended.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Ended {
    /// No legal flip gains.
    #[default]
    NoFlipGains,
    /// An earlier triangulation came back ([`Gain::Local`] only); the best one is returned.
    Cycle,
    /// The maximum number of sweeps was run; the best triangulation is returned.
    SweepLimit,
}

/// Why a mesh could not be optimised.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptimiseError {
    /// The mesh is not a closed manifold.
    #[error("the mesh to optimise is not a closed manifold: {0}")]
    NotClosed(#[from] MeshDefect),
    /// A parameter is outside its range.
    #[error("{field} is {value}; it must lie in {least}..={most}")]
    Parameter {
        /// Name of the parameter.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Smallest allowed value.
        least: f64,
        /// Largest allowed value.
        most: f64,
    },
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Optimises `tiled` against `reference`: first the fit, if it has any rounds, then the flips.
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
        let relaxed = sweep_with_relaxed_guard(&moved, reference, rules, &mut facts, monitor)?;
        flipped = relaxed.unwrap_or(flipped);
    }
    facts.flips = flipped.flips;
    facts.sweeps = flipped.sweeps;
    facts.ended = flipped.ended;
    let mesh = TriMesh {
        vertices: moved.vertices.clone(),
        triangles: flipped.triangles,
    };
    let optimised = configurations(&mesh, reference)?.summary(parameters.weights);
    facts.self_intersections = self_intersections(&mesh).len();
    monitor.report(Stage::Optimise, 1.0)?;
    Ok(Optimised {
        mesh,
        fitted_mesh: moved,
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
/// The first [`MeshDefect`] of a mesh that is not a closed manifold.
pub fn assess(
    mesh: &TriMesh,
    reference: &Reference,
    weights: [f64; 4],
) -> Result<FitnessSummary, MeshDefect> {
    Ok(configurations(mesh, reference)?.summary(weights))
}

/// Factors of the guard, tried in this order if neither the fit nor the flips improved the
/// mesh: on rugged surfaces every gain costs some shape.
const RELAXED_GUARDS: [f64; 4] = [0.75, 0.5, 0.25, 0.0];

/// The flips under the first relaxed guard that allows any; `None` if none does.
fn sweep_with_relaxed_guard(
    mesh: &TriMesh,
    reference: &Reference,
    mut rules: FlipRules,
    facts: &mut OptimiseFacts,
    monitor: &Monitor,
) -> Result<Option<SweepResult>, OptimiseError> {
    let requested = rules.guard;
    for factor in RELAXED_GUARDS {
        rules.guard = requested * factor;
        let tried = flips::sweep(configurations(mesh, reference)?, &rules, monitor)?;
        if tried.flips > 0 {
            facts.warnings.push(format!(
                "no flip gained under the guard of {requested}; it was eased to {:.2}",
                rules.guard
            ));
            return Ok(Some(tried));
        }
    }
    Ok(None)
}

/// The fitted mesh, or the original one if the fit would lower the mean fitness both in the
/// form that flips increase and in the robust one. A single one may fall without fault: the
/// normalised form ignores distances below a hundredth of an edge and only registers that a
/// close fit to a noisy surface is less flat; the robust one rates a start whose vertices lie
/// on a flat part of the surface as perfect there.
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
    let fitted = fit::fit(
        &tiled.mesh.vertices,
        start.half_edges().clone(),
        &tiled.sizing,
        reference,
        &parameters.fit,
        monitor,
    )?;
    facts.fit_rounds = fitted.rounds;
    let state = configurations(&fitted.mesh, reference)?;
    let lengths = reference.lengths(tiled.mesh.triangles.len());
    let robust = FitnessFunction::new(FitnessForm::Robust, [1.0; 4], lengths);
    let falls = |fitness: &FitnessFunction| state.mean(fitness) < start.mean(fitness);
    if falls(&parameters.fitness(lengths)) && falls(&robust) {
        let warning = "the least-squares fit would have lowered the fitness and was not used";
        facts.warnings.push(warning.to_owned());
        return Ok(tiled.mesh.clone());
    }
    facts.fit_flips = fitted.flips;
    facts.fit_shortened = fitted.shortened;
    Ok(fitted.mesh)
}

fn configurations<'a>(
    mesh: &'a TriMesh,
    reference: &'a Reference,
) -> Result<Configurations<'a>, MeshDefect> {
    let half_edges = HalfEdges::new(mesh.vertices.len(), mesh.triangles.clone())?;
    Ok(Configurations::new(&mesh.vertices, half_edges, reference))
}
