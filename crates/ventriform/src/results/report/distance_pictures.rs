//! A model coloured by its distance to the surface that it was made from.

use maud::{Markup, html};

use super::closeness::{Closeness, cut};
use crate::image::draw::facets::{Colour, Facet};
use crate::image::draw::views::{self, Pictures};
use crate::mesh::TriMesh;

/// The model from three sides, and the distance in mm at which the colours are full: blue lies
/// inside of the surface, red outside.
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
    (views::pictures(&facets, mesh, 0.62), full)
}

/// The scale of the colours from `-full` to `full` mm.
pub fn scale(full: f64) -> Markup {
    html! {
        div.scale role="img"
            aria-label=(format_args!("Colours from {full} mm inside to {full} mm outside")) {
            span { "−" (full) " mm" }
            svg viewBox="0 0 100 10" preserveAspectRatio="none" {
                defs {
                    linearGradient id="ramp" {
                        @for i in 0..=10 {
                            @let colour = diverging(f64::from(i) / 5.0 - 1.0);
                            @let [r, g, b] = colour.map(|c| (255.0 * c) as u8);
                            stop offset=(format_args!("{}%", 10 * i))
                                stop-color=(format_args!("rgb({r},{g},{b})")) {}
                        }
                    }
                }
                rect width="100" height="10" fill="url(#ramp)" {}
            }
            span { "+" (full) " mm" }
        }
    }
}

/// The colour for -1 (blue) over 0 (near white) to 1 (red).
fn diverging(x: f64) -> Colour {
    let (end, x) = if x < 0.0 {
        ([0.10, 0.36, 0.76], -x)
    } else {
        ([0.80, 0.13, 0.10], x)
    };
    let x = x.min(1.0);
    [0, 1, 2].map(|r| 0.95 + (end[r] - 0.95) * x)
}

/// The colours of vertices at these distances, mm: blue lies inside of the surface, red outside. They are full
/// at a round number that nearly all distances keep below.
pub fn vertex_colours(distances: &[f64]) -> Vec<Colour> {
    let full = full_scale(distances.iter().map(|d| d.abs()).collect());
    distances.iter().map(|d| diverging(d / full)).collect()
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
