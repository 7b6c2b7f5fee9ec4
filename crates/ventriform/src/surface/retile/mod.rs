//! Re-tiling: replaces a surface by a mesh with exactly N evenly distributed vertices.
//!
//! In: a closed surface S with its smoothed twin W. Out: a closed mesh with exactly N vertices,
//! which lie on S, and the topology of S. After Turk, "Re-Tiling Polygonal Surfaces", SIGGRAPH
//! 1992 (doi:10.1145/133994.134008), by two methods.
//!
//! [`Method::Paper`]:
//! 1. [`placement`]: random points, uniform by area;
//! 2. [`repulsion`]: the points push each other apart along the surface ([`geodesics`]) and move
//!    on straight paths ([`trace`]);
//! 3. [`tessellate`]: mutual tessellation by constrained Delaunay triangulation, then removal of
//!    the old vertices;
//! 4. from the points of the new mesh the procedure is repeated until the result is good ([`paper`]).
//!
//! [`Method::Refined`]:
//! 1. [`surface_samples`]: the vertices of the surface, subdivided finely enough for N cells;
//! 2. [`cells`]: centroidal cells of these samples, grown from random ones;
//! 3. [`dual`]: a triangle where three cells meet. If the result has another topology or
//!    intersects itself, [`refined`] moves points and tries again.
//!
//! In both methods [`sizing`] makes the points denser where curvature is high. Lengths are
//! measured on W, since noise and voxel steps make paths on S too long. A point, given by a
//! triangle and barycentric coordinates, lies on both.
//!
//! Guaranteed for the result:
//! - exactly N vertices;
//! - closed, edge- and vertex-manifold, with the components and the Euler characteristic of S;
//! - every component has the orientation that it has on S ([`orientation`]);
//! - no self-intersection (tested exactly);
//! - the same input gives the same bytes, whatever the number of threads.
//!
//! Not guaranteed: that N points suffice for every surface. [`RetileError::TooFewPoints`] names a
//! number that does.

mod cells;
mod clipping;
mod domain;
mod dual;
pub mod geodesics;
mod orientation;
mod paper;
mod placement;
mod quotas;
mod refined;
mod repulsion;
mod sizing;
mod split;
mod surface_samples;
pub mod tessellate;
mod trace;

use crate::base::geometry::Vec3;
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::mesh::topology::MeshDefect;
use crate::mesh::{FaceId, TriMesh};
use crate::surface::Surface;

pub use geodesics::Geodesics;

/// Smallest number of points of a model: that of an icosahedron.
pub const LEAST_POINTS: usize = 12;

/// Largest number of points of a model.
pub const MOST_POINTS: usize = 50_000;

/// The method of re-tiling.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// The paper's method: random points, geodesic repulsion, mutual tessellation by constrained
    /// Delaunay triangulation, removal of the old vertices.
    Paper,
    /// Centroidal Voronoi cells and their dual mesh.
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
    /// Exponent γ of the adaptation to curvature, spacing ∝ curvature^-γ, 0..=1. 0 is even
    /// spacing, as in the paper. Default 0.25.
    pub adaptive: f64,
    /// Where spacing starts to adapt: the rise of the surface's arc over one edge of evenly
    /// spaced points, in percent of the square root of the surface's area, 0..=100. What such
    /// points resolve needs no denser ones. 0 adapts everywhere. Default 0.8.
    pub adaptive_from: f64,
    /// Number of rounds of repulsion ([`Method::Paper`]), 0..=1000. Default 40.
    pub repulsion_iterations: usize,
    /// Fraction of the overlap by which one round of repulsion moves points, (0, 1].
    /// Default 0.15 (Turk).
    pub repulsion_strength: f64,
    /// Most repetitions of the procedure, each from the points of the mesh before
    /// ([`Method::Paper`]), 0..=100. It ends earlier when the triangles' shape no longer improves.
    /// Default 8.
    pub repeats: usize,
    /// Distances that repulsion uses ([`Method::Paper`]). Default [`Geodesics::Approximate`];
    /// exact ones are for validation.
    pub geodesics: Geodesics,
    /// Largest number of rounds of relaxation ([`Method::Refined`]), 0..=1000; of 600 points and more, of the first
    /// relaxation of fewer cells, after which those of more take three tenths of it each. Default 50; 80 make
    /// triangles more regular by .001 of 2r/R.
    pub relaxation_iterations: usize,
    /// Number of the last rounds of relaxation that cut triangles between cells to find the cells' centroids;
    /// those before count whole samples. Default 20. Requests cannot set it; the built-in hearts were made
    /// with exact centroids in all rounds.
    pub exact_rounds: usize,
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
            repeats: 8,
            geodesics: Geodesics::Approximate,
            relaxation_iterations: 50,
            exact_rounds: 20,
        }
    }
}

