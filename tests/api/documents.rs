//! Pages of `docs/` that are written from the code.

use crate::helpers::generated;
use std::fmt::Write as _;
use std::path::Path;
use ventriform::results::figures;
use ventriform_service::config::Settings;

const SETTINGS_BEGIN: &str = "<!-- settings: written by scripts/generate.sh -->\n";
const SETTINGS_END: &str = "<!-- end of settings -->\n";

/// Every setting as tables, one for each group.
fn settings_tables() -> String {
    let mut text = String::new();
    let mut group = "";
    for row in Settings::ROWS {
        if row.group != group {
            group = row.group;
            writeln!(
                text,
                "\n**{group}**\n\n| setting | default | what |\n|---|---|---|"
            )
            .unwrap();
        }
        let default = match row.default {
            "" => String::new(),
            value => format!("`{value}`"),
        };
        let what = row.summary().replace('|', "\\|");
        writeln!(text, "| `{}` | {default} | {what} |", row.name).unwrap();
    }
    text.push('\n');
    text
}

/// The page `name` with `tables` between the lines `begin` and `end`.
fn written_into(name: &str, [begin, end]: [&str; 2], tables: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
    let page = std::fs::read_to_string(path).unwrap();
    let (before, rest) = page.split_once(begin).unwrap();
    let (_, after) = rest.split_once(end).unwrap();
    generated(name, &format!("{before}{begin}{tables}{end}{after}"));
}

#[test]
fn the_page_for_operators_lists_every_setting() {
    let marks = [SETTINGS_BEGIN, SETTINGS_END];
    written_into("docs/operations.md", marks, &settings_tables());
}

const FIGURES_BEGIN: &str = "<!-- figures: written by scripts/generate.sh -->\n";
const FIGURES_END: &str = "<!-- end of figures -->\n";

/// What the reports and their parts are called.
const REPORTS: &[(&str, &str)] = &[
    ("SegmentationReport", "Segmentation, `report.json`"),
    ("PolarSegment", "Segmentation: each of `polar.segments`"),
    ("BeatReport", "Beat, `beat.json`"),
    ("SegmentMotionReport", "Beat: each of `segments`"),
    ("ComparisonReport", "Comparison, `comparison.json`"),
    ("ComparedScan", "Comparison: `stress` and `rest`"),
    ("ComparedTerritory", "Comparison: each of `territories`"),
    ("ComparedSegment", "Comparison: each of `segments`"),
    (
        "SerialScan",
        "Serial comparison, `serial.json`: each of `scans`",
    ),
    ("SerialPair", "Serial comparison: each of `pairs`"),
    (
        "SerialSegment",
        "Serial comparison: each of `segments` of a pair",
    ),
    ("Perfusion", "Beside normal limits: `perfusion`"),
    (
        "TerritoryScore",
        "Beside normal limits: each of `territories`",
    ),
    ("SegmentScore", "Beside normal limits: each of `segments`"),
    ("ModelReport", "Model, `report.json`"),
];

/// Every figure as tables, one for each report or part of one.
fn figures_tables() -> String {
    let mut text = String::new();
    for (schema, rows) in figures::TABLES {
        let title = REPORTS.iter().find(|(name, _)| name == schema).unwrap().1;
        writeln!(
            text,
            "\n**{title}**\n\n| figure | place | unit | code | what |\n|---|---|---|---|---|"
        )
        .unwrap();
        for row in *rows {
            let coded = row.coded.map(|coded| coded.concept);
            let code = coded.map_or(String::new(), |c| format!("{}, {}", c.value, c.scheme));
            writeln!(
                text,
                "| {} | `{}` | {} | {code} | {} |",
                row.label,
                row.place,
                row.unit.symbol,
                row.about.trim_end_matches('.')
            )
            .unwrap();
        }
    }
    text.push('\n');
    text
}

#[test]
fn the_page_of_figures_lists_every_figure() {
    written_into(
        "docs/figures.md",
        [FIGURES_BEGIN, FIGURES_END],
        &figures_tables(),
    );
}

/// Every flag that the code can raise has a line on the page of flags.
#[test]
fn the_page_of_flags_has_every_flag() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/flags.md")).unwrap();
    let mut codes = 0;
    for file in [
        "heart/judge/flags.rs",
        "heart/beat/flags.rs",
        "heart/comparison/flags.rs",
        "heart/normals/flags.rs",
        "heart/serial/flags.rs",
    ] {
        let path = root.join("crates/ventriform/src").join(file);
        let source = std::fs::read_to_string(path).unwrap();
        let (_, after) = source.split_once("fn code(&self)").unwrap();
        let (body, _) = after.split_once("\n    }\n").unwrap();
        let own = body.split('"').skip(1).step_by(2);
        for code in own {
            assert!(page.contains(&format!("| `{code}` |")), "{file}: {code}");
            codes += 1;
        }
    }
    assert!(codes > 30, "{codes}");
}
