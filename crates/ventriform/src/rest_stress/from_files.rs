//! A comparison from files: read, fit both hearts by one model, compare.

use super::checks;
use super::error::ComparisonError;
use super::hearts::{ComparedHeart, ComparedHearts};
use super::order::ComparisonOrder;
use crate::comparison::WhichScan;
use crate::comparison::{Change, Sides};
use crate::gated::{self, GatedOrder};
use crate::parameters::{BeatChoice, FitParameters};
use crate::progress::Monitor;
use crate::segmentation::{self, RankedTemplate, SegmentationOrder};
use crate::volume::{ReadLimits, VolumeFile, hold_gates};

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
        let choice = order.parameters.choice;
        hold_gates(files, choice.gated, limits, monitor)
            .map_err(|error| ComparisonError::of_gated(scan, error.into()))
    };
    let gated = is_gated(scans[0])? && is_gated(scans[1])?;
    let fit = |kept: Option<&str>, which: usize| {
        let (scan, files) = scans[which];
        let monitor = monitor.part(which, scans.len());
        if gated {
            beating(order, scan, files, kept, limits, &monitor)
        } else {
            still(order, scan, files, kept, limits, &monitor)
        }
    };
    let (mut stress, mut rest) = (fit(None, 0)?, fit(None, 1)?);
    checks::refuse(&stress, &rest, order.parameters.choice.same_patient)?;
    if let Some(common) = common_template(&stress, &rest) {
        let again = |heart: ComparedHeart, which: usize| {
            if heart.template() == common {
                return Ok(heart);
            }
            fit(Some(&common), which)
        };
        stress = again(stress, 0)?;
        rest = again(rest, 1)?;
    }
    let map = |heart: &ComparedHeart, scan: WhichScan| {
        heart
            .map()
            .cloned()
            .ok_or(ComparisonError::NoVentricle { scan })
    };
    let (at_stress, at_rest) = (
        map(&stress, WhichScan::Stress)?,
        map(&rest, WhichScan::Rest)?,
    );
    let sides = Sides {
        stress: &at_stress,
        rest: &at_rest,
    };
    let change = Change::between(&sides).ok_or(ComparisonError::NothingInCommon)?;
    Ok(ComparedHearts {
        flags: checks::flags(&stress, &rest, &change),
        stress,
        rest,
        change,
        parameters: order.parameters.fit.clone(),
        choice: order.parameters.choice,
    })
}

/// The model in which both fits together have the greatest confidence, if they chose different ones and both can have
/// it.
fn common_template(stress: &ComparedHeart, rest: &ComparedHeart) -> Option<String> {
    if stress.template() == rest.template() {
        return None;
    }
    let other = &rest.segmentation().candidates;
    let together = stress.segmentation().candidates.iter().filter_map(|own| {
        let same = |candidate: &&RankedTemplate| candidate.name == own.name;
        let at_rest = other.iter().find(same)?;
        Some((own.confidence + at_rest.confidence, own.name.clone()))
    });
    let best = together.max_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, name)| name)
}

/// The parameters of both fits, and the model to keep.
fn keeping(order: &ComparisonOrder<'_>, kept: Option<&str>) -> FitParameters {
    let own = order.parameters.fit.clone();
    FitParameters {
        kept_model: kept.map(str::to_owned).or(own.kept_model),
        ..own
    }
}

fn still(
    order: &ComparisonOrder<'_>,
    scan: WhichScan,
    files: &[VolumeFile],
    kept: Option<&str>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<ComparedHeart, ComparisonError> {
    let parameters = keeping(order, kept);
    let own = SegmentationOrder {
        volume: files,
        expert: None,
        auto: order.auto,
        models: order.models.clone(),
        reader: None,
        normals: order.normals.as_ref().map(|normals| normals.of(scan)),
        parameters: &parameters,
    };
    let made = segmentation::from_files(&own, limits, monitor)
        .map_err(|error| ComparisonError::of_segmentation(scan, error))?;
    Ok(ComparedHeart::Still(Box::new(made)))
}

fn beating(
    order: &ComparisonOrder<'_>,
    scan: WhichScan,
    files: &[VolumeFile],
    kept: Option<&str>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<ComparedHeart, ComparisonError> {
    let parameters = keeping(order, kept);
    let own = GatedOrder {
        gates: files,
        normals: order.normals.as_ref().map(|normals| normals.of(scan)),
        auto: order.auto,
        models: order.models.clone(),
        parameters: &parameters,
        choice: BeatChoice {
            gated: order.parameters.choice.gated,
            ..BeatChoice::default()
        },
    };
    let made = gated::from_files(&own, limits, monitor)
        .map_err(|error| ComparisonError::of_gated(scan, error))?;
    Ok(ComparedHeart::Beating(Box::new(made)))
}
