//! Slices of one fit of each patient.
//!
//! Shown are the fits of one kind of model: our finished one, or else the next variant before
//! it, at the number of points with the greatest mean E_J; of several templates the first by
//! name.

use super::cohort::{Cohort, mask_on, read_volume};
use super::cohort_fit::CohortFit;
use super::error::EvaluateError;
use super::fits::PatientFits;
use super::models::CohortModel;
use super::parameters::InSample;
use super::rows::{self, FitRow, Gold, ModelKind};
use super::table::Picture;
use crate::base::progress::Monitor;
use crate::image::volume::VolumeFile;
use crate::runs::segmentation::slices;
use rayon::prelude::*;

/// The pictures of all patients that have a fit of the kind that is shown.
///
/// # Errors
/// [`EvaluateError::Scan`] where a scan cannot be read again.
pub fn draw(
    cohort: &Cohort,
    models: &[CohortModel],
    patients: &[PatientFits],
    rows: &[FitRow],
    in_sample: &InSample,
    monitor: &Monitor<'_>,
) -> Result<Vec<Picture>, EvaluateError> {
    let Some(kind) = shown(rows) else {
        return Ok(Vec::new());
    };
    let drawn: Vec<Option<Picture>> = patients
        .par_iter()
        .map(|patient| {
            let pairs = models.iter().zip(&patient.fits);
            let Some((model, fit)) = pairs
                .filter(|(m, f)| m.kind == kind && m.template != patient.case && f.cup.is_some())
                .min_by(|a, b| a.0.template.cmp(&b.0.template))
            else {
                return Ok(None);
            };
            let png = png(cohort, &patient.case, model, fit, monitor)?;
            Ok(png.map(|png| Picture {
                case: patient.case.clone(),
                caption: caption(patient, model, fit)
                    + ", "
                    + in_sample.sample(&patient.case).as_str(),
                png,
            }))
        })
        .collect::<Result<_, EvaluateError>>()?;
    Ok(drawn.into_iter().flatten().collect())
}

/// The kind of model whose fits are shown.
fn shown(rows: &[FitRow]) -> Option<ModelKind> {
    let score = |kind: &ModelKind| {
        let own = || rows::of_kind(rows, None, *kind);
        let found = rows::mean(own(), Gold::Expert).or_else(|| rows::mean(own(), Gold::Truth));
        (kind.variant, found.map_or(0.0, |c| c.jaccard))
    };
    rows::kinds(rows).into_iter().reduce(|best, kind| {
        let better = score(&kind) > score(&best);
        if better { kind } else { best }
    })
}

/// The slices of one fit; `None` where there is no fit or no scan.
fn png(
    cohort: &Cohort,
    case: &str,
    model: &CohortModel,
    fit: &CohortFit,
    monitor: &Monitor<'_>,
) -> Result<Option<Vec<u8>>, EvaluateError> {
    let (Some(cut), Some(scan)) = (fit.cut(), cohort.scan(case)) else {
        return Ok(None);
    };
    let reading = read_volume(&scan, monitor);
    monitor.check()?;
    let reading = reading.map_err(|error| EvaluateError::Scan {
        case: case.to_owned(),
        error: Box::new(error),
    })?;
    let volume = reading.volume;
    let expert = cohort
        .gold(case, Gold::Expert)
        .and_then(|path| mask_on(&[VolumeFile::at(path)], &cohort.masks, &volume, monitor).ok());
    monitor.check()?;
    let mesh = fit.mesh(model);
    let png = slices::png(&volume, &mesh, &cut, expert.as_ref(), monitor)?;
    Ok(Some(png))
}

fn caption(patient: &PatientFits, model: &CohortModel, fit: &CohortFit) -> String {
    let mut text = format!(
        "{}: model of {} with {} points {}",
        patient.case,
        model.template,
        model.kind.points,
        model.kind.variant.title()
    );
    for gold in Gold::ALL {
        if let Some(a) = &fit.agreed[gold as usize] {
            text += &format!("; {} E_J {:.3}", gold.as_str(), a.jaccard);
            if let Some(distance) = a.contour_voxels {
                text += &format!(", E_CD {distance:.3}");
            }
        }
    }
    text
}
