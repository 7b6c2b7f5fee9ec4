//! The model from three sides: as it is, and coloured by its distance to the surface.

use rayon::prelude::*;

use super::raster::{Colour, Facet, Style, View, data_uri, png};
use crate::geometry::Vec3;
use crate::geometry::bvh::{Aabb, Bvh};
use crate::mesh::TriMesh;

/// Side of a picture in pixels; shown at half of that or less.
const SIDE: usize = 500;
/// Most distance queries for a coloured model.
const MOST_QUERIES: usize = 20_000;
/// The wall of the heart.
const MYOCARDIUM: Colour = [0.90, 0.42, 0.36];

/// Three pictures as `data:` URIs, in the order of [`View::ALL`].
pub type Pictures = Vec<String>;

/// The model in the colour of the myocardium, with its edges.
pub fn plain(mesh: &TriMesh) -> Pictures {
    let facets: Vec<Facet> = (0..mesh.triangles.len())
        .map(|t| Facet {
            corners: mesh.corners(t),
            colour: MYOCARDIUM,
            outline: mesh.corners(t),
        })
        .collect();
    pictures(&facets, mesh, 0.34)
}

/// The model coloured by its signed distance to `reference`, and the distance in mm at which
/// the colours are full: blue lies inside of the surface, red outside.
pub fn by_distance(mesh: &TriMesh, reference: &TriMesh) -> (Pictures, f64) {
    let tree = Bvh::new(&reference.vertices, &reference.triangles);
    let parts = subdivisions(mesh.triangles.len());
    let pieces: Vec<(Facet, f64)> = (0..mesh.triangles.len())
        .into_par_iter()
        .flat_map_iter(|t| cut(&mesh.corners(t), parts))
        .map(|facet| {
            let [a, b, c] = facet.corners;
            let distance = signed_distance(&((a + b + c) / 3.0), reference, &tree);
            (facet, distance)
        })
        .collect();
    let full = full_scale(pieces.iter().map(|(_, d)| d.abs()).collect());
    let facets: Vec<Facet> = pieces
        .into_iter()
        .map(|(facet, d)| Facet {
            colour: diverging(d / full),
            ..facet
        })
        .collect();
    (pictures(&facets, mesh, 0.62), full)
}

/// The colour for -1 (blue) over 0 (near white) to 1 (red).
pub fn diverging(x: f64) -> Colour {
    let (end, x) = if x < 0.0 {
        ([0.10, 0.36, 0.76], -x)
    } else {
        ([0.80, 0.13, 0.10], x)
    };
    let x = x.min(1.0);
    [0, 1, 2].map(|r| 0.95 + (end[r] - 0.95) * x)
}

fn pictures(facets: &[Facet], mesh: &TriMesh, ambient: f64) -> Pictures {
    let aabb = Aabb::of(&mesh.vertices);
    let reach = (aabb.max - aabb.min).amax() / 2.0;
    // Lines of many small triangles would black everything out.
    let edge = (4.0 * mesh.area() / 3f64.sqrt() / mesh.triangles.len() as f64).sqrt();
    let pixels = edge / reach * SIDE as f64 / 2.0;
    let style = Style {
        centre: (aabb.min + aabb.max) / 2.0,
        reach,
        side: SIDE,
        line: (pixels / 16.0).clamp(0.0, 1.6),
        ambient,
    };
    View::ALL
        .par_iter()
        .map(|view| data_uri(&png(facets, view, &style)))
        .collect()
}

/// How many parts to cut each side of a triangle into, so that colours follow the surface
/// without more than [`MOST_QUERIES`] queries.
fn subdivisions(triangles: usize) -> usize {
    let fitting = (MOST_QUERIES as f64 / triangles.max(1) as f64).sqrt();
    (fitting as usize).clamp(1, 12)
}

/// The triangle cut into `parts`² alike ones.
fn cut(whole: &[Vec3; 3], parts: usize) -> Vec<Facet> {
    let [a, b, c] = whole;
    let at = |i: usize, j: usize| {
        a + (b - a) * (i as f64 / parts as f64) + (c - a) * (j as f64 / parts as f64)
    };
    let facet = |corners| Facet {
        corners,
        colour: [0.0; 3],
        outline: *whole,
    };
    let mut facets = Vec::with_capacity(parts * parts);
    for j in 0..parts {
        for i in 0..parts - j {
            facets.push(facet([at(i, j), at(i + 1, j), at(i, j + 1)]));
            if i + j + 1 < parts {
                facets.push(facet([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]));
            }
        }
    }
    facets
}

/// Positive outside of the surface; the side is told by the closest triangle's normal.
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

/// A round number, at least 0.1, that 98 % of the distances do not exceed.
fn full_scale(mut distances: Vec<f64>) -> f64 {
    distances.sort_unstable_by(f64::total_cmp);
    let high = distances
        .get(distances.len() * 98 / 100)
        .copied()
        .unwrap_or_default();
    let round = [0.1, 0.2, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0];
    round.into_iter().find(|r| *r >= high).unwrap_or(100.0)
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
            let facets = cut(&corners, parts);
            assert_eq!(facets.len(), parts * parts);
            let sum: Vec3 = facets.iter().map(|f| area(&f.corners)).sum();
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
}
