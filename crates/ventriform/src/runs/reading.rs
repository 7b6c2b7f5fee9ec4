//! What a reader states of a stored result, as files.
//!
//! In: the statement ([`ReadingParameters`]), and the files of the result. Out: `reading.json` ([`ReadingReport`]) and copies
//! of the report, of the pictures and of what its structured report is made of ([`kept_files`]), so that the reading can be
//! shown and sent when the result is gone.
//!
//! Guaranteed: the statement is written as it was given; a statement that the result has no place for is refused.

use crate::image::volume::Provenance;
use crate::parameters::ReadingParameters;
use crate::results::report::{self, ReadKind, ReadingPage, ReadingReport};
use crate::runs::segmentation::{NamedFile, json_file};
use serde_json::{Map, Value};

/// The file with the reading.
pub const READING_FILE: &str = "reading.json";

/// The files of a reading: itself, and those that it keeps of every kind of result.
pub const FILE_NAMES: &[&str] = &[
    READING_FILE,
    "report.html",
    "comparison.json",
    "report.json",
    "beat.json",
    "mask.nii.gz",
    "mesh.json",
    "slices.png",
    "polar_stress.svg",
    "polar_rest.svg",
    "polar_difference.svg",
    "polar.svg",
    "polar_motion.svg",
    "polar_thickening.svg",
    "polar_phase.svg",
    "curve.svg",
];

/// Those of them that [`page`] is made of.
pub const PAGE_FILES: &[&str] = &[
    READING_FILE,
    "comparison.json",
    "report.json",
    "beat.json",
    "slices.png",
    "polar_stress.svg",
    "polar_rest.svg",
    "polar_difference.svg",
    "polar.svg",
    "polar_motion.svg",
    "polar_thickening.svg",
    "polar_phase.svg",
    "curve.svg",
];

/// A picture of a result: its file and its title.
type Picture = (&'static str, &'static str);

const COMPARISON_PICTURES: &[Picture] = &[
    ("slices.png", "Slices of stress above those of rest"),
    ("polar_stress.svg", "Uptake at stress"),
    ("polar_rest.svg", "Uptake at rest"),
    ("polar_difference.svg", "Rest less stress"),
];

const SEGMENTATION_PICTURES: &[Picture] = &[("slices.png", "Slices"), ("polar.svg", "Uptake")];

const BEAT_PICTURES: &[Picture] = &[
    ("curve.svg", "Volume over the cycle"),
    ("polar.svg", "Uptake"),
    ("polar_motion.svg", "Motion inward"),
    ("polar_thickening.svg", "Thickening"),
    ("polar_phase.svg", "Phase"),
];

/// Why a result is not read as stated.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReadingError {
    /// The statement lacks what every reading has.
    #[error("`{field}` is missing")]
    Missing {
        /// The field.
        field: &'static str,
    },
    /// The result has no place for part of the statement.
    #[error("`{field}` is given, and the result {reason}")]
    NoPlace {
        /// The field.
        field: &'static str,
        /// Why.
        reason: &'static str,
    },
    /// The stored report cannot be read.
    #[error("the report of the result cannot be read: {0}")]
    Report(String),
}

/// The report of a kind of result.
pub fn report_file(kind: ReadKind) -> &'static str {
    match kind {
        ReadKind::Comparison => "comparison.json",
        ReadKind::Segmentation => "report.json",
        ReadKind::Beat => "beat.json",
    }
}

/// The files that a reading keeps of a kind of result: its report, the pictures, and of a single scan mask and mesh, to which
/// its structured report refers.
pub fn kept_files(kind: ReadKind) -> impl Iterator<Item = &'static str> {
    let shape: &[&str] = match kind {
        ReadKind::Segmentation => &["mask.nii.gz", "mesh.json"],
        ReadKind::Comparison | ReadKind::Beat => &[],
    };
    let pictures = pictures(kind).iter().map(|(name, _)| *name);
    let first = std::iter::once(report_file(kind));
    first.chain(shape.iter().copied()).chain(pictures)
}

fn pictures(kind: ReadKind) -> &'static [Picture] {
    match kind {
        ReadKind::Comparison => COMPARISON_PICTURES,
        ReadKind::Segmentation => SEGMENTATION_PICTURES,
        ReadKind::Beat => BEAT_PICTURES,
    }
}

/// A report as JSON.
///
/// # Errors
/// [`ReadingError::Report`].
pub fn report_of(bytes: &[u8]) -> Result<Map<String, Value>, ReadingError> {
    serde_json::from_slice(bytes).map_err(|error| ReadingError::Report(error.to_string()))
}

