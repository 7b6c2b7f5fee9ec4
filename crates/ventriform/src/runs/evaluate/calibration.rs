//! A reader's profile from a folder of scans and masks, with figures that say what it is worth.
//!
//! 1. [`cases_of`]: the folders that hold a scan and a mask.
//! 2. Every scan is segmented as `segment` does, without a profile; the distances to its mask and the level of the image
//!    at its mask are measured ([`crate::heart::reader::measure()`], [`crate::heart::reader::measure_level()`]).
//! 3. Every case is judged without a profile, and for both kinds of reader by what the *other* masks teach (held-out; of
//!    one mask there are no others, so that a level is the usual one and distances are zero) and by what all masks teach
//!    (in-sample, they have seen the case).
//! 4. The kind is chosen by the held-out figures: a level where it agrees better by more than [`LEVEL_MARGIN_E_J`].
//! 5. The profile is learnt on all masks.
//!
//! Guaranteed: the same files give the same profile and figures, on any number of threads.

use super::cohort::{case_file, mask_file, mask_on};
use super::files::sha256_of_volume;
use super::paired::PairedDifference;
use super::sample::Sample;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::FittedModel;
use crate::heart::reader::{
    self, Learnt, LearntOn, ReaderDrawing, ReaderKind, ReaderOffsets, ReaderProfile, WallImage,
};
use crate::image::grid::agreement::compare;
use crate::image::grid::voxelise::{Mask, voxelise};
use crate::image::volume::{ReadLimits, VolumeFile};
use crate::parameters::FitParameters;
use crate::runs::segmentation::{SegmentationOrder, from_files};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A scan and a reader's mask of it.
#[derive(Debug, Clone)]
pub struct CalibrationCase {
    /// Its name in figures and problems: of a folder's case that of its folder.
    pub name: String,
    /// The files of the scan.
    pub scan: Vec<VolumeFile>,
    /// The files of the mask.
    pub mask: Vec<VolumeFile>,
}

impl CalibrationCase {
    /// A case of two files.
    pub fn of_files(name: String, scan: &Path, mask: &Path) -> Self {
        let [scan, mask] = [scan, mask].map(|path| vec![VolumeFile::at(path)]);
        Self { name, scan, mask }
    }
}

/// The cases of `folder`, by name: its folders with a scan (`spect.nii.gz`, `.nii` or `.dcm`) and a mask
/// of that name, without ending.
///
/// # Errors
/// If the folder cannot be read.
pub fn cases_of(folder: &Path, mask: &str) -> std::io::Result<Vec<CalibrationCase>> {
    let mut cases = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let name = entry?.file_name().to_string_lossy().into_owned();
        let scan = case_file(folder, &name, "spect");
        let mask = mask_file(folder, &name, mask);
        if let (Some(scan), Some(mask)) = (scan, mask) {
            cases.push(CalibrationCase::of_files(name, &scan, &mask));
        }
    }
    cases.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(cases)
}

/// Agreement of a mask with a reader's.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CaseFigures {
    /// E_J.
    pub jaccard: f64,
    /// E_CD, voxels; NaN where a mask is empty.
    pub contour: f64,
    /// Volume of the fitted wall, ml.
    pub wall_ml: f64,
    /// Volume of its cavity, ml.
    pub cavity_ml: f64,
}

/// Held-out agreement (E_J) by which a level must be better than distances to be chosen. Readers of either kind differ by
/// more than ten times as much.
pub const LEVEL_MARGIN_E_J: f64 = 0.01;

/// Agreement by what was learnt of one kind of reader.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct KindFigures {
    /// Learnt on the other masks. `None` if there are none and the kind is the edge, which is then drawn as it is.
    pub held_out: Option<CaseFigures>,
    /// Learnt on all masks.
    pub in_sample: CaseFigures,
}

/// One case of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationRow {
    /// The case.
    pub case: String,
    /// The distances measured on its mask.
    pub measured: ReaderOffsets,
    /// The level measured on its mask, a share of the polar map's reference.
    pub level: f64,
    /// Volume of the reader's wall, ml.
    pub reader_ml: f64,
    /// Without a profile.
    pub without: CaseFigures,
    /// By distances.
    pub by_edge: KindFigures,
    /// By a level.
    pub by_level: KindFigures,
}

impl CalibrationRow {
    /// The figures of a kind.
    pub fn by(&self, kind: ReaderKind) -> KindFigures {
        match kind {
            ReaderKind::Edge => self.by_edge,
            ReaderKind::Level => self.by_level,
        }
    }
}

/// A profile with its figures.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The profile.
    pub profile: ReaderProfile,
    /// The cases.
    pub rows: Vec<CalibrationRow>,
    /// Cases that taught nothing, and why.
    pub problems: Vec<(String, String)>,
}

