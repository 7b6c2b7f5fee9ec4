//! `ventriform compare`: rest and stress of one patient.

use super::limit_args::LimitArgs;
use super::normals::NormalLimitArgs;
use super::output::note;
use super::parameter_args::{TableArgs, with_fit};
use super::segment::{MODEL_AUTO, chosen_models, write_all};
use super::volume_args::volume_files;
use super::{Bar, FitArgs};
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::PathBuf;
use ventriform::mesh_files::MeshStatement;
use ventriform::parameters::ComparisonChoice;
use ventriform::progress::{CancelToken, Monitor, Plan};
use ventriform::report::ComparisonReport;
use ventriform::rest_stress::{ComparedHearts, ComparisonOrder, from_files};
use ventriform_service::work::problems::Explain;

/// Compare rest and stress of one patient: where the wall lacks blood only under stress
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform compare --stress stress.dcm --rest rest.dcm -o out
  ventriform compare --stress stress.nii.gz --rest rest.nii.gz -o out --normals normals.json --sex F
Both scans are fitted by the same model. Where both are gated, a beat is fitted to each, and EF, motion and thickening are compared too.
Writes comparison.json (TID, reversible and fixed share of the wall, segments, territories, flags), segments.csv and polar maps
(polar_stress, polar_rest, polar_difference).
One scan given twice and scans of two patients are refused.")]
pub struct CompareArgs {
    /// The scan at stress: a file, or all files of it
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    stress: Vec<PathBuf>,
    /// The scan at rest
    #[arg(long, value_name = "FILE", required = true, num_args = 1..)]
    rest: Vec<PathBuf>,
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "OUTDIR")]
    output: PathBuf,
    /// Model to fit to both scans: a closed mesh, or auto for the built-in hearts (repeatable: the one in which both
    /// fits together have the greatest confidence is kept)
    #[arg(long, value_name = "MODEL", default_value = MODEL_AUTO)]
    model: Vec<PathBuf>,
    /// The protocol of the scan at stress, as the normal limits name it; by default the only one with the word stress
    /// in its name
    #[arg(long, value_name = "NAME", requires = "normals")]
    stress_protocol: Option<String>,
    /// The protocol of the scan at rest
    #[arg(long, value_name = "NAME", requires = "normals")]
    rest_protocol: Option<String>,
    #[command(flatten)]
    normals: NormalLimitArgs,
    #[command(flatten)]
    choice: TableArgs<ComparisonChoice>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, a heart cannot be fitted, the scans cannot be compared, or a file cannot be written.
/// Nothing is written unless the comparison is complete.
pub fn run(args: &CompareArgs) -> Result<()> {
    let parameters = with_fit(&args.choice, &args.fit)?;
    let limits = args.limits.limits()?;
    let stress = volume_files(&args.stress, &limits)?;
    let rest = volume_files(&args.rest, &limits)?;
    let protocols = [&args.stress_protocol, &args.rest_protocol].map(Option::clone);
    let normals = args.normals.of_pair(protocols)?;
    let (auto, models) = chosen_models(&args.model, &MeshStatement::default(), &limits)?;
    let order = ComparisonOrder {
        stress: &stress,
        rest: &rest,
        auto,
        models,
        normals,
        parameters: &parameters,
    };
    let bar = Bar::over(Plan::COMPARISON);
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = from_files(&order, &limits, &monitor)
        .map_err(|error| anyhow!(error.with_advice()))
        .and_then(|made| Ok((made.files(&monitor)?, made)));
    bar.finish();
    let (files, made) = made?;
    write_all(&args.output, &files)?;
    let report = made.report();
    note!("{}", headline(&made, &report));
    for scan in [&report.stress, &report.rest] {
        for warning in &scan.warnings {
            note!("warning: {warning}");
        }
    }
    for flag in &report.flags {
        note!("warning: {}", flag.reason);
    }
    Ok(())
}

fn headline(made: &ComparedHearts, report: &ComparisonReport) -> String {
    let change = &made.change;
    let mut line = format!(
        "TID {:.2}, reversible {:.0} % of the wall, fixed {:.0} %",
        made.tid(),
        change.reversible_percent,
        change.fixed_percent
    );
    if let (Some(sss), Some(srs), Some(sds)) = (report.sss, report.srs, report.sds) {
        line += &format!("; SSS {sss}, SRS {srs}, SDS {sds}");
    }
    line
}
