//! `ventriform compare`: rest and stress of one patient.

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
use ventriform::mesh::files::MeshStatement;
use ventriform::parameters::ComparisonChoice;
use ventriform::results::export::Format;
use ventriform::results::figures;
use ventriform::runs::advice::Explain;
use ventriform::runs::rest_stress::{ComparisonOrder, from_files};

/// Compare rest and stress of one patient: reversible and fixed defects
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform compare --stress stress.dcm --rest rest.dcm -o out
  ventriform compare --stress stress.nii.gz --rest rest.nii.gz -o out --normals normals.json --sex F
Both scans are fitted by the same model. Where both are gated, a beat is fitted to each, and EF, motion and thickening \
are compared too.
Writes comparison.json (TID, reversible and fixed share of the wall, segments, territories, flags), segments.csv and \
polar maps
(polar_stress, polar_rest, polar_difference; with normal limits also polar_z_stress, polar_score_stress, ...), and of \
each scan the
fitted wall (mesh_stress.glb, mesh_rest.glb, ...) and the image about the heart (region_stress.nii.gz, \
region_rest.nii.gz); slices.png
(stress above rest), report.html and, with --dicom, measurements.dcm, fhir.json
(the same as FHIR R4), page.dcm (the report as one picture), polar_stress.dcm, polar_rest.dcm and polar_difference.dcm.
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
    choice: TableArgs<ComparisonChoice>,
    #[command(flatten)]
    fit: FitArgsOf<ComparisonChoice>,
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
pub fn run(args: &CompareArgs) -> Result<()> {
    let parameters = with_fit(&args.choice, &args.fit)?;
    let limits = args.limits.limits()?;
    let stress = volume_files(&args.stress, &limits)?;
    let rest = volume_files(&args.rest, &limits)?;
    let normals = args.normals.limits(&parameters.fit)?;
    let dicom = args.dicom.order_of_pair([&stress, &rest], &limits)?;
    let whose = args.dicom.whose_of_either(&stress, &limits)?;
    let choice = &parameters.choice;
    if normals.is_none() && (choice.stress_protocol.is_some() || choice.rest_protocol.is_some()) {
        let without = "--stress-protocol and --rest-protocol choose groups of normal limits; give --normals FILE too, \
                       or leave them out";
        return Err(UnusableArgument::new(without.to_owned()).into());
    }
    let (auto, models) = chosen_models(&args.model, &MeshStatement::default(), &limits)?;
    let order = ComparisonOrder {
        stress: &stress,
        rest: &rest,
        auto,
        models,
        normals: normals.as_ref(),
        parameters: &parameters,
    };
    let bar = Bar::over(Plan::COMPARISON);
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = from_files(&order, &limits, &monitor)
        .map_err(|error| anyhow!(error.with_advice()))
        .and_then(|made| Ok((made.files(&args.formats, &monitor)?, made)));
    bar.finish();
    let (mut files, made) = made?;
    files.push(made.page(&files, whose.as_ref()));
    if let Some([stress, rest]) = dicom {
        let scans = [
            stress.of_compared(&made.stress),
            rest.of_compared(&made.rest),
        ];
        let objects = made.dicom_files(&scans, &files);
        files.extend(objects.map_err(|error| anyhow!(error.with_advice()))?);
    }
    write_all(&args.output, &files)?;
    let report = made.report();
    note!("{}", figures::line(figures::comparison::FIGURES, &report));
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
