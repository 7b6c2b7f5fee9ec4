//! The page of a beat: flags, figures with their intervals, curves, polar maps, segments, gates, the wall at both ends.

use super::beat_report::BeatReport;
use super::page_parts::{
    flags_headline, limits_hint, normal_limits, polar_maps, short, volume_line,
};
use super::sections::Program;
use super::summaries::object;
use super::whose;
use crate::image::draw::document::{self, HtmlDocument, Sign};
use crate::image::draw::table::TableColumn;
use crate::image::draw::text::{data_uri, number};
use crate::image::draw::views;
use crate::image::volume::Provenance;
use crate::mesh::TriMesh;
use crate::results::figures::beat::{FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{self, headlines, readable};
use maud::{Markup, html};
use serde_json::Value;

/// How to read the polar maps.
const MAPS_HINT: &str = "Apex in the centre, base outside. Uptake in per cent of the hottest quarter of the same map's \
    wall; motion in mm, thickening in per cent, from end diastole to end systole; phase in degrees of the cycle.";

/// A beat's report with its pictures, all of them SVG.
#[derive(Debug, Clone, Copy)]
pub struct BeatPage<'a> {
    /// The report.
    pub report: &'a BeatReport,
    /// The volume curve.
    pub curve: Option<&'a [u8]>,
    /// The histogram of phases.
    pub phase: Option<&'a [u8]>,
    /// The polar maps: file name and picture.
    pub maps: &'a [(&'static str, &'a [u8])],
    /// The wall at end diastole and at end systole.
    pub meshes: [&'a TriMesh; 2],
    /// Whose scan it is, as far as the page is to name it.
    pub scan: Option<&'a Provenance>,
}

impl BeatPage<'_> {
    /// The polar maps of a beat, by file name, in their order, each with its title.
    pub const POLAR_MAPS: [(&'static str, &'static str); 8] = [
        ("polar.svg", "Uptake, all gates"),
        ("polar_ed.svg", "Uptake, end diastole"),
        ("polar_es.svg", "Uptake, end systole"),
        ("polar_motion.svg", "Motion inward"),
        ("polar_thickening.svg", "Thickening"),
        ("polar_phase.svg", "Phase"),
        ("polar_z.svg", "Against normal limits, z"),
        ("polar_score.svg", "Score by segment"),
    ];
}

/// The page as HTML. What the report does not contain is left out.
pub fn beat_page(page: &BeatPage) -> String {
    let report = page.report;
    let reasons = report.flags.iter().map(|flag| flag.reason.as_str());
    let [diastole, systole] = page.meshes;
    let perfusion = report.perfusion.as_ref();
    let hint = format!("{MAPS_HINT} {}", limits_hint(perfusion));
    HtmlDocument {
        title: "Left ventricle: beat",
        subtitle: &origin(report),
        body: html! {
            (whose::section(page.scan))
            (verdict(report))
            (figures(report))
            (document::notes("Reasons to look closer", reasons))
            (document::notes("Please note", report.warnings.iter().map(String::as_str)))
            (curves(page))
            (polar_maps(&BeatPage::POLAR_MAPS, page.maps, &hint))
            (normal_limits(perfusion))
            section {
                h2 { "Gates and segments" }
                div.row.beside { (gates(report)) (segments(report)) }
            }
            (views::section("The wall at end diastole", diastole, &[], false))
            (views::section("The wall at end systole", systole, &[], false))
            (particulars(report))
        },
        data: None,
        footer: &Program::this().footer(),
    }
    .html()
}

/// One line on where the beat comes from.
fn origin(report: &BeatReport) -> String {
    let parts = [
        Some(format!("{} gates", report.gates.len())),
        (report.rr_ms).map(|rr| format!("R-R interval {} ms", number(rr, 0))),
        Some(format!("model {}", report.template)),
    ];
    let parts = parts
        .into_iter()
        .flatten()
        .chain(volume_line(&report.input));
    parts.collect::<Vec<_>>().join(" · ")
}