impl Calibration {
    /// The kind of the profile.
    pub fn kind(&self) -> ReaderKind {
        self.profile.learnt.kind()
    }

    /// The figures of a row by the profile's kind, judged on that sample.
    pub fn figures(&self, row: &CalibrationRow, sample: Sample) -> Option<CaseFigures> {
        let own = row.by(self.kind());
        match sample {
            Sample::InSample => Some(own.in_sample),
            Sample::HeldOut => own.held_out,
        }
    }

    /// Change of E_J by the profile, from the figures of that sample.
    pub fn gain(&self, sample: Sample) -> Option<PairedDifference> {
        let gains: Vec<f64> = (self.rows.iter())
            .filter_map(|row| Some(self.figures(row, sample)?.jaccard - row.without.jaccard))
            .collect();
        PairedDifference::from_differences(&gains)
    }

    /// Mean E_J of the cases without a profile, and held-out by each kind.
    pub fn mean_jaccards(&self) -> MeanJaccards {
        MeanJaccards::from_rows(&self.rows)
    }
}

/// Mean E_J over the cases.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MeanJaccards {
    /// Without a profile.
    pub without: f64,
    /// By distances learnt on the other masks.
    pub edge: f64,
    /// By a level learnt on the other masks.
    pub level: f64,
}

impl MeanJaccards {
    fn from_rows(rows: &[CalibrationRow]) -> Self {
        let mean = |of: fn(&CalibrationRow) -> CaseFigures| {
            rows.iter().map(|row| of(row).jaccard).sum::<f64>() / rows.len().max(1) as f64
        };
        Self {
            without: mean(|row| row.without),
            edge: mean(|row| row.by_edge.held_out.unwrap_or(row.without)),
            level: mean(|row| row.by_level.held_out.unwrap_or(row.without)),
        }
    }

    fn kind(self) -> ReaderKind {
        if self.level > self.edge + LEVEL_MARGIN_E_J {
            ReaderKind::Level
        } else {
            ReaderKind::Edge
        }
    }
}

/// Why there is no profile.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The folder cannot be read.
    #[error("{}: {error}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// Why.
        error: std::io::Error,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// No case can be used.
    #[error("no mask can be learnt from: {}", reasons.join("; "))]
    NoMask {
        /// The problem of each case.
        reasons: Vec<String>,
    },
}

/// Learns the profile of the reader who drew the masks of `cases`. `parameters` are those of the fits,
/// and their edge is the wall that the distances start from. `progress` is told the share of the cases
/// that is done, from any thread; `monitor` is told nothing and may cancel.
///
/// # Errors
/// [`CalibrationError::NoMask`] or [`CalibrationError::Cancelled`]. A case that cannot be used is a problem of the result.
pub fn calibrate(
    cases: &[CalibrationCase],
    parameters: &FitParameters,
    progress: &(dyn Fn(f64) + Sync),
    monitor: &Monitor<'_>,
) -> Result<Calibration, CalibrationError> {
    let monitor = &monitor.without_observer();
    let done = AtomicUsize::new(0);
    let read: Vec<Result<ReadCase, String>> = cases
        .par_iter()
        .with_max_len(1)
        .map(|case| {
            let read = ReadCase::new(case, parameters, monitor);
            // A case that ended because of the caller is no problem of the case.
            monitor.check()?;
            let count = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress(count as f64 / cases.len() as f64);
            Ok(read)
        })
        .collect::<Result<_, Cancelled>>()?;
    let (mut usable, mut problems) = (Vec::new(), Vec::new());
    for (case, read) in cases.iter().zip(read) {
        match read {
            Ok(read) => usable.push((case.name.clone(), read)),
            Err(reason) => problems.push((case.name.clone(), reason)),
        }
    }
    let measured: Vec<ReaderOffsets> = usable.iter().map(|(_, c)| c.measured).collect();
    let levels: Vec<f64> = usable.iter().map(|(_, c)| c.level).collect();
    let Some(offsets) = reader::learn(&measured) else {
        let named = problems.iter().map(|(case, why)| format!("{case}: {why}"));
        let mut reasons: Vec<String> = named.collect();
        if reasons.is_empty() {
            reasons.push("no folder has both a scan and a mask".into());
        }
        return Err(CalibrationError::NoMask { reasons });
    };
    let by_edge = Learnt::Edge(offsets);
    let by_level = Learnt::Level(reader::learn_level(&levels));
    let rows: Vec<CalibrationRow> = usable
        .par_iter()
        .enumerate()
        .with_max_len(1)
        .map(|(place, (name, case))| {
            let judged = |learnt: Learnt| case.judged(&learnt.drawing(), monitor);
            let other_offsets = reader::learn(&without_one(&measured, place));
            let other_level = reader::learn_level(&without_one(&levels, place));
            let held_out = other_offsets.map(|offsets| judged(Learnt::Edge(offsets)));
            Ok(CalibrationRow {
                case: name.clone(),
                measured: case.measured,
                level: case.level,
                reader_ml: case.reader_ml,
                without: case.judged(&ReaderDrawing::Edge(ReaderOffsets::default()), monitor)?,
                by_edge: KindFigures {
                    held_out: held_out.transpose()?,
                    in_sample: judged(by_edge)?,
                },
                by_level: KindFigures {
                    held_out: Some(judged(Learnt::Level(other_level))?),
                    in_sample: judged(by_level)?,
                },
            })
        })
        .collect::<Result<_, Cancelled>>()?;
    let learnt = match MeanJaccards::from_rows(&rows).kind() {
        ReaderKind::Edge => by_edge,
        ReaderKind::Level => by_level,
    };
    // Not in the order of the folders' names, which may be those of patients.
    let mut learnt_on: Vec<LearntOn> = usable.iter().map(|(_, c)| c.learnt_on.clone()).collect();
    learnt_on.sort();
    Ok(Calibration {
        profile: ReaderProfile {
            edge: parameters.deform.edge,
            learnt,
            learnt_on,
        },
        rows,
        problems,
    })
}

