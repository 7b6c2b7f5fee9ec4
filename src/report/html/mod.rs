//! Reports as pages for people: a model's ([`html()`]) and a segmentation's
//! ([`segmentation()`]).
//!
//! Self-contained: style, pictures and a small script are inside; nothing is fetched, also
//! not fonts. The page carries its own Content-Security-Policy, which allows just that
//! style, that script and embedded pictures; a server that sends the header sends
//! [`content_security_policy`]. Without scripts all but the turning view is there.

mod charts;
mod parts;
mod raster;
mod sections;
mod segmentation;
mod text;
mod views;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use sha2::{Digest, Sha256};

use super::closeness::Closeness;
use super::{Report, Software};
use crate::mesh::TriMesh;
pub use segmentation::{Pictured, segmentation};
use text::escape;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("rotate.js");

/// What the page needs to be allowed, as the value of a `Content-Security-Policy` header.
pub fn content_security_policy() -> String {
    let hash = |text: &str| STANDARD.encode(Sha256::digest(text.as_bytes()));
    format!(
        "default-src 'none'; img-src data:; style-src 'sha256-{}'; script-src 'sha256-{}'; base-uri 'none'; form-action 'none'",
        hash(STYLE),
        hash(SCRIPT)
    )
}

/// The page for `report` on `mesh`; with `closeness`, the distances to the surface that the
/// model was made from, also the model coloured by them.
pub fn html(report: &Report, mesh: &TriMesh, closeness: Option<&Closeness>) -> String {
    let title = format!(
        "Left ventricle: surface model of {} points",
        report.mesh.vertices
    );
    let closeness = closeness.filter(|c| c.suits(mesh.triangles.len()));
    let body = [
        sections::verdict(report),
        sections::figures(report),
        parts::warnings("Please note", report.warnings.iter().map(String::as_str)),
        parts::model("The model", mesh),
        closeness.map_or_else(String::new, |c| sections::closeness(report, mesh, c)),
        sections::fitness(report),
        sections::distributions(report),
        sections::measures(report),
        sections::particulars(report),
    ]
    .concat();
    document(&title, &sections::origin(report), &body, &report.software)
}

/// A whole page.
fn document(title: &str, origin: &str, body: &str, software: &Software) -> String {
    format!(
        r#"<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>{STYLE}</style>
</head>
<body>
<main>
<header>
<h1>{title}</h1>
<p class="soft">{origin}</p>
</header>
{body}
<footer>{name} {version}. Lengths in millimetres, patient frame LPS (left, posterior, superior). Research software: not a medical device.</footer>
</main>
<script>{SCRIPT}</script>
</body>
</html>
"#,
        policy = content_security_policy(),
        title = escape(title),
        origin = escape(origin),
        name = escape(&software.name),
        version = escape(&software.version),
    )
}
