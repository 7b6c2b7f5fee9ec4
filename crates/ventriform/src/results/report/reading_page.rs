//! The page of a reading, for whoever asked for the study: whose it is, the impression, who read it and when, the figures,
//! scores beside the automatic ones, pictures.

use super::reading_report::{ReadKind, ReadScores, ReadingReport};
use super::sections::Program;
use super::whose;
use crate::heart::polar::SEGMENT_NAMES;
use crate::image::draw::document::{self, HtmlDocument};
use crate::image::draw::table::{Table, TableColumn};
use crate::image::draw::text::data_uri;
use crate::image::volume::Provenance;
use crate::results::figures::{Figure, beat, comparison, headlines, segmentation};
use maud::{Markup, html};
use serde_json::{Map, Value};

/// A reading with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct ReadingPage<'a> {
    /// The reading.
    pub reading: &'a ReadingReport,
    /// The report that was read.
    pub report: &'a Map<String, Value>,
    /// The pictures of the result that was read: title, media type and file.
    pub pictures: &'a [(&'static str, &'static str, &'a [u8])],
    /// Whose scan it is, as far as the page is to name it.
    pub scan: Option<&'a Provenance>,
}

/// The page as HTML. What the reader did not state is left out.
pub fn reading_page(page: &ReadingPage<'_>) -> String {
    let reading = page.reading;
    let reasons = reading.flags.iter().map(|flag| flag.reason.as_str());
    let lines = reading.impression.as_deref().unwrap_or_default().lines();
    HtmlDocument {
        title: title(reading.kind),
        subtitle: &signature(reading),
        body: html! {
            (whose::section(page.scan))
            section {
                h2 { "Impression" }
                @for line in lines { p { (line) } }
                @if reading.impression.is_none() { p.hint { "None was stated." } }
                p.hint { (signature(reading)) }
            }
            (document::figures(&headlines(rows(reading.kind), page.report)))
            (document::notes("Limits of the study", reading.limits.as_deref()))
            (pictures(page.pictures))
            (scores(reading))
            (document::notes("What the program flags", reasons))
        },
        data: None,
        footer: &Program::this().footer(),
    }
    .html()
}

fn title(kind: ReadKind) -> &'static str {
    match kind {
        ReadKind::Comparison => "Left ventricle: rest and stress, read",
        ReadKind::Segmentation => "Left ventricle: one scan, read",
        ReadKind::Beat => "Left ventricle: beat, read",
    }
}

fn rows(kind: ReadKind) -> &'static [Figure] {
    match kind {
        ReadKind::Comparison => comparison::FIGURES,
        ReadKind::Segmentation => segmentation::FIGURES,
        ReadKind::Beat => beat::FIGURES,
    }
}

/// Who read the study, when, and how good it is.
fn signature(reading: &ReadingReport) -> String {
    let at = reading.read_at.replace('T', " ").replace('Z', " UTC");
    let mut parts = vec![format!("read by {}", whose::person(&reading.reader)), at];
    parts.extend(
        reading
            .quality
            .as_ref()
            .map(|quality| format!("quality: {quality}")),
    );
    parts.extend(
        reading
            .amends
            .as_ref()
            .map(|_| "amends a former reading".to_owned()),
    );
    parts.join(" · ")
}

fn pictures(pictures: &[(&'static str, &'static str, &[u8])]) -> Markup {
    html! {
        @if !pictures.is_empty() {
            section {
                h2 { "Pictures" }
                div.row {
                    @for (title, media_type, bytes) in pictures {
                        figure.paper.wide[title.starts_with("Slices")] {
                            img src=(data_uri(media_type, bytes)) alt=(title);
                            figcaption { (title) }
                        }
                    }
                }
            }
        }
    }
}

/// The reader's scores, each beside the automatic one.
fn scores(reading: &ReadingReport) -> Markup {
    let table = score_table(reading);
    html! {
        @if let Some(table) = table {
            section {
                h2 { "Scores" }
                p.hint { "0 normal, 1 slightly, 2 clearly, 3 severely reduced, 4 no uptake." }
                (document::table(&table, "Table of scores"))
                @if let Some(sds) = reading.sds { p { "Summed difference score: " (sds) " of 68." } }
            }
        }
    }
}

/// The table of scores; `None` if no scan was scored.
fn score_table(reading: &ReadingReport) -> Option<Table> {
    let scans = &reading.scores;
    if scans.is_empty() {
        return None;
    }
    let mut columns = vec![TableColumn::number("No."), TableColumn::name("Segment")];
    for scores in scans {
        columns.push(TableColumn::number(match scores.scan.as_str() {
            "stress" => "Stress",
            "rest" => "Rest",
            _ => "Score",
        }));
        if scores.automatic.is_some() {
            columns.push(TableColumn::number("automatic"));
        }
    }
    let cells = |own: &dyn Fn(&ReadScores) -> [Option<String>; 2]| -> Vec<String> {
        let cells = scans.iter().flat_map(|scores| {
            let [read, automatic] = own(scores);
            let dash = || "–".to_owned();
            let automatic = scores
                .automatic
                .as_ref()
                .map(|_| automatic.unwrap_or_else(dash));
            [Some(read.unwrap_or_else(dash)), automatic]
        });
        cells.flatten().collect()
    };
    let mut rows: Vec<Vec<String>> = (SEGMENT_NAMES.iter().enumerate())
        .map(|(at, name)| {
            let of_segment = cells(&|scores| {
                let automatic = scores.automatic.as_ref();
                let automatic = automatic.and_then(|own| *own.get(at)?);
                [
                    Some(scores.segments[at].to_string()),
                    automatic.map(|score| score.to_string()),
                ]
            });
            [vec![(at + 1).to_string(), (*name).to_owned()], of_segment].concat()
        })
        .collect();
    let sums = cells(&|scores| {
        [
            Some(scores.sum.to_string()),
            scores.automatic_sum.map(|sum| sum.to_string()),
        ]
    });
    rows.push([vec![String::new(), "sum".to_owned()], sums].concat());
    Some(Table { columns, rows })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::report::reading_report::tests::first_reading;

    #[test]
    fn a_page_says_who_read_what_and_when_and_escapes_it() {
        let mut reading = first_reading();
        reading.limits = Some("<b>gut</b>".into());
        let page = reading_page(&ReadingPage {
            reading: &reading,
            report: &Map::new(),
            pictures: &[("Slices", "image/png", b"png")],
            scan: None,
        });
        for said in [
            "read by Doe, Jane Dr.",
            "2026-11-30 22:15:00 UTC",
            "<p>Reversible defect.</p>",
            "<p>No dilation.</p>",
            "quality: fair",
            "&lt;b&gt;gut",
            "mid anterior",
            "Summed difference score: 4 of 68",
        ] {
            assert!(page.contains(said), "{said}");
        }
        let table = score_table(&reading).unwrap();
        assert_eq!(table.rows[6][2..], ["4", "3", "0", "0"].map(str::to_owned));
        assert_eq!(table.rows[17][2..], ["4", "3", "0", "0"].map(str::to_owned));
    }
}
