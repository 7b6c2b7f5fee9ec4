//! A segmentation from files: read, segment, keep what the output needs.

use super::error::SegmentationError;
use super::expert_mask;
use super::order::{NamedReader, SegmentationOrder};
use super::segment::{Segmentation, SegmentationParameters, segment};
use super::templates::prepare;
use crate::model::Organ;
use crate::parameters::FitParameters;
use crate::progress::Monitor;
use crate::volume::{self, ReadLimits, ReadOptions, Reading, VolumeError, VolumeFile};

/// A volume's segmentation with what it was made from.
#[derive(Debug, Clone)]
pub struct SegmentedVolume {
    /// The volume and the facts of its header.
    pub reading: Reading,
    /// The segmentation.
    pub segmentation: Segmentation,
    /// The parameters used.
    pub parameters: FitParameters,
}

/// Segments the volume of `order`.
///
/// # Errors
/// [`SegmentationError`].
pub fn from_files(
    order: &SegmentationOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<SegmentedVolume, SegmentationError> {
    let frame = order.parameters.frame;
    let parts = 1 + usize::from(order.expert.is_some());
    let reading = read(order.volume, frame, limits, &monitor.part(0, parts))
        .map_err(|error| unusable(error, SegmentationError::Volume))?;
    let expert = order
        .expert
        .map(|files| read(files, None, limits, &monitor.part(1, parts)))
        .transpose()
        .map_err(|error| unusable(error, SegmentationError::ExpertVolume))?;
    let parameters = order.parameters.clone();
    let fit = SegmentationParameters {
        deform: parameters.on(&reading.volume)?,
        polar: parameters.polar,
        reader: order.reader.clone(),
    };
    check_reader(order)?;
    let (templates, refused) = prepare(order, monitor)?;
    let expert = expert.map(expert_mask::of_file);
    let mut segmentation = segment(&reading.volume, &templates, &fit, expert.as_ref(), monitor)?;
    segmentation.refused.splice(0..0, refused);
    Ok(SegmentedVolume {
        reading,
        segmentation,
        parameters,
    })
}

/// Refuses a reader's profile that says nothing of the wall asked for.
fn check_reader(order: &SegmentationOrder<'_>) -> Result<(), SegmentationError> {
    let Some(NamedReader { name, profile }) = &order.reader else {
        return Ok(());
    };
    let (name, organ) = (name.clone(), order.parameters.organ);
    if organ != Organ::LeftVentricle {
        let organ = organ.as_str();
        return Err(SegmentationError::ReaderOfVentricles { name, organ });
    }
    let edge = order.parameters.deform.edge;
    if profile.edge != edge {
        return Err(SegmentationError::ReaderOfOtherWall {
            name,
            learnt: profile.edge.as_str(),
            asked: edge.as_str(),
        });
    }
    Ok(())
}

fn read(
    files: &[VolumeFile],
    frame: Option<usize>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Reading, VolumeError> {
    volume::read(files, &ReadOptions { frame }, limits, monitor)
}

fn unusable(
    error: VolumeError,
    which: impl FnOnce(VolumeError) -> SegmentationError,
) -> SegmentationError {
    match error {
        VolumeError::Cancelled(cancelled) => cancelled.into(),
        error => which(error),
    }
}