/// A point on the surface: on S and on W at the same time, since both have the same triangles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SurfacePoint {
    /// The triangle that contains the point.
    pub triangle: FaceId,
    /// Barycentric coordinates in it: positive, with sum 1.
    pub barycentric: [f64; 3],
}

impl SurfacePoint {
    /// The position of the point for the given positions of the vertices, those of S or of W.
    pub fn position(&self, vertices: &[Vec3], triangles: &[[u32; 3]]) -> Vec3 {
        let [a, b, c] = triangles[self.triangle.index()].map(|v| vertices[v as usize]);
        let [u, v, w] = self.barycentric;
        a * u + b * v + c * w
    }
}

/// The re-tiled surface.
#[derive(Debug, Clone)]
pub struct Tiled {
    /// Closed mesh with exactly N vertices on S (LPS mm) and the topology of S.
    pub mesh: TriMesh,
    /// Wanted spacing at each vertex relative to the mean: 1 everywhere unless adaptive.
    pub sizing: Vec<f64>,
    /// The facts of the re-tiling.
    pub facts: RetileFacts,
}

/// Facts of [`retile`]; part of the report.
#[derive(Debug, Clone, Default)]
pub struct RetileFacts {
    /// Seed of every random choice.
    pub seed: u64,
    /// Number of rounds of repulsion, each time.
    pub repulsion_rounds: usize,
    /// Number of times that the procedure was repeated ([`Method::Paper`]).
    pub repeats: usize,
    /// Number of rounds of centroidal relaxation.
    pub relaxation_rounds: usize,
    /// Number of attempts (new seeds, repairs) until the mesh had the surface's topology.
    pub attempts: usize,
    /// Warnings for the user, as sentences.
    pub warnings: Vec<String>,
}

/// Why a surface could not be re-tiled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum RetileError {
    /// The surface is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] MeshDefect),
    /// The surface has no area, or a coordinate that is not finite.
    #[error("the area of the surface is not a positive, finite number")]
    NoArea,
    /// N points are too few for the surface's handles and components.
    #[error("{points} points are too few for the topology of the surface; {needed} suffice")]
    TooFewPoints {
        /// The requested number of points.
        points: usize,
        /// A number that suffices, with the same method and seed.
        needed: usize,
    },
    /// N points are too few for the surface's topology, and so are all larger numbers tried.
    #[error(
        "{points} points are too few for the topology of the surface, and so are all numbers tried, up to {tried}"
    )]
    NotCarried {
        /// The requested number of points.
        points: usize,
        /// The largest number tried.
        tried: usize,
    },
    /// More points than are supported.
    #[error("{points} points are too many; at most {limit} are supported")]
    TooManyPoints {
        /// The requested number of points.
        points: usize,
        /// The largest supported number.
        limit: usize,
    },
    /// The surface intersects itself, so a mesh of that many points on it would, too.
    #[error(
        "the surface intersects itself near ({:.1}, {:.1}, {:.1}) mm (LPS), and so would a mesh \
         of {points} points",
        place[0], place[1], place[2]
    )]
    SelfIntersecting {
        /// The requested number of points.
        points: usize,
        /// Position of the intersection, LPS mm.
        place: [f64; 3],
    },
    /// A parameter is outside its range.
    #[error("{name} is {value}; it must lie in {range}")]
    BadParameter {
        /// The field of [`RetileParameters`].
        name: &'static str,
        /// Its value.
        value: f64,
        /// The allowed range.
        range: &'static str,
    },
    /// Cancelled by the caller.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
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

/// In the search for a sufficient N, N is doubled up to this multiple of the first number tried,
/// or up to [`LEAST_TRIED`] if that is more.
const NEEDED_FACTOR: usize = 16;

/// See [`NEEDED_FACTOR`].
const LEAST_TRIED: usize = 2000;

