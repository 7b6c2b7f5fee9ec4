//! HTML pages of stored models, segmentations, beats, comparisons, serial comparisons and readings.
//!
//! A page consists mostly of pictures: it is ten times as large as the other files together and
//! takes as long to make as the model, and few are ever looked at. Pages are therefore not stored.
//! Each is made when it is requested, from the product's own files; the volume may have been
//! deleted by then. The scan that a page names is not one of these files: whoever asks hands in what
//! may be shown of it.

use serde_json::{Map, Value};
use std::io;
use std::sync::LazyLock;
use ventriform::image::volume::Provenance;
use ventriform::results::export::read_json::{self, ReadMeshError};
use ventriform::results::report::{
    self, BeatPage, BeatReport, Closeness, ComparisonPage, ComparisonReport, ModelReport,
    ReadingReport, SegmentationPage, SegmentationReport, SerialPage, SerialReport,
};
use ventriform::runs::reading::{self, READING_FILE, report_file};
use ventriform::runs::serial;

/// Why there is no page.
#[derive(Debug, thiserror::Error)]
pub enum PageError {
    /// A required file does not exist.
    #[error("the file {0} is missing")]
    Missing(&'static str),
    /// A file cannot be read.
    #[error("{0} cannot be read: {1}")]
    Io(&'static str, io::Error),
    /// A JSON file cannot be parsed.
    #[error("{0} cannot be parsed: {1}")]
    Json(&'static str, serde_json::Error),
    /// A mesh cannot be parsed.
    #[error("a mesh cannot be used: {0}")]
    Mesh(#[from] ReadMeshError),
}

/// Reads a product's file by name; `None` if it does not exist.
pub type ReadFile<'a> = dyn Fn(&str) -> io::Result<Option<Vec<u8>>> + 'a;

/// The files that [`model_page`] reads.
pub(super) const MODEL_FILES: &[&str] = &["report.json", "mesh.json", "distance.json"];

/// The files that [`segmentation_page`] reads.
pub(super) const SEGMENTATION_FILES: &[&str] = &[
    "report.json",
    "mesh.json",
    OTHER_WALLS[0],
    OTHER_WALLS[1],
    "slices.png",
    "polar.svg",
    "polar.json",
    "region.nii.gz",
    "projections.png",
];

/// The files that [`beat_page`] reads.
pub(super) const BEAT_FILES: &[&str] = &[
    "beat.json",
    END_MESHES[0],
    END_MESHES[1],
    "curve.svg",
    "phase.svg",
    BeatPage::POLAR_MAPS[0].0,
    BeatPage::POLAR_MAPS[1].0,
    BeatPage::POLAR_MAPS[2].0,
    BeatPage::POLAR_MAPS[3].0,
    BeatPage::POLAR_MAPS[4].0,
    BeatPage::POLAR_MAPS[5].0,
];

/// The slices of a comparison, stress above rest.
const COMPARISON_SLICES: &str = "slices.png";

/// The files that [`comparison_page`] reads.
pub(super) const COMPARISON_FILES: &[&str] = &[
    "comparison.json",
    COMPARISON_SLICES,
    ComparisonPage::POLAR_MAPS[0].0,
    ComparisonPage::POLAR_MAPS[1].0,
    ComparisonPage::POLAR_MAPS[2].0,
    ComparisonPage::POLAR_MAPS[3].0,
    ComparisonPage::POLAR_MAPS[4].0,
    ComparisonPage::POLAR_MAPS[5].0,
    ComparisonPage::POLAR_MAPS[6].0,
];

/// The files that [`serial_page`] reads: report and trend, the polar map of every scan that there may be, and the maps of
/// the changes from the first scan and from scan to scan.
pub(super) fn serial_files() -> &'static [&'static str] {
    static FILES: LazyLock<Vec<&'static str>> = LazyLock::new(|| {
        let names = serial::page_files().into_iter();
        names.map(|name| &*name.leak()).collect()
    });
    &FILES
}

/// The page of a reading, made of `reading.json`, and of the report and the pictures that it keeps of the result.
///
/// # Errors
/// [`PageError`].
pub(super) fn reading_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let stated: ReadingReport = from_json(READING_FILE, &required(read, READING_FILE)?)?;
    let name = report_file(stated.kind);
    let report: Map<String, Value> = from_json(name, &required(read, name)?)?;
    reading::page(
        &stated,
        &report,
        |name| optional(read, name),
        Some(&first(scans)),
    )
}

/// The wall at end diastole and at end systole.
const END_MESHES: [&str; 2] = ["mesh_ed.json", "mesh_es.json"];

/// The mesh of the wall by the other edge: one of these, of a ventricle.
const OTHER_WALLS: [&str; 2] = ["mesh_anatomical.json", "mesh_apparent.json"];

/// The page of a model, made of `report.json`, `mesh.json` and, if it exists, `distance.json`.
///
/// # Errors
/// [`PageError`].
pub(super) fn model_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let text = required(read, "report.json")?;
    let report: ModelReport = from_json("report.json", &text)?;
    let mesh = read_json::decode(&required(read, "mesh.json")?)?;
    let closeness: Option<Closeness> = optional(read, "distance.json")?
        .map(|text| from_json("distance.json", &text))
        .transpose()?;
    let scan = first(scans);
    Ok(report::model_page(
        &report,
        &mesh,
        closeness.as_ref(),
        Some(&scan),
    ))
}

