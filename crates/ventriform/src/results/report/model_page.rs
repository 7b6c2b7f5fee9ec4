//! The page of a model: what was promised and whether it holds, figures, pictures, distributions.

use super::closeness::Closeness;
use super::distance::Direction;
use super::distance_pictures;
use super::elements::Shape;
use super::embedded::Embedded;
use super::model_report::ModelReport;
use super::sections::{FitnessForms, FitnessTerms};
use super::summaries::object;
use super::summary::{Histogram, Summary};
use super::whose;
use crate::image::draw::chart::{self, Bins};
use crate::image::draw::document::{self, HtmlDocument, Sign};
use crate::image::draw::text::{number, signed};
use crate::image::draw::views;
use crate::image::volume::Provenance;
use crate::mesh::TriMesh;
use crate::results::figures::headlines;
use crate::results::figures::model::FIGURES;
use maud::{Markup, html};
use serde_json::{Map, Value};

/// The page for `report` on `mesh`; with `closeness`, the distances to the surface that the
/// model was made from, also the model coloured by them. Distances of another mesh are left out.
///
/// The page names patient, study and series as far as `scan` does.
pub fn model_page(
    report: &ModelReport,
    mesh: &TriMesh,
    closeness: Option<&Closeness>,
    scan: Option<&Provenance>,
) -> String {
    let closeness = closeness.filter(|c| c.suits(mesh.triangles.len()));
    HtmlDocument {
        title: &format!(
            "Left ventricle: surface model of {} points",
            report.mesh.vertices
        ),
        subtitle: &origin(report),
        body: html! {
            (whose::section(scan))
            (verdict(report))
            (document::figures(&headlines(FIGURES, report)))
            (document::notes("Please note", report.warnings.iter().map(String::as_str)))
            (views::section("The model", mesh, &[], true))
            @if let Some(closeness) = closeness { (distances(report, mesh, closeness)) }
            (fitness(report))
            (distributions(report))
            (measures(report))
            (particulars(report))
        },
        data: Embedded {
            name: "Surface model",
            mesh: (mesh, &[]),
            other: None,
            fit: None,
            polar: None,
            closeness,
            region: None,
        }
        .json(),
        footer: &report.software.footer(),
    }
    .html()
}

