//! A triangle mesh for a page: shaded pictures from three sides, embedded as PNGs.

use maud::{Markup, html};
use rayon::prelude::*;

use super::document;
use super::facets::{Colour, Facet, Style, View, picture};
use super::text::data_uri;
use crate::base::geometry::bvh::Aabb;
use crate::mesh::TriMesh;

/// Side of a picture in pixels; shown at half of that or less.
const PICTURE_SIDE_PX: usize = 500;
/// Colour of the heart's wall.
const MYOCARDIUM_COLOUR: Colour = [0.90, 0.42, 0.36];
/// Uncertainty at which the colour is full, mm, and that colour.
const FULL_COLOUR_UNCERTAINTY_MM: f64 = 6.0;
const UNSURE_COLOUR: Colour = [0.16, 0.27, 0.68];

/// Three pictures as `data:` URIs, in the order of [`View::ALL`].
pub type Pictures = Vec<String>;

/// A section with the mesh from three sides and, if it is `touched`, the place `viewer` for one to turn.
/// `uncertainty` of each vertex, mm, colours the pictures; without it they have the wall's colour.
pub fn section(title: &str, mesh: &TriMesh, uncertainty: &[f64], touched: bool) -> Markup {
    let known = !uncertainty.is_empty() && uncertainty.len() == mesh.vertices.len();
    let colour = |t: usize| {
        if known {
            let sum: f64 = mesh.triangles[t]
                .iter()
                .map(|v| uncertainty[*v as usize])
                .sum();
            colour_of(sum / 3.0)
        } else {
            MYOCARDIUM_COLOUR
        }
    };
    let facets: Vec<Facet> = (0..mesh.triangles.len())
        .map(|t| Facet {
            corners: mesh.corners(t),
            colour: colour(t),
            outline: mesh.corners(t),
        })
        .collect();
    html! {
        section {
            h2 { (title) }
            p.hint {
                "Every triangle of the mesh. Letters mark the patient's sides: L left, R right, "
                "A anterior, P posterior, S superior, I inferior."
                @if known {
                    " The bluer a triangle, the less certain its place: full colour where the standard "
                    "deviation of its distance from the wall is " (FULL_COLOUR_UNCERTAINTY_MM) " mm or more."
                }
            }
            @if touched { (document::place("viewer")) }
            div.row { (figures(&pictures(&facets, mesh, 0.34), "The model")) }
        }
    }
}

/// The colour of a place with this uncertainty, mm.
fn colour_of(uncertainty: f64) -> Colour {
    let share = (uncertainty / FULL_COLOUR_UNCERTAINTY_MM).clamp(0.0, 1.0);
    [0, 1, 2].map(|c| MYOCARDIUM_COLOUR[c] + (UNSURE_COLOUR[c] - MYOCARDIUM_COLOUR[c]) * share)
}

/// `facets`, triangles of `mesh` or parts of them, from three sides; `ambient` as in [`Style`].
pub fn pictures(facets: &[Facet], mesh: &TriMesh, ambient: f64) -> Pictures {
    let aabb = Aabb::around(&mesh.vertices);
    let reach = (aabb.max - aabb.min).amax() / 2.0;
    // Full-width lines about many small triangles would make the picture black.
    let edge = (4.0 * mesh.area() / 3f64.sqrt() / mesh.triangles.len() as f64).sqrt();
    let pixels = edge / reach * PICTURE_SIDE_PX as f64 / 2.0;
    let style = Style {
        centre: (aabb.min + aabb.max) / 2.0,
        reach,
        side: PICTURE_SIDE_PX,
        line: (pixels / 16.0).clamp(0.0, 1.6),
        ambient,
    };
    View::ALL
        .par_iter()
        .map(|view| data_uri("image/png", &picture(facets, view, &style).png()))
        .collect()
}

/// `pictures` with the letters of the patient's sides; `what` they show, for readers who cannot
/// see them.
pub fn figures(pictures: &Pictures, what: &str) -> Markup {
    html! {
        @for (view, uri) in View::ALL.iter().zip(pictures) {
            @let [east, north, west, south] = view.letters;
            figure {
                div.view {
                    img src=(uri) alt=(format!("{what}, {} view", view.name.to_lowercase()))
                        width="500" height="500";
                    i.east aria-hidden="true" { (east) }
                    i.north aria-hidden="true" { (north) }
                    i.west aria-hidden="true" { (west) }
                    i.south aria-hidden="true" { (south) }
                }
                figcaption { (view.name) }
            }
        }
    }
}
