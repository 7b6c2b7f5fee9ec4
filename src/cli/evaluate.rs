//! `ventriform evaluate`: [`ventriform::runs::evaluate`] on the command line.

use super::cohort_args::CohortArgs;
use super::output::note;
use super::{Bar, UnusableArgument};
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use std::path::PathBuf;
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::DeformParameters;
use ventriform::heart::deform::elastic::{Stiffness, SupportScaling};
use ventriform::runs::evaluate::parameters::InSample;
use ventriform::runs::evaluate::rows::{self, Gold, Variant};
use ventriform::runs::evaluate::sample::Sample;
use ventriform::runs::evaluate::table::Evaluation;
use ventriform::runs::evaluate::{
    EvaluateError, EvaluationObserver, EvaluationParameters, EvaluationStep, evaluate,
};

/// Make models of the templates, fit them to every patient, write tables, plots and pictures
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform evaluate cohort --points 67,110,150,200,300 -o evaluation
Writes evaluation.html, evaluation.json, table1.csv, figure3.csv and fits.csv; models/ holds the
models, fits/ the result and the fitted mesh of every fit. Existing fits are reused unless the
model, files, options or program have changed.")]
#[command(mut_arg("points", |arg| arg.default_value("67,110,150,200,300")))]
pub struct EvaluateArgs {
    #[command(flatten)]
    cohort: CohortArgs,
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
        default_value = "reference,retiled,optimised,auto"
    )]
    models: Vec<ModelName>,
    /// How our models are made, as with `generate --method`
    #[arg(long, value_name = "WORD", default_value = "refined")]
    method: String,
    /// Stiffness of support springs between all nodes within a radius, to study their effect
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
    /// Skip the alignment of the model as a whole, as for models that are placed by hand
    #[arg(long, help_heading = "Experiment")]
    no_align: bool,
    /// Choose model, number of points and reader's profile for each case without that case, and judge
    /// templates by the models of the others
    #[arg(long)]
    leave_one_out: bool,
    /// Cases that the program's constants were chosen on, or all: their figures are labelled in-sample
    #[arg(long, value_name = "CASE,...|all", value_delimiter = ',')]
    in_sample: Vec<String>,
    /// Folder for the results (created if missing)
    #[arg(short, long = "output", value_name = "DIR")]
    out: PathBuf,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ModelName {
    /// Marching Cubes simplified by quadric error: our substitute for the paper's older model
    Reference,
    /// Ours after re-tiling
    Retiled,
    /// Ours after fit and flips
    Optimised,
    /// What `segment --model auto` keeps of the built-in hearts
    Auto,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum ScalingName {
    /// The same for every N
    Fixed,
    /// By 150/N
    PerNode,
}

impl ModelName {
    fn variant(self) -> Variant {
        match self {
            ModelName::Reference => Variant::Reference,
            ModelName::Retiled => Variant::Retiled,
            ModelName::Optimised => Variant::Optimised,
            ModelName::Auto => Variant::Auto,
        }
    }
}

impl EvaluateArgs {
    fn parameters(&self) -> EvaluationParameters {
        EvaluationParameters {
            points: self.cohort.points.clone(),
            reference_points: self.reference_points.clone(),
            variants: self.models.iter().map(|name| name.variant()).collect(),
            method: self.method.clone(),
            deform: DeformParameters {
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
            },
            in_sample: match self.in_sample.as_slice() {
                [word] if word == "all" => InSample::All,
                names => InSample::Named(names.to_vec()),
            },
            leave_one_out: self.leave_one_out,
        }
    }
}

impl EvaluationObserver for Bar {
    fn progress(&self, step: EvaluationStep, fraction: f64) {
        self.show(step.as_str(), fraction);
    }
}

/// Runs `ventriform evaluate`.
///
/// # Errors
/// The errors of [`evaluate`], and if no fit succeeded.
pub fn run(args: &EvaluateArgs) -> Result<()> {
    let parameters = args.parameters();
    parameters.validate().map_err(with_advice)?;
    let mut cohort = args.cohort.open()?;
    if args.leave_one_out {
        cohort.judge_templates();
    }
    // Another build may fit otherwise.
    let program = std::env::current_exe().and_then(std::fs::read);
    let bar = Bar::start();
    let made = evaluate(
        &cohort,
        &parameters,
        &program.unwrap_or_default(),
        &args.out,
        &bar,
        &Monitor::silent(),
    );
    bar.finish();
    let evaluation = made.map_err(with_advice)?;
    print_summary(&evaluation);
    if !evaluation.has_fit() {
        bail!("no fit succeeded; see the reasons in evaluation.html");
    }
    Ok(())
}

fn with_advice(error: EvaluateError) -> anyhow::Error {
    match error {
        EvaluateError::ModelParameter(error) => UnusableArgument::from(error).into(),
        error => error.into(),
    }
}

/// Prints the problems and the means on standard error.
fn print_summary(evaluation: &Evaluation) {
    for (case, problem) in &evaluation.problems {
        note!("warning: {case}: {problem}");
    }
    let rows = &evaluation.rows;
    for kind in rows::kinds(rows) {
        let mut line = format!("{:<9} {:>4} points", kind.variant.as_str(), kind.points);
        for gold in Gold::ALL {
            if let Some(cell) = rows::mean(rows::of_kind(rows, None, kind), gold) {
                line += &format!(
                    "; {}, {}: E_J {:.3} (least {:.3}), E_CD {:.3}",
                    gold.as_str(),
                    cell.sample.as_str(),
                    cell.jaccard,
                    cell.least,
                    cell.contour.unwrap_or(f64::NAN)
                );
            }
        }
        note!("{line}");
    }
    if let Some(found) = &evaluation.leave_one_out {
        let [held_out, in_sample] = found.means().map(|mean| mean.unwrap_or(f64::NAN));
        note!(
            "model chosen without the case: held-out E_J {held_out:.3}; with it: in-sample {in_sample:.3}"
        );
    }
    if let Some(made) = &evaluation.reader {
        for sample in [Sample::HeldOut, Sample::InSample] {
            let gain = super::calibrate::gain(made, sample);
            note!("reader's profile: {}", gain.trim_end_matches('\n'));
        }
    }
}