/// One line on where the model comes from.
fn origin(report: &ModelReport) -> String {
    let seed = report.parameters.get("seed").and_then(Value::as_u64);
    [
        Some(format!("iso-value {}", number(report.surface.iso_value, 3))),
        seed.map(|s| format!("seed {s}")),
        Some(format!("ventriform {}", report.software.version)),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>()
    .join(" · ")
}

/// The promises made of every model, each with whether it holds.
fn checks(report: &ModelReport) -> Vec<(bool, String)> {
    let mesh = &report.mesh;
    let manifold = &mesh.manifold;
    let surface = &report.surface;
    let wanted = report.parameters.get("points").and_then(Value::as_u64);
    let exact = wanted.map(|n| {
        let text = format!("Exactly {n} points, as asked for");
        (n == mesh.vertices as u64, text)
    });
    let kind = match (mesh.components, mesh.euler_characteristic) {
        (1, 2) => "one piece without handles, like a ball".to_owned(),
        (components, euler) => format!("pieces: {components}, Euler characteristic: {euler}"),
    };
    let same = mesh.components == surface.components
        && mesh.euler_characteristic == surface.euler_characteristic;
    let gain = report.fitness.gain_percent;
    let mut checks: Vec<(bool, String)> = exact.into_iter().collect();
    checks.extend([
        (
            manifold.closed,
            "Closed: the surface has no hole".to_owned(),
        ),
        (
            manifold.edge_manifold && manifold.vertex_manifold,
            "Manifold: two triangles at every edge, one fan at every point".to_owned(),
        ),
        (
            manifold.oriented
                && manifold.outward
                && manifold.outward_components == surface.outward_components,
            match mesh.components - manifold.outward_components {
                0 => "Every triangle faces outward".to_owned(),
                n => format!("Every triangle faces out of the wall, also about {n} cavities"),
            },
        ),
        (
            mesh.self_intersections == 0,
            match mesh.self_intersections {
                0 => "No two triangles cut through each other (exact test)".to_owned(),
                n => format!("{n} pairs of triangles cut through each other"),
            },
        ),
        (same, format!("The topology of the image's surface: {kind}")),
        (gain >= 0.0, improvement(gain)),
    ]);
    checks
}

fn improvement(gain_percent: f64) -> String {
    let amount = number(gain_percent.abs(), 1);
    let verb = if gain_percent < 0.0 {
        "lowered"
    } else {
        "raised"
    };
    format!("Optimisation {verb} the fitness by {amount}\u{a0}%")
}

/// Whether the model keeps all promises, and each by itself.
fn verdict(report: &ModelReport) -> Markup {
    let checks = checks(report);
    let failed = checks.iter().filter(|(holds, _)| !holds).count();
    let (sign, headline) = match failed {
        0 => (
            Sign::Good,
            "The mesh keeps every promise. Whether it is the wall of the heart, slices show."
                .to_owned(),
        ),
        n => (
            Sign::Bad,
            format!("{n} of {} promises are broken.", checks.len()),
        ),
    };
    document::verdict(sign, &headline, &checks)
}

/// The model coloured by its distance to the surface, and the distances as a table.
fn distances(report: &ModelReport, mesh: &TriMesh, closeness: &Closeness) -> Markup {
    let (pictures, full) = distance_pictures::by_distance(mesh, closeness);
    let columns = ["mean", "RMS", "95 %", "largest", "at most", "samples"];
    let rows = [
        ("Model to surface", &report.distance.model_to_surface),
        ("Surface to model", &report.distance.surface_to_model),
    ];
    html! {
        section {
            h2 { "How close the model is" }
            p.hint {
                "Distance from the model to the surface that Marching Cubes found in the image. "
                "Blue lies inside of that surface, red outside."
            }
            div.row { (views::figures(&pictures, "The model coloured by distance")) }
            (distance_pictures::scale(full))
            div.scroll tabindex="0" role="group" aria-label="Table, scrollable" {
                table {
                    thead {
                        tr {
                            th scope="col" { "Distances, mm" }
                            @for column in columns { th.n scope="col" { (column) } }
                        }
                    }
                    tbody { @for (name, direction) in rows { (direction_row(name, direction)) } }
                }
            }
            p.hint { "At most: an upper bound of the largest distance over all points." }
        }
    }
}

fn direction_row(name: &str, direction: &Direction) -> Markup {
    let distances = [
        direction.mean_mm,
        direction.rms_mm,
        direction.p95_mm,
        direction.max_mm,
        direction.max_at_most_mm.unwrap_or(f64::NAN),
    ];
    html! {
        tr {
            th scope="row" { (name) }
            @for distance in distances { td.n { (number(distance, 3)) } }
            td.n { (direction.samples) }
        }
    }
}

/// The paper's fitness and its terms after each stage.
fn fitness(report: &ModelReport) -> Markup {
    let fitness = &report.fitness;
    let terms = &fitness.terms;
    let term = |pick: fn(&FitnessTerms) -> f64| {
        [&terms.retiled, &terms.fitted, &terms.optimised].map(pick)
    };
    let forms = &fitness.forms;
    let form = |pick: fn(&FitnessForms) -> f64| {
        [&forms.retiled, &forms.fitted, &forms.optimised].map(pick)
    };
    let driving = [fitness.retiled, fitness.fitted, fitness.optimised];
    let driving_title = format!("Fitness F, {} form", fitness.form);
    let smooth = "degrees; lower is smoother";
    let other = if fitness.form == "robust" {
        let hint = "1 is flat, equilateral and on the surface";
        ("F, normalised form", hint, form(|f| f.normalised), 3)
    } else {
        let hint = "higher is better; comparable between tools";
        ("F, robust form", hint, form(|f| f.robust), 3)
    };
    let charts = [
        (
            driving_title.as_str(),
            "higher is better; this form drove the flips",
            driving,
            4,
        ),
        (
            "A: dihedral angle at the edge",
            smooth,
            term(|t| t.a_deg),
            2,
        ),
        (
            "B: dihedral angle to the neighbours",
            smooth,
            term(|t| t.b_deg),
            2,
        ),
        ("C: shape, R/(2r)", "1 is equilateral", term(|t| t.c), 4),
        (
            "D: edge to surface",
            "mm; lower is closer",
            term(|t| t.d_mm),
            3,
        ),
        other,
    ];
    let weights = fitness.weights.map(|w| number(w, 2)).join(" : ");
    html! {
        section {
            h2 { "Fitness before and after" }
            p.hint {
                "Mean over all edges of the four-term fitness; weights A : B : C : D = " (weights)
                ". Gain from re-tiled to optimised: " (signed(fitness.gain_percent, 2)) " %."
            }
            div.row {
                @for (title, hint, [retiled, fitted, optimised], decimals) in charts {
                    @let stages = [
                        ("re-tiled", retiled), ("fitted", fitted), ("optimised", optimised)
                    ];
                    figure {
                        h3 { (title) }
                        p.hint { (hint) }
                        (chart::bars(title, &stages, decimals))
                    }
                }
            }
        }
    }
}

/// Histograms before and after optimisation.
fn distributions(report: &ModelReport) -> Markup {
    let histograms = &report.histograms;
    let charts = [
        (
            &histograms.radius_ratio,
            "radius ratio 2r/R of each triangle",
        ),
        (
            &histograms.min_angle_deg,
            "smallest angle of each triangle, degrees",
        ),
        (&histograms.edge_length_mm, "edge length, mm"),
        (
            &histograms.dihedral_deg,
            "dihedral angle at each edge, degrees",
        ),
        (&histograms.valence, "edges at each point"),
    ];
    html! {
        section {
            h2 { "Distributions before and after optimisation" }
            p.legend {
                span.key-before { "re-tiled" }
                span.key-after { "optimised" }
            }
            div.row {
                @for (histogram, quantity) in charts {
                    figure { (chart::histogram(&bins(histogram), quantity)) }
                }
            }
        }
    }
}

fn bins(histogram: &Histogram) -> Bins<'_> {
    Bins {
        lower: histogram.lower,
        width: histogram.width,
        before: &histogram.retiled,
        after: &histogram.optimised,
    }
}