/// The error if `parameters.points` are too few for the topology of `surface`. It names a larger
/// number that suffices: `carries` tells whether re-tiling works with the given parameters.
fn too_few(
    surface: &Surface,
    parameters: &RetileParameters,
    carries: impl Fn(&RetileParameters) -> Result<bool, RetileError>,
) -> RetileError {
    let points = parameters.points;
    let mut tried = points;
    let mut needed = quotas::least_points(surface).max(points + 1);
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
    if p.repeats > 100 {
        return bad("repeats", p.repeats as f64, "0..=100");
    }
    if p.relaxation_iterations > 1000 {
        let value = p.relaxation_iterations as f64;
        return bad("relaxation_iterations", value, "0..=1000");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::surface::from_mesh;

    fn check(change: impl FnOnce(&mut RetileParameters)) -> Result<(), RetileError> {
        let mut parameters = RetileParameters::default();
        change(&mut parameters);
        validate(&parameters)
    }

    #[test]
    fn the_limits_of_the_number_of_points_are_allowed_and_what_is_beyond_is_not() {
        for fine in [LEAST_POINTS, MOST_POINTS] {
            assert!(check(|p| p.points = fine).is_ok(), "{fine}");
        }
        let few = check(|p| p.points = LEAST_POINTS - 1).unwrap_err();
        assert!(matches!(few, RetileError::TooFewPoints { needed, .. } if needed == LEAST_POINTS));
        let many = check(|p| p.points = MOST_POINTS + 1).unwrap_err();
        assert!(matches!(many, RetileError::TooManyPoints { limit, .. } if limit == MOST_POINTS));
    }

    #[test]
    fn each_parameter_is_refused_by_name_beyond_its_range() {
        let refused = |change: &dyn Fn(&mut RetileParameters)| match check(change) {
            Err(RetileError::BadParameter { name, .. }) => Some(name),
            _ => None,
        };
        type Setter = fn(&mut RetileParameters, f64);
        let cases: [(&str, Setter, [f64; 2], [f64; 2]); 6] = [
            ("adaptive", |p, x| p.adaptive = x, [0.0, 1.0], [-0.01, 1.01]),
            (
                "adaptive_from",
                |p, x| p.adaptive_from = x,
                [0.0, 100.0],
                [-0.01, 100.1],
            ),
            (
                "repulsion_strength",
                |p, x| p.repulsion_strength = x,
                [0.01, 1.0],
                [0.0, 1.01],
            ),
            (
                "repulsion_iterations",
                |p, x| p.repulsion_iterations = x as usize,
                [0.0, 1000.0],
                [1001.0, f64::INFINITY],
            ),
            (
                "repeats",
                |p, x| p.repeats = x as usize,
                [0.0, 100.0],
                [101.0, f64::INFINITY],
            ),
            (
                "relaxation_iterations",
                |p, x| p.relaxation_iterations = x as usize,
                [0.0, 1000.0],
                [1001.0, f64::INFINITY],
            ),
        ];
        for (name, set, fine, beyond) in cases {
            for x in fine {
                assert_eq!(refused(&|p| set(p, x)), None, "{name} {x}");
            }
            for x in beyond {
                assert_eq!(refused(&|p| set(p, x)), Some(name), "{x}");
            }
        }
        assert_eq!(refused(&|p| p.adaptive = f64::NAN), Some("adaptive"));
    }

    /// The numbers tried are doubled from the least that the topology needs, or from one more than was asked for.
    #[test]
    fn a_sufficient_number_is_searched_by_doubling() {
        let ring = from_mesh(shapes::torus(9.0, 3.0, 12, 6), 1.0).unwrap();
        let search = |points: usize, enough: usize| {
            let tried = std::cell::RefCell::new(Vec::new());
            let parameters = RetileParameters {
                points,
                seed: 5,
                ..RetileParameters::default()
            };
            let outcome = too_few(&ring, &parameters, |larger| {
                tried.borrow_mut().push(larger.points);
                let points = larger.points;
                let same = RetileParameters {
                    points,
                    ..parameters.clone()
                };
                assert_eq!(*larger, same);
                Ok(points >= enough)
            });
            (outcome, tried.into_inner())
        };
        let (outcome, tried) = search(4, 25);
        assert_eq!(tried, [7, 14, 28]);
        assert_eq!(
            outcome,
            RetileError::TooFewPoints {
                points: 4,
                needed: 28
            }
        );
        assert_eq!(search(20, 0).1, [21]);
        // Up to `LEAST_TRIED`, or to a multiple of the first number if that is more, but never beyond `MOST_POINTS`.
        for (points, most) in [
            (20, LEAST_TRIED),
            (399, NEEDED_FACTOR * 400),
            (4999, MOST_POINTS),
        ] {
            let (outcome, tried) = search(points, usize::MAX);
            let doubled = tried.windows(2).all(|pair| pair[1] == 2 * pair[0]);
            let last = tried[tried.len() - 1];
            assert!(doubled && tried[0] == points + 1);
            assert!(last <= most && 2 * last > most, "{last}");
            assert_eq!(
                outcome,
                RetileError::NotCarried {
                    points,
                    tried: last
                }
            );
        }
        let parameters = RetileParameters::default();
        let stopped = too_few(&ring, &parameters, |_| Err(Cancelled.into()));
        assert_eq!(stopped, RetileError::Cancelled(Cancelled));
    }

    #[test]
    fn surfaces_without_a_finite_area_are_refused() {
        let ball = shapes::icosphere(1.0, 1);
        for size in [0.0, 1e200] {
            let mut mesh = ball.clone();
            mesh.vertices.iter_mut().for_each(|v| *v *= size);
            let surface = from_mesh(mesh, 1.0).unwrap();
            let outcome = retile(&surface, &RetileParameters::default(), &Monitor::silent());
            assert_eq!(outcome.unwrap_err(), RetileError::NoArea);
        }
    }
}
