//! `ventriform evaluate`: the paper's evaluation on a cohort.
//!
//! 1. [`cohort`](crate::evaluate::cohort) says who is in the folder.
//! 2. [`models`] makes the models of the templates.
//! 3. [`fits`] fits them to the patients; [`record`]s are kept, and a run that was stopped goes
//!    on where it was.
//! 4. Tables, page and pictures are written from the results by
//!    [`evaluate`](crate::evaluate).
//!
//! The same cohort, options and program give the same bytes, on any number of threads and
//! however often the run was stopped on the way.

use super::Bar;
use crate::deform::DeformParameters;
use crate::deform::elastic::{Stiffness, SupportScaling};
use crate::evaluate::cohort::{Cohort, CohortArgs, sorted};
use crate::evaluate::findings::findings;
use crate::evaluate::fits::{self, Patient};
use crate::evaluate::models::{self, Model};
use crate::evaluate::page;
use crate::evaluate::record;
use crate::evaluate::rows::{self, Gold, Kind, Outcome, Row, Variant};
use crate::evaluate::table::{self, Evaluation, Picture};
use crate::parameters::ModelParameters;
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use rayon::prelude::*;
use std::path::{Path, PathBuf};

/// Builds the template models, fits them to every patient, writes tables, plots and pictures.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform evaluate --cohort cohort --points 67,110,150,200,300 --out evaluation
Writes evaluation.html, evaluation.json, table1.csv, figure3.csv and fits.csv; models/ holds the
models, fits/ the result and the fitted mesh of every fit. Fits that are there already are not
made again unless model, files, options or program have changed.")]
#[command(mut_arg("points", |arg| arg.default_value("67,110,150,200,300")))]
pub struct EvaluateArgs {
    #[command(flatten)]
    pub(crate) cohort: CohortArgs,
    /// Numbers of points of the reference model
    #[arg(
        long,
        value_name = "N,...",
        value_delimiter = ',',
        default_value = "67"
    )]
    reference_points: Vec<usize>,
    /// Which models to fit
    #[arg(
        long,
        value_name = "WORD,...",
        value_enum,
        value_delimiter = ',',
        default_value = "reference,retiled,optimised"
    )]
    models: Vec<ModelName>,
    /// How our models are made: as by `generate --method`
    #[arg(long, value_name = "WORD", default_value = "refined")]
    method: String,
    /// Stiffness of support springs between all nodes within a radius, to see what they do
    #[arg(
        long,
        value_name = "K",
        default_value_t = 0.0,
        help_heading = "Experiment"
    )]
    support: f64,
    /// Longest support spring, millimetres
    #[arg(
        long,
        value_name = "MM",
        default_value_t = 46.0,
        help_heading = "Experiment"
    )]
    support_radius: f64,
    /// Whether a support spring's stiffness falls with the number of nodes
    #[arg(
        long,
        value_name = "WORD",
        value_enum,
        default_value = "fixed",
        help_heading = "Experiment"
    )]
    support_scaling: ScalingName,
    /// Leave the alignment of the model as a whole out, as where models are placed by hand
    #[arg(long, help_heading = "Experiment")]
    no_align: bool,
    /// Where the results go (made where missing)
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ModelName {
    /// Marching Cubes thinned out by quadric error: the stand-in for the paper's older model
    Reference,
    /// Ours after re-tiling
    Retiled,
    /// Ours after fit and flips
    Optimised,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ScalingName {
    /// The same for every N
    Fixed,
    /// By 150/N
    PerNode,
}

impl EvaluateArgs {
    pub(crate) fn reference_points(&self) -> Vec<usize> {
        sorted(&self.reference_points)
    }

    pub(crate) fn makes(&self, variant: Variant) -> bool {
        let name = match variant {
            Variant::Reference => ModelName::Reference,
            Variant::Retiled => ModelName::Retiled,
            Variant::Optimised => ModelName::Optimised,
        };
        self.models.contains(&name)
    }

    /// The parameters that our models are made by.
    pub(crate) fn model_parameters(&self, points: Option<usize>) -> Result<ModelParameters> {
        let mut pairs = vec![("method", self.method.clone())];
        pairs.extend(points.map(|n| ("points", n.to_string())));
        ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str())))
            .map_err(|e| anyhow::anyhow!("{e}. {}", e.fix))
    }

    fn deform_parameters(&self) -> Result<DeformParameters> {
        let parameters = DeformParameters {
            align: !self.no_align,
            stiffness: Stiffness {
                support: self.support,
                support_radius: self.support_radius,
                support_scaling: match self.support_scaling {
                    ScalingName::Fixed => SupportScaling::Fixed,
                    ScalingName::PerNode => SupportScaling::PerNode,
                },
                ..Stiffness::default()
            },
            ..DeformParameters::default()
        };
        parameters.validate()?;
        Ok(parameters)
    }

    /// What was asked for, for the page.
    fn settings(&self, cohort: &Cohort) -> Vec<(String, String)> {
        let list = |numbers: &[usize]| {
            let texts: Vec<String> = numbers.iter().map(usize::to_string).collect();
            texts.join(", ")
        };
        let mut settings = vec![
            ("patients".to_owned(), cohort.patients.join(", ")),
            ("points".to_owned(), list(&self.cohort.points())),
            (
                "reference model".to_owned(),
                format!(
                    "Marching Cubes thinned out by quadric error (Garland and Heckbert 1997) to {} \
                     points: our stand-in for the paper's, which is not public",
                    list(&self.reference_points())
                ),
            ),
            ("method".to_owned(), self.method.clone()),
            (
                "program".to_owned(),
                format!("ventriform {}", env!("CARGO_PKG_VERSION")),
            ),
        ];
        if self.no_align {
            settings.push(("alignment as a whole".to_owned(), "left out".to_owned()));
        }
        if self.support > 0.0 {
            let scaling = match self.support_scaling {
                ScalingName::Fixed => "the same for every N",
                ScalingName::PerNode => "scaled by 150/N",
            };
            settings.push((
                "support springs".to_owned(),
                format!(
                    "k = {} up to {} mm, {scaling}",
                    self.support, self.support_radius
                ),
            ));
        }
        settings
    }
}

