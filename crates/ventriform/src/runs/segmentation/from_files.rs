//! A segmentation from files: read, segment, keep what the output needs.

use super::acquired::{Acquired, MadeOfSlices, with_motion};
use super::error::SegmentationError;
use super::normals::{heart_figures, judged_by_normals};
use super::order::{NamedReader, SegmentationOrder};
use super::segment::{Segmentation, SegmentationParameters, segment};
use super::templates::prepare;
use crate::base::progress::Monitor;
use crate::heart::judge::Flag;
use crate::heart::model::Organ;
use crate::heart::normals::Perfusion;
use crate::image::volume::given_mask::{GivenMask, PlacedMask, read_mask};
use crate::image::volume::{
    self, FileFormat, FromProjections, ReadLimits, ReadOptions, Reading, Volume, VolumeError,
    VolumeFile,
};
use crate::parameters::FitParameters;

/// A volume's segmentation with what it was made from.
#[derive(Debug, Clone)]
pub struct SegmentedVolume {
    /// The volume and the facts of its header.
    pub reading: Reading,
    /// The part of the expert's mask that was compared, if one was given.
    pub expert: Option<ExpertFacts>,
    /// The segmentation.
    pub segmentation: Segmentation,
    /// The wall's uptake beside normal limits, if some were given.
    pub perfusion: Option<Perfusion>,
    /// The parameters used.
    pub parameters: FitParameters,
    /// The projections that the volume was reconstructed of, if it was reconstructed here.
    pub acquired: Option<Acquired>,
}

/// The part of an expert's mask that was compared.
#[derive(Debug, Clone, PartialEq)]
pub struct ExpertFacts {
    /// The structure; `None` if the file holds nothing else.
    pub structure: Option<String>,
    /// Whether it was resampled to the volume's grid.
    pub resampled: bool,
    /// Voxels outside the volume, which were left out.
    pub outside: usize,
}

impl ExpertFacts {
    fn new(given: &GivenMask, placed: &PlacedMask) -> Self {
        Self {
            structure: given.structure.clone(),
            resampled: placed.resampled,
            outside: placed.outside,
        }
    }

    /// Notes on the comparison for people, in sentences.
    pub fn warnings(&self) -> Vec<String> {
        let structure = self.structure.as_ref().map(|structure| {
            format!(
                "Of the expert's mask, {structure} was compared; it holds other structures too."
            )
        });
        let resampled = self.resampled.then(|| {
            "The expert's mask lies on another grid and was resampled by the nearest voxel.".into()
        });
        let outside = (self.outside > 0).then(|| {
            format!(
                "{} voxels of the expert's mask lie outside the volume and were left out.",
                self.outside
            )
        });
        [structure, resampled, outside]
            .into_iter()
            .flatten()
            .collect()
    }
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
    check_reader(order)?;
    let make = |from: &FromProjections| made(order, from, limits, monitor);
    let (mut made, acquired) = with_motion(order.volume, order.parameters, limits, monitor, make)?;
    made.acquired = acquired;
    Ok(made)
}

impl MadeOfSlices for SegmentedVolume {
    fn parts(&self) -> (FileFormat, &Volume, &Segmentation) {
        let Reading { facts, volume, .. } = &self.reading;
        (facts.format, volume, &self.segmentation)
    }

    fn flags(&mut self) -> &mut Vec<Flag> {
        &mut self.segmentation.fit.judgement.flags
    }
}

/// The segmentation of slices that are made as `from` says.
fn made(
    order: &SegmentationOrder<'_>,
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<SegmentedVolume, SegmentationError> {
    let frame = order.parameters.frame;
    let parts = 1 + usize::from(order.expert.is_some());
    let reading = read(order.volume, frame, from, limits, &monitor.part(0, parts))?;
    let parameters = order.parameters.clone();
    let choice = &parameters.mask;
    let expert = order
        .expert
        .map(|files| {
            let given = read_mask(files, choice, limits, &monitor.part(1, parts))?;
            let grid = (reading.volume.shape, &reading.volume.frame);
            let placed = given.on(grid, choice.resample, monitor)?;
            Ok::<_, SegmentationError>((ExpertFacts::new(&given, &placed), placed.mask))
        })
        .transpose()?;
    let fit = SegmentationParameters {
        deform: parameters.on(
            &reading.volume,
            reading.facts.affine_source,
            reading.provenance.as_ref(),
        )?,
        polar: parameters.polar,
        kept_model: parameters.kept_model.clone(),
        segments_from: parameters.segments_from,
        reader: order.reader.clone(),
    };
    let (templates, refused) = prepare(order.auto, &order.models, parameters.organ, monitor)?;
    let (expert, mask) = expert.unzip();
    // On a thread of the pool: from another one, each parallel step would be handed over and waited for.
    let mut segmentation =
        rayon::scope(|_| segment(&reading.volume, &templates, &fit, mask.as_ref(), monitor))?;
    segmentation.refused.splice(0..0, refused);
    let judged = |limits| {
        let figures = heart_figures(&segmentation);
        let scan = reading.provenance.as_ref();
        judged_by_normals(&segmentation, &figures, scan, &parameters, limits)
    };
    let perfusion = order.normals.map(judged).transpose()?;
    Ok(SegmentedVolume {
        perfusion,
        expert,
        reading,
        segmentation,
        parameters,
        acquired: None,
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
    from: &FromProjections,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Reading, VolumeError> {
    volume::read_with(files, &ReadOptions { frame }, from, limits, monitor)?.usable()
}
