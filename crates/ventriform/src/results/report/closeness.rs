//! Signed distances from a model to the surface that it was made from.
//!
//! Every triangle is cut into `parts`² congruent ones, as many as keep their number below
//! [`MOST_QUERIES`]. For the centroid of each, the distance to the closest point of the surface is
//! stored, so that a page can be coloured after the surface itself is gone.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Bvh;
use crate::base::progress::{Cancelled, Monitor};
use crate::mesh::TriMesh;

/// Upper limit of the distance queries for a model, unless it has more triangles.
const MOST_QUERIES: usize = 20_000;
/// Upper limit of the parts that a triangle's side is cut into.
const MOST_PARTS: usize = 12;

/// Signed distances from a model to its surface, as in `distance.json`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Closeness {
    /// Parts that each side of a triangle is cut into.
    pub parts: usize,
    /// Distance of the centroid of each part, mm, rounded to 0.001; positive outside of the
    /// surface. Triangle by triangle, `parts`² each.
    #[cfg_attr(feature = "schema", schema(value_type = Vec<f64>))]
    pub distances_mm: Vec<f32>,
}

/// A surface from which distances are measured, with the tree that finds the closest points.
pub struct MeasuredSurface<'a> {
    surface: &'a TriMesh,
    tree: Bvh,
}

impl<'a> MeasuredSurface<'a> {
    /// Builds the tree of `surface`.
    pub fn new(surface: &'a TriMesh) -> Self {
        let tree = Bvh::new(&surface.vertices, &surface.triangles);
        Self { surface, tree }
    }

    /// Measures the triangles of `mesh`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn closeness(&self, mesh: &TriMesh, monitor: &Monitor) -> Result<Closeness, Cancelled> {
        let parts = subdivisions(mesh.triangles.len());
        let distances = (0..mesh.triangles.len()).into_par_iter().map(|t| {
            monitor.check()?;
            let centroids = cut(&mesh.corners(t), parts).map(|[a, b, c]| (a + b + c) / 3.0);
            Ok(centroids.map(|p| self.distance(&p)).collect::<Vec<f32>>())
        });
        Ok(Closeness {
            parts,
            distances_mm: distances.collect::<Result<Vec<_>, _>>()?.concat(),
        })
    }

    /// The signed distance of every vertex of `mesh`, mm, rounded to 0.001; positive outside of the surface.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn of_vertices(&self, mesh: &TriMesh, monitor: &Monitor) -> Result<Vec<f64>, Cancelled> {
        mesh.vertices
            .par_iter()
            .map(|p| {
                monitor.check()?;
                Ok(f64::from(self.distance(p)))
            })
            .collect()
    }

    /// Signed distance of a point, mm, rounded to 0.001.
    fn distance(&self, p: &Vec3) -> f32 {
        rounded(signed_distance(p, self.surface, &self.tree))
    }
}

impl Closeness {
    /// Measures `mesh` against `reference`; see [`MeasuredSurface`].
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(mesh: &TriMesh, reference: &TriMesh, monitor: &Monitor) -> Result<Self, Cancelled> {
        MeasuredSurface::new(reference).closeness(mesh, monitor)
    }

    /// Whether there are as many distances as a mesh of `triangles` triangles needs.
    pub fn suits(&self, triangles: usize) -> bool {
        (1..=MOST_PARTS).contains(&self.parts)
            && self.distances_mm.len() == triangles * self.parts * self.parts
    }
}

fn rounded(distance: f64) -> f32 {
    ((1e3 * distance).round() / 1e3) as f32
}

/// The number of parts of each side of a triangle that [`MOST_QUERIES`] and [`MOST_PARTS`]
/// allow.
fn subdivisions(triangles: usize) -> usize {
    let fitting = (MOST_QUERIES as f64 / triangles.max(1) as f64).sqrt();
    (fitting as usize).clamp(1, MOST_PARTS)
}

/// The triangle cut into `parts`² congruent ones.
pub fn cut(whole: &[Vec3; 3], parts: usize) -> impl Iterator<Item = [Vec3; 3]> + use<> {
    let [a, b, c] = *whole;
    let at = move |i: usize, j: usize| {
        a + (b - a) * (i as f64 / parts as f64) + (c - a) * (j as f64 / parts as f64)
    };
    let rows = (0..parts).flat_map(move |j| (0..parts - j).map(move |i| (i, j)));
    rows.flat_map(move |(i, j)| {
        let upright = [at(i, j), at(i + 1, j), at(i, j + 1)];
        let turned = (i + j + 1 < parts).then(|| [at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        std::iter::once(upright).chain(turned)
    })
}

/// Distance to the surface, mm: positive on the side to which the closest triangle's normal
/// points.
fn signed_distance(p: &Vec3, reference: &TriMesh, tree: &Bvh) -> f64 {
    tree.closest(p).map_or(0.0, |closest| {
        let normal = reference.area_normal(closest.triangle as usize);
        let distance = closest.squared_distance.sqrt();
        if (p - closest.point).dot(&normal) < 0.0 {
            -distance
        } else {
            distance
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    #[test]
    fn a_cut_triangle_keeps_its_area() {
        let mesh = shapes::tetrahedron(3.0);
        let corners = mesh.corners(1);
        let area = |c: &[Vec3; 3]| (c[1] - c[0]).cross(&(c[2] - c[0]));
        for parts in [1, 2, 7] {
            let pieces: Vec<_> = cut(&corners, parts).collect();
            assert_eq!(pieces.len(), parts * parts);
            let sum: Vec3 = pieces.iter().map(area).sum();
            assert!((sum - area(&corners)).norm() < 1e-9);
        }
    }

    #[test]
    fn the_sign_tells_inside_from_outside() {
        let sphere = shapes::icosphere(30.0, 4);
        let tree = Bvh::new(&sphere.vertices, &sphere.triangles);
        let at = |r: f64| signed_distance(&Vec3::new(r, 0.3, 0.2), &sphere, &tree);
        assert!((at(32.0) - 2.0).abs() < 0.1 && (at(28.5) + 1.5).abs() < 0.1);
    }

    #[test]
    fn distances_come_back_from_a_file_as_they_were() {
        let (small, large) = (shapes::icosphere(29.0, 1), shapes::icosphere(30.0, 4));
        let closeness = Closeness::new(&small, &large, &Monitor::silent()).unwrap();
        assert!(closeness.suits(small.triangles.len()));
        assert!(!closeness.suits(small.triangles.len() + 1));
        assert!(
            closeness
                .distances_mm
                .iter()
                .all(|d| (-6.0..0.0).contains(d))
        );
        let text = serde_json::to_string(&closeness).unwrap();
        assert_eq!(serde_json::from_str::<Closeness>(&text).unwrap(), closeness);
    }
}