/// Runs `ventriform evaluate`.
///
/// # Errors
/// Where no model or no patient can be used, or the results cannot be written; a single
/// template, patient or fit that fails is named in the results and is no error.
pub fn run(args: &EvaluateArgs) -> Result<()> {
    let parameters = args.deform_parameters()?;
    args.model_parameters(None)?;
    let cohort = args.cohort.open()?;
    let (models_folder, fits_folder) = (args.out.join("models"), args.out.join("fits"));
    make_folder(&models_folder)?;
    make_folder(&fits_folder)?;

    let bar = Bar::start();
    bar.show("models", 0.0);
    let (models, problems) = models::build(&cohort, args);
    if models.is_empty() {
        let reasons: Vec<&str> = problems.iter().map(|p| p.1.as_str()).collect();
        bail!("no model could be made: {}", reasons.join("; "));
    }
    for model in &models {
        let path = models_folder.join(format!("{}.json", model.name()));
        record::write_file(&path, &model.json)?;
    }
    let patients = fits::run(&cohort, &models, &parameters, &fits_folder, &bar)?;
    bar.show("pictures", 1.0);
    let evaluation = evaluate(args, &cohort, &models, &patients, problems)?;
    bar.finish();
    write_results(&args.out, &evaluation)?;
    say(&evaluation);
    if evaluation
        .rows
        .iter()
        .all(|r| !matches!(r.outcome, Outcome::Fitted(_)))
    {
        bail!("not one fit succeeded; evaluation.html says why");
    }
    Ok(())
}

fn evaluate(
    args: &EvaluateArgs,
    cohort: &Cohort,
    models: &[Model],
    patients: &[Patient],
    of_models: Vec<(String, String)>,
) -> Result<Evaluation> {
    let rows: Vec<Row> = patients.iter().flat_map(|p| p.rows(models)).collect();
    let of_patients = patients
        .iter()
        .flat_map(|p| p.problems.iter().map(|text| (p.case.clone(), text.clone())));
    let problems = cohort
        .problems
        .iter()
        .cloned()
        .chain(of_models)
        .chain(of_patients);
    let figure3: Vec<_> = models.iter().map(|m| m.row.clone()).collect();
    Ok(Evaluation {
        settings: args.settings(cohort),
        templates: cohort
            .templates
            .iter()
            .filter_map(|t| Some((t.clone(), cohort.source(t)?.1.to_owned())))
            .collect(),
        problems: problems.collect(),
        findings: findings(&rows, &figure3),
        pictures: pictures(cohort, models, patients, &rows)?,
        models: figure3,
        rows,
    })
}

