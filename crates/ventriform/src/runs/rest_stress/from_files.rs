//! A comparison from files: read, fit both hearts by one model, compare.

use super::checks;
use super::error::ComparisonError;
use super::hearts::{ComparedHeart, ComparedHearts};
use super::order::ComparisonOrder;
use crate::base::progress::Monitor;
use crate::heart::comparison::{Change, ScoreAnswers, Sides, WhichScan};
use crate::heart::normals::ScanKind;
use crate::image::volume::{HeldGates, ReadLimits, VolumeFile, hold_gates};
use crate::parameters::{BeatChoice, FitParameters};
use crate::runs::gated::GatedOrder;
use crate::runs::segmentation::{self, SegmentationOrder, common_template};

/// Compares the scans of `order`. Both are fitted as beats if both are gated, as images otherwise.
///
/// # Errors
/// [`ComparisonError`].
pub fn from_files(
    order: &ComparisonOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<ComparedHearts, ComparisonError> {
    let scans = [
        (WhichScan::Stress, order.stress),
        (WhichScan::Rest, order.rest),
    ];
    let is_gated = |(scan, files): (WhichScan, &[VolumeFile])| {
        let choice = &order.parameters.choice;
        hold_gates(files, choice.gated, limits, monitor)
            .map_err(|error| ComparisonError::of_gated(scan, error.into()))
    };
    checks::refuse(order, limits, monitor)?;
    let gates = [is_gated(scans[0])?, is_gated(scans[1])?];
    let gated = gates == [HeldGates::Beat; 2];
    let fit = |kept: Option<&str>, which: usize| {
        let monitor = monitor.part(which, scans.len());
        let (scan, files) = scans[which];
        fitted(order, scan, files, gated, kept, limits, &monitor)
    };
    let (mut stress, mut rest) = (fit(None, 0)?, fit(None, 1)?);
    checks::refuse_fits(&stress, &rest)?;
    let candidates = [&stress, &rest].map(|heart| heart.segmentation().candidates.as_slice());
    let other = stress.template() != rest.template();
    if let Some(common) = common_template(&candidates).filter(|_| other) {
        let again = |heart: ComparedHeart, which: usize| {
            if heart.template() == common {
                return Ok(heart);
            }
            fit(Some(&common), which)
        };
        stress = again(stress, 0)?;
        rest = again(rest, 1)?;
    }
    let none = |scan: WhichScan| ComparisonError::NoVentricle { scan };
    let sides = Sides {
        stress: stress.map().ok_or(none(WhichScan::Stress))?,
        rest: rest.map().ok_or(none(WhichScan::Rest))?,
    };
    let change = Change::between(&sides, monitor)?.ok_or(ComparisonError::NothingInCommon)?;
    let scores = (stress.perfusion().zip(rest.perfusion()))
        .map(|(stress, rest)| ScoreAnswers::new([stress, rest], &sides, &change, monitor))
        .transpose()?;
    Ok(ComparedHearts {
        flags: checks::flags(&stress, &rest, &change),
        stress,
        rest,
        gates,
        change,
        scores,
        parameters: order.parameters.fit.clone(),
        choice: order.parameters.choice.clone(),
    })
}

/// The heart of a scan, a beat if it is `gated`, by the model `kept` or else that with the greatest confidence.
fn fitted(
    order: &ComparisonOrder<'_>,
    scan: WhichScan,
    files: &[VolumeFile],
    gated: bool,
    kept: Option<&str>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<ComparedHeart, ComparisonError> {
    let own = order.parameters.fit.clone();
    let mut parameters = FitParameters {
        kept_model: kept.map(str::to_owned).or(own.kept_model),
        scan: ScanKind {
            protocol: order.protocol(scan),
            ..own.scan
        },
        ..own
    };
    order
        .parameters
        .choice
        .correction(scan)
        .correct(&mut parameters);
    let (auto, models) = (order.auto, order.models.clone());
    if gated {
        let own = GatedOrder {
            gates: files,
            auto,
            models,
            normals: order.normals,
            parameters: &parameters,
            choice: BeatChoice {
                gated: order.parameters.choice.gated,
                ..BeatChoice::default()
            },
        };
        let made = crate::runs::gated::from_files(&own, limits, monitor)
            .map_err(|error| ComparisonError::of_gated(scan, error))?;
        return Ok(ComparedHeart::Beating(Box::new(made)));
    }
    let own = SegmentationOrder {
        volume: files,
        expert: None,
        auto,
        models,
        reader: None,
        normals: order.normals,
        parameters: &parameters,
    };
    let made = segmentation::from_files(&own, limits, monitor)
        .map_err(|error| ComparisonError::of_segmentation(scan, error))?;
    Ok(ComparedHeart::Still(Box::new(made)))
}