/// The things that could be flagged, each with whether it is in order.
fn checks(report: &BeatReport) -> Vec<(bool, String)> {
    let raised = |code: &str| report.flags.iter().any(|flag| flag.code == code);
    let mut checks: Vec<(bool, String)> = [
        ("no_contraction", "The gates are moments of one beat"),
        (
            "count_loss",
            "No gate lacks so many counts that it was left out of the curve",
        ),
        ("count_gain", "No gate has too many counts"),
        ("leaves_field", "The heart lies inside of the volume"),
        ("dark_wall", "The wall takes up enough to show its motion"),
        ("small_heart", "The cavity is wider than the image blurs"),
        (
            "phase_unreliable",
            "The wall moves enough, and more than noise, to have a phase",
        ),
        (
            "activity_beside_wall",
            "No activity beside the wall changes over the beat",
        ),
        ("outward_motion", "Every segment moves inward"),
    ]
    .map(|(code, text)| (!raised(code), text.to_owned()))
    .into();
    let timing = &report.timing;
    if timing.beats_accepted.is_some() && timing.beats_rejected.is_some() {
        let few = "Few beats were rejected".to_owned();
        checks.push((!raised("beats_rejected"), few));
    }
    let stated_mass_g = report.parameters.get("mass_g").and_then(Value::as_f64);
    if stated_mass_g.is_some() {
        let met = "The wall has the mass that was given".to_owned();
        checks.push((!raised("mass_not_met"), met));
    }
    checks.push((
        !raised("uncertain_fit"),
        format!(
            "Confidence of the fit to the gates' sum: {} %",
            number(100.0 * report.confidence, 0)
        ),
    ));
    checks
}

fn verdict(report: &BeatReport) -> Markup {
    let (sign, headline) = match report.ef_percent {
        None => (
            Sign::Bad,
            "The gates show no beat: there is no ejection fraction.".to_owned(),
        ),
        Some(_) => flags_headline(report.flags.len(), "beat"),
    };
    document::verdict(sign, &headline, &checks(report))
}

fn figures(report: &BeatReport) -> Markup {
    html! {
        (document::figures(&headlines(FIGURES, report)))
        @if let Some(reason) = &report.no_rates { p.hint { "No rates: " (reason) "." } }
    }
}

/// The volume curve and the histogram of phases.
fn curves(page: &BeatPage) -> Markup {
    let phase = &page.report.phase;
    let picture = |svg: Option<&[u8]>, alt: &str, caption: String| {
        html! {
            @if let Some(svg) = svg {
                figure.paper.curve {
                    img src=(data_uri("image/svg+xml", svg)) alt=(alt);
                    figcaption { (caption) }
                }
            }
        }
    };
    let reliable = if phase.reliable { "" } else { "; not reliable" };
    html! {
        @if page.curve.is_some() || page.phase.is_some() {
            section {
                h2 { "Volume and phases" }
                p.hint {
                    "Bars are the gates, each a mean over its width; the curve has that width taken off. "
                    "Phase 0 is the beginning of the first gate."
                }
                div.row.even {
                    (picture(page.curve, "Volume of the cavity over the beat", "Volume of the cavity, ml".into()))
                    (picture(page.phase, "Histogram of the wall's phases", format!(
                        "Phases of the wall: SD {}° ({}° by noise alone), bandwidth {}°, entropy {} %{reliable}",
                        number(phase.sd_degrees, 0),
                        number(phase.noise_degrees, 0),
                        number(phase.bandwidth_degrees, 0),
                        number(phase.entropy_percent, 0),
                    )))
                }
            }
        }
    }
}

fn segments(report: &BeatReport) -> Markup {
    let parts = report.segments.iter().map(|segment| {
        let names = vec![segment.segment.to_string(), segment.name.clone()];
        (names, readable(segment))
    });
    let columns = [TableColumn::number("No."), TableColumn::name("Segment")];
    let table = figures::table(columns, SEGMENT_FIGURES, parts);
    html! { div { (document::table(&table, "Table of segments")) } }
}

fn gates(report: &BeatReport) -> Markup {
    let end = |gate: usize| match gate {
        gate if gate == report.end_diastole_gate => "end diastole",
        gate if gate == report.end_systole_gate => "end systole",
        _ => "",
    };
    html! {
        div {
            div.scroll tabindex="0" role="group" aria-label="Table of gates, scrollable" {
                table {
                    thead {
                        tr {
                            th.n scope="col" { "Gate" }
                            th.n scope="col" { "cavity, ml" }
                            th.n scope="col" { "muscle, ml" }
                            th.n scope="col" { "factor of counts" }
                            th scope="col" { "end of the beat" }
                        }
                    }
                    tbody {
                        @for gate in &report.gates {
                            tr {
                                th.n scope="row" { (gate.gate) }
                                td.n { (number(gate.cavity_ml, 1)) }
                                td.n { (number(gate.wall_ml, 1)) }
                                td.n { (number(gate.counts_factor, 3)) }
                                td { (end(gate.gate)) }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Everything else, by its name in the report, without long lists.
fn particulars(report: &BeatReport) -> Markup {
    let mut beat = object(report);
    for told in ["parameters", "input", "timing", "phase", "rates", "flags"] {
        beat.remove(told);
    }
    document::particulars(&[
        ("Parameters", short(report.parameters.clone())),
        ("Beat", short(beat)),
        ("Beats in the file", short(object(&report.timing))),
        ("Input", short(object(&report.input))),
    ])
}
