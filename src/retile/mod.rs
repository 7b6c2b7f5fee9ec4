//! Exactly N evenly spread points on the surface, joined to triangles.
//!
//! STUB: the owner of this folder writes the module page.

mod cells;
mod dual;
mod refined;
mod samples;
mod sizing;
pub mod tessellate;

use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::progress::{Cancelled, Monitor};
use crate::surface::Surface;

/// Which route makes the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The paper's: random points, geodesic repulsion, mutual tessellation by constrained
    /// Delaunay, removal of the old vertices.
    Paper,
    /// Centroidal Voronoi points, their dual, and a least-squares fit to the surface.
    Refined,
}

/// Parameters of [`retile`].
#[derive(Debug, Clone, PartialEq)]
pub struct RetileParameters {
    /// Number of points N, 12..=50_000. Default 150.
    pub points: usize,
    /// Seed of every random choice. Default 1.
    pub seed: u64,
    /// Default [`Method::Refined`].
    pub method: Method,
    /// Curvature-adaptive density: spacing ∝ curvature^-γ, γ in 0..=1. Default 0 (even
    /// spacing); 0.25 is a good choice where the surface bends.
    pub adaptive: f64,
    /// Rounds of geodesic repulsion, 0..=1000. Default 40.
    pub repulsion_iterations: usize,
    /// Share of the overlap that one round of repulsion moves, (0, 1]. Default 0.15 (Turk).
    pub repulsion_strength: f64,
    /// Most rounds of centroidal relaxation ([`Method::Refined`]), 0..=1000. Default 110.
    pub relaxation_iterations: usize,
}

impl Default for RetileParameters {
    fn default() -> Self {
        Self {
            points: 150,
            seed: 1,
            method: Method::Refined,
            adaptive: 0.0,
            repulsion_iterations: 40,
            repulsion_strength: 0.15,
            relaxation_iterations: 110,
        }
    }
}

/// A point that lives on the surface: it lies on S and on W at the same time, since both
/// share their connectivity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// Index of the triangle.
    pub triangle: u32,
    /// Barycentric coordinates in it, each positive, sum 1.
    pub barycentric: [f64; 3],
}

impl SurfacePoint {
    /// The point's position for the given vertex positions (S's or W's).
    pub fn position(&self, vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec3 {
        let [a, b, c] = triangles[self.triangle as usize].map(|v| vertices[v as usize]);
        let [u, v, w] = self.barycentric;
        a * u + b * v + c * w
    }
}

/// The re-tiled surface.
#[derive(Debug, Clone)]
pub struct Tiled {
    /// Exactly N vertices on S (LPS mm), closed, same topology as S.
    pub mesh: TriMesh,
    /// Target spacing at each vertex relative to the mean (1 everywhere unless adaptive).
    pub sizing: Vec<f64>,
    /// What was done.
    pub facts: RetileFacts,
}

/// What [`retile`] did; goes into the report.
#[derive(Debug, Clone, Default)]
pub struct RetileFacts {
    /// Rounds of repulsion run.
    pub repulsion_rounds: usize,
    /// Rounds of centroidal relaxation run.
    pub relaxation_rounds: usize,
    /// Tries (reseeding, repairs) until the tessellation carried the topology.
    pub attempts: usize,
    /// Things a user should know, as sentences.
    pub warnings: Vec<String>,
}

/// Why the surface cannot be re-tiled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RetileError {
    /// Asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// N points cannot carry the surface's handles and components.
    #[error("{points} points cannot carry the surface's topology; about {needed} would")]
    TooFewPoints {
        /// Points asked for.
        points: usize,
        /// Points that would do.
        needed: usize,
    },
    /// More points than the surface can carry.
    #[error("{points} points are more than the surface can carry; at most {limit}")]
    TooManyPoints {
        /// Points asked for.
        points: usize,
        /// Most points possible.
        limit: usize,
    },
}

impl RetileError {
    /// What the caller can do about it.
    pub fn fix(&self) -> String {
        match self {
            RetileError::Cancelled(_) => "Ask again if the result is still wanted.".into(),
            RetileError::TooFewPoints { needed, .. } => {
                format!("Set `points` to {needed} or more, or `topology` to genus0.")
            }
            RetileError::TooManyPoints { limit, .. } => {
                format!("Set `points` to {limit} or fewer.")
            }
        }
    }
}

/// Re-tiles `surface`.
///
/// # Errors
/// See [`RetileError`].
pub fn retile(
    surface: &Surface,
    parameters: &RetileParameters,
    monitor: &Monitor,
) -> Result<Tiled, RetileError> {
    monitor.report(crate::progress::Stage::Retile, 0.0)?;
    refined::retile(surface, parameters, monitor)
}
