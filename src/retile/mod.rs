//! Exactly N evenly spread points on the surface, joined to triangles.
//!
//! In: a closed surface S with its smoothed twin W. Out: a closed mesh with exactly N vertices
//! that lie on S, of S's topology. After Turk, "Re-Tiling Polygonal Surfaces", SIGGRAPH 1992
//! (doi:10.1145/133994.134008), in two ways:
//!
//! [`Method::Paper`]
//! 1. [`placement`]: random points, uniform by area.
//! 2. [`repulsion`]: they push each other apart along the surface ([`geodesics`]: [`log_map`],
//!    or [`exact`] for validation; straight moves: [`trace`]).
//! 3. [`tessellate`]: mutual tessellation by constrained Delaunay, old vertices removed.
//!
//! [`Method::Refined`]
//! 1. [`samples`]: the surface's vertices, cut finely enough for N cells.
//! 2. [`cells`]: centroidal cells of samples, grown from random ones.
//! 3. [`dual`]: a triangle where three cells meet; where that does not carry the topology or
//!    pierces itself, [`refined`] transplants points and tries again.
//!
//! [`sizing`] makes the points denser where the surface bends, in both ways. Lengths are
//! taken on W, since noise and voxel steps make S longer than it is; a point (triangle and
//! barycentric coordinates) lies on both.
//!
//! **Guaranteed** for what is returned: exactly N vertices, closed, edge- and vertex-manifold,
//! components and Euler characteristic of S, each component facing as on S ([`orientation`]),
//! no self-intersection (checked exactly). **Not** guaranteed: that N points can carry every
//! surface; [`RetileError::TooFewPoints`] names a number that does. The same input gives the same bytes on any number of threads.

mod cells;
mod clipping;
mod domain;
mod dual;
mod exact;
pub mod geodesics;
mod log_map;
mod orientation;
mod paper;
mod placement;
mod quotas;
mod refined;
mod repulsion;
mod samples;
mod sizing;
pub mod tessellate;
mod trace;

use crate::geometry::Vec3;
use crate::mesh::TriMesh;
use crate::mesh::topology::Defect;
use crate::progress::{Cancelled, Monitor, Stage};
use crate::surface::Surface;

pub use geodesics::Geodesics;

/// Fewest points a model may have: an icosahedron's.
pub const LEAST_POINTS: usize = 12;

/// Most points a model may have.
pub const MOST_POINTS: usize = 50_000;

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
    /// Curvature-adaptive density: spacing ∝ curvature^-γ, γ in 0..=1, 0 for even spacing.
    /// Default 0.25; 0 is the paper's.
    pub adaptive: f64,
    /// Rise of the surface's arc over one edge of even spacing, in percent of the square root of
    /// the surface's area, 0..=100, from which on spacing adapts: what N even points resolve
    /// needs no denser ones. Default 0.8; 0 adapts everywhere.
    pub adaptive_from: f64,
    /// Rounds of geodesic repulsion ([`Method::Paper`]), 0..=1000. Default 40.
    pub repulsion_iterations: usize,
    /// Share of the overlap that one round of repulsion moves, (0, 1]. Default 0.15 (Turk).
    pub repulsion_strength: f64,
    /// Distances that repulsion goes by ([`Method::Paper`]). Default
    /// [`Geodesics::Approximate`]; exact ones are for validation.
    pub geodesics: Geodesics,
    /// Most rounds of centroidal relaxation ([`Method::Refined`]), 0..=1000. Default 80.
    pub relaxation_iterations: usize,
}

