//! The model from three sides: as it is, and coloured by its distance to the surface.

use rayon::prelude::*;

use super::raster::{Colour, Facet, Style, View, png};
use super::text::data_uri;
use crate::geometry::bvh::Aabb;
use crate::mesh::TriMesh;
use crate::report::closeness::{Closeness, cut};

/// Side of a picture in pixels; shown at half of that or less.
const SIDE: usize = 500;
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

/// The model coloured by its distance to the surface, and the distance in mm at which the
/// colours are full: blue lies inside of the surface, red outside.
pub fn by_distance(mesh: &TriMesh, closeness: &Closeness) -> (Pictures, f64) {
    let distances = || closeness.distances_mm.iter().map(|d| f64::from(*d));
    let full = full_scale(distances().map(f64::abs).collect());
    let pieces = (0..mesh.triangles.len()).flat_map(|t| {
        let outline = mesh.corners(t);
        cut(&outline, closeness.parts).map(move |corners| (corners, outline))
    });
    let facets: Vec<Facet> = pieces
        .zip(distances())
        .map(|((corners, outline), distance)| Facet {
            corners,
            colour: diverging(distance / full),
            outline,
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
        .map(|view| data_uri("image/png", &png(facets, view, &style)))
        .collect()
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
