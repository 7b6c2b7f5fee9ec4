//! The page of a segmentation as one picture: whose scan it is, flags, slices with contours, the polar map beside the
//! figures, the segments, and what stands beside normal limits.

use super::page_parts::{flags_headline, limits_line, score_table};
use super::sections::Program;
use super::segmentation_page::{
    agreement_rows, origin, polar_hint, slice_names, title, uptake_table,
};
use super::segmentation_report::SegmentationReport;
use super::sheet_parts::{self, DrawnPage};
use crate::image::draw::Image;
use crate::image::draw::sheet::{Block, COLUMN_GAP_PX, CONTENT_WIDTH_PX, Tone};
use crate::image::draw::table::{Table, TableColumn};
use crate::image::volume::Provenance;
use crate::results::figures::{headlines, perfusion, segmentation};

/// The slices are small: a pixel of theirs is shown as a square of so many.
const SLICES_ENLARGED: usize = 2;

/// A segmentation's report with its pictures.
#[derive(Debug, Clone, Copy)]
pub struct SegmentationSheet<'a> {
    /// The report.
    pub report: &'a SegmentationReport,
    /// Slices of the volume with the contour of the fit: three squares side by side.
    pub slices: Option<&'a Image<3>>,
    /// The polar map.
    pub polar: Option<&'a Image<3>>,
    /// Whose scan it is; `None` leaves out all that the file says of it.
    pub scan: Option<&'a Provenance>,
}

/// The page as a picture. What the report does not contain is left out.
pub fn segmentation_sheet(sheet: &SegmentationSheet<'_>) -> DrawnPage {
    let report = sheet.report;
    let (sign, headline) = flags_headline(report.flags.len(), "segmentation");
    let mut blocks = vec![Block::Sentence(Tone::Soft, origin(report))];
    blocks.extend(sheet.scan.and_then(acquisition));
    blocks.extend(sheet_parts::verdict(sign, headline, &report.flags));
    blocks.extend(slices(sheet));
    blocks.extend(figures(sheet));
    blocks.extend(limits(report));
    blocks.extend(agreement(report));
    if sheet.scan.is_some() {
        blocks.extend(sheet_parts::notes(report.warnings.clone()));
    }
    let scans = sheet.scan.map(|scan| [("", scan)]);
    let scans = scans.as_ref().map_or(&[][..], |scans| &scans[..]);
    DrawnPage::new(&title(report), scans, blocks, Program::this().footer())
}

/// What the file says of how the scan was made.
fn acquisition(scan: &Provenance) -> Option<Block> {
    let field = |name: &str, value: Option<String>| value.map(|value| format!("{name} {value}"));
    let corrected = scan.attenuation_corrected().map(|corrected| {
        let with = if corrected { "with" } else { "without" };
        format!("{with} attenuation correction")
    });
    let fields = [
        field("series", scan.series_description.clone()),
        scan.rest_or_stress
            .as_ref()
            .map(|state| format!("at {state}")),
        field("tracer", scan.radiopharmaceutical.clone()),
        scan.injected_dose_mbq().map(|dose| format!("{dose} MBq")),
        corrected,
        field("reconstruction", scan.reconstruction_method.clone()),
        field("filter", scan.convolution_kernel.clone()),
    ];
    let known: Vec<String> = fields.into_iter().flatten().collect();
    let line = format!("Scan: {}", known.join(" · "));
    (!known.is_empty()).then_some(Block::Sentence(Tone::Plain, line))
}

fn slices(sheet: &SegmentationSheet<'_>) -> Vec<Block> {
    let Some(slices) = sheet.slices else {
        return Vec::new();
    };
    let width = (SLICES_ENLARGED * slices.width).min(CONTENT_WIDTH_PX);
    let (about, names) = slice_names(sheet.report);
    let contours = match sheet.report.measures {
        Some(_) => "Orange: the fitted surface; blue: the expert's mask.",
        None => "Orange: the fitted surface.",
    };
    let about = format!(
        "From the left: {}. {about} {contours}",
        names.join(", ").to_lowercase()
    );
    vec![
        Block::Heading("Slices".into()),
        Block::Pictures(vec![(slices.of_width(width), String::new())]),
        Block::Sentence(Tone::Soft, about),
    ]
}

/// The polar map with its segments on the left, and the figures on the right; figures alone where there is no map.
fn figures(sheet: &SegmentationSheet<'_>) -> Vec<Block> {
    let report = sheet.report;
    let figures = Block::Figures(headlines(segmentation::FIGURES, report));
    let (Some(map), Some(table)) = (sheet.polar, uptake_table(report)) else {
        return vec![Block::Heading("Figures".into()), figures];
    };
    let rest = CONTENT_WIDTH_PX.saturating_sub(map.width + COLUMN_GAP_PX);
    let left = vec![
        Block::Heading("Uptake of the wall".into()),
        Block::Pictures(vec![(map.clone(), String::new())]),
        Block::Sentence(Tone::Soft, polar_hint(report)),
    ];
    let right = vec![
        Block::Heading("Figures".into()),
        figures,
        Block::Table(table),
    ];
    vec![Block::Columns(vec![(map.width, left), (rest, right)])]
}

fn limits(report: &SegmentationReport) -> Vec<Block> {
    let Some(perfusion) = &report.perfusion else {
        return Vec::new();
    };
    let half = (CONTENT_WIDTH_PX - COLUMN_GAP_PX) / 2;
    let mut left = vec![
        Block::Figures(headlines(perfusion::FIGURES, perfusion)),
        Block::Sentence(Tone::Soft, limits_line(perfusion)),
    ];
    let reasons: Vec<String> = perfusion
        .flags
        .iter()
        .map(|flag| flag.reason.clone())
        .collect();
    if !reasons.is_empty() {
        left.push(Block::List(reasons));
    }
    let right = vec![Block::Table(score_table(perfusion))];
    vec![
        Block::Heading("Beside normal limits".into()),
        Block::Columns(vec![(half, left), (half, right)]),
    ]
}

fn agreement(report: &SegmentationReport) -> Vec<Block> {
    let rows = agreement_rows(report);
    if rows.is_empty() {
        return Vec::new();
    }
    let columns = vec![
        TableColumn::name(""),
        TableColumn::number(""),
        TableColumn::text(""),
    ];
    let rows = rows.into_iter().map(Vec::from).collect();
    vec![
        Block::Heading("Against the expert's mask".into()),
        Block::Table(Table { columns, rows }),
    ]
}
