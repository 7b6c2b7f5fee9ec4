//! The page of a segmentation: flags, figures, slices, polar map, agreement, the fitted model.

use super::embedded::Embedded;
use super::page_parts::{flags_headline, limits_hint, normal_limits, short, volume_line};
use super::projections_report::{MoveReport, ProjectionsReport, UncorrectedReport, ViewReport};
use super::sections::Program;
use super::segmentation_report::{AppliedReaderReport, SegmentationReport};
use super::summaries::object;
use super::whose;
use crate::image::draw::chart::{self, Series};
use crate::image::draw::document::{self, HtmlDocument};
use crate::image::draw::table::{CellKind, Table, TableColumn};
use crate::image::draw::text::{data_uri, number};
use crate::image::draw::views;
use crate::image::volume::Provenance;
use crate::mesh::TriMesh;
use crate::results::figures::segmentation::{AGAINST_THE_EXPERT, FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{self, headlines, readable, section};
use maud::{Markup, html};
use serde_json::{Value, json};

/// A segmentation's report with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct SegmentationPage<'a> {
    /// The report.
    pub report: &'a SegmentationReport,
    /// The fitted model.
    pub mesh: &'a TriMesh,
    /// Standard deviation of each vertex's distance from the wall, mm; empty if it is not known.
    pub uncertainty: &'a [f64],
    /// Of a ventricle, the wall by the other edge and its uncertainty.
    pub other: Option<(&'a TriMesh, &'a [f64])>,
    /// Slices of the volume with the contour of the fit: a PNG of three squares side by side.
    pub slices: Option<&'a [u8]>,
    /// The polar map as SVG.
    pub polar: Option<&'a [u8]>,
    /// The polar map as JSON.
    pub polar_map: Option<&'a Value>,
    /// The scan about the organ, a packed NIfTI file.
    pub region: Option<&'a [u8]>,
    /// Views, sinogram and linogram of the projections: a PNG of three pictures side by side.
    pub projections: Option<&'a [u8]>,
    /// Whose scan it is, as far as the page is to name it.
    pub scan: Option<&'a Provenance>,
}

/// The page as HTML. What the report does not contain is left out.
pub fn segmentation_page(page: &SegmentationPage) -> String {
    let report = page.report;
    let reasons = report.flags.iter().map(|flag| flag.reason.as_str());
    HtmlDocument {
        title: &title(report),
        subtitle: &origin(report),
        body: html! {
            (whose::section(page.scan))
            (verdict(report))
            (figures(report))
            (document::notes("Reasons to look closer", reasons))
            (document::notes("Please note", report.warnings.iter().map(String::as_str)))
            @if let Some(png) = page.slices { (slices(report, png, page.region.is_some())) }
            @if let Some(svg) = page.polar { (polar(report, svg)) }
            (normal_limits(report.perfusion.as_ref()))
            @if let Some(own) = &report.projections { (projections(own, page.projections)) }
            (agreement(report))
            (views::section("The fitted model", page.mesh, page.uncertainty, !shows_scan(page)))
            (candidates(report))
            (particulars(report))
        },
        data: embedded(page),
        footer: &Program::this().footer(),
    }
    .html()
}

/// Whether the script shows the wall beside the scan.
fn shows_scan(page: &SegmentationPage) -> bool {
    page.region.is_some() && page.slices.is_some()
}

/// The data that the script draws.
fn embedded(page: &SegmentationPage) -> Option<Value> {
    let report = page.report;
    Embedded {
        name: &title(report),
        mesh: (page.mesh, page.uncertainty),
        other: page.other,
        fit: Some(json!({
            "edge": report.edge(),
            "fit": { "long_axis": report.fit.long_axis },
            "posture": report.posture,
            "polar": report.polar.as_ref().map(|polar| json!({ "orientation": polar.orientation })),
        })),
        polar: page.polar_map,
        closeness: None,
        region: page.region.filter(|_| page.slices.is_some()),
    }
    .json()
}

/// The title of the page.
pub(super) fn title(report: &SegmentationReport) -> String {
    format!("{}: segmentation", organ(report))
}

/// The organ's name as a heading begins.
fn organ(report: &SegmentationReport) -> String {
    let word = match report.organ() {
        "generic" => "organ",
        word => word,
    };
    let mut letters = word.chars();
    let first = letters.next().map(|letter| letter.to_ascii_uppercase());
    first
        .into_iter()
        .chain(letters)
        .collect::<String>()
        .replace('_', " ")
}

