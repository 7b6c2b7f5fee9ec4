//! `ventriform templates`: the library of models that segmentations start from.

use crate::evaluate::cohort::{CohortArgs, read_volume};
use crate::export::{self, Format};
use crate::parameters::ModelParameters;
use crate::pipeline;
use crate::progress::Monitor;
use anyhow::{Context, Result};
use clap::{Args, Subcommand};
use std::path::PathBuf;

/// Keeps the library of models.
#[derive(Debug, Args)]
pub struct TemplatesArgs {
    #[command(subcommand)]
    action: TemplatesAction,
}

#[derive(Debug, Subcommand)]
enum TemplatesAction {
    /// Makes the models of a cohort's template cases: scans by threshold, one from the expert's
    /// mask
    Build(BuildArgs),
    /// Adds models to the library of a service that does not run just now
    Import(super::library::ImportArgs),
}

#[derive(Debug, Args)]
#[command(mut_arg("points", |arg| arg.default_value("150")))]
struct BuildArgs {
    #[command(flatten)]
    cohort: CohortArgs,
    /// Where the models go, as CASE_N.json (made where missing)
    #[arg(short, long = "output", value_name = "DIR")]
    output: PathBuf,
}

/// Runs `ventriform templates`.
///
/// # Errors
/// What reading, generating or the file system says.
pub fn run(args: &TemplatesArgs) -> Result<()> {
    match &args.action {
        TemplatesAction::Build(args) => build(args),
        TemplatesAction::Import(args) => super::library::import(args),
    }
}

fn build(args: &BuildArgs) -> Result<()> {
    let (cohort, output) = (args.cohort.open()?, &args.output);
    std::fs::create_dir_all(output).with_context(|| format!("cannot make {}", output.display()))?;
    for case in &cohort.templates {
        let (path, what) = cohort.source(case).context("its files are gone")?;
        let reading = read_volume(&path)?;
        for n in args.cohort.points() {
            let context = || format!("the model of {case} with {n} points");
            let pairs = [("points", n.to_string())];
            let parameters =
                ModelParameters::from_pairs(pairs.iter().map(|(n, t)| (*n, t.as_str())))
                    .map_err(|e| anyhow::anyhow!("{e}. {}", e.fix))?;
            let model = pipeline::from_reading(&reading, &parameters, 0.0, &Monitor::silent())
                .with_context(context)?;
            let bytes = export::encode(Format::Json, &model.mesh, &model.metadata())?;
            let path = output.join(format!("{case}_{n}.json"));
            std::fs::write(&path, bytes)
                .with_context(|| format!("cannot write {}", path.display()))?;
            eprintln!("{} written, made from {what}", path.display());
        }
    }
    Ok(())
}