/// The measures of shape and smoothness as a table.
fn measures(report: &ModelReport) -> Markup {
    let (before, after) = (&report.retile.shape, &report.shape);
    let dihedral = (
        &report.retile.smoothness.dihedral_deg,
        &report.smoothness.dihedral_deg,
    );
    type Pick = fn(&Shape) -> &Summary;
    let shapes: [(&str, Pick, usize); 5] = [
        ("Radius ratio 2r/R", |s| &s.radius_ratio, 3),
        ("Smallest angle, degrees", |s| &s.min_angle_deg, 1),
        ("Largest angle, degrees", |s| &s.max_angle_deg, 1),
        ("Edge length, mm", |s| &s.edge_length_mm, 2),
        ("Triangle area, mm²", |s| &s.area_mm2, 1),
    ];
    let rows = shapes
        .into_iter()
        .map(|(name, pick, decimals)| (name, pick(before), pick(after), decimals))
        .chain([("Dihedral angle, degrees", dihedral.0, dihedral.1, 1)]);
    let share = |shape: &Shape| {
        let percent = |x: f64| number(100.0 * x, 1);
        let valence = &shape.valence;
        format!(
            "{} % / {} %",
            percent(valence.share_6),
            percent(valence.share_5_to_7)
        )
    };
    let columns = ["mean", "variation", "smallest", "5 %", "95 %", "largest"];
    html! {
        section {
            h2 { "Shape and smoothness in figures" }
            div.scroll tabindex="0" role="group" aria-label="Table, scrollable" {
                table {
                    thead {
                        tr {
                            th scope="col" { "Quantity" }
                            th scope="col" { "mesh" }
                            @for column in columns { th.n scope="col" { (column) } }
                        }
                    }
                    tbody {
                        @for (name, before, after, decimals) in rows {
                            tr {
                                th scope="rowgroup" rowspan="2" { (name) }
                                td { "re-tiled" }
                                (summary_cells(before, decimals))
                            }
                            tr {
                                td { "optimised" }
                                (summary_cells(after, decimals))
                            }
                        }
                    }
                }
            }
            p.hint {
                "Variation: standard deviation over mean. Dihedral angle: between the normals of "
                "the two triangles at an edge, 0 where they are flat. Points with six edges / with "
                "five to seven: re-tiled " (share(before)) ", optimised " (share(after)) "."
            }
        }
    }
}

fn summary_cells(summary: &Summary, decimals: usize) -> Markup {
    let cells = [
        number(summary.mean, decimals),
        format!("{} %", number(100.0 * summary.cv, 1)),
        number(summary.min, decimals),
        number(summary.p5, decimals),
        number(summary.p95, decimals),
        number(summary.max, decimals),
    ];
    html! { @for cell in cells { td.n { (cell) } } }
}

/// Everything else, by its name in the JSON report.
fn particulars(report: &ModelReport) -> Markup {
    let mut retile = object(&report.retile);
    // They have sections of their own.
    for name in ["shape", "smoothness"] {
        retile.shift_remove(name);
    }
    let tables: [(&str, Map<String, Value>); 6] = [
        ("Parameters", report.parameters.clone()),
        ("Input", object(&report.input)),
        ("Surface", object(&report.surface)),
        ("Re-tiling", retile),
        ("Optimisation", object(&report.optimise)),
        ("Milliseconds", report.timings_ms.clone()),
    ];
    document::particulars(&tables.map(|(title, table)| (title, table.into())))
}
