//! The page of a comparison: flags, figures, slices, polar maps side by side, territories and segments, both scans.

use super::comparison_report::{ComparedScan, ComparisonReport};
use super::page_parts::{flags_headline, polar_maps, short};
use super::sections::Program;
use super::summaries::object;
use super::whose;
use crate::image::draw::document::{self, HtmlDocument};
use crate::image::draw::table::{Table, TableColumn};
use crate::image::draw::text::{data_uri, number};
use crate::image::volume::Provenance;
use crate::results::figures::comparison::{FIGURES, SEGMENT_FIGURES, TERRITORY_FIGURES};
use crate::results::figures::{self, Figure, headlines, readable};
use maud::{Markup, html};
use serde_json::Value;

/// How to read the polar maps.
pub(super) const MAPS_HINT: &str = "Apex in the centre, base outside. Uptake in per cent of the hottest quarter of the \
    same scan's wall; differences in points, stress scaled to rest where nothing changed; z in standard deviations \
    from the normal mean; scores from 0 (normal) to 4 (none).";

/// How to read the slices.
pub(super) const SLICES_HINT: &str = "Stress above rest at the same levels, each by the greatest uptake of its own \
    wall. Short axis from apex to base, vertical long axis from septum to lateral wall, horizontal long axis from \
    inferior to anterior wall.";

/// The title of a comparison's page.
pub(super) const TITLE: &str = "Left ventricle: rest and stress";

/// A comparison's report with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct ComparisonPage<'a> {
    /// The report.
    pub report: &'a ComparisonReport,
    /// Slices of stress above those of rest, a PNG.
    pub slices: Option<&'a [u8]>,
    /// The polar maps: file name and picture, SVG.
    pub maps: &'a [(&'static str, &'a [u8])],
    /// Whose scan that at stress is, as far as the page is to name it.
    pub scan: Option<&'a Provenance>,
}

impl ComparisonPage<'_> {
    /// The polar maps of a comparison, by file name, in their order, each with its title.
    pub const POLAR_MAPS: [(&'static str, &'static str); 7] = [
        ("polar_stress.svg", "Stress"),
        ("polar_rest.svg", "Rest"),
        ("polar_difference.svg", "Rest less stress"),
        ("polar_z_stress.svg", "Stress against normal limits, z"),
        ("polar_z_rest.svg", "Rest against normal limits, z"),
        ("polar_score_stress.svg", "Scores at stress"),
        ("polar_score_rest.svg", "Scores at rest"),
    ];
}

/// The page as HTML. What the report does not contain is left out.
pub fn comparison_page(page: &ComparisonPage) -> String {
    let report = page.report;
    let reasons = report.flags.iter().map(|flag| flag.reason.as_str());
    let warnings = [&report.stress, &report.rest];
    let warnings = warnings.into_iter().flat_map(|scan| &scan.warnings);
    let (sign, headline) = flags_headline(report.flags.len(), "comparison");
    HtmlDocument {
        title: TITLE,
        subtitle: &origin(report, page.scan.is_some()),
        body: html! {
            (whose::section(page.scan))
            (document::verdict(sign, &headline, &checks(report)))
            (figures(report))
            (document::notes("Reasons to look closer", reasons))
            (document::notes("Please note", warnings.map(String::as_str)))
            (slices(page))
            (polar_maps(&ComparisonPage::POLAR_MAPS, page.maps, MAPS_HINT))
            section {
                h2 { "Territories and segments" }
                (territories(report))
                (document::table(&segment_table(report), "Table of segments"))
            }
            section {
                h2 { "Both scans" }
                (document::table(&scan_table(report, page.scan.is_some()), "Table of both scans"))
                @for note in attenuation_notes(report) { p.hint { (note) } }
            }
            (particulars(report))
        },
        data: None,
        footer: &Program::this().footer(),
    }
    .html()
}