/// The reading that `stated` makes of a result with this report.
///
/// # Errors
/// [`ReadingError`].
pub fn read(
    stated: &ReadingParameters,
    kind: ReadKind,
    report: &Map<String, Value>,
) -> Result<ReadingReport, ReadingError> {
    let scored_twice = kind == ReadKind::Comparison;
    for (field, given, has_place) in [
        ("scores", stated.scores.is_some(), !scored_twice),
        (
            "stress_scores",
            stated.stress_scores.is_some(),
            scored_twice,
        ),
        ("rest_scores", stated.rest_scores.is_some(), scored_twice),
    ] {
        if given && !has_place {
            let reason = match scored_twice {
                true => "has two scans",
                false => "has one scan",
            };
            return Err(ReadingError::NoPlace { field, reason });
        }
    }
    let scored = [stated.scores, stated.stress_scores, stated.rest_scores];
    if stated.impression.is_none() && scored.iter().all(Option::is_none) {
        return Err(ReadingError::Missing {
            field: "impression",
        });
    }
    let missing = match stated.reader {
        None => "reader",
        Some(_) => "read_at",
    };
    ReadingReport::new(stated, kind, report).ok_or(ReadingError::Missing { field: missing })
}

/// The files of a reading; `content` gives those of the result, by name.
///
/// # Errors
/// Those of `content`.
pub fn files<E>(
    reading: &ReadingReport,
    content: impl Fn(&'static str) -> Result<Option<Vec<u8>>, E>,
) -> Result<Vec<NamedFile>, E> {
    let mut files = vec![json_file(READING_FILE, reading)];
    for name in kept_files(reading.kind) {
        files.extend(content(name)?.map(|bytes| NamedFile {
            name: name.to_owned(),
            media_type: media_type(name),
            bytes,
        }));
    }
    Ok(files)
}

/// The reading of a result with this report as a self-contained page; `content` gives its files, by name. It names whose scan
/// it is as far as `scan` does.
///
/// # Errors
/// Those of `content`.
pub fn page<E>(
    reading: &ReadingReport,
    report: &Map<String, Value>,
    content: impl Fn(&'static str) -> Result<Option<Vec<u8>>, E>,
    scan: Option<&Provenance>,
) -> Result<String, E> {
    let mut found = Vec::new();
    for (name, title) in pictures(reading.kind) {
        found.extend(content(name)?.map(|bytes| (*title, media_type(name), bytes)));
    }
    let pictures: Vec<_> = (found.iter())
        .map(|(title, media_type, bytes)| (*title, *media_type, bytes.as_slice()))
        .collect();
    Ok(report::reading_page(&ReadingPage {
        reading,
        report,
        pictures: &pictures,
        scan,
    }))
}

fn media_type(name: &str) -> &'static str {
    match name.rsplit('.').next() {
        Some("png") => "image/png",
        Some("svg") => "image/svg+xml",
        Some("gz") => "application/gzip",
        _ => "application/json",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stated() -> ReadingParameters {
        ReadingParameters {
            reader: Some("Doe^Jane".into()),
            read_at: Some("2026-11-30T22:15:00Z".into()),
            impression: Some("Normal.".into()),
            ..ReadingParameters::default()
        }
    }

    #[test]
    fn a_reading_keeps_report_and_pictures_of_the_result() {
        let report = report_of(br#"{"ef_percent": 60, "edv_ml": 100}"#).unwrap();
        let reading = read(&stated(), ReadKind::Beat, &report).unwrap();
        let content = |name: &str| Ok::<_, ()>(name.starts_with('c').then(|| b"<svg/>".to_vec()));
        let files = files(&reading, content).unwrap();
        let names: Vec<&str> = files.iter().map(|file| file.name.as_str()).collect();
        assert_eq!(names, [READING_FILE, "curve.svg"]);
        let page = page(&reading, &report, |_| Ok::<_, ()>(None), None).unwrap();
        for said in ["Normal.", "read by Doe, Jane", "Ejection fraction"] {
            assert!(page.contains(said), "{said}");
        }
        for kind in [ReadKind::Comparison, ReadKind::Segmentation, ReadKind::Beat] {
            assert!(kept_files(kind).all(|name| FILE_NAMES.contains(&name)));
            let shown = pictures(kind).iter().map(|(name, _)| *name);
            let mut shown = shown.chain([READING_FILE, report_file(kind)]);
            assert!(shown.all(|name| PAGE_FILES.contains(&name)));
        }
    }

    #[test]
    fn what_the_result_has_no_place_for_is_refused() {
        let refused = |change: &dyn Fn(&mut ReadingParameters), kind| {
            let mut stated = stated();
            change(&mut stated);
            match read(&stated, kind, &Map::new()) {
                Err(ReadingError::NoPlace { field, .. } | ReadingError::Missing { field }) => field,
                other => panic!("{other:?}"),
            }
        };
        let comparison = ReadKind::Comparison;
        assert_eq!(
            refused(&|own| own.scores = Some([0; 17]), comparison),
            "scores"
        );
        let single = ReadKind::Segmentation;
        assert_eq!(
            refused(&|own| own.rest_scores = Some([0; 17]), single),
            "rest_scores"
        );
        assert_eq!(refused(&|own| own.impression = None, single), "impression");
        assert_eq!(refused(&|own| own.reader = None, single), "reader");
        assert_eq!(refused(&|own| own.read_at = None, single), "read_at");
    }
}
