//! The page's sections, from the verdict to the particulars.

use serde_json::Value;

use super::charts;
use super::parts::{self, Verdict, figure, shown};
use super::text::{number, signed};
use super::views;
use crate::mesh::TriMesh;
use crate::report::Report;
use crate::report::closeness::Closeness;
use crate::report::distance::Direction;
use crate::report::elements::Shape;
use crate::report::summary::Summary;

/// One line on where the model comes from.
pub fn origin(report: &Report) -> String {
    let name = ["name", "file", "title", "id"]
        .iter()
        .find_map(|key| report.input.get(key)?.as_str());
    let seed = report.parameters.get("seed").and_then(Value::as_u64);
    [
        name.map(|n| format!("Volume {n}")),
        Some(format!("iso-value {}", number(report.surface.iso_value, 3))),
        seed.map(|s| format!("seed {s}")),
        Some(format!("ventriform {}", report.software.version)),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>()
    .join(" · ")
}

/// What is promised of every model, each with whether it holds.
fn checks(report: &Report) -> Vec<(bool, String)> {
    let mesh = &report.mesh;
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
        (mesh.closed, "Closed: the surface has no hole".to_owned()),
        (
            mesh.edge_manifold && mesh.vertex_manifold,
            "Manifold: two triangles at every edge, one fan at every point".to_owned(),
        ),
        (
            mesh.oriented && mesh.outward && mesh.outward_components == surface.outward_components,
            match mesh.components - mesh.outward_components {
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

/// Whether the model is sound, and each promise by itself.
pub fn verdict(report: &Report) -> String {
    let checks = checks(report);
    let failed = checks.iter().filter(|(holds, _)| !holds).count();
    let (outcome, headline) = match failed {
        0 => (Verdict::Good, "The model keeps every promise.".to_owned()),
        n => (
            Verdict::Bad,
            format!("{n} of {} promises are broken.", checks.len()),
        ),
    };
    parts::verdict(outcome, &headline, &checks)
}

/// The headline figures.
pub fn figures(report: &Report) -> String {
    let distance = &report.distance;
    let total = report.timings_ms.get("total").and_then(Value::as_f64);
    let mut figures = vec![
        figure(
            report.mesh.vertices.to_string(),
            "points",
            format!("joined to {} triangles", report.mesh.triangles),
        ),
        figure(
            number(report.shape.radius_ratio.mean, 3),
            "of 1",
            format!(
                "mean shape of triangles (2r/R); worst {}",
                number(report.shape.radius_ratio.min, 3)
            ),
        ),
        figure(
            number(distance.mean_mm, 2),
            "mm",
            format!(
                "mean distance to the image's surface, {} voxel",
                number(distance.mean_voxels, 2)
            ),
        ),
        figure(
            number(distance.hausdorff_mm, 2),
            "mm",
            format!(
                "largest distance (Hausdorff); 95\u{a0}% within {}\u{a0}mm",
                number(distance.hd95_mm, 2)
            ),
        ),
        figure(
            number(distance.volume_ml, 1),
            "ml",
            format!(
                "wall volume, {}\u{a0}% against the surface",
                signed(distance.volume_error_percent, 2)
            ),
        ),
        figure(
            number(report.smoothness.dihedral_deg.mean, 1),
            "degrees",
            "mean bend between neighbouring triangles".to_owned(),
        ),
        figure(
            signed(report.fitness.gain_percent, 1),
            "%",
            "fitness gained by optimisation".to_owned(),
        ),
    ];
    if let Some(total) = total.filter(|t| *t > 0.0) {
        let label = "from voxels to the measured model".to_owned();
        figures.push(figure(number(total, 0), "ms", label));
    }
    parts::figures(&figures)
}

/// The model coloured by its distance to the surface.
pub fn closeness(report: &Report, mesh: &TriMesh, closeness: &Closeness) -> String {
    let (pictures, full) = views::by_distance(mesh, closeness);
    let stops: String = (0..=10)
        .map(|i| {
            let [r, g, b] = views::diverging(f64::from(i) / 5.0 - 1.0).map(|c| (255.0 * c) as u8);
            format!(
                r#"<stop offset="{}%" stop-color="rgb({r},{g},{b})"/>"#,
                10 * i
            )
        })
        .collect();
    let rows: String = [
        ("Model to surface", &report.distance.model_to_surface),
        ("Surface to model", &report.distance.surface_to_model),
    ]
    .iter()
    .map(|(name, direction)| direction_row(name, direction))
    .collect();
    format!(
        r#"<section><h2>How close the model is</h2><p class="hint">Distance from the model to the surface that Marching Cubes found in the image. Blue lies inside of that surface, red outside.</p><div class="row">{pictures}</div><div class="scale" role="img" aria-label="Colours from {full} mm inside to {full} mm outside"><span>−{full} mm</span><svg viewBox="0 0 100 10" preserveAspectRatio="none"><defs><linearGradient id="ramp">{stops}</linearGradient></defs><rect width="100" height="10" fill="url(#ramp)"/></svg><span>+{full} mm</span></div><div class="scroll"><table><thead><tr><th scope="col">Distances, mm</th><th scope="col" class="n">mean</th><th scope="col" class="n">RMS</th><th scope="col" class="n">95 %</th><th scope="col" class="n">largest</th><th scope="col" class="n">surely below</th><th scope="col" class="n">samples</th></tr></thead><tbody>{rows}</tbody></table></div></section>"#,
        pictures = shown(&pictures, "The model coloured by distance"),
    )
}

fn direction_row(name: &str, direction: &Direction) -> String {
    let cells: String = [
        direction.mean_mm,
        direction.rms_mm,
        direction.p95_mm,
        direction.max_mm,
        direction.max_at_most_mm.unwrap_or(f64::NAN),
    ]
    .iter()
    .map(|x| format!(r#"<td class="n">{}</td>"#, number(*x, 3)))
    .collect();
    let samples = direction.samples;
    format!(r#"<tr><th scope="row">{name}</th>{cells}<td class="n">{samples}</td></tr>"#)
}

/// The paper's fitness and its terms after each stage.
pub fn fitness(report: &Report) -> String {
    let fitness = &report.fitness;
    let terms = &fitness.terms;
    let chart = |title: &str, hint: &str, [a, b, c]: [f64; 3], decimals: usize| {
        let stages = [("re-tiled", a), ("fitted", b), ("optimised", c)];
        format!(
            r#"<figure><h3>{title}</h3><p class="hint">{hint}</p>{}</figure>"#,
            charts::bars(title, &stages, decimals)
        )
    };
    let term = |pick: fn(&crate::report::Terms) -> f64| {
        [&terms.retiled, &terms.fitted, &terms.optimised].map(pick)
    };
    let forms = &fitness.forms;
    let form = |pick: fn(&crate::report::Forms) -> f64| {
        [&forms.retiled, &forms.fitted, &forms.optimised].map(pick)
    };
    let driving = [fitness.retiled, fitness.fitted, fitness.optimised];
    let other = if fitness.form == "robust" {
        let hint = "1 is flat, equilateral and on the surface";
        ("F, normalised form", hint, form(|f| f.normalised))
    } else {
        let hint = "higher is better; comparable between tools";
        ("F, robust form", hint, form(|f| f.robust))
    };
    let charts = [
        chart(
            &format!("Fitness F, {} form", fitness.form),
            "higher is better; this one drove the flips",
            driving,
            4,
        ),
        chart(
            "A: bend at the edge",
            "degrees; lower is smoother",
            term(|t| t.a_deg),
            2,
        ),
        chart(
            "B: bend to the neighbours",
            "degrees; lower is smoother",
            term(|t| t.b_deg),
            2,
        ),
        chart("C: shape, R/(2r)", "1 is equilateral", term(|t| t.c), 4),
        chart(
            "D: edge to surface",
            "mm; lower is closer",
            term(|t| t.d_mm),
            3,
        ),
        chart(other.0, other.1, other.2, 3),
    ]
    .concat();
    let weights = fitness.weights.map(|w| number(w, 2)).join(" : ");
    format!(
        r#"<section><h2>Fitness before and after</h2><p class="hint">Mean over all edges of the four-term fitness; weights A : B : C : D = {weights}. Gain from re-tiled to optimised: {} %.</p><div class="row">{charts}</div></section>"#,
        signed(fitness.gain_percent, 2)
    )
}

/// Histograms before and after optimisation.
pub fn distributions(report: &Report) -> String {
    let histograms = &report.histograms;
    let charts: String = [
        (
            &histograms.radius_ratio,
            "radius ratio 2r/R of each triangle",
        ),
        (
            &histograms.min_angle_deg,
            "smallest angle of each triangle, degrees",
        ),
        (&histograms.edge_length_mm, "edge length, mm"),
        (&histograms.dihedral_deg, "bend between neighbours, degrees"),
        (&histograms.valence, "edges at each point"),
    ]
    .iter()
    .map(|(histogram, quantity)| {
        format!(
            "<figure>{}</figure>",
            charts::histogram(histogram, quantity)
        )
    })
    .collect();
    format!(
        r#"<section><h2>Distributions before and after optimisation</h2><p class="legend"><span class="key-before">re-tiled</span><span class="key-after">optimised</span></p><div class="row">{charts}</div></section>"#
    )
}

/// The measures of shape and smoothness as a table.
pub fn measures(report: &Report) -> String {
    let before = (&report.retile.shape, &report.retile.smoothness.dihedral_deg);
    let after = (&report.shape, &report.smoothness.dihedral_deg);
    type Pick = fn(&Shape) -> &Summary;
    let quantities: [(&str, Pick, usize); 5] = [
        ("Radius ratio 2r/R", |s| &s.radius_ratio, 3),
        ("Smallest angle, degrees", |s| &s.min_angle_deg, 1),
        ("Largest angle, degrees", |s| &s.max_angle_deg, 1),
        ("Edge length, mm", |s| &s.edge_length_mm, 2),
        ("Triangle area, mm²", |s| &s.area_mm2, 1),
    ];
    let mut rows = String::new();
    for (name, pick, decimals) in quantities {
        rows += &summary_rows(name, pick(before.0), pick(after.0), decimals);
    }
    rows += &summary_rows("Bend between neighbours, degrees", before.1, after.1, 1);
    let share = |s: &Shape| {
        let percent = |x: f64| number(100.0 * x, 1);
        let valence = &s.valence;
        format!(
            "{} % / {} %",
            percent(valence.share_6),
            percent(valence.share_5_to_7)
        )
    };
    format!(
        r#"<section><h2>Shape and smoothness in figures</h2><div class="scroll"><table><thead><tr><th scope="col">Quantity</th><th scope="col">mesh</th><th scope="col" class="n">mean</th><th scope="col" class="n">variation</th><th scope="col" class="n">smallest</th><th scope="col" class="n">5 %</th><th scope="col" class="n">95 %</th><th scope="col" class="n">largest</th></tr></thead><tbody>{rows}</tbody></table></div><p class="hint">Variation: standard deviation over mean. Points with six edges / with five to seven: re-tiled {}, optimised {}.</p></section>"#,
        share(before.0),
        share(after.0)
    )
}

fn summary_rows(name: &str, before: &Summary, after: &Summary, decimals: usize) -> String {
    let cells = |s: &Summary| -> String {
        [
            number(s.mean, decimals),
            format!("{} %", number(100.0 * s.cv, 1)),
            number(s.min, decimals),
            number(s.p5, decimals),
            number(s.p95, decimals),
            number(s.max, decimals),
        ]
        .iter()
        .map(|x| format!(r#"<td class="n">{x}</td>"#))
        .collect()
    };
    format!(
        r#"<tr><th scope="rowgroup" rowspan="2">{name}</th><td>re-tiled</td>{}</tr><tr><td>optimised</td>{}</tr>"#,
        cells(before),
        cells(after)
    )
}

/// Everything else, by its name in the JSON report.
pub fn particulars(report: &Report) -> String {
    let surface = serde_json::to_value(&report.surface).unwrap_or_default();
    let tables = [
        ("Parameters", report.parameters.clone()),
        ("Input", report.input.clone()),
        ("Surface", surface),
        ("Re-tiling", report.retile.facts.clone().into()),
        ("Optimisation", report.optimise.clone().into()),
        ("Milliseconds", report.timings_ms.clone().into()),
    ];
    parts::particulars(&tables)
}
