//! A serial comparison from files: read, fit all hearts by one model, register them, fit them again, compare.

use super::checks;
use super::error::SerialError;
use super::fits::ScanFit;
use super::hearts::{SerialHearts, SerialPair, SerialScan};
use super::order::{SCAN_COUNTS, SerialOrder};
use crate::base::progress::Monitor;
use crate::heart::comparison::{Change, ScoreAnswers, Sides};
use crate::heart::model::MYOCARDIAL_DENSITY_G_PER_ML;
use crate::heart::serial::{CommonHeart, Registration, registered};
use crate::image::volume::{HeldGates, ReadLimits, VolumeFile, hold_gates};
use crate::runs::segmentation::common_template;

/// A scan: its number as it was given, from 1, and its files.
type Numbered<'a> = (usize, &'a [VolumeFile]);

/// Compares the scans of `order`. All are fitted as beats if all are gated, as images otherwise.
///
/// # Errors
/// [`SerialError`].
pub fn from_files(
    order: &SerialOrder<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<SerialHearts, SerialError> {
    let count = order.scans.len();
    if !SCAN_COUNTS.contains(&count) {
        return Err(SerialError::ScanCount { found: count });
    }
    let headers = checks::headers(order, limits, monitor)?;
    checks::refuse(&headers, order.parameters.choice.same_patient)?;
    let (sequence, dated) = checks::sequence(&headers);
    let scans: Vec<Numbered<'_>> = (sequence.iter())
        .map(|place| (place + 1, order.scans[*place].as_slice()))
        .collect();
    let gated = all_gated(order, &scans, limits, monitor)?;
    let alone = fitted_alone(order, &scans, gated, limits, &monitor.part(0, 2))?;
    checks::refuse_same_voxels(&scans, &alone)?;
    let compared = compared(order, &scans, alone, &monitor.part(1, 2))?;
    let pairs = pairs(&compared, monitor)?;
    let mut hearts = SerialHearts {
        flags: Vec::new(),
        scans: compared,
        pairs,
        gated,
        fit: order.parameters.fit.clone(),
        choice: order.parameters.choice.clone(),
    };
    hearts.flags = checks::flags(&hearts, dated);
    Ok(hearts)
}

/// Whether every scan is gated.
fn all_gated(
    order: &SerialOrder<'_>,
    scans: &[Numbered<'_>],
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<bool, SerialError> {
    let stated = order.parameters.choice.gated;
    for (number, files) in scans {
        let held = hold_gates(files, stated, limits, monitor)
            .map_err(|error| SerialError::of_volume(*number, error))?;
        if held != HeldGates::Beat {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Every scan fitted by itself, all by one model.
fn fitted_alone(
    order: &SerialOrder<'_>,
    scans: &[Numbered<'_>],
    gated: bool,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Vec<ScanFit>, SerialError> {
    let mut voxels = 0;
    let mut fits = Vec::with_capacity(scans.len());
    for (place, scan) in scans.iter().enumerate() {
        let part = monitor.part(place, scans.len());
        let fit = ScanFit::of_files(order, *scan, gated, None, limits, &part)?;
        voxels += fit.voxels();
        if voxels > limits.voxels {
            let limit = limits.voxels;
            return Err(SerialError::TooManyVoxels { voxels, limit });
        }
        fits.push(fit);
    }
    let candidates: Vec<_> = fits.iter().map(ScanFit::candidates).collect();
    let Some(common) = common_template(&candidates) else {
        return Ok(fits);
    };
    let quiet = monitor.without_observer();
    for (fit, scan) in fits.iter_mut().zip(scans) {
        if fit.template() != common {
            *fit = ScanFit::of_files(order, *scan, gated, Some(&common), limits, &quiet)?;
        }
    }
    Ok(fits)
}

/// The hearts registered, fitted again from the common one, with their beats.
fn compared(
    order: &SerialOrder<'_>,
    scans: &[Numbered<'_>],
    alone: Vec<ScanFit>,
    monitor: &Monitor<'_>,
) -> Result<Vec<SerialScan>, SerialError> {
    let mut registrations = Vec::with_capacity(alone.len());
    let placed = |place: usize| {
        let scan = scans[place].0;
        alone[place]
            .placed()
            .ok_or(SerialError::NoVentricle { scan })
    };
    let first = placed(0)?;
    for place in 0..alone.len() {
        registrations.push(if place == 0 {
            Registration::none()
        } else {
            registered(&first, &placed(place)?, monitor)?
        });
    }
    let models: Vec<_> = (alone.iter().zip(&registrations))
        .map(|(fit, registration)| (&fit.segmentation().fit.model, registration.motion))
        .collect();
    let scan = scans[0].0;
    let mut common = CommonHeart::of(&models).ok_or(SerialError::NoVentricle { scan })?;
    if let Some(mass_g) = order.parameters.fit.mass_g {
        common.muscle_ml = mass_g / MYOCARDIAL_DENSITY_G_PER_ML;
    }
    let count = scans.len();
    let fits = alone.into_iter().zip(registrations).zip(scans).enumerate();
    fits.map(|(place, ((fit, registration), (number, _)))| {
        let part = monitor.part(place, count);
        let own_muscle_ml = fit.muscle_ml().unwrap_or(f64::NAN);
        let motion = &registration.motion;
        let (heart, fitted_again) = fit.compared(order, *number, &common, motion, &part)?;
        Ok(SerialScan {
            given: *number,
            heart,
            registration,
            own_mass_g: own_muscle_ml * MYOCARDIAL_DENSITY_G_PER_ML,
            fitted_again,
        })
    })
    .collect()
}

/// Every scan against the first one and against the one before it.
fn pairs(scans: &[SerialScan], monitor: &Monitor<'_>) -> Result<Vec<SerialPair>, SerialError> {
    let with_first = (1..scans.len()).map(|later| [0, later]);
    let with_former = (2..scans.len()).map(|later| [later - 1, later]);
    let map = |place: usize| {
        let scan: &SerialScan = &scans[place];
        let none = SerialError::NoVentricle { scan: scan.given };
        scan.heart.map().ok_or(none)
    };
    with_first
        .chain(with_former)
        .map(|[earlier, later]| {
            let sides = Sides {
                stress: map(later)?,
                rest: map(earlier)?,
            };
            let numbers = [earlier + 1, later + 1];
            let change = Change::between(&sides, monitor)?
                .ok_or(SerialError::NothingInCommon { scans: numbers })?;
            let perfusion = [later, earlier].map(|place| scans[place].heart.perfusion());
            let scores = match perfusion {
                [Some(after), Some(before)] => Some(ScoreAnswers::new(
                    [after, before],
                    &sides,
                    &change,
                    monitor,
                )?),
                _ => None,
            };
            Ok(SerialPair {
                earlier,
                later,
                change,
                scores,
            })
        })
        .collect()
}
