//! A reader's profile from a folder of scans and masks, with figures that say what it is worth.
//!
//! 1. [`cases_of`]: the folders that hold a scan and a mask.
//! 2. Every scan is segmented as `segment` does, without a profile, and the distances to its mask are
//!    measured ([`crate::reader::measure()`]).
//! 3. The profile is learnt on all masks.
//! 4. Every case is judged three times: without a profile; by a profile learnt on the *other* masks
//!    (held-out); by the profile itself, which has seen the case (in-sample).
//!
//! Guaranteed: the same files give the same profile and figures, on any number of threads.

use super::cohort::{case_file, mask_file, mask_on};
use super::files::sha256;
use super::paired::PairedDifference;
use super::sample::Sample;
use crate::deform::FittedModel;
use crate::geometry::frame::VoxelToPatient;
use crate::grid::agreement::compare;
use crate::grid::voxelise::{Mask, voxelise};
use crate::parameters::FitParameters;
use crate::progress::Monitor;
use crate::reader::{self, LearntOn, ReaderOffset, ReaderOffsets, ReaderProfile};
use crate::segmentation::{SegmentationOrder, from_files};
use crate::volume::{ReadLimits, VolumeFile};
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A scan and a reader's mask of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CalibrationCase {
    /// Its folder's name.
    pub name: String,
    /// The scan.
    pub scan: PathBuf,
    /// The mask.
    pub mask: PathBuf,
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
            cases.push(CalibrationCase { name, scan, mask });
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

/// One case of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationRow {
    /// The case.
    pub case: String,
    /// The distances measured on its mask.
    pub measured: ReaderOffsets,
    /// Volume of the reader's wall, ml.
    pub reader_ml: f64,
    /// Without a profile.
    pub without: CaseFigures,
    /// By the profile learnt on the other masks, if there are any.
    pub held_out: Option<CaseFigures>,
    /// By the profile learnt on all masks.
    pub in_sample: CaseFigures,
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
    /// The figures of a row judged on that sample.
    pub fn figures(row: &CalibrationRow, sample: Sample) -> Option<CaseFigures> {
        match sample {
            Sample::InSample => Some(row.in_sample),
            Sample::HeldOut => row.held_out,
        }
    }

    /// Change of E_J by the profile, from the figures of that sample.
    pub fn gain(&self, sample: Sample) -> Option<PairedDifference> {
        let gains: Vec<f64> = self
            .rows
            .iter()
            .filter_map(|row| Some(Self::figures(row, sample)?.jaccard - row.without.jaccard))
            .collect();
        PairedDifference::of(&gains)
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
    /// No case can be used.
    #[error("no mask can be learnt from: {}", reasons.join("; "))]
    NoMask {
        /// The problem of each case.
        reasons: Vec<String>,
    },
}

