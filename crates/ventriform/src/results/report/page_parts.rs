//! The parts that the pages of fits have in common.

use super::input::FileFacts;
use super::perfusion_report::PerfusionReport;
use crate::image::draw::document::{self, Sign};
use crate::image::draw::table::{Table, TableColumn};
use crate::image::draw::text::{data_uri, number};
use crate::results::figures::perfusion::{FIGURES, SEGMENT_FIGURES};
use crate::results::figures::{self, Figure, headlines, readable};
use maud::{Markup, html};
use serde_json::{Map, Value};

/// Format, voxels and spacing of a volume, for the line below the title.
pub(super) fn volume_line(input: &FileFacts) -> [String; 3] {
    let times = |numbers: [f64; 3], decimals| numbers.map(|x| number(x, decimals)).join(" × ");
    [
        format!("volume: {}", input.format),
        format!("{} voxels", times(input.shape.map(|n| n as f64), 0)),
        format!("{} mm", times(input.spacing_mm, 2)),
    ]
}

/// The headline of a result with so many flags, by its name.
pub(super) fn flags_headline(flags: usize, result: &str) -> (Sign, String) {
    match flags {
        0 => (
            Sign::Good,
            format!("Nothing gives reason to doubt this {result}."),
        ),
        1 => (Sign::Flag, "There is one reason to look closer.".to_owned()),
        n => (Sign::Flag, format!("There are {n} reasons to look closer.")),
    }
}

/// The polar maps beside each other: of `titles` (file name, title) those that `maps` (file name, SVG) has.
pub(super) fn polar_maps(
    titles: &[(&'static str, &'static str)],
    maps: &[(&'static str, &[u8])],
    hint: &str,
) -> Markup {
    let titled = titles.iter().filter_map(|(name, title)| {
        let found = maps.iter().find(|(known, _)| known == name)?;
        Some((*title, found.1))
    });
    let mut titled = titled.peekable();
    html! {
        @if titled.peek().is_some() {
            section {
                h2 { "Maps of the wall" }
                p.hint { (hint) }
                div.row {
                    @for (title, svg) in titled {
                        figure.paper {
                            img src=(data_uri("image/svg+xml", svg)) alt=(format!("Polar map: {title}"));
                            figcaption { (title) }
                        }
                    }
                }
            }
        }
    }
}

/// For the hint at maps of uptake: whether normal limits stand beside them.
pub(super) fn limits_hint(perfusion: Option<&PerfusionReport>) -> &'static str {
    match perfusion {
        None => "No normal limits were used.",
        Some(_) => "Comparison with normal limits: below.",
    }
}

/// Whose limits the wall stands beside.
pub(super) fn limits_line(perfusion: &PerfusionReport) -> String {
    let used = &perfusion.normals;
    let corrected = if used.attenuation_corrected {
        "with"
    } else {
        "without"
    };
    format!(
        "Limits: {}, {} cases, sex {}, {}, {}, {corrected} attenuation correction; SHA-256 {}. Figures: {}.",
        used.people,
        used.cases,
        used.sex.as_str(),
        used.protocol,
        used.tracer,
        used.sha256,
        perfusion.note
    )
}

/// The segments beside normal limits.
pub(super) fn score_table(perfusion: &PerfusionReport) -> Table {
    let rows = SEGMENT_FIGURES.iter().copied().filter(|row| row.headline);
    let rows: Vec<Figure> = rows.collect();
    let parts = perfusion.segments.iter().map(|segment| {
        let names = vec![segment.segment.to_string(), segment.name.clone()];
        (names, readable(segment))
    });
    let columns = [TableColumn::number("No."), TableColumn::name("Segment")];
    figures::table(columns, &rows, parts)
}

/// The wall beside normal limits, if some were given.
pub(super) fn normal_limits(perfusion: Option<&PerfusionReport>) -> Markup {
    let Some(perfusion) = perfusion else {
        return Markup::default();
    };
    html! {
        section {
            h2 { "Beside normal limits" }
            p.hint { (limits_line(perfusion)) }
            (document::figures(&headlines(FIGURES, perfusion)))
            ul.warnings { @for flag in &perfusion.flags { li { (flag.reason) } } }
            (document::table(&score_table(perfusion), "Table of scores"))
        }
    }
}

/// A table of a report without lists of an entry for each node, step or moment, and without matrices.
pub(super) fn short(mut table: Map<String, Value>) -> Value {
    table.retain(|name, value| {
        let long = value.as_array().is_some_and(|list| list.len() > 4);
        !long && !name.starts_with("affine")
    });
    Value::Object(table)
}
