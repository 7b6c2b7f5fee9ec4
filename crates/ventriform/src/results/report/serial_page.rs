//! The page of a serial comparison: flags, the trend of every figure, what changed with its interval, maps and segments.

use super::page_parts::{flags_headline, short};
use super::sections::Program;
use super::serial_report::{FigureChangeReport, SerialPairReport, SerialReport, SerialScanReport};
use super::summaries::object;
use super::whose;
use crate::image::draw::document::{self, HeadlineFigure, HtmlDocument};
use crate::image::draw::table::{Table, TableColumn};
use crate::image::draw::text::{data_uri, number};
use crate::image::volume::Provenance;
use crate::results::figures::serial::{PAIR_FIGURES, SCAN_FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{self, Figure, readable};
use maud::{Markup, html};
use serde_json::Value;

/// The title of a serial comparison's page.
const TITLE: &str = "Left ventricle over the years";

/// How to read the changes.
const CHANGES_HINT: &str = "Changed: yes, if the 95 % interval of the change excludes none; no, if it excludes a change \
    that matters; cannot tell otherwise. The least change is that which nine of ten such pairs of scans would show.";

/// How to read the maps.
const MAPS_HINT: &str = "Apex in the centre, base outside. Uptake in per cent of the hottest quarter of the same scan's \
    wall; changes in points, earlier less later, counts matched where nothing changed: positive where uptake was lost.";

/// A serial comparison's report with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct SerialPage<'a> {
    /// The report.
    pub report: &'a SerialReport,
    /// The figures over the years, SVG.
    pub trend: Option<&'a [u8]>,
    /// The polar maps: title and picture, SVG.
    pub maps: &'a [(String, &'a [u8])],
    /// Whose scan the first one is, as far as the page is to name it.
    pub scan: Option<&'a Provenance>,
}

/// The page as HTML. What the report does not contain is left out.
pub fn serial_page(page: &SerialPage<'_>) -> String {
    let report = page.report;
    let reasons = report.flags.iter().map(|flag| flag.reason.as_str());
    let warnings = report.scans.iter().flat_map(|scan| {
        let number = scan.number;
        let warnings = scan.warnings.iter();
        warnings.map(move |warning| format!("Scan {number}: {warning}"))
    });
    let warnings: Vec<String> = warnings.collect();
    let (sign, headline) = flags_headline(report.flags.len(), "comparison");
    HtmlDocument {
        title: TITLE,
        subtitle: &origin(report, page.scan.is_some()),
        body: html! {
            (whose::section(page.scan))
            (document::verdict(sign, &headline, &checks(report)))
            (document::figures(&headlines(report)))
            (document::notes("Reasons to look closer", reasons))
            (document::notes("Please note", warnings.iter().map(String::as_str)))
            (trend(page))
            section {
                h2 { "Figures by date" }
                (document::table(&scan_table(report, page.scan.is_some()), "Table of figures by date"))
            }
            section {
                h2 { "What changed" }
                p.hint { (CHANGES_HINT) }
                @for [earlier, later] in pairs(report) {
                    h3 { (pair_title(report, [earlier, later], page.scan.is_some())) }
                    (document::table(&change_table(report, [earlier, later]), "Table of changes"))
                }
            }
            (maps(page))
            section {
                h2 { "Segments" }
                @for pair in &report.pairs {
                    h3 { (pair_title(report, [pair.earlier, pair.later], page.scan.is_some())) }
                    (document::table(&segment_table(pair), "Table of segments"))
                }
            }
            (particulars(report))
        },
        data: None,
        footer: &Program::this().footer(),
    }
    .html()
}

/// A scan's date, or its number where it has none.
fn named(scan: &SerialScanReport) -> String {
    match &scan.date {
        Some(date) => format!("scan {}, {date}", scan.number),
        None => format!("scan {}", scan.number),
    }
}

/// One line on what the scans are.
fn origin(report: &SerialReport, with_dates: bool) -> String {
    let count = report.scans.len();
    let dates = report.scans.first().zip(report.scans.last());
    let dates = dates.and_then(|(first, last)| Some((first.date.clone()?, last.date.clone()?)));
    let kind = if report.gated { "gated scans" } else { "scans" };
    match dates.filter(|_| with_dates) {
        Some((first, last)) => format!("{count} {kind}, {first} to {last}"),
        None => format!("{count} {kind}"),
    }
}

