//! Distances and directions along the surface.
//!
//! In: a closed surface, a source point on it and a radius. Out: for every vertex and point
//! within the radius, its distance along the surface and the direction at the source in which
//! the path to it starts. There are two implementations of [`GeodesicMap`]: [`LogMap`] is an
//! approximation and fast, and is what repulsion uses; [`ExactMap`] is exact and about ten times
//! slower, and serves to validate the former and, as a parameter, the paper's method.

mod exact;
mod log_map;

use super::SurfacePoint;
use super::domain::Domain;
use crate::base::geometry::Vec2;
use crate::mesh::topology::MeshDefect;
use crate::mesh::{TriMesh, VertexId};

pub(super) use exact::ExactMap;
pub(super) use log_map::LogMap;

/// The distances that repulsion uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Geodesics {
    /// Discrete geodesic polar coordinates (Melvær & Reimers 2012).
    Approximate,
    /// Exact polyhedral distances (windows; Mitchell, Mount & Papadimitriou 1987).
    Exact,
}

/// The shortest path known from the source to some place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reach {
    /// Initial direction times distance, in the frame of the source's triangle, mm.
    pub vector: Vec2,
    /// Geodesic distance, mm.
    pub distance: f64,
}

impl Reach {
    /// No path is known yet.
    pub const UNKNOWN: Self = Self {
        vector: Vec2::new(0.0, 0.0),
        distance: f64::INFINITY,
    };
}

/// Distances and directions from one source. The memory is reused for the next source; clearing
/// it takes time proportional to what was visited.
pub(crate) trait GeodesicMap {
    /// An empty map.
    fn over(domain: &Domain) -> Self;

    /// Maps everything within `radius` mm of `source`.
    fn spread(&mut self, domain: &Domain, source: &SurfacePoint, radius: f64);

    /// The path to a vertex, if that lies within the radius.
    fn reach(&self, vertex: VertexId) -> Option<Reach>;

    /// The vertices within the radius and some just beyond it, in no particular order.
    fn visited(&self) -> &[VertexId];

    /// The path to a point of the surface, if that lies well within the radius.
    fn reach_point(&self, domain: &Domain, point: &SurfacePoint) -> Option<Reach>;
}

/// Why distances could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeodesicsError {
    /// The mesh is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] MeshDefect),
    /// The triangle of a point does not exist, or its barycentric coordinates are invalid.
    #[error("point {point} does not lie on the surface")]
    NotOnSurface {
        /// Its index among the sources followed by the targets.
        point: usize,
    },
}

/// The distances along `mesh` from each source (row) to each target (column), mm; `None` if
/// larger than `radius` mm. Points may lie on edges and vertices.
///
/// # Errors
/// See [`GeodesicsError`].
pub fn distances(
    mesh: &TriMesh,
    how: Geodesics,
    sources: &[SurfacePoint],
    targets: &[SurfacePoint],
    radius: f64,
) -> Result<Vec<Vec<Option<f64>>>, GeodesicsError> {
    let domain = Domain::new(mesh.vertices.clone(), mesh.triangles.clone())?;
    let stray = |p: &SurfacePoint| {
        let sum: f64 = p.barycentric.iter().sum();
        p.triangle.index() >= mesh.triangles.len()
            || !p.barycentric.iter().all(|x| *x >= 0.0)
            || !((sum - 1.0).abs() < 1e-6)
    };
    if let Some(point) = sources.iter().chain(targets).position(stray) {
        return Err(GeodesicsError::NotOnSurface { point });
    }
    Ok(match how {
        Geodesics::Approximate => table::<LogMap>(&domain, sources, targets, radius),
        Geodesics::Exact => table::<ExactMap>(&domain, sources, targets, radius),
    })
}

fn table<M: GeodesicMap>(
    domain: &Domain,
    sources: &[SurfacePoint],
    targets: &[SurfacePoint],
    radius: f64,
) -> Vec<Vec<Option<f64>>> {
    let mut map = M::over(domain);
    let mut row = |source| {
        map.spread(domain, source, radius);
        let distance = |target| Some(map.reach_point(domain, target)?.distance);
        let within = |target| distance(target).filter(|d| *d <= radius);
        targets.iter().map(within).collect()
    };
    sources.iter().map(&mut row).collect()
}