/// Learns the profile of the reader who drew the masks of `cases`. `parameters` are those of the fits,
/// and their edge is the wall that the distances start from. `progress` is told the share of the cases
/// that is done, from any thread.
///
/// # Errors
/// [`CalibrationError::NoMask`]. A case that cannot be used is a problem of the result.
pub fn calibrate(
    cases: &[CalibrationCase],
    parameters: &FitParameters,
    progress: &(dyn Fn(f64) + Sync),
) -> Result<Calibration, CalibrationError> {
    let done = AtomicUsize::new(0);
    let read: Vec<Result<ReadCase, String>> = cases
        .par_iter()
        .with_max_len(1)
        .map(|case| {
            let read = ReadCase::of(case, parameters);
            let count = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress(count as f64 / cases.len() as f64);
            read
        })
        .collect();
    let (mut usable, mut problems) = (Vec::new(), Vec::new());
    for (case, read) in cases.iter().zip(read) {
        match read {
            Ok(read) => usable.push((case.name.clone(), read)),
            Err(reason) => problems.push((case.name.clone(), reason)),
        }
    }
    let measured: Vec<ReaderOffsets> = usable.iter().map(|(_, c)| c.measured).collect();
    let Some(offsets) = reader::learn(&measured) else {
        let named = problems.iter().map(|(case, why)| format!("{case}: {why}"));
        let mut reasons: Vec<String> = named.collect();
        if reasons.is_empty() {
            reasons.push("no folder has both a scan and a mask".into());
        }
        return Err(CalibrationError::NoMask { reasons });
    };
    let rows = usable
        .par_iter()
        .enumerate()
        .with_max_len(1)
        .map(|(place, (name, case))| {
            let others: Vec<ReaderOffsets> = (0..measured.len())
                .filter(|other| *other != place)
                .map(|other| measured[other])
                .collect();
            let judged = |offsets: [ReaderOffset; 3]| {
                case.judged(&ReaderOffsets::from_array(offsets.map(|o| o.value)))
            };
            CalibrationRow {
                case: name.clone(),
                measured: case.measured,
                reader_ml: case.reader_ml,
                without: case.judged(&ReaderOffsets::default()),
                held_out: reader::learn(&others).map(judged),
                in_sample: judged(offsets),
            }
        })
        .collect();
    // Not in the order of the folders' names, which may be those of patients.
    let mut learnt_on: Vec<LearntOn> = usable.iter().map(|(_, c)| c.learnt_on.clone()).collect();
    learnt_on.sort();
    Ok(Calibration {
        profile: ReaderProfile {
            edge: parameters.deform.edge,
            offsets,
            learnt_on,
        },
        rows,
        problems,
    })
}

/// A case's fit and mask.
struct ReadCase {
    fit: FittedModel,
    drawn: Mask,
    frame: VoxelToPatient,
    measured: ReaderOffsets,
    reader_ml: f64,
    learnt_on: LearntOn,
}

impl ReadCase {
    fn of(case: &CalibrationCase, parameters: &FitParameters) -> Result<Self, String> {
        let monitor = Monitor::silent();
        let order = SegmentationOrder {
            volume: &[VolumeFile::at(&case.scan)],
            expert: None,
            auto: true,
            models: Vec::new(),
            reader: None,
            normals: None,
            parameters,
        };
        let made = from_files(&order, &ReadLimits::default(), &monitor);
        let made = made.map_err(|error| error.to_string())?;
        let volume = &made.reading.volume;
        let drawn = mask_on(&case.mask, &parameters.mask, volume);
        let drawn = drawn.map_err(|error| format!("its mask: {error}"))?;
        let fit = made.segmentation.fit.model;
        let frame = volume.frame.clone();
        let measured = reader::measure(&fit, &made.segmentation.mask, &drawn, &frame)
            .ok_or("its mask and the fitted wall have too little in common")?;
        let learnt_on = LearntOn {
            scan: sha256(&case.scan).map_err(|error| error.to_string())?,
            mask: sha256(&case.mask).map_err(|error| error.to_string())?,
        };
        Ok(Self {
            reader_ml: drawn.count() as f64 * frame.voxel_volume() / 1000.0,
            fit,
            drawn,
            frame,
            measured,
            learnt_on,
        })
    }

    /// The fit with `offsets`, against the reader's mask.
    fn judged(&self, offsets: &ReaderOffsets) -> CaseFigures {
        let monitor = Monitor::silent();
        // Nobody cancels.
        let moved = reader::drawn(self.fit.clone(), offsets, &monitor);
        let fit = moved.map_or_else(|_| self.fit.clone(), |moved| moved.0);
        let mask = voxelise(&fit.mesh, self.drawn.shape, &self.frame);
        let agreement = compare(&mask, &self.drawn, self.frame.spacing(), &monitor).ok();
        let contours = agreement.as_ref().and_then(|a| a.contours);
        CaseFigures {
            jaccard: agreement.map_or(0.0, |a| a.jaccard),
            contour: contours.map_or(f64::NAN, |c| c.mean_voxels),
            wall_ml: fit.wall_ml,
            cavity_ml: fit.wall.map_or(f64::NAN, |wall| wall.cavity_ml),
        }
    }
}