/// One line on where the segmentation comes from.
pub(super) fn origin(report: &SegmentationReport) -> String {
    let model = format!("Model {}", report.template);
    let parts = [model].into_iter().chain(volume_line(&report.input));
    let parts = parts.chain(report.reader.as_ref().map(drawn_by));
    parts.collect::<Vec<_>>().join(" · ")
}

/// By which reader's profile the wall was drawn.
fn drawn_by(reader: &AppliedReaderReport) -> String {
    let name = &reader.name;
    let moved = reader.offsets_mm.map(|offsets| {
        [
            ("endocardium", offsets.endocardium, "outward"),
            ("epicardium", offsets.epicardium, "outward"),
            ("rim", offsets.rim, "towards the base"),
        ]
        .map(|(what, by, where_to)| format!("{what} {by:+.2} mm {where_to}"))
        .join(", ")
    });
    let at_level = reader.level.map(|level| {
        let percent = number(100.0 * level, 0);
        format!("at {percent} % of the wall's brightest uptake")
    });
    let how: Vec<String> = moved.into_iter().chain(at_level).collect();
    format!("drawn as reader {name}: {}", how.join(", "))
}

/// The things that could be flagged, each with whether it is in order.
fn checks(report: &SegmentationReport) -> Vec<(bool, String)> {
    let percent = |share: f64| number(100.0 * share, 0);
    let (fit, place) = (&report.fit, &report.localisation);
    let mut checks = vec![
        (
            "poor_contrast",
            format!(
                "An edge is seen along {} % of the surface",
                percent(fit.active_sensors)
            ),
        ),
        (
            "not_at_rest",
            format!(
                "The model came to rest: {} after {} steps",
                fit.reason.replace('_', " "),
                number(fit.iterations as f64, 0)
            ),
        ),
        (
            "folded",
            "No triangle cuts another one or is turned over".to_owned(),
        ),
        (
            "touches_border",
            "The organ lies inside of the volume".to_owned(),
        ),
    ];
    if report.is_ventricle() {
        checks.extend([
            (
                "uncertain_place",
                format!(
                    "Confidence in the heart's place: {} %",
                    percent(place.as_ref().map_or(f64::NAN, |place| place.confidence))
                ),
            ),
            (
                "uncertain_fit",
                format!(
                    "Chance that a reader of the visible edge agrees (by simulated scans): {} %",
                    percent(fit.confidence)
                ),
            ),
            (
                "thick_wall",
                "The wall looks no thicker than usual walls do".to_owned(),
            ),
            (
                "thickness_assumed",
                format!(
                    "Chance that the true cavity is within 20 % of the one found: {} %",
                    percent(fit.size_confidence.unwrap_or(f64::NAN))
                ),
            ),
            (
                "motion",
                "The wall is neither doubled nor displaced as by motion".to_owned(),
            ),
            (
                "right_ventricle",
                "The septum lies where round hearts have it".to_owned(),
            ),
            ("dark_apex", "The apical wall is seen".to_owned()),
            (
                "mirrored",
                "The apex points neither to the right nor to the back nor up".to_owned(),
            ),
            (
                "implausible_shape",
                "Volumes, thickness and length are those of a heart".to_owned(),
            ),
            (
                "valve_plane",
                "The wall reaches up to the base all around".to_owned(),
            ),
        ]);
    }
    // One line for both: an image that ends in the wall is a volume that does not hold all of it.
    let raised = |code: &str| {
        let is_told =
            |flag: &str| flag == code || (flag == "field_of_view" && code == "touches_border");
        report.flags.iter().any(|flag| is_told(&flag.code))
    };
    let polar = report.polar.as_ref();
    let placed = polar.is_some_and(|polar| polar.orientation != UNKNOWN_ORIENTATION);
    let turned = report.parameters.get("orbit").and_then(Value::as_str) != Some("none");
    // What was not judged is neither in order nor not.
    let judged = |code: &str| match code {
        "mirrored" => placed,
        "motion" => turned,
        _ => true,
    };
    checks
        .into_iter()
        .filter(|(code, _)| judged(code))
        .map(|(code, text)| (!raised(code), text))
        .collect()
}

