//! Normal limits from a folder of healthy people's scans.
//!
//! In: a folder with `cohort.csv` ([`table`]) and the scans that it names. Out: [`NormalLimits`], one group for each
//! sex, protocol, tracer and correction.
//!
//! 1. Every healthy case is fitted with the built-in hearts; of several gates the sum is fitted, and the beat.
//! 2. A case is left out, with the reason, if it cannot be read or fitted, if its fit has a confidence below
//!    [`LEAST_CONFIDENCE`] or a flag that speaks against its uptake or place ([`FLAGS_OF_NO_NORMAL`]), or if its
//!    orientation is unknown.
//! 3. [`group_of`] builds the limits of each group, and leaves out who lies beyond the limits of the others.
//! 4. Where a case names its scan at rest, the ratio of the cavities is a figure of its group, `tid`.
//!
//! Guaranteed: the same files, parameters and program give the same bytes, on any number of threads.
//!
//! Not guaranteed: that the people are healthy. Whoever fills in the table says so.

pub mod table;

use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::heart::normals::{
    ExcludedCase, GroupError, GroupKind, GroupSex, HealthyScan, HeartFigure, NormalCase,
    NormalLimits, NormalsError, ScanPlaces, group_of,
};
use crate::image::volume::{HeldGates, ReadLimits, VolumeFile, hold_gates};
use crate::parameters::{BeatChoice, NormalsParameters};
use crate::runs::evaluate::error::EvaluateError;
use crate::runs::evaluate::files::{sha256_of, write_whole};
use crate::runs::gated::{self, GatedOrder, beat_figures};
use crate::runs::segmentation::{self, Segmentation, SegmentationOrder, heart_figures};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
pub use table::CohortRow;
use table::TableError;

/// Confidence of a fit below which a case is left out.
pub const LEAST_CONFIDENCE: f64 = 0.5;

/// Flags of a fit that speak against its uptake or its place. Others, such as those of the septum's shape, are raised
/// for one healthy heart in seven.
const FLAGS_OF_NO_NORMAL: [&str; 10] = [
    "mirrored",
    "uncertain_place",
    "motion",
    "label_map",
    "dark_apex",
    "folded",
    "poor_contrast",
    "field_of_view",
    "touches_border",
    "implausible_shape",
];

/// Reason why a case without a place in the limits is left out.
const NOT_HEALTHY: &str = "the table does not say that it is healthy";

/// A scan of a cohort.
#[derive(Debug, Clone)]
pub struct CohortScan {
    /// Whose it is, and how it was made.
    pub row: CohortRow,
    /// Its files.
    pub paths: Vec<PathBuf>,
}

/// Options of [`build`].
#[derive(Debug, Clone)]
pub struct NormalsOptions {
    /// The parameters.
    pub parameters: NormalsParameters,
    /// The program's version, for the file.
    pub program_version: String,
    /// Limits of what is read.
    pub limits: ReadLimits,
}

/// Why no limits can be built of a folder.
#[derive(Debug, thiserror::Error)]
pub enum BuildError {
    /// The table cannot be read.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A group has too few people.
    #[error("{error}{}", reasons(.excluded))]
    Normals {
        /// Why.
        error: NormalsError,
        /// The cases that were left out.
        excluded: Vec<ExcludedCase>,
    },
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] EvaluateError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

fn reasons(excluded: &[ExcludedCase]) -> String {
    excluded.iter().fold(String::new(), |mut text, case| {
        write!(text, "\n  left out: {}: {}", case.case, case.reason)
            .expect("a string takes any text");
        text
    })
}

/// A case that was fitted.
struct FittedCase {
    places: ScanPlaces,
    figures: Vec<HeartFigure>,
    sha256: String,
    cavity_ml: f64,
}

/// The limits of the healthy cases in `folder`. `told` hears of every case as it is done.
///
/// # Errors
/// [`BuildError`].
pub fn build(
    folder: &Path,
    options: &NormalsOptions,
    told: &(dyn Fn(&str, Result<(), &str>) + Sync),
    monitor: &Monitor,
) -> Result<NormalLimits, BuildError> {
    let rows = table::read(folder)?.into_iter();
    let scans = rows.map(|row| CohortScan {
        paths: vec![folder.join(&row.file)],
        row,
    });
    of_scans(&scans.collect::<Vec<_>>(), options, told, monitor)
}

