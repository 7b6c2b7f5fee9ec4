//! The paper's evaluation on a cohort: how well models segment, against which gold standard,
//! and whether the findings of the paper are confirmed.
//!
//! In goes a folder of scans with gold standards; out come tables, a page, the models and every
//! fit ([`evaluate`]).
//!
//! 1. [`cohort`]: which cases are templates, which are patients, and their files.
//! 2. [`models`]: the models of the templates, ours at every number of points and the reference
//!    model.
//! 3. [`fits`]: every model fitted to every patient by the functions of [`crate::runs::segmentation`], and the fit that
//!    `auto` keeps; results are kept in [`record`]s, so that a run that was stopped continues where it ended.
//! 4. [`rows`]: the table of all fits, and means over it; [`findings`](mod@findings): what they say about
//!    each of the paper's findings.
//! 5. If asked for, [`leave_one_out`](mod@leave_one_out): model and reader's profile chosen for each case
//!    without it.
//! 6. [`pictures`], [`table`], [`cohort_page`]: slices, CSV and JSON, and one page with charts.
//!
//! [`normals`] stands beside this: limits from scans of healthy people. [`statistics`], too: mean shape and principal
//! modes of fits of one model. And [`protocol_resolution`](mod@protocol_resolution): how much a camera blurs.
//!
//! Guaranteed: the same cohort, parameters and program give the same bytes, on any number of
//! threads and however often the run was stopped.

pub mod calibration;
pub mod cohort;
pub mod cohort_fit;
pub mod cohort_page;
pub mod error;
pub mod files;
pub mod findings;
pub mod fits;
pub mod leave_one_out;
pub mod models;
pub mod normals;
pub mod observer;
pub mod paired;
pub mod parameters;
pub mod pictures;
pub mod protocol_resolution;
pub mod record;
pub mod rows;
pub mod sample;
pub mod statistics;
pub mod table;

pub use cohort::{Cohort, CohortError};
pub use error::EvaluateError;
pub use observer::{EvaluationObserver, EvaluationStep};
pub use parameters::EvaluationParameters;

use crate::base::progress::{Cancelled, Monitor};
use crate::parameters::FitParameters;
use calibration::{Calibration, CalibrationCase, CalibrationError, calibrate};
use files::{make_folder, write_whole};
use findings::findings;
use fits::{FitRun, PatientFits};
use leave_one_out::LeaveOneOut;
use models::{CohortModel, CohortModels};
use rows::{FitRow, Gold, Variant};
use std::path::Path;
use table::Evaluation;

/// Evaluates `cohort` and writes everything to the folder `out`: `evaluation.html`,
/// `evaluation.json`, `table1.csv`, `figure3.csv`, `fits.csv`, `models/`, `fits/` and `slices/`. `program`
/// is any bytes that identify the program: fits of another program are made again. `monitor` is told nothing and may
/// cancel; fits that were made until then are kept.
///
/// # Errors
/// Where a parameter is out of range, no model can be made, the results cannot be written, or the caller cancels. A
/// single template, patient or fit that fails is named in the results and is no error.
pub fn evaluate(
    cohort: &Cohort,
    parameters: &EvaluationParameters,
    program: &[u8],
    out: &Path,
    observer: &dyn EvaluationObserver,
    monitor: &Monitor<'_>,
) -> Result<Evaluation, EvaluateError> {
    let monitor = &monitor.without_observer();
    parameters.validate()?;
    let (models_folder, fits_folder) = (out.join("models"), out.join("fits"));
    make_folder(&models_folder)?;
    make_folder(&fits_folder)?;
    observer.progress(EvaluationStep::Models, 0.0);
    let CohortModels { models, problems } = models::build(cohort, parameters, monitor)?;
    if models.is_empty() {
        let reasons = problems.into_iter().map(|(_, reason)| reason).collect();
        return Err(EvaluateError::NoModel { reasons });
    }
    for model in &models {
        let path = models_folder.join(format!("{}.json", model.name()));
        write_whole(&path, &model.json)?;
    }
    let run = FitRun {
        parameters: &parameters.deform,
        auto: parameters.variants.contains(&Variant::Auto),
        program,
        folder: &fits_folder,
        masks: &cohort.masks,
    };
    let patients = fits::fit_all(cohort, &models, &run, observer, monitor)?;
    observer.progress(EvaluationStep::Pictures, 1.0);
    let mut evaluation = summarise(cohort, &models, &patients, problems, parameters, monitor)?;
    if parameters.leave_one_out {
        evaluation.leave_one_out = LeaveOneOut::new(&evaluation.rows, Gold::Expert);
        evaluation.reader = reader(cohort, parameters, monitor)?;
    }
    evaluation.settings = parameters.settings(cohort);
    make_folder(&out.join(table::SLICES_FOLDER))?;
    write_results(out, &evaluation)?;
    Ok(evaluation)
}