impl Default for RetileParameters {
    fn default() -> Self {
        Self {
            points: 150,
            seed: 1,
            method: Method::Refined,
            adaptive: 0.25,
            adaptive_from: 0.8,
            repulsion_iterations: 40,
            repulsion_strength: 0.15,
            geodesics: Geodesics::Approximate,
            relaxation_iterations: 80,
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
    /// Seed of every random choice.
    pub seed: u64,
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
    /// The surface is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] Defect),
    /// The surface has no area, or a coordinate that is not finite.
    #[error("the surface has no finite, positive area")]
    NoArea,
    /// N points cannot carry the surface's handles and components.
    #[error("{points} points cannot carry the surface's topology; {needed} do")]
    TooFewPoints {
        /// Points asked for.
        points: usize,
        /// Points that do, with the same method and seed.
        needed: usize,
    },
    /// Nor can any larger number that was tried.
    #[error("{points} points cannot carry the surface's topology, nor do up to {tried}")]
    NotCarried {
        /// Points asked for.
        points: usize,
        /// The largest number tried.
        tried: usize,
    },
    /// More points than the surface can carry.
    #[error("{points} points are more than the surface can carry; at most {limit}")]
    TooManyPoints {
        /// Points asked for.
        points: usize,
        /// Most points possible.
        limit: usize,
    },
    /// The surface's own triangles pierce each other: the model's would, too.
    #[error(
        "the surface pierces itself near ({:.1}, {:.1}, {:.1}) mm (LPS), and so would \
         {points} points",
        place[0], place[1], place[2]
    )]
    SelfIntersecting {
        /// Points asked for.
        points: usize,
        /// Where, LPS mm.
        place: [f64; 3],
    },
    /// A parameter is out of its range.
    #[error("{name} is {value}, outside {range}")]
    BadParameter {
        /// The field of [`RetileParameters`].
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it may be.
        range: &'static str,
    },
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
    validate(parameters)?;
    monitor.report(Stage::Retile, 0.0)?;
    let area = surface.mesh.area();
    if !(area > 0.0 && area.is_finite()) {
        return Err(RetileError::NoArea);
    }
    let mut tiled = match parameters.method {
        Method::Paper => paper::retile(surface, parameters, monitor),
        Method::Refined => refined::retile(surface, parameters, monitor),
    }?;
    tiled.facts.seed = parameters.seed;
    monitor.report(Stage::Retile, 1.0)?;
    Ok(tiled)
}

/// To tell which N would do, N is doubled as long as it stays below this multiple of the first
/// number tried (or this number).
const NEEDED_FACTOR: usize = 16;
const LEAST_TRIED: usize = 2000;

/// The error to give up with where `parameters.points` do not carry the topology of `surface`.
/// It names a larger number that does: `carries` begins as [`retile`] does with the parameters
/// it is handed, and tells whether that went well.
fn too_few(
    surface: &Surface,
    parameters: &RetileParameters,
    carries: impl Fn(&RetileParameters) -> Result<bool, RetileError>,
) -> RetileError {
    let points = parameters.points;
    let mut tried = points;
    let mut needed = quotas::least_points(&surface.mesh).max(points + 1);
    let most = MOST_POINTS.min(LEAST_TRIED.max(NEEDED_FACTOR * needed));
    while needed <= most {
        let larger = RetileParameters {
            points: needed,
            ..parameters.clone()
        };
        match carries(&larger) {
            Ok(true) => return RetileError::TooFewPoints { points, needed },
            Ok(false) => {}
            Err(error) => return error,
        }
        tried = needed;
        needed *= 2;
    }
    RetileError::NotCarried { points, tried }
}

fn validate(parameters: &RetileParameters) -> Result<(), RetileError> {
    let bad = |name, value, range| Err(RetileError::BadParameter { name, value, range });
    let p = parameters;
    if p.points < LEAST_POINTS {
        return Err(RetileError::TooFewPoints {
            points: p.points,
            needed: LEAST_POINTS,
        });
    }
    if p.points > MOST_POINTS {
        return Err(RetileError::TooManyPoints {
            points: p.points,
            limit: MOST_POINTS,
        });
    }
    if !(0.0..=1.0).contains(&p.adaptive) {
        return bad("adaptive", p.adaptive, "0..=1");
    }
    if !(0.0..=100.0).contains(&p.adaptive_from) {
        return bad("adaptive_from", p.adaptive_from, "0..=100");
    }
    if !(p.repulsion_strength > 0.0 && p.repulsion_strength <= 1.0) {
        return bad("repulsion_strength", p.repulsion_strength, "(0, 1]");
    }
    if p.repulsion_iterations > 1000 {
        let value = p.repulsion_iterations as f64;
        return bad("repulsion_iterations", value, "0..=1000");
    }
    if p.relaxation_iterations > 1000 {
        let value = p.relaxation_iterations as f64;
        return bad("relaxation_iterations", value, "0..=1000");
    }
    Ok(())
}