/// All values but one.
fn without_one<T: Copy>(values: &[T], left_out: usize) -> Vec<T> {
    let others = values.iter().enumerate();
    others
        .filter(|(place, _)| *place != left_out)
        .map(|(_, value)| *value)
        .collect()
}

/// A case's fit and mask.
struct ReadCase {
    fit: FittedModel,
    image: WallImage,
    drawn: Mask,
    frame: VoxelToPatient,
    measured: ReaderOffsets,
    level: f64,
    reader_ml: f64,
    learnt_on: LearntOn,
}

impl ReadCase {
    fn new(
        case: &CalibrationCase,
        parameters: &FitParameters,
        monitor: &Monitor<'_>,
    ) -> Result<Self, String> {
        let order = SegmentationOrder::of_built_in_hearts(&case.scan, parameters);
        let made = from_files(&order, &ReadLimits::default(), monitor);
        let made = made.map_err(|error| error.to_string())?;
        let volume = &made.reading.volume;
        let drawn = mask_on(&case.mask, &parameters.mask, volume, monitor);
        let drawn = drawn.map_err(|error| format!("its mask: {error}"))?;
        let reference = made.segmentation.polar.as_ref().map(|map| map.reference);
        let reference = reference.ok_or("the fit has no polar map")?;
        let fit = made.segmentation.fit.model;
        let frame = volume.frame.clone();
        let measured = reader::measure(&fit, &made.segmentation.mask, &drawn, &frame)
            .ok_or("its mask and the fitted wall have too little in common")?;
        let cancelled = |error: Cancelled| error.to_string();
        let image = WallImage::about(&fit, volume, reference, monitor).map_err(cancelled)?;
        let level =
            reader::measure_level(&fit, &image, &drawn, &frame, monitor).map_err(cancelled)?;
        let learnt_on = LearntOn {
            scan: sha256_of_volume(&case.scan).map_err(|error| error.to_string())?,
            mask: sha256_of_volume(&case.mask).map_err(|error| error.to_string())?,
        };
        Ok(Self {
            reader_ml: drawn.count() as f64 * frame.voxel_volume() / 1000.0,
            fit,
            image,
            drawn,
            frame,
            measured,
            level,
            learnt_on,
        })
    }

    /// The fit as `drawing` has it, against the reader's mask.
    fn judged(
        &self,
        drawing: &ReaderDrawing,
        monitor: &Monitor<'_>,
    ) -> Result<CaseFigures, Cancelled> {
        let fit = reader::drawn(self.fit.clone(), drawing, &self.image, monitor)?.model;
        let mask = voxelise(&fit.mesh, self.drawn.shape, &self.frame, monitor)?;
        let agreement = compare(&mask, &self.drawn, self.frame.spacing(), monitor).ok();
        monitor.check()?;
        let contours = agreement.as_ref().and_then(|a| a.contours);
        Ok(CaseFigures {
            jaccard: agreement.map_or(0.0, |a| a.jaccard),
            contour: contours.map_or(f64::NAN, |c| c.mean_voxels),
            wall_ml: fit.wall_ml,
            cavity_ml: fit.wall.map_or(f64::NAN, |wall| wall.cavity_ml),
        })
    }
}