fn verdict(report: &SegmentationReport) -> Markup {
    let (sign, headline) = flags_headline(report.flags.len(), "segmentation");
    document::verdict(sign, &headline, &checks(report))
}

fn figures(report: &SegmentationReport) -> Markup {
    document::figures(&headlines(FIGURES, report))
}

/// What the slices show, and the name of each.
pub(super) fn slice_names(report: &SegmentationReport) -> (&'static str, [&'static str; 3]) {
    let polar = report.polar.as_ref();
    let unknown = polar.is_some_and(|polar| polar.orientation == UNKNOWN_ORIENTATION);
    match report.is_ventricle() {
        true if unknown => (
            "Planes of the heart through the middle of its cavity, which side is anterior unknown: \
             apex on top of the second and on the right of the third.",
            ["Short axis", "Long axis", "Long axis, a quarter turn on"],
        ),
        true => (
            "Planes of the heart through the middle of its cavity: anterior on top and septum on \
             the left of the first, apex on top of the second and on the right of the third.",
            ["Short axis", "Horizontal long axis", "Vertical long axis"],
        ),
        false => (
            "Planes of the patient through the middle of the organ: the patient's right on the \
             left of the first two, anterior on top of the first and on the left of the third.",
            ["Axial", "Coronal", "Sagittal"],
        ),
    }
}

/// The slices as a picture; `touched` if the script draws them with the scan, which is without the expert's mask.
/// The projections: pictures, the heart's motion, and what a correction changed.
fn projections(own: &ProjectionsReport, png: Option<&[u8]>) -> Markup {
    let line = |label: &str, class, thin, of: fn(&ViewReport) -> Option<f64>| Series {
        label: label.into(),
        class,
        thin,
        points: (own.views.iter().enumerate())
            .filter_map(|(number, view)| Some((number as f64 + 1.0, of(view)?)))
            .collect(),
    };
    let moved = [
        line("along", "red", false, |view| view.moved_along_mm),
        line("across", "blue", false, |view| view.moved_across_mm),
        line("along, measured", "orange", true, |view| view.along_mm),
        line("across, measured", "faint", true, |view| view.across_mm),
    ];
    let most = own.views.iter().map(|view| view.counts).fold(1.0, f64::max);
    let relative = Series {
        label: "counts".into(),
        class: "blue",
        thin: false,
        points: (own.views.iter().enumerate())
            .map(|(number, view)| (number as f64 + 1.0, 100.0 * view.counts / most))
            .collect(),
    };
    html! {
        section {
            h2 { "Projections" }
            p.hint {
                (own.views.len()) " views, " (number(own.counts / 1e6, 2)) " million counts. "
                @match own.moved {
                    None => "The heart's motion was not measured.",
                    Some(false) => "The heart did not move by more than the projections can tell: steps of some 5 mm, \
                                    drifts of 10 mm.",
                    Some(true) => {
                        "The heart moved: "
                        (own.moves.iter().map(MoveReport::text).collect::<Vec<_>>().join("; ")) "."
                    }
                }
            }
            @if let Some(png) = png {
                figure.slices {
                    img src=(data_uri("image/png", png))
                        alt="Views of the camera, sinogram and linogram";
                    figcaption { span { "views" } span { "sinogram at the heart" } span { "linogram" } }
                }
            }
            @if own.moved.is_some() {
                (chart::lines("How far the heart lay from its mean place, mm", "view", &moved))
            }
            (chart::lines("Counts, % of the greatest", "view", &[relative]))
            @if let Some(before) = &own.uncorrected { (correction(before)) }
        }
    }
}

/// What a correction of motion changed.
fn correction(before: &UncorrectedReport) -> Markup {
    let text = |value: &Option<f64>| value.map_or_else(|| "–".into(), |value| number(value, 1));
    let segment = |(n, (own, change)): (usize, (&Option<f64>, &Option<f64>))| {
        vec![(n + 1).to_string(), text(own), text(change)]
    };
    let rows = (before.segments_percent.iter().zip(&before.segments_change)).enumerate();
    let table = Table {
        columns: vec![
            TableColumn::number("segment"),
            TableColumn::number("before, %"),
            TableColumn::number("change, points"),
        ],
        rows: rows.map(segment).collect(),
    };
    html! {
        h3 { "Before the views were shifted back" }
        p.hint {
            "Confidence " (number(before.confidence, 2)) ", wall " (number(before.wall_ml, 0)) " ml"
            @if let Some(ml) = before.cavity_ml { ", cavity " (number(ml, 0)) " ml" }
            "."
        }
        (document::table(&table, "Uptake before the views were shifted back"))
    }
}

