//! The page of a comparison as one picture: whose scans they are, flags, slices beside the figures, polar maps side by
//! side, territories and segments.

use super::comparison_page::{
    self, MAPS_HINT, SLICES_HINT, TITLE, attenuation_notes, missing_figures, scan_table,
    segment_table, territory_table,
};
use super::comparison_report::ComparisonReport;
use super::page_parts::flags_headline;
use super::sections::Program;
use super::sheet_parts::{self, DrawnPage};
use crate::image::draw::Image;
use crate::image::draw::sheet::{Block, COLUMN_GAP_PX, CONTENT_WIDTH_PX, Tone};
use crate::image::volume::Provenance;
use crate::results::figures::comparison::FIGURES;
use crate::results::figures::headlines;

/// Polar maps beside each other.
const MAPS_PER_ROW: usize = 3;
/// Width of a polar map.
const MAP_WIDTH_PX: usize = (CONTENT_WIDTH_PX - (MAPS_PER_ROW - 1) * COLUMN_GAP_PX) / MAPS_PER_ROW;
/// Width of the territories beside the segments.
const TERRITORIES_WIDTH_PX: usize = 560;

/// A comparison's report with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct ComparisonSheet<'a> {
    /// The report.
    pub report: &'a ComparisonReport,
    /// Slices of stress above those of rest.
    pub slices: Option<&'a Image<3>>,
    /// The polar maps, each with its title.
    pub maps: &'a [(&'static str, Image<3>)],
    /// Whose scans those at stress and at rest are; `None` leaves out all that the files say of them.
    pub scans: Option<[&'a Provenance; 2]>,
}

/// The page as a picture. What the report does not contain is left out.
pub fn comparison_sheet(sheet: &ComparisonSheet<'_>) -> DrawnPage {
    let report = sheet.report;
    let scans = sheet
        .scans
        .map(|[stress, rest]| [("stress", stress), ("rest", rest)]);
    let (sign, headline) = flags_headline(report.flags.len(), "comparison");
    let mut blocks = vec![Block::Sentence(Tone::Soft, origin(sheet))];
    blocks.extend(sheet_parts::verdict(sign, headline, &report.flags));
    blocks.push(pictures_and_figures(sheet));
    blocks.extend(maps(sheet));
    blocks.extend(tables(report));
    if sheet.scans.is_some() {
        let both = [("stress", &report.stress), ("rest", &report.rest)];
        let warnings = both.into_iter().flat_map(|(name, scan)| {
            let warnings = scan.warnings.iter();
            warnings.map(move |warning| format!("At {name}: {warning}"))
        });
        blocks.extend(sheet_parts::notes(warnings.collect()));
    }
    let scans = scans.as_ref().map_or(&[][..], |scans| &scans[..]);
    DrawnPage::new(TITLE, scans, blocks, Program::this().footer())
}

/// One line on what both scans are.
fn origin(sheet: &ComparisonSheet<'_>) -> String {
    comparison_page::origin(sheet.report, sheet.scans.is_some())
}

/// Slices on the left; figures and the facts of both scans on the right.
fn pictures_and_figures(sheet: &ComparisonSheet<'_>) -> Block {
    let report = sheet.report;
    let mut facts = vec![Block::Figures(headlines(FIGURES, report))];
    let missing = missing_figures(report).into_iter();
    facts.extend(missing.map(|hint| Block::Sentence(Tone::Soft, hint)));
    let mut table = scan_table(report, sheet.scans.is_some());
    if let Some(scans) = sheet.scans {
        let rows = [
            (
                "reconstruction",
                scans.map(|scan| &scan.reconstruction_method),
            ),
            ("filter", scans.map(|scan| &scan.convolution_kernel)),
        ];
        for (name, both) in rows {
            if both.iter().any(|text| text.is_some()) {
                let text = |text: &Option<String>| text.clone().unwrap_or("not stated".into());
                let [stress, rest] = both.map(text);
                table.rows.push(vec![name.to_owned(), stress, rest]);
            }
        }
    }
    facts.push(Block::Table(table));
    let notes = attenuation_notes(report).into_iter();
    facts.extend(notes.map(|note| Block::Sentence(Tone::Soft, note)));
    let Some(slices) = sheet.slices else {
        return Block::Columns(vec![(CONTENT_WIDTH_PX, facts)]);
    };
    let pictures = vec![
        Block::Pictures(vec![(slices.clone(), String::new())]),
        Block::Sentence(Tone::Soft, SLICES_HINT.to_owned()),
    ];
    let rest = CONTENT_WIDTH_PX.saturating_sub(slices.width + COLUMN_GAP_PX);
    Block::Columns(vec![(slices.width, pictures), (rest, facts)])
}

fn maps(sheet: &ComparisonSheet<'_>) -> Vec<Block> {
    if sheet.maps.is_empty() {
        return Vec::new();
    }
    let mut blocks = vec![Block::Heading("Maps of the wall".into())];
    for row in sheet.maps.chunks(MAPS_PER_ROW) {
        let row = row.iter();
        let row = row.map(|(title, map)| (map.of_width(MAP_WIDTH_PX), (*title).to_owned()));
        blocks.push(Block::Pictures(row.collect()));
    }
    blocks.push(Block::Sentence(Tone::Soft, MAPS_HINT.to_owned()));
    blocks
}

fn tables(report: &ComparisonReport) -> Vec<Block> {
    let mut blocks = vec![Block::Heading("Territories and segments".into())];
    let segments = vec![Block::Table(segment_table(report))];
    match territory_table(report) {
        Some(territories) => {
            let rest = CONTENT_WIDTH_PX - TERRITORIES_WIDTH_PX - COLUMN_GAP_PX;
            blocks.push(Block::Columns(vec![
                (rest, segments),
                (TERRITORIES_WIDTH_PX, vec![Block::Table(territories)]),
            ]));
        }
        None => blocks.extend(segments),
    }
    blocks
}