/// The pairs of scans that are compared.
fn pairs(report: &SerialReport) -> Vec<[usize; 2]> {
    let pairs = report.pairs.iter();
    pairs.map(|pair| [pair.earlier, pair.later]).collect()
}

fn scan_of(report: &SerialReport, scan: usize) -> Option<&SerialScanReport> {
    report.scans.iter().find(|own| own.number == scan)
}

fn pair_title(report: &SerialReport, [earlier, later]: [usize; 2], with_dates: bool) -> String {
    let name = |scan: usize| match scan_of(report, scan).filter(|_| with_dates) {
        Some(own) => named(own),
        None => format!("scan {scan}"),
    };
    format!("From {} to {}", name(earlier), name(later))
}

/// The things that could be flagged, each with whether it is in order.
fn checks(report: &SerialReport) -> Vec<(bool, String)> {
    let raised = |codes: &[&str]| {
        let mut flags = report.flags.iter();
        flags.any(|flag| codes.contains(&flag.code.as_str()))
    };
    let mut checks: Vec<(bool, String)> = [
        (
            &["patient_not_stated", "other_patient"][..],
            "The headers say that all scans are of one patient",
        ),
        (&["dates_not_stated"], "The headers say when each was made"),
        (
            &["made_otherwise", "not_comparable", "not_stated"],
            "Camera, tracer, reconstruction and resolution are the same",
        ),
        (
            &["not_registered", "fitted_alone"],
            "The hearts lie on each other place for place",
        ),
        (&["odd_scan"], "No scan is the odd one"),
    ]
    .map(|(codes, text)| (!raised(codes), text.to_owned()))
    .into();
    checks.extend(report.scans.iter().map(|scan| {
        let percent = number(100.0 * scan.confidence, 0);
        let text = format!("Confidence of the fit of scan {}: {percent} %", scan.number);
        (scan.confidence >= 0.5, text)
    }));
    checks
}

/// What changed from the first to the last scan.
fn headlines(report: &SerialReport) -> Vec<HeadlineFigure> {
    let last = report.scans.len();
    let mut headlines: Vec<HeadlineFigure> = SCAN_FIGURES
        .iter()
        .filter_map(|row| {
            let change = report.change(row.place, 1, last)?;
            let [low, high] = change.interval.map(|end| row.written_change(end));
            Some(HeadlineFigure {
                value: row.written_change(change.change),
                unit: points_of(row),
                label: format!(
                    "{}, change; 95 %: {low} to {high}; {}",
                    row.label,
                    change.verdict.as_str()
                ),
            })
        })
        .take(4)
        .collect();
    if let Some(pair) = (report.pairs.iter()).find(|pair| [pair.earlier, pair.later] == [1, last]) {
        let rows = PAIR_FIGURES
            .iter()
            .filter(|row| row.verdict.is_some())
            .copied();
        headlines.extend(figures::headlines(&rows.collect::<Vec<_>>(), pair));
    }
    headlines
}

/// The unit of a change: points of figures in per cent.
fn points_of(row: &Figure) -> &'static str {
    match row.unit.symbol {
        "%" => "points",
        symbol => symbol,
    }
}

fn trend(page: &SerialPage<'_>) -> Markup {
    html! {
        @if let Some(svg) = page.trend {
            section {
                h2 { "Trend" }
                figure.paper.wide {
                    img src=(data_uri("image/svg+xml", svg)) alt="The figures of all scans by date";
                }
            }
        }
    }
}

/// The name of a fact of a scan, and how it is written.
type ScanFact<'a> = (&'a str, &'a dyn Fn(&SerialScanReport) -> String);

/// The figures of all scans, a column a scan. Without the dates unless they are to be named.
pub(super) fn scan_table(report: &SerialReport, with_dates: bool) -> Table {
    let heads = report.scans.iter().map(|scan| {
        TableColumn::number(if with_dates {
            named(scan)
        } else {
            format!("scan {}", scan.number)
        })
    });
    let scans: Vec<Value> = report.scans.iter().map(readable).collect();
    let has = |row: &&Figure| scans.iter().any(|scan| row.value(scan).is_some());
    let rows = SCAN_FIGURES.iter().filter(has).map(|row| {
        let values = scans.iter();
        let values = values.map(|scan| row.written(row.value(scan).unwrap_or(f64::NAN)));
        std::iter::once(row.column()).chain(values).collect()
    });
    let facts: [ScanFact<'_>; 4] = [
        ("confidence of the fit, %", &|scan| {
            number(100.0 * scan.confidence, 0)
        }),
        ("moved against scan 1, mm", &|scan| number(scan.moved_mm, 1)),
        ("turned against scan 1, °", &|scan| {
            number(scan.turned_degrees, 1)
        }),
        ("beats a minute", &|scan| {
            scan.beats_per_minute
                .map_or("–".to_owned(), |rate| number(rate, 0))
        }),
    ];
    let facts = facts.into_iter().map(|(name, of)| {
        let values = report.scans.iter().map(of);
        std::iter::once(name.to_owned()).chain(values).collect()
    });
    Table {
        columns: std::iter::once(TableColumn::name(""))
            .chain(heads)
            .collect(),
        rows: rows.chain(facts).collect(),
    }
}

