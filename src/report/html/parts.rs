//! What pages are put together from, whatever they report on.

use serde_json::{Value, json};

use super::raster::View;
use super::text::{escape, leaves};
use super::views::{self, Pictures};
use crate::geometry::Vec3;
use crate::geometry::bvh::Aabb;
use crate::mesh::TriMesh;

/// Most triangles that a browser turns smoothly.
const MOST_TURNED: usize = 20_000;

/// How the first line of a page looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// All is well.
    Good,
    /// Somebody should look.
    Doubt,
    /// A promise is broken.
    Bad,
}

/// The first section: what it comes to, and each check with whether it holds.
pub fn verdict(verdict: Verdict, headline: &str, checks: &[(bool, String)]) -> String {
    let (class, sign) = match verdict {
        Verdict::Good => ("", "✓"),
        Verdict::Doubt => (" doubt", "!"),
        Verdict::Bad => (" bad", "✗"),
    };
    let items: String = checks
        .iter()
        .map(|(holds, text)| {
            let class = if *holds { "" } else { r#" class="no""# };
            let spoken = if *holds { "yes" } else { "no" };
            format!(
                r#"<li{class} aria-label="{spoken}: {0}">{0}</li>"#,
                escape(text)
            )
        })
        .collect();
    format!(
        r#"<section class="verdict{class}"><div class="sign" aria-hidden="true">{sign}</div><div><h2>{}</h2><ul class="checks">{items}</ul></div></section>"#,
        escape(headline)
    )
}

/// One headline figure; `unit` is small beside it.
pub fn figure(value: String, unit: &str, label: String) -> String {
    format!(
        r#"<div class="figure"><b>{value} <small>{unit}</small></b><span>{}</span></div>"#,
        escape(&label)
    )
}

/// The headline figures side by side.
pub fn figures(figures: &[String]) -> String {
    format!(r#"<div class="figures">{}</div>"#, figures.concat())
}

/// What the user should know; nothing where there is nothing.
pub fn warnings<'a>(title: &str, warnings: impl Iterator<Item = &'a str>) -> String {
    let items: String = warnings
        .map(|w| format!("<li>{}</li>", escape(w)))
        .collect();
    if items.is_empty() {
        return items;
    }
    format!(r#"<section><h2>{title}</h2><ul class="warnings">{items}</ul></section>"#)
}

/// Tables of everything else, by its name in the JSON report; empty ones are left out.
pub fn particulars(tables: &[(&str, Value)]) -> String {
    let tables: String = tables
        .iter()
        .filter(|(_, value)| value.as_object().is_some_and(|map| !map.is_empty()))
        .map(|(title, value)| {
            // Warnings stand at the top already.
            let rows: String = leaves(value)
                .iter()
                .filter(|(path, _)| path != "warnings")
                .map(|(path, text)| {
                    format!(
                        r#"<tr><th scope="row">{}</th><td>{}</td></tr>"#,
                        escape(path),
                        escape(text)
                    )
                })
                .collect();
            format!("<div><h3>{title}</h3><table><tbody>{rows}</tbody></table></div>")
        })
        .collect();
    format!(
        r#"<section><details open><summary>Particulars</summary><div class="row">{tables}</div></details></section>"#
    )
}

/// The model from three sides, and one to turn.
pub fn model(title: &str, mesh: &TriMesh) -> String {
    let turning = if mesh.triangles.len() <= MOST_TURNED {
        turnable(mesh)
    } else {
        String::new()
    };
    format!(
        r#"<section><h2>{title}</h2><p class="hint">Every triangle as it is. Letters: L left, R right, A anterior, P posterior, S superior, I inferior side of the patient.</p><div class="row four">{}{turning}</div></section>"#,
        shown(&views::plain(mesh), "The model")
    )
}

/// Pictures from the sides of [`View::ALL`].
pub fn shown(pictures: &Pictures, what: &str) -> String {
    View::ALL
        .iter()
        .zip(pictures)
        .map(|(view, uri)| {
            let [east, north, west, south] = view.letters;
            let name = view.name;
            let marks = format!(
                r#"<i class="east" aria-hidden="true">{east}</i><i class="north" aria-hidden="true">{north}</i><i class="west" aria-hidden="true">{west}</i><i class="south" aria-hidden="true">{south}</i>"#
            );
            format!(
                r#"<figure><div class="view"><img src="{uri}" alt="{what}, {} view" width="500" height="500">{marks}</div><figcaption>{name}</figcaption></figure>"#,
                name.to_lowercase()
            )
        })
        .collect()
}

/// A canvas for the script, and the mesh about its centre, rounded to 0.01 mm.
fn turnable(mesh: &TriMesh) -> String {
    let aabb = Aabb::of(&mesh.vertices);
    let centre = (aabb.min + aabb.max) / 2.0;
    let about = |v: &Vec3| ((v - centre) * 100.0).map(f64::round) / 100.0;
    let vertices: Vec<f64> = mesh
        .vertices
        .iter()
        .flat_map(|v| <[f64; 3]>::from(about(v)))
        .collect();
    let triangles: Vec<u32> = mesh.triangles.iter().flatten().copied().collect();
    // Numbers only: nothing in it can end the script element.
    let data = json!({ "vertices": vertices, "triangles": triangles });
    format!(
        r#"<figure id="turnable" hidden><div class="view"><canvas id="turn" tabindex="0" role="img" aria-label="The model to turn by dragging or by the arrow keys"></canvas></div><figcaption>Drag to turn</figcaption></figure><script type="application/json" id="mesh">{data}</script>"#
    )
}