fn slices(report: &SegmentationReport, png: &[u8], touched: bool) -> Markup {
    let (about, names) = slice_names(report);
    html! {
        section {
            h2 { "Slices" }
            @if touched { (document::place("viewer")) }
            @let still = report.measures.is_none();
            p.hint.still[still] { (about) }
            p.legend.still[still] {
                span.key-fit { "the fitted surface" }
                @if report.measures.is_some() { span.key-expert { "the expert's mask" } }
            }
            figure.slices.still[still] {
                img src=(data_uri("image/png", png))
                    alt="Three slices of the volume with the contour of the fit";
                figcaption { @for name in names { span { (name) } } }
            }
        }
    }
}

/// The orientation of a polar map without sides.
const UNKNOWN_ORIENTATION: &str = "unknown";

/// How to read the polar map.
pub(super) fn polar_hint(report: &SegmentationReport) -> String {
    let polar = report.polar.as_ref();
    let sides = match polar.map(|polar| polar.orientation.as_str()) {
        Some(UNKNOWN_ORIENTATION) => {
            "base outside. Orientation unknown: nothing in the image or its header tells which side \
             is anterior, so segments have numbers within their level but no sides and no arteries; \
             `superior` or `anterior` can state a direction"
        }
        _ => {
            "anterior on top, septum on the left; thick white lines part the territories of the \
             arteries"
        }
    };
    let attenuation = polar.and_then(|polar| polar.attenuation.as_ref());
    let attenuation = attenuation.map_or(String::new(), |attenuation| {
        let said = match attenuation.corrected {
            None => "nothing says that attenuation was corrected",
            Some(_) => "attenuation was not corrected",
        };
        let part = attenuation.inferior_extent_percent;
        format!(" {part:.1} % of the wall lie below it in inferior segments; {said}.")
    });
    format!(
        "Polar map of the 17 segments of the American Heart Association: apex in the centre, {sides}. In per cent of \
         the hottest quarter of this scan's own wall. {} The cyan line encloses the wall below the threshold.{attenuation} \
         Grey is outside of the wall.",
        limits_hint(report.perfusion.as_ref())
    )
}

/// Uptake of the segments and of the arteries' territories; `None` without a polar map.
pub(super) fn uptake_table(report: &SegmentationReport) -> Option<Table> {
    let polar = report.polar.as_ref()?;
    let segments = polar.segments.iter().map(|segment| {
        let artery = segment.territory.clone().unwrap_or("–".to_owned());
        let names = vec![segment.number.to_string(), segment.name.clone(), artery];
        (names, readable(segment))
    });
    let territories = polar.territories.iter().map(|territory| {
        let names = ["", "all of the territory", &territory.name].map(str::to_owned);
        (names.into(), readable(territory))
    });
    let columns = [
        TableColumn::number("No."),
        TableColumn::name("Segment"),
        TableColumn::text("Artery"),
    ];
    let parts = segments.chain(territories);
    Some(figures::table(columns, SEGMENT_FIGURES, parts))
}

