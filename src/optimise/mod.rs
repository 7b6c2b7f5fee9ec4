//! A better mesh of the same points: least-squares fit and greedy edge flips.
//!
//! STUB: the owner of this folder writes the module page.

use crate::geometry::Vec3;
use crate::geometry::bvh::Bvh;
use crate::mesh::TriMesh;
use crate::progress::{Cancelled, Monitor};
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
    /// Whether a flip may not make a sliver. Default true.
    pub guard: bool,
    /// Rounds of the least-squares fit, 0..=200; 0 leaves the vertices on the surface.
    /// Default 40.
    pub fit_iterations: usize,
    /// Weight of triangle shape against distance in the fit, (0, 1]. Default 0.1.
    pub fit_shape_weight: f64,
}

impl Default for OptimiseParameters {
    fn default() -> Self {
        Self {
            fitness: FitnessForm::Normalised,
            weights: [1.0; 4],
            gain: Gain::Total,
            guard: true,
            fit_iterations: 40,
            fit_shape_weight: 0.1,
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
    /// What was done.
    pub facts: OptimiseFacts,
}

/// What [`optimise`] did; goes into the report.
#[derive(Debug, Clone, Default)]
pub struct OptimiseFacts {
    /// Edges flipped by the greedy sweeps.
    pub flips: usize,
    /// Sweeps run.
    pub sweeps: usize,
    /// Why the sweeps ended.
    pub ended: String,
    /// Rounds of the fit run.
    pub fit_rounds: usize,
    /// Things a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Why there is no optimised mesh.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum OptimiseError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Optimises `tiled` against `reference`.
///
/// # Errors
/// See [`OptimiseError`].
pub fn optimise(
    _tiled: &Tiled,
    _reference: &Reference,
    _parameters: &OptimiseParameters,
    _monitor: &Monitor,
) -> Result<Optimised, OptimiseError> {
    Err(OptimiseError::Cancelled(Cancelled))
}