/// The kind of model that pictures are shown of: ours, at its best number of points.
fn shown(rows: &[Row]) -> Option<Kind> {
    let score = |kind: &Kind| {
        let own = || rows::of_kind(rows, None, *kind);
        let found = rows::mean(own(), Gold::Expert).or_else(|| rows::mean(own(), Gold::Truth));
        (kind.variant, found.map_or(0.0, |c| c.jaccard))
    };
    rows::kinds(rows).into_iter().reduce(|best, kind| {
        let better = score(&kind) > score(&best);
        if better { kind } else { best }
    })
}

fn pictures(
    cohort: &Cohort,
    models: &[Model],
    patients: &[Patient],
    rows: &[Row],
) -> Result<Vec<Picture>> {
    let Some(kind) = shown(rows) else {
        return Ok(Vec::new());
    };
    let drawn: Vec<Option<Picture>> = patients
        .par_iter()
        .map(|patient| {
            let pairs = models.iter().zip(&patient.fits);
            let Some((model, fitted)) = pairs
                .filter(|(m, f)| m.kind == kind && f.cup.is_some())
                .min_by(|a, b| a.0.template.cmp(&b.0.template))
            else {
                return Ok(None);
            };
            let png = fits::picture(cohort, &patient.case, model, fitted)?;
            let caption = caption(patient, model, fitted);
            Ok(png.map(|png| Picture {
                case: patient.case.clone(),
                caption,
                png,
            }))
        })
        .collect::<Result<_>>()?;
    Ok(drawn.into_iter().flatten().collect())
}

fn caption(patient: &Patient, model: &Model, fitted: &fits::Fitted) -> String {
    let mut text = format!(
        "{}: model of {} with {} points {}",
        patient.case,
        model.template,
        model.kind.points,
        model.kind.variant.title()
    );
    for gold in Gold::ALL {
        if let Some(a) = &fitted.agreed[gold as usize] {
            text += &format!("; {} E_J {:.3}", gold.as_str(), a.jaccard);
            if let Some(distance) = a.contour_voxels {
                text += &format!(", E_CD {distance:.3}");
            }
        }
    }
    text
}

fn write_results(out: &Path, evaluation: &Evaluation) -> Result<()> {
    let json = serde_json::to_vec_pretty(&table::to_json(evaluation))?;
    for (name, bytes) in [
        ("fits.csv", table::fits_csv(&evaluation.rows).into_bytes()),
        (
            "table1.csv",
            table::table1_csv(&evaluation.rows).into_bytes(),
        ),
        (
            "figure3.csv",
            table::figure3_csv(&evaluation.models).into_bytes(),
        ),
        ("evaluation.json", json),
        ("evaluation.html", page::html(evaluation).into_bytes()),
    ] {
        record::write_file(&out.join(name), &bytes)?;
    }
    Ok(())
}

/// The means and what was missing, on standard error.
fn say(evaluation: &Evaluation) {
    for (case, problem) in &evaluation.problems {
        eprintln!("warning: {case}: {problem}");
    }
    let rows = &evaluation.rows;
    for kind in rows::kinds(rows) {
        let mut line = format!("{:<9} {:>4} points", kind.variant.as_str(), kind.points);
        for gold in Gold::ALL {
            if let Some(cell) = rows::mean(rows::of_kind(rows, None, kind), gold) {
                line += &format!(
                    "; {} E_J {:.3} (least {:.3}), E_CD {:.3}",
                    gold.as_str(),
                    cell.jaccard,
                    cell.least,
                    cell.contour.unwrap_or(f64::NAN)
                );
            }
        }
        eprintln!("{line}");
    }
}

fn make_folder(path: &Path) -> Result<()> {
    std::fs::create_dir_all(path).with_context(|| format!("cannot make {}", path.display()))
}
