//! `ventriform templates`: the library of models that segmentations start from.

use super::evaluate::cohort::{Cohort, read_volume};
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
    Build {
        /// The cohort's folder
        #[arg(long, value_name = "DIR")]
        cohort: PathBuf,
        /// Numbers of points
        #[arg(
            long,
            value_name = "N,...",
            value_delimiter = ',',
            default_value = "150"
        )]
        points: Vec<usize>,
        /// The template whose model comes from its expert's mask [default: the third, if it
        /// has one]
        #[arg(long, value_name = "CASE")]
        manual: Option<String>,
        /// Where the models go, as CASE_N.json (made where missing)
        #[arg(short, long = "output", value_name = "DIR")]
        output: PathBuf,
    },
    /// Adds models to the library of a service that does not run just now
    Import(super::library::ImportArgs),
}

/// Runs `ventriform templates`.
///
/// # Errors
/// What reading, generating or the file system says.
pub fn run(args: &TemplatesArgs) -> Result<()> {
    let (cohort, points, manual, output) = match &args.action {
        TemplatesAction::Build {
            cohort,
            points,
            manual,
            output,
        } => (cohort, points, manual, output),
        TemplatesAction::Import(args) => return super::library::import(args),
    };
    let cohort = Cohort::open(cohort, manual.as_deref())?;
    std::fs::create_dir_all(output).with_context(|| format!("cannot make {}", output.display()))?;
    for case in &cohort.templates {
        let (path, what) = cohort.source(case).context("its files are gone")?;
        let reading = read_volume(&path)?;
        for n in points {
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