fn summarise(
    cohort: &Cohort,
    models: &[CohortModel],
    patients: &[PatientFits],
    of_models: Vec<(String, String)>,
    parameters: &EvaluationParameters,
    monitor: &Monitor<'_>,
) -> Result<Evaluation, EvaluateError> {
    let in_sample = &parameters.in_sample;
    let rows: Vec<FitRow> = patients
        .iter()
        .flat_map(|p| p.rows(models, in_sample.sample(&p.case)))
        .collect();
    let of_patients = patients
        .iter()
        .flat_map(|p| p.problems.iter().map(|text| (p.case.clone(), text.clone())));
    let problems = cohort.problems.iter().cloned();
    let figure3: Vec<_> = models.iter().flat_map(|m| m.rows.clone()).collect();
    Ok(Evaluation {
        settings: Vec::new(),
        templates: cohort
            .templates
            .iter()
            .filter_map(|t| Some((t.clone(), cohort.source(t)?.1.to_owned())))
            .collect(),
        problems: problems.chain(of_models).chain(of_patients).collect(),
        findings: findings(&rows, &figure3),
        pictures: pictures::draw(cohort, models, patients, &rows, in_sample, monitor)?,
        leave_one_out: None,
        reader: None,
        models: figure3,
        rows,
    })
}

/// The profile of the reader who drew the patients' masks, with its held-out figures; `None` without any
/// mask to learn from.
fn reader(
    cohort: &Cohort,
    parameters: &EvaluationParameters,
    monitor: &Monitor<'_>,
) -> Result<Option<Calibration>, Cancelled> {
    let cases: Vec<CalibrationCase> = cohort
        .patients
        .iter()
        .filter_map(|name| {
            let (scan, mask) = (cohort.scan(name)?, cohort.gold(name, Gold::Expert)?);
            Some(CalibrationCase::of_files(name.clone(), &scan, &mask))
        })
        .collect();
    let fit = FitParameters {
        deform: parameters.deform.clone(),
        mask: cohort.masks.clone(),
        ..FitParameters::default()
    };
    match calibrate(&cases, &fit, &|_| (), monitor) {
        Err(CalibrationError::Cancelled(cancelled)) => Err(cancelled),
        made => Ok(made.ok()),
    }
}

fn write_results(out: &Path, evaluation: &Evaluation) -> Result<(), EvaluateError> {
    let json = serde_json::to_vec_pretty(&table::to_json(evaluation))?;
    for (name, bytes) in [
        ("fits.csv", table::fits_csv(&evaluation.rows)?),
        ("table1.csv", table::table1_csv(&evaluation.rows)?),
        ("figure3.csv", table::figure3_csv(&evaluation.models)?),
        ("evaluation.json", json),
        (
            "evaluation.html",
            cohort_page::cohort_page(evaluation).into_bytes(),
        ),
    ] {
        write_whole(&out.join(name), &bytes)?;
    }
    for picture in &evaluation.pictures {
        write_whole(&out.join(picture.file()), &picture.png)?;
    }
    Ok(())
}