/// The page of a segmentation, made of `report.json`, `mesh.json` and those of [`SEGMENTATION_FILES`] that
/// exist.
///
/// # Errors
/// [`PageError`].
pub(super) fn segmentation_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let report: SegmentationReport = from_json("report.json", &required(read, "report.json")?)?;
    let mesh_file = required(read, "mesh.json")?;
    let mesh = read_json::decode(&mesh_file)?;
    let mut other = None;
    for name in OTHER_WALLS {
        if let Some(file) = optional(read, name)? {
            other = Some((read_json::decode(&file)?, read_json::uncertainty(&file)));
        }
    }
    let slices = optional(read, "slices.png")?;
    let polar = optional(read, "polar.svg")?;
    let polar_map: Option<Value> = optional(read, "polar.json")?
        .map(|text| from_json("polar.json", &text))
        .transpose()?;
    let region = optional(read, "region.nii.gz")?;
    let projections = optional(read, "projections.png")?;
    Ok(report::segmentation_page(&SegmentationPage {
        report: &report,
        mesh: &mesh,
        uncertainty: &read_json::uncertainty(&mesh_file),
        other: other
            .as_ref()
            .map(|(mesh, uncertainty)| (mesh, uncertainty.as_slice())),
        slices: slices.as_deref(),
        polar: polar.as_deref(),
        polar_map: polar_map.as_ref(),
        region: region.as_deref(),
        projections: projections.as_deref(),
        scan: Some(&first(scans)),
    }))
}

/// The page of a beat, made of `beat.json`, the meshes at both ends and those of [`BEAT_FILES`] that exist.
///
/// # Errors
/// [`PageError`].
pub(super) fn beat_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let report: BeatReport = from_json("beat.json", &required(read, "beat.json")?)?;
    let diastole = read_json::decode(&required(read, END_MESHES[0])?)?;
    let systole = read_json::decode(&required(read, END_MESHES[1])?)?;
    let curve = optional(read, "curve.svg")?;
    let phase = optional(read, "phase.svg")?;
    let maps = maps(read, &BeatPage::POLAR_MAPS)?;
    Ok(report::beat_page(&BeatPage {
        report: &report,
        curve: curve.as_deref(),
        phase: phase.as_deref(),
        maps: &borrowed(&maps),
        meshes: [&diastole, &systole],
        scan: Some(&first(scans)),
    }))
}

/// The page of a comparison, made of `comparison.json` and those of [`COMPARISON_FILES`] that exist.
///
/// # Errors
/// [`PageError`].
pub(super) fn comparison_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let report = required(read, "comparison.json")?;
    let report: ComparisonReport = from_json("comparison.json", &report)?;
    let scans = [0, 1].map(|place| scans.get(place).map(provenance).unwrap_or_default());
    let report = report.with_scans(scans.each_ref());
    let slices = optional(read, COMPARISON_SLICES)?;
    let maps = maps(read, &ComparisonPage::POLAR_MAPS)?;
    Ok(report::comparison_page(&ComparisonPage {
        report: &report,
        slices: slices.as_deref(),
        maps: &borrowed(&maps),
        scan: Some(&scans[0]),
    }))
}

/// The page of a serial comparison, made of `serial.json` and those of [`serial_files`] that exist.
///
/// # Errors
/// [`PageError`].
pub(super) fn serial_page(
    read: &ReadFile<'_>,
    scans: &[Map<String, Value>],
) -> Result<String, PageError> {
    let report: SerialReport = from_json("serial.json", &required(read, "serial.json")?)?;
    let scans: Vec<_> = scans.iter().map(provenance).collect();
    let report = report.with_scans(&scans);
    let trend = optional(read, "trend.svg")?;
    let mut maps = Vec::new();
    for name in serial_files() {
        maps.extend(optional(read, name)?.map(|svg| (*name, svg)));
    }
    let content = |name: &str| {
        let found = maps.iter().find(|(known, _)| *known == name);
        found.map(|(_, svg)| svg.as_slice())
    };
    let first = report.scans.first();
    let first = first.and_then(|scan| scans.get(scan.given.checked_sub(1)?));
    Ok(report::serial_page(&SerialPage {
        report: &report,
        trend: trend.as_deref(),
        maps: &serial::maps_of(&report, content),
        scan: first,
    }))
}

/// Polar maps with their names.
type NamedMaps = Vec<(&'static str, Vec<u8>)>;

/// Those of the `known` polar maps that exist.
fn maps(
    read: &ReadFile<'_>,
    known: &[(&'static str, &'static str)],
) -> Result<NamedMaps, PageError> {
    let mut maps = Vec::new();
    for (name, _) in known {
        maps.extend(optional(read, name)?.map(|svg| (*name, svg)));
    }
    Ok(maps)
}

fn borrowed(maps: &NamedMaps) -> Vec<(&'static str, &[u8])> {
    let maps = maps.iter();
    maps.map(|(name, svg)| (*name, svg.as_slice())).collect()
}

/// The scan of a product's volume.
fn first(scans: &[Map<String, Value>]) -> Provenance {
    scans.first().map(provenance).unwrap_or_default()
}

/// Fields of a scan that are named; fields of another type are left out.
fn provenance(scan: &Map<String, Value>) -> Provenance {
    serde_json::from_value(scan.clone().into()).unwrap_or_default()
}

fn optional(read: &ReadFile<'_>, name: &'static str) -> Result<Option<Vec<u8>>, PageError> {
    read(name).map_err(|error| PageError::Io(name, error))
}

fn required(read: &ReadFile<'_>, name: &'static str) -> Result<Vec<u8>, PageError> {
    optional(read, name)?.ok_or(PageError::Missing(name))
}

fn from_json<T: serde::de::DeserializeOwned>(
    name: &'static str,
    text: &[u8],
) -> Result<T, PageError> {
    serde_json::from_slice(text).map_err(|error| PageError::Json(name, error))
}