/// One line on what both scans are. Of scans that are not `named`, the description is left out: it may say whose they
/// are.
pub(super) fn origin(report: &ComparisonReport, named: bool) -> String {
    let described = |name: &str, scan: &ComparedScan| {
        let parts = [
            scan.series_description.clone().filter(|_| named),
            scan.radiopharmaceutical.clone(),
            scan.injected_dose
                .as_ref()
                .map(|dose| format!("{dose} MBq")),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        match parts.is_empty() {
            true => format!("{name}: {}", scan.input.format),
            false => format!("{name}: {}", parts.join(", ")),
        }
    };
    [
        described("stress", &report.stress),
        described("rest", &report.rest),
        format!("model {}", report.stress.template),
    ]
    .join(" · ")
}

/// The things that could be flagged, each with whether it is in order.
fn checks(report: &ComparisonReport) -> Vec<(bool, String)> {
    let raised = |codes: &[&str]| {
        let mut flags = report.flags.iter();
        flags.any(|flag| codes.contains(&flag.code.as_str()))
    };
    let mut checks: Vec<(bool, String)> = [
        (
            &["not_comparable", "not_stated", "origin_not_stated"][..],
            "The headers say that both scans were made alike",
        ),
        (
            &["role_not_stated", "origin_not_stated"],
            "The headers say which scan is at stress and which at rest",
        ),
        (
            &["made_otherwise", "origin_not_stated"],
            "Camera, unit, position and reconstruction are the same",
        ),
        (
            &["tid_uncertain"],
            "No large defect blurs the ratio of the cavities",
        ),
        (
            &["scale_uncertain"],
            "Enough of the wall is alike in both scans",
        ),
    ]
    .map(|(codes, text)| (!raised(codes), text.to_owned()))
    .into();
    for (name, scan) in [("stress", &report.stress), ("rest", &report.rest)] {
        checks.push((
            scan.confidence >= 0.5,
            format!(
                "Confidence of the fit at {name}: {} %",
                number(100.0 * scan.confidence, 0)
            ),
        ));
    }
    checks
}

/// The figures that are missing, and why.
pub(super) fn missing_figures(report: &ComparisonReport) -> Vec<String> {
    let scores = "No scores and no z: the scans were compared with no normal limits.";
    let scores = report.sss.is_none().then(|| scores.to_owned());
    let beats = (!report.no_beat.is_empty()).then(|| not_compared(report));
    scores.into_iter().chain(beats).collect()
}

fn figures(report: &ComparisonReport) -> Markup {
    html! {
        (document::figures(&headlines(FIGURES, report)))
        @for hint in missing_figures(report) { p.hint { (hint) } }
    }
}

/// Why nothing of the beat, or no ejection fraction, stands here.
fn not_compared(report: &ComparisonReport) -> String {
    let lacking = match report.beat {
        None => "No beats",
        Some(_) => "No ejection fractions",
    };
    let reasons: Vec<&str> = (report.no_beat.iter())
        .map(|no_beat| no_beat.reason.as_str())
        .collect();
    format!("{lacking} were compared: {}.", reasons.join("; "))
}

fn slices(page: &ComparisonPage) -> Markup {
    html! {
        @if let Some(png) = page.slices {
            section {
                h2 { "Slices" }
                p.hint { (SLICES_HINT) }
                figure.paper.wide {
                    img src=(data_uri("image/png", png)) alt="Slices of the heart at stress above those at rest";
                }
            }
        }
    }
}

/// The walls of the arteries; `None` if there are none.
pub(super) fn territory_table(report: &ComparisonReport) -> Option<Table> {
    let parts = report.territories.iter();
    let parts = parts.map(|territory| (vec![territory.name.clone()], readable(territory)));
    let columns = [TableColumn::name("Territory")];
    (!report.territories.is_empty()).then(|| figures::table(columns, TERRITORY_FIGURES, parts))
}

fn territories(report: &ComparisonReport) -> Markup {
    let table = territory_table(report);
    html! {
        @if let Some(table) = table { (document::table(&table, "Table of territories")) }
    }
}

/// The segments, with those figures that one of them has.
pub(super) fn segment_table(report: &ComparisonReport) -> Table {
    let segments: Vec<Value> = report.segments.iter().map(readable).collect();
    let has = |row: &Figure| segments.iter().any(|segment| row.value(segment).is_some());
    let rows: Vec<Figure> = SEGMENT_FIGURES.iter().copied().filter(has).collect();
    let names = report.segments.iter();
    let names = names.map(|segment| vec![segment.segment.to_string(), segment.name.clone()]);
    let columns = [TableColumn::number("No."), TableColumn::name("Segment")];
    figures::table(columns, &rows, names.zip(segments))
}

/// What attenuation may have to do with the extents of both scans.
pub(super) fn attenuation_notes(report: &ComparisonReport) -> Vec<String> {
    let scans = [("Stress", &report.stress), ("Rest", &report.rest)];
    let notes = scans.into_iter().filter_map(|(name, scan)| {
        let attenuation = scan.polar.as_ref()?.attenuation.as_ref()?;
        Some(format!("{name}: {}", attenuation.note))
    });
    notes.collect()
}

/// The known facts of both scans, side by side. Of scans that are not `named`, the description is left out: it may say
/// whose they are.
pub(super) fn scan_table(report: &ComparisonReport, named: bool) -> Table {
    let text = |text: &Option<String>| text.clone().unwrap_or_else(|| "not stated".to_owned());
    let both = [&report.stress, &report.rest];
    let row = |name: &'static str, of: &dyn Fn(&ComparedScan) -> String| (name, both.map(of));
    let mut rows = Vec::new();
    if named {
        rows.push(row("series", &|scan| text(&scan.series_description)));
    }
    rows.extend([
        row("tracer", &|scan| text(&scan.radiopharmaceutical)),
        row("total dose by the header, MBq", &|scan| {
            text(&scan.injected_dose)
        }),
        row(
            "attenuation corrected",
            &|scan| match scan.attenuation_corrected {
                None => "not stated".to_owned(),
                Some(true) => "yes".to_owned(),
                Some(false) => "no".to_owned(),
            },
        ),
        row("resolution, mm", &|scan| {
            let known = scan.resolution_mm.as_ref();
            known.map_or("–".to_owned(), |r| {
                format!("{} ({})", number(r.value, 1), r.source)
            })
        }),
        row("cavity, ml", &|scan| number(scan.cavity_ml, 0)),
        row("muscle, ml", &|scan| number(scan.muscle_ml, 0)),
        row("confidence of the fit, %", &|scan| {
            number(100.0 * scan.confidence, 0)
        }),
        row("below the threshold, % of the wall", &|scan| {
            let known = scan.polar.as_ref();
            known.map_or("–".to_owned(), |polar| number(polar.extent_percent, 1))
        }),
        row("normal limits", &|scan| match &scan.perfusion {
            None => "none".to_owned(),
            Some(perfusion) => {
                let used = &perfusion.normals;
                format!(
                    "{} {}people, sex {}, {}, {}",
                    used.cases,
                    if used.simulated { "simulated " } else { "" },
                    used.sex.as_str(),
                    used.protocol,
                    used.tracer
                )
            }
        }),
        row("below the limit, % of the wall", &|scan| {
            let known = scan.perfusion.as_ref();
            known.map_or("–".to_owned(), |perfusion| {
                number(perfusion.extent_percent, 1)
            })
        }),
        row("deficit score, %", &|scan| {
            let known = scan.perfusion.as_ref();
            known.map_or("–".to_owned(), |perfusion| {
                number(perfusion.deficit_percent, 1)
            })
        }),
    ]);
    if let Some(beat) = &report.beat {
        let volumes = [
            (
                "end-diastolic volume, ml",
                [beat.stress_edv_ml, beat.rest_edv_ml],
            ),
            (
                "end-systolic volume, ml",
                [beat.stress_esv_ml, beat.rest_esv_ml],
            ),
        ];
        rows.extend(volumes.map(|(name, both)| (name, both.map(|ml| number(ml, 0)))));
    }
    Table {
        columns: vec![
            TableColumn::name(""),
            TableColumn::text("Stress"),
            TableColumn::text("Rest"),
        ],
        rows: rows
            .into_iter()
            .map(|(name, [stress, rest])| vec![name.to_owned(), stress, rest])
            .collect(),
    }
}

/// Everything else, by its name in the report, without long lists.
fn particulars(report: &ComparisonReport) -> Markup {
    let mut comparison = object(report);
    for told in ["parameters", "stress", "rest", "flags", "beat", "no_beat"] {
        comparison.remove(told);
    }
    document::particulars(&[
        ("Parameters", short(report.parameters.clone())),
        ("Comparison", short(comparison)),
        ("File at stress", short(object(&report.stress.input))),
        ("File at rest", short(object(&report.rest.input))),
    ])
}
