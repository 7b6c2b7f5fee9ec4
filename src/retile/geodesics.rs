//! Distances and directions along the surface, in two ways.
//!
//! A [`GeodesicMap`] tells, for everything within a radius of one surface point, how far it
//! lies along the surface and in which direction a walker must set out to get there.
//! [`LogMap`] approximates (fast; what repulsion uses), [`ExactMap`] is exact (some ten times
//! slower; the oracle of the former, and a parameter of the paper's route for validation).

use super::SurfacePoint;
use super::domain::Domain;
use super::exact::ExactMap;
use super::log_map::LogMap;
use crate::geometry::Vec2;
use crate::mesh::TriMesh;
use crate::mesh::topology::Defect;

/// Which distances repulsion goes by.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Geodesics {
    /// Discrete geodesic polar coordinates (Melvær & Reimers 2012).
    Approximate,
    /// Exact polyhedral distances (windows; Mitchell, Mount & Papadimitriou 1987).
    Exact,
}

/// A place as seen from the source: the vector in the source triangle's frame that a walker
/// must take to get there, and its length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Reach {
    /// Direction times distance, in the frame of the source's triangle, mm.
    pub vector: Vec2,
    /// Geodesic distance, mm.
    pub distance: f64,
}

impl Reach {
    /// Nowhere yet.
    pub const UNKNOWN: Self = Self {
        vector: Vec2::new(0.0, 0.0),
        distance: f64::INFINITY,
    };
}

/// The surroundings of one source at a time, and the memory for the next one: clearing costs
/// what was visited.
pub(crate) trait GeodesicMap {
    /// An empty map.
    fn over(domain: &Domain) -> Self;

    /// Maps everything within `radius` mm of `source`.
    fn spread(&mut self, domain: &Domain, source: &SurfacePoint, radius: f64);

    /// The vertex as seen from the source, if it lies within the radius.
    fn reach(&self, vertex: u32) -> Option<Reach>;

    /// The vertices within the radius, in no particular order, and those just beyond.
    fn visited(&self) -> &[u32];

    /// A point of the surface as seen from the source, if it lies well within the radius.
    fn reach_point(&self, domain: &Domain, point: &SurfacePoint) -> Option<Reach>;
}

/// Why there are no distances.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GeodesicsError {
    /// The mesh is not a closed manifold.
    #[error("the surface is not a closed manifold: {0}")]
    OpenSurface(#[from] Defect),
    /// A point names no triangle, or its coordinates are no barycentric ones.
    #[error("point {point} does not lie on the surface")]
    NotOnSurface {
        /// Index among sources, then targets.
        point: usize,
    },
}

/// Distances along `mesh` from each source (row) to each target (column), mm; `None` beyond
/// `radius` mm. Points may lie on edges and vertices.
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
        p.triangle as usize >= mesh.triangles.len()
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
