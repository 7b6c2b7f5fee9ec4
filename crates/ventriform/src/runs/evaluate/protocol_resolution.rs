//! The resolution of one protocol's images, from scans of many people.
//!
//! In: scans of one camera, collimator, reconstruction and filter. Each is segmented as `segment` does. Out: the
//! resolution and how well it is known ([`ProtocolResolution`]), how each wall looks, and why scans were left out.
//!
//! Guaranteed: the same files give the same figures, on any number of threads and in any order but that of the rows.

use crate::base::progress::{Cancelled, Monitor};
use crate::heart::deform::protocol_resolution::ProtocolResolution;
use crate::heart::deform::wall_thickness::WallLook;
use crate::image::volume::{ReadLimits, VolumeFile};
use crate::parameters::ResolutionParameters;
use crate::runs::segmentation::{SegmentationOrder, from_files};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Confidence below which a fit says nothing about its wall.
const LEAST_CONFIDENCE: f64 = 0.5;

/// A scan of the protocol.
#[derive(Debug, Clone)]
pub struct ProtocolScan {
    /// Its name in the results.
    pub name: String,
    /// Its files.
    pub files: Vec<VolumeFile>,
}

/// What the scans of a protocol tell.
#[derive(Debug, Clone, PartialEq)]
pub struct LearntResolution {
    /// The resolution.
    pub resolution: ProtocolResolution,
    /// The scans that it was learnt from, and how their walls look.
    pub looks: Vec<(String, WallLook)>,
    /// Scans that were left out, and why.
    pub left_out: Vec<(String, String)>,
}

/// Why there is no resolution.
#[derive(Debug, thiserror::Error)]
pub enum ResolutionError {
    /// No scan can be used.
    #[error("no scan shows a wall whose thickness can be seen{}", .left_out.iter().fold(String::new(), |text, (name, why)| {
        format!("{text}\n  left out: {name}: {why}")
    }))]
    NoScan {
        /// The scans, and why.
        left_out: Vec<(String, String)>,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Learns the resolution that `scans` have. `progress` is told the share of them that is done, from any thread; `monitor`
/// is told nothing and may cancel.
///
/// # Errors
/// [`ResolutionError`]. A scan that cannot be used is left out.
pub fn learn_resolution(
    scans: &[ProtocolScan],
    parameters: &ResolutionParameters,
    limits: &ReadLimits,
    progress: &(dyn Fn(f64) + Sync),
    monitor: &Monitor<'_>,
) -> Result<LearntResolution, ResolutionError> {
    let monitor = &monitor.without_observer();
    let done = AtomicUsize::new(0);
    let seen: Vec<Result<WallLook, String>> = (scans.par_iter().with_max_len(1))
        .map(|scan| {
            let look = look_of(scan, parameters, limits, monitor);
            monitor.check()?;
            let count = 1 + done.fetch_add(1, Ordering::Relaxed);
            progress(count as f64 / scans.len() as f64);
            Ok(look)
        })
        .collect::<Result<_, Cancelled>>()?;
    let (mut looks, mut left_out) = (Vec::new(), Vec::new());
    for (scan, seen) in scans.iter().zip(seen) {
        match seen {
            Ok(look) => looks.push((scan.name.clone(), look)),
            Err(why) => left_out.push((scan.name.clone(), why)),
        }
    }
    let walls: Vec<WallLook> = looks.iter().map(|(_, look)| *look).collect();
    match ProtocolResolution::new(&walls) {
        Some(resolution) => Ok(LearntResolution {
            resolution,
            looks,
            left_out,
        }),
        None => Err(ResolutionError::NoScan { left_out }),
    }
}

fn look_of(
    scan: &ProtocolScan,
    parameters: &ResolutionParameters,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<WallLook, String> {
    let order = SegmentationOrder::of_built_in_hearts(&scan.files, &parameters.fit);
    let made = from_files(&order, limits, monitor).map_err(|error| error.to_string())?;
    let fit = &made.segmentation.fit;
    let confidence = fit.judgement.confidence;
    if confidence < LEAST_CONFIDENCE {
        return Err(format!(
            "confidence {confidence:.2}, at least {LEAST_CONFIDENCE} is needed"
        ));
    }
    let thickness = fit.model.surfaces.as_ref().and_then(|both| both.thickness);
    thickness
        .map(|thickness| thickness.look)
        .ok_or_else(|| "it has no wall around".to_owned())
}
