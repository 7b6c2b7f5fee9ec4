//! `ventriform normals`: limits from healthy people's scans; and the arguments of commands that compare with them.

use super::UnusableArgument;
use super::limit_args::LimitArgs;
use super::output::note;
use super::parameter_args::{FitArgsOf, TableArgs, with_fit};
use anyhow::{Context, Result, anyhow};
use clap::{Args, Subcommand};
use std::path::PathBuf;
use ventriform::base::progress::Monitor;
use ventriform::heart::normals::{FEW_CASES, NormalGroup, NormalLimits, Perfusion, ScanKind};
use ventriform::parameters::{FitParameters, NormalsChoice};
use ventriform::runs::advice::Explain;
use ventriform::runs::evaluate::normals::{self, NormalsOptions};

/// Build normal limits from scans of healthy people
#[derive(Debug, Args)]
pub struct NormalsArgs {
    #[command(subcommand)]
    action: NormalsAction,
}

#[derive(Debug, Subcommand)]
enum NormalsAction {
    /// Fit every healthy scan of a folder; mean and standard deviation of the wall's uptake by sex and protocol
    Build(Box<BuildArgs>),
}

#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform normals build cohort -o normals.json
  ventriform segment scan.nii.gz --model auto -o out --normals normals.json --sex F --protocol rest
The folder holds cohort.csv with the columns case, file, sex (M or F), protocol, tracer, attenuation_corrected (yes or \
no),
healthy (yes or no) and, if a scan at stress has one at rest, rest_case. A group of sex, protocol, tracer and \
correction needs 12
cases; 30 or more give steady limits. Files of gates also give limits of EDV, ESV, EF, motion, thickening and phase.")]
struct BuildArgs {
    /// Folder with cohort.csv and the scans
    #[arg(value_name = "COHORT")]
    cohort: PathBuf,
    /// File to write
    #[arg(short, long = "output", value_name = "FILE")]
    output: PathBuf,
    #[command(flatten)]
    choice: TableArgs<NormalsChoice>,
    #[command(flatten)]
    fit: FitArgsOf<NormalsChoice>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// The normal limits that a scan is compared with.
#[derive(Debug, Args)]
pub struct NormalLimitArgs {
    /// Compare the wall's uptake with these normal limits (`ventriform normals build` writes them)
    #[arg(long, value_name = "FILE")]
    normals: Option<PathBuf>,
}

impl NormalLimitArgs {
    /// The limits, read and checked.
    ///
    /// # Errors
    /// If the file cannot be read, was edited, or is not given although `parameters` state the kind of the scan.
    pub fn limits(&self, parameters: &FitParameters) -> Result<Option<NormalLimits>> {
        let Some(path) = &self.normals else {
            if parameters.scan == ScanKind::default() {
                return Ok(None);
            }
            let without = "--sex, --protocol, --tracer and --attenuation-corrected choose a group of normal limits; \
                           give --normals FILE too, or leave them out";
            return Err(UnusableArgument::new(without.to_owned()).into());
        };
        let context = || format!("{}", path.display());
        let bytes = std::fs::read(path).with_context(context)?;
        let limits = NormalLimits::from_json(&bytes)
            .map_err(|error| anyhow!(error.with_advice()))
            .with_context(context)?;
        Ok(Some(limits))
    }
}

/// Runs `ventriform normals`.
///
/// # Errors
/// If the table cannot be read, a group has too few usable cases, or the file cannot be written.
pub fn run(args: &NormalsArgs) -> Result<()> {
    match &args.action {
        NormalsAction::Build(args) => build(args),
    }
}

fn build(args: &BuildArgs) -> Result<()> {
    let options = NormalsOptions {
        parameters: with_fit(&args.choice, &args.fit)?,
        program_version: env!("CARGO_PKG_VERSION").to_owned(),
        limits: args.limits.limits()?,
    };
    let told = |case: &str, made: Result<(), &str>| match made {
        Ok(()) => note!("{case}: fitted"),
        Err(reason) => note!("{case}: left out: {reason}"),
    };
    let limits = normals::build(&args.cohort, &options, &told, &Monitor::silent())?;
    normals::write(&limits, &args.output)?;
    for group in &limits.groups {
        note!("{}", summary(group));
        if group.cases.len() < FEW_CASES {
            note!(
                "warning: {} cases; {FEW_CASES} or more give steady limits",
                group.cases.len()
            );
        }
    }
    for case in &limits.excluded {
        note!("left out: {}: {}", case.case, case.reason);
    }
    note!(
        "Written: {} ({}), SHA-256 {}",
        args.output.display(),
        limits.people,
        limits.sha256
    );
    Ok(())
}

fn summary(group: &NormalGroup) -> String {
    let left_out = &group.leave_one_out;
    format!(
        "{group}; each judged by the limits of the others: {:.1} % of the wall below them and a deficit score of {:.2} \
         % in the mean, 95 of 100 people below {:.2} %",
        left_out.mean_extent_percent, left_out.mean_deficit_percent, left_out.deficit_percent_of_95
    )
}

/// A scan beside its limits, in a line.
pub(super) fn normals_line(perfusion: &Perfusion) -> String {
    format!(
        "against the normal limits of {} {}people: deficit score {:.1} % (TPD-like: not comparable with QPS's), {:.1} \
         % of the wall below the limit, summed score {}",
        perfusion.group.cases,
        if perfusion.group.simulated {
            "simulated "
        } else {
            ""
        },
        perfusion.deficit_percent,
        perfusion.extent_percent,
        perfusion.summed_score
    )
}