/// What changed between two scans, and what would have shown.
pub(super) fn change_table(report: &SerialReport, [earlier, later]: [usize; 2]) -> Table {
    let row = |row: &Figure, own: &FigureChangeReport| {
        let [low, high] = own.interval.map(|end| row.written_change(end));
        vec![
            format!("{}, {}", row.label, points_of(row))
                .trim_end_matches(", ")
                .to_owned(),
            row.written_change(own.change),
            format!("{low} to {high}"),
            own.verdict.as_str().to_owned(),
            number(own.least_change, row.digits),
        ]
    };
    let mut rows: Vec<Vec<String>> = SCAN_FIGURES
        .iter()
        .filter_map(|figure| Some(row(figure, report.change(figure.place, earlier, later)?)))
        .collect();
    let pair = (report.pairs.iter()).find(|pair| [pair.earlier, pair.later] == [earlier, later]);
    rows.extend(pair.into_iter().flat_map(uptake_rows));
    Table {
        columns: vec![
            TableColumn::name("Figure"),
            TableColumn::number("Change"),
            TableColumn::text("95 % interval"),
            TableColumn::text("Changed"),
            TableColumn::number("Least change"),
        ],
        rows,
    }
}

/// The wall that got worse and better, as rows of the table of changes.
fn uptake_rows(pair: &SerialPairReport) -> Vec<Vec<String>> {
    let report = readable(pair);
    let answered = PAIR_FIGURES.iter().filter(|row| row.verdict.is_some());
    answered
        .filter_map(|row| {
            let [low, high] = row.interval(&report)?.map(|end| row.written(end));
            Some(vec![
                format!("{} wall, {}", row.label, row.unit.symbol),
                row.written(row.value(&report)?),
                format!("{low} to {high} (90 %)"),
                row.verdict(&report)?.to_owned(),
                number(pair.detectable_percent, 0),
            ])
        })
        .collect()
}

fn maps(page: &SerialPage<'_>) -> Markup {
    html! {
        @if !page.maps.is_empty() {
            section {
                h2 { "Maps of the wall" }
                p.hint { (MAPS_HINT) }
                div.row {
                    @for (title, svg) in page.maps {
                        figure.paper {
                            img src=(data_uri("image/svg+xml", svg)) alt=(title);
                            figcaption { (title) }
                        }
                    }
                }
            }
        }
    }
}

/// The segments of a pair, with those figures that one of them has.
pub(super) fn segment_table(pair: &SerialPairReport) -> Table {
    let segments: Vec<Value> = pair.segments.iter().map(readable).collect();
    let has = |row: &Figure| segments.iter().any(|segment| row.value(segment).is_some());
    let rows: Vec<Figure> = SEGMENT_FIGURES.iter().copied().filter(has).collect();
    let names = pair.segments.iter();
    let names = names.map(|segment| vec![segment.segment.to_string(), segment.name.clone()]);
    let columns = [TableColumn::number("No."), TableColumn::name("Segment")];
    let mut table = figures::table(columns, &rows, names.zip(segments));
    table.columns.push(TableColumn::text("Changed"));
    for (row, segment) in table.rows.iter_mut().zip(&pair.segments) {
        let verdict = segment.change_verdict;
        row.push(verdict.map_or("–", |verdict| verdict.as_str()).to_owned());
    }
    table
}

/// Everything else, by its name in the report, without long lists.
fn particulars(report: &SerialReport) -> Markup {
    let mut tables = vec![("Parameters".to_owned(), short(report.parameters.clone()))];
    tables.extend(report.scans.iter().map(|scan| {
        let name = format!("File of scan {}", scan.number);
        (name, short(object(&scan.input)))
    }));
    let tables: Vec<(&str, Value)> = (tables.iter())
        .map(|(name, table)| (name.as_str(), table.clone()))
        .collect();
    document::particulars(&tables)
}
