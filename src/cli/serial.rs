//! `ventriform serial`: scans of one patient over the years.

use super::dicom_args::DicomArgs;
use super::limit_args::LimitArgs;
use super::normals::NormalLimitArgs;
use super::output::note;
use super::parameter_args::{FitArgsOf, TableArgs, with_fit};
use super::segment::{MODEL_AUTO, chosen_models, parse_format, write_all};
use super::volume_args::volume_files;
use super::{Bar, UnusableArgument};
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::PathBuf;
use ventriform::base::progress::{CancelToken, Monitor, Plan};
use ventriform::image::volume::VolumeFile;
use ventriform::mesh::files::MeshStatement;
use ventriform::parameters::SerialChoice;
use ventriform::results::export::Format;
use ventriform::results::figures::serial::SCAN_FIGURES;
use ventriform::results::report::{SerialPairReport, SerialReport};
use ventriform::runs::advice::Explain;
use ventriform::runs::objects;
use ventriform::runs::serial::{SerialOrder, from_files};

/// Compare scans of one patient over the years: what really changed
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform serial 2022.dcm 2023.dcm 2025.dcm -o out
  ventriform serial before/ after/ -o out --normals normals.json --sex F
Every scan is a file, or a folder with all files of one scan. All are at rest, or all at stress, of one tracer. They are \
ordered by the dates of their headers; where not all state one, they stay as they are given.
All are fitted from one common heart, so that what differs is the heart and not the fit. Where all are gated, a beat is \
fitted to each.
Writes serial.json (figures of every scan; of every pair the change of each figure with its 95 % interval, whether it \
changed, and the
least change that would show), figures.csv, changes.csv, segments.csv, trend.svg, report.html; of every scan \
polar_scan01, mesh_scan01
and region_scan01.nii.gz; of every pair polar_change_01_02; with --dicom measurements.dcm
and fhir.json (the same as FHIR R4).
One scan given twice, scans of two patients, and rest beside stress are refused.")]
pub struct SerialArgs {
    /// The scans, 2 to 20: each a file, or a folder with all files of one scan
    #[arg(value_name = "SCAN", required = true, num_args = 2..)]
    scans: Vec<PathBuf>,
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "OUTDIR")]
    output: PathBuf,
    /// Model to fit to all scans: a closed mesh, or auto for the built-in hearts (repeatable: the one in which all fits
    /// together have the greatest confidence is kept)
    #[arg(long, value_name = "MODEL", default_value = MODEL_AUTO)]
    model: Vec<PathBuf>,
    /// Format of the fitted meshes (repeatable)
    #[arg(
        long = "format",
        value_name = "FORMAT",
        value_parser = parse_format,
        default_values = ["glb", "json"]
    )]
    formats: Vec<Format>,
    #[command(flatten)]
    normals: NormalLimitArgs,
    #[command(flatten)]
    choice: TableArgs<SerialChoice>,
    #[command(flatten)]
    fit: FitArgsOf<SerialChoice>,
    #[command(flatten)]
    dicom: DicomArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, a heart cannot be fitted, the scans cannot be compared, or a file cannot be written.
/// Nothing is written unless the comparison is complete.
pub fn run(args: &SerialArgs) -> Result<()> {
    let parameters = with_fit(&args.choice, &args.fit)?;
    let limits = args.limits.limits()?;
    let files = |path: &PathBuf| volume_files(std::slice::from_ref(path), &limits);
    let scans: Vec<Vec<VolumeFile>> = args.scans.iter().map(files).collect::<Result<_>>()?;
    let Some(first) = scans.first() else {
        return Err(UnusableArgument::new("give two scans or more".to_owned()).into());
    };
    let normals = args.normals.limits(&parameters.fit)?;
    let objects = args.dicom.order_of_scans(&scans, &limits)?;
    let whose = args.dicom.whose_of_either(first, &limits)?;
    let (auto, models) = chosen_models(&args.model, &MeshStatement::default(), &limits)?;
    let order = SerialOrder {
        scans: &scans,
        auto,
        models,
        normals: normals.as_ref(),
        parameters: &parameters,
    };
    let bar = Bar::over(Plan::SERIAL);
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = from_files(&order, &limits, &monitor)
        .map_err(|error| anyhow!(error.with_advice()))
        .and_then(|made| Ok((made.files(&args.formats, &monitor)?, made)));
    bar.finish();
    let (mut files, made) = made?;
    files.push(made.page(&files, whose.as_ref()));
    if let Some(orders) = objects {
        let written = made.dicom_files(&objects::of_serial(&orders, &made));
        files.extend(written.map_err(|error| anyhow!(error.with_advice()))?);
    }
    write_all(&args.output, &files)?;
    let report = made.report();
    for pair in &report.pairs {
        note!("{}", line(&report, pair));
    }
    for scan in &report.scans {
        for warning in &scan.warnings {
            note!("warning: scan {}: {warning}", scan.number);
        }
    }
    for flag in &report.flags {
        note!("warning: {}", flag.reason);
    }
    Ok(())
}

/// A line on what changed between two scans, such as `scan 1 to 2: EF +5 (yes), worse 3 % (cannot tell)`.
fn line(report: &SerialReport, pair: &SerialPairReport) -> String {
    let (earlier, later) = (pair.earlier, pair.later);
    let mut said: Vec<String> = (SCAN_FIGURES.iter())
        .filter_map(|row| {
            let own = report.change(row.place, earlier, later)?;
            let (change, verdict) = (row.written_change(own.change), own.verdict.as_str());
            Some(format!("{} {change} ({verdict})", row.short?))
        })
        .collect();
    for (name, share, verdict) in [
        ("worse", pair.worse_percent, pair.worse_verdict),
        ("better", pair.better_percent, pair.better_verdict),
    ] {
        said.push(format!("{name} {share:.0} % ({})", verdict.as_str()));
    }
    format!("scan {earlier} to {later}: {}", said.join(", "))
}