/// The polar map beside its segments.
fn polar(report: &SegmentationReport, svg: &[u8]) -> Markup {
    let (Some(figures), Some(table)) = (&report.polar, uptake_table(report)) else {
        return Markup::default();
    };
    let rows = table.rows.iter().enumerate();
    let rows = rows.map(|(at, row)| (figures.segments.get(at).map(|segment| segment.number), row));
    html! {
        section {
            h2 { "Uptake of the wall" }
            p.hint { (polar_hint(report)) }
            div.row.beside {
                div {
                    (document::place("polar"))
                    figure.paper.still {
                        img src=(data_uri("image/svg+xml", svg)) alt="Polar map of the wall's uptake";
                    }
                }
                div.scroll tabindex="0" role="group" aria-label="Table, scrollable" {
                    table {
                        thead {
                            tr {
                                @for column in &table.columns {
                                    th.n[column.kind == CellKind::Number] scope="col" { (column.title) }
                                }
                            }
                        }
                        tbody {
                            // The script finds segments by their numbers.
                            @for (segment, row) in rows {
                                tr data-segment=[segment] {
                                    td.n { (row[0]) }
                                    th scope="row" { (row[1]) }
                                    td { (row[2]) }
                                    td.n { (row[3]) }
                                    td.n { (row[4]) }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Measures against the expert's mask, where there was one: name, value, unit.
pub(super) fn agreement_rows(report: &SegmentationReport) -> Vec<[String; 3]> {
    section(FIGURES, AGAINST_THE_EXPERT, report)
}

fn agreement(report: &SegmentationReport) -> Markup {
    let rows = agreement_rows(report);
    if rows.is_empty() {
        return Markup::default();
    }
    html! {
        section {
            h2 { "Against the expert's mask" }
            table.narrow {
                tbody {
                    @for [name, value, unit] in rows {
                        tr { th scope="row" { (name) } td.n { (value) } td { (unit) } }
                    }
                }
            }
        }
    }
}

/// The models that were tried, where there were several.
fn candidates(report: &SegmentationReport) -> Markup {
    let (tried, refused) = (&report.candidates, &report.refused);
    if tried.len() + refused.len() < 2 {
        return Markup::default();
    }
    let columns = [
        "confidence",
        "merit",
        "share with an edge",
        "strain",
        "residual, mm",
    ];
    html! {
        section {
            h2 { "Models tried" }
            p.hint { (report.choice) "." }
            div.scroll tabindex="0" role="group" aria-label="Table, scrollable" {
                table {
                    thead {
                        tr {
                            th scope="col" { "Model" }
                            @for column in columns { th.n scope="col" { (column) } }
                        }
                    }
                    tbody {
                        @for model in tried {
                            @let figures = [
                                (model.confidence, 2), (model.merit, 3), (model.active, 3),
                                (model.strain, 3), (model.residual_mm, 2),
                            ];
                            tr {
                                th scope="row" { (model.template) }
                                @for (value, decimals) in figures {
                                    td.n { (number(value, decimals)) }
                                }
                            }
                        }
                        @for model in refused {
                            tr {
                                th scope="row" { (model.template) }
                                td colspan="4" { "left out: " (model.reason) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Everything else, by its name in the report, without lists of an entry for each node or step.
fn particulars(report: &SegmentationReport) -> Markup {
    let place = report.localisation.as_ref().map(object);
    document::particulars(&[
        ("Parameters", short(report.parameters.clone())),
        ("Fit", short(object(&report.fit))),
        ("Place", short(place.unwrap_or_default())),
        ("Input", short(object(&report.input))),
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;
    use crate::results::report::RaisedFlag;
    use crate::results::report::segmentation_report::tests::first_report;

    fn page(report: &SegmentationReport) -> String {
        segmentation_page(&SegmentationPage {
            report,
            mesh: &shapes::tetrahedron(2.0),
            uncertainty: &[],
            other: None,
            slices: None,
            polar: None,
            polar_map: None,
            region: None,
            projections: None,
            scan: None,
        })
    }

    #[test]
    fn what_a_report_does_not_have_is_left_out() {
        let page = page(&first_report());
        // What the script may draw is no part of what this page says.
        let page = page.split("<script").next().unwrap_or_default();
        assert!(page.contains("<h1>Organ: segmentation</h1>"));
        assert!(page.contains("12.2 ") && page.contains("Volume"));
        for absent in [
            "cavity",
            "thickness",
            "Jaccard",
            "Uptake",
            "Place",
            "Models tried",
        ] {
            assert!(!page.contains(absent), "{absent}");
        }
    }

    #[test]
    fn flags_lower_the_verdict_and_are_listed_with_their_reasons() {
        let mut report = first_report();
        report
            .parameters
            .insert("organ".into(), "left_ventricle".into());
        report.flags.push(RaisedFlag {
            code: "dark_apex".into(),
            reason: "No wall at the <apex>.".into(),
        });
        let page = page(&report);
        assert!(page.contains("<h1>Left ventricle: segmentation</h1>"));
        assert!(page.contains("There is one reason to look closer."));
        assert!(page.contains("<li>No wall at the &lt;apex&gt;.</li>"));
        assert!(page.contains("no: The apical wall is seen"));
        assert!(page.contains("yes: No triangle cuts another one"));
    }
}
