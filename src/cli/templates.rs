//! `ventriform templates`: the library of models that `segment` and the service choose from.

use super::cohort_args::CohortArgs;
use super::output::{create_folder, note, write_file};
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use ventriform::base::progress::Monitor;
use ventriform::parameters::ModelParameters;
use ventriform::results::export::{self, Format};
use ventriform::runs::advice::Explain;
use ventriform::runs::evaluate::parameters::ascending;
use ventriform::runs::pipeline;

/// Build models for the library, or add them to a service's library
#[derive(Debug, Args)]
pub struct TemplatesArgs {
    #[command(subcommand)]
    action: TemplatesAction,
}

#[derive(Debug, Subcommand)]
enum TemplatesAction {
    /// Make models of a cohort's template cases, from the scans and from an expert's mask
    Build(BuildArgs),
    /// Add models to the library of a service that is not running
    Import(super::library::ImportArgs),
}

#[derive(Debug, Args)]
#[command(mut_arg("points", |arg| arg.default_value("150")))]
struct BuildArgs {
    #[command(flatten)]
    cohort: CohortArgs,
    /// Folder for the models, named CASE_N.json (created if missing)
    #[arg(short, long = "output", value_name = "DIR")]
    output: PathBuf,
}

/// Runs `ventriform templates`.
///
/// # Errors
/// If a case cannot be read, no model can be made of it, or a file cannot be written.
pub fn run(args: &TemplatesArgs) -> Result<()> {
    match &args.action {
        TemplatesAction::Build(args) => build(args),
        TemplatesAction::Import(args) => super::library::import(args),
    }
}

fn build(args: &BuildArgs) -> Result<()> {
    let (cohort, output) = (args.cohort.open()?, &args.output);
    create_folder(output)?;
    for case in &cohort.templates {
        let (path, what) = cohort.source(case).with_context(|| {
            format!("the files of case {case} are missing from the cohort's folder")
        })?;
        let reading = cohort.read_source(case, &path, &Monitor::silent());
        let reading = reading.with_context(|| path.display().to_string())?;
        for n in ascending(&args.cohort.points) {
            let context = || format!("the model of {case} with {n} points");
            let pairs = [("points", n.to_string())];
            let parameters =
                ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str())))
                    .map_err(|error| anyhow::anyhow!(error.with_advice()))?;
            let model = pipeline::from_reading(&reading, &parameters, 0.0, &Monitor::silent())
                .with_context(context)?;
            let bytes = export::encode(Format::Json, &model.mesh, &model.metadata())?;
            let path = output.join(format!("{case}_{n}.json"));
            write_file(&path, &bytes)?;
            note!("{} written, made from {what}", path.display());
        }
    }
    Ok(())
}