/// The limits of the healthy cases among `scans`. `told` hears of every case as it is done.
///
/// # Errors
/// [`BuildError`].
pub fn of_scans(
    scans: &[CohortScan],
    options: &NormalsOptions,
    told: &(dyn Fn(&str, Result<(), &str>) + Sync),
    monitor: &Monitor,
) -> Result<NormalLimits, BuildError> {
    let rows: Vec<&CohortRow> = scans.iter().map(|scan| &scan.row).collect();
    let done = AtomicUsize::new(0);
    let fitted: Vec<Result<FittedCase, String>> = (scans.par_iter())
        .map(|scan| {
            let row = &scan.row;
            let is_rest = |other: &&CohortRow| other.rest_case.as_ref() == Some(&row.case);
            let made = if row.healthy || rows.iter().any(is_rest) {
                fitted_case(scan, options, monitor)?
            } else {
                Err(NOT_HEALTHY.to_owned())
            };
            told(&row.case, made.as_ref().map(|_| ()).map_err(String::as_str));
            let done = done.fetch_add(1, Ordering::Relaxed) + 1;
            monitor.report(Stage::Deform, done as f64 / scans.len() as f64)?;
            Ok(made)
        })
        .collect::<Result<_, Cancelled>>()?;
    let cavity_of = |case: &String| {
        let at = rows.iter().position(|row| row.case == *case)?;
        Some(fitted[at].as_ref().ok()?.cavity_ml)
    };
    let (mut kinds, mut excluded) = (BTreeMap::<GroupKind, Vec<HealthyScan>>::new(), Vec::new());
    for (row, fitted) in rows.iter().zip(&fitted) {
        let leave_out = |reason: &str| ExcludedCase {
            case: row.case.clone(),
            reason: reason.to_owned(),
        };
        if !row.healthy {
            excluded.push(leave_out(NOT_HEALTHY));
            continue;
        }
        let fitted = match fitted {
            Ok(fitted) => fitted,
            Err(reason) => {
                excluded.push(leave_out(reason));
                continue;
            }
        };
        let kind = GroupKind {
            sex: if options.parameters.choice.mixed {
                GroupSex::Mixed
            } else {
                row.sex.into()
            },
            protocol: row.protocol.clone(),
            tracer: row.tracer.clone(),
            attenuation_corrected: row.attenuation_corrected,
        };
        let mut figures = fitted.figures.clone();
        let rest = row
            .rest_case
            .as_ref()
            .and_then(cavity_of)
            .filter(|ml| *ml > 0.0);
        figures.extend(rest.map(|rest| HeartFigure::whole("tid", fitted.cavity_ml / rest)));
        kinds.entry(kind).or_default().push(HealthyScan {
            case: NormalCase {
                case: row.case.clone(),
                sex: row.sex.into(),
                sha256: fitted.sha256.clone(),
            },
            places: fitted.places.clone(),
            figures,
        });
    }
    let mut groups = Vec::new();
    for (number, (kind, people)) in kinds.iter().enumerate() {
        monitor.report(Stage::Report, number as f64 / kinds.len() as f64)?;
        match group_of(kind, people, monitor) {
            Ok((group, odd)) => {
                groups.push(group);
                excluded.extend(odd);
            }
            Err(GroupError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(GroupError::Normals(error)) => {
                return Err(BuildError::Normals { error, excluded });
            }
        }
    }
    if groups.is_empty() {
        let error = NormalsError::TooFewCases {
            group: "the table".to_owned(),
            cases: 0,
        };
        return Err(BuildError::Normals { error, excluded });
    }
    let simulated = rows.iter().any(|row| row.is_simulated());
    let parameters = options.parameters.to_json();
    Ok(NormalLimits::new(
        &options.program_version,
        simulated,
        groups,
        excluded,
        parameters,
    ))
}

/// Writes limits to a file, whole or not at all.
///
/// # Errors
/// [`BuildError::File`].
pub fn write(limits: &NormalLimits, path: &Path) -> Result<(), BuildError> {
    Ok(write_whole(path, limits.to_json().as_bytes())?)
}

/// A case's wall and figures, or why it is left out.
fn fitted_case(
    scan: &CohortScan,
    options: &NormalsOptions,
    monitor: &Monitor,
) -> Result<Result<FittedCase, String>, Cancelled> {
    monitor.check()?;
    let sha256 = match sha256_of(&scan.paths) {
        Ok(sha256) => sha256,
        Err(error) => return Ok(Err(format!("{}: {error}", scan.row.file))),
    };
    let quiet = monitor.without_observer();
    let files: Vec<VolumeFile> = scan.paths.iter().map(VolumeFile::at).collect();
    let (segmentation, figures) = match fitted(&files, options, &quiet) {
        Ok(fitted) => fitted,
        Err(reason) => {
            monitor.check()?;
            return Ok(Err(reason));
        }
    };
    Ok(usable(&segmentation).map(|(places, cavity_ml)| FittedCase {
        places,
        figures,
        sha256,
        cavity_ml,
    }))
}

/// The fit to a scan, or to the sum of its gates, and the figures of the heart, of its beat too if it is gated; or why
/// there is none.
fn fitted(
    files: &[VolumeFile],
    options: &NormalsOptions,
    monitor: &Monitor,
) -> Result<(Segmentation, Vec<HeartFigure>), String> {
    let (parameters, limits) = (&options.parameters.fit, &options.limits);
    let held = hold_gates(files, false, limits, monitor).map_err(|error| error.to_string())?;
    if held == HeldGates::Beat {
        let order = GatedOrder {
            gates: files,
            auto: true,
            models: Vec::new(),
            normals: None,
            parameters,
            choice: BeatChoice::default(),
        };
        let made = gated::from_files(&order, limits, monitor).map_err(|error| error.to_string())?;
        let figures = beat_figures(&made.segmentation, &made.beat);
        return Ok((made.segmentation, figures));
    }
    let order = SegmentationOrder::of_built_in_hearts(files, parameters);
    let made =
        segmentation::from_files(&order, limits, monitor).map_err(|error| error.to_string())?;
    let figures = heart_figures(&made.segmentation);
    Ok((made.segmentation, figures))
}

/// The wall and the cavity of a fit that limits can stand on, or why they cannot.
fn usable(segmentation: &Segmentation) -> Result<(ScanPlaces, f64), String> {
    let judgement = &segmentation.fit.judgement;
    if judgement.confidence < LEAST_CONFIDENCE {
        return Err(format!(
            "the fit's confidence is {:.2}; {LEAST_CONFIDENCE} is needed",
            judgement.confidence
        ));
    }
    let raised = (judgement.flags.iter()).find(|flag| FLAGS_OF_NO_NORMAL.contains(&flag.code()));
    if let Some(flag) = raised {
        return Err(format!("the fit is flagged {}: {flag}", flag.code()));
    }
    let map = segmentation.polar.as_ref().filter(|map| map.is_oriented());
    let map = map.ok_or("the orientation of the heart is unknown")?;
    let surfaces = segmentation.fit.model.surfaces.as_ref();
    let surfaces = surfaces.ok_or("the fit has no anatomical wall")?;
    Ok((
        ScanPlaces::from_map(map),
        surfaces.anatomical.wall.cavity_ml,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::volume::nifti::{self, StoredType};
    use crate::image::volume::phantom::{PhantomParameters, phantom};

    /// Gates of a heart that becomes smaller and thicker, one file each.
    fn gates() -> Vec<VolumeFile> {
        let usual = PhantomParameters::default();
        let gate = |gate: usize| {
            let contraction = (1.0 - (std::f64::consts::TAU * gate as f64 / 8.0).cos()) / 2.0;
            let parameters = PhantomParameters {
                shape: [40; 3],
                spacing_mm: [6.0; 3],
                width_mm: usual.width_mm * (1.0 - 0.12 * contraction),
                wall_mm: usual.wall_mm * (1.0 + 0.2 * contraction),
                ..usual.clone()
            };
            let made = phantom(&parameters, &Monitor::silent()).unwrap();
            let bytes = nifti::write(&made.volume, StoredType::Float32, false).unwrap();
            VolumeFile::in_memory(format!("gate{gate}.nii"), bytes)
        };
        (0..8).map(gate).collect()
    }

    /// Limits of EF, volumes and motion come from gated cases alone.
    #[test]
    fn a_gated_case_has_the_figures_of_its_beat() {
        let options = NormalsOptions {
            parameters: NormalsParameters::default(),
            program_version: "0".to_owned(),
            limits: ReadLimits::default(),
        };
        let files = gates();
        let names = |files: &[VolumeFile]| -> Vec<String> {
            let (_, figures) = fitted(files, &options, &Monitor::silent()).unwrap();
            figures.iter().map(|own| own.figure.to_owned()).collect()
        };
        let of_beat = ["ef_percent", "edv_ml", "esv_ml", "motion_mm"];
        let gated = names(&files);
        for figure in of_beat {
            assert!(
                gated.iter().any(|name| name == figure),
                "{figure}: {gated:?}"
            );
        }
        let still = names(&files[..1]);
        assert_eq!(still, ["cavity_ml", "wall_ml"]);
    }
}
