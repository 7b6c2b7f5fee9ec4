//! `ventriform beat`: one model in motion of a gated study.

use super::Bar;
use super::dicom_args::DicomArgs;
use super::limit_args::LimitArgs;
use super::normals::{NormalLimitArgs, normals_line};
use super::output::note;
use super::parameter_args::{FitArgsOf, TableArgs, with_fit};
use super::segment::{MODEL_AUTO, chosen_models, parse_format, write_all};
use super::volume_args::volume_files;
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::PathBuf;
use ventriform::base::progress::{CancelToken, Monitor, Plan};
use ventriform::mesh::files::MeshStatement;
use ventriform::parameters::BeatChoice;
use ventriform::results::export::Format;
use ventriform::results::figures;
use ventriform::runs::advice::Explain;
use ventriform::runs::gated::{GatedHeart, GatedOrder, from_files};

/// Fit one model in motion to the gates of a study: volumes, ejection fraction, motion of the wall
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform beat gated.nii.gz -o out
  ventriform beat gated.dcm -o out --mass-g 130
  ventriform beat gate1.nii.gz gate2.nii.gz ... gate8.nii.gz -o out --rr-ms 850
Writes beat.json (EDV, ESV, EF, curve, motion, thickening and phase of each segment, flags), report.html, curve.svg,
phase.svg, gates.csv,
segments.csv, polar maps (polar.svg and polar.json: uptake of all gates; polar_ed, polar_es, polar_motion, \
polar_thickening,
polar_phase), mesh.glb (the beat as an animation), mesh_ed.glb and mesh_es.glb (end diastole and end systole),
mesh_gate01.glb, ... (or the formats given by --format; all have the same nodes and triangles) and \
labels_gate01.nii.gz, ...
(wall 1, cavity 2); with --dicom also mask_ed.dcm, mask_es.dcm, measurements.dcm
and fhir.json (the same as FHIR R4).
Gates and segments are counted from 1.")]
pub struct BeatArgs {
    /// The gates: a 4-D NIfTI file, a gated DICOM file, or one file for each gate, ordered by DICOM headers, else by the
    /// numbers in their names (gate2 before gate10), else as given
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// Folder to write to (created if missing)
    #[arg(short, long = "output", value_name = "OUTDIR")]
    output: PathBuf,
    /// Model to fit to the gates' sum: a closed mesh, or auto for the built-in hearts (repeatable: the fit with the
    /// greatest confidence is kept)
    #[arg(long, value_name = "MODEL", default_value = MODEL_AUTO)]
    model: Vec<PathBuf>,
    /// Format of the meshes (repeatable)
    #[arg(
        long = "format",
        value_name = "FORMAT",
        value_parser = parse_format,
        default_values = ["glb"]
    )]
    formats: Vec<Format>,
    #[command(flatten)]
    choice: TableArgs<BeatChoice>,
    #[command(flatten)]
    fit: FitArgsOf<BeatChoice>,
    #[command(flatten)]
    normals: NormalLimitArgs,
    #[command(flatten)]
    dicom: DicomArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, the gates are no beat, or a file cannot be written. Nothing is written unless the fit is
/// complete.
pub fn run(args: &BeatArgs) -> Result<()> {
    let parameters = with_fit(&args.choice, &args.fit)?;
    let limits = args.limits.limits()?;
    let gates = volume_files(&args.input, &limits)?;
    let dicom = args.dicom.order_of_gates(&gates, &limits)?;
    let whose = args.dicom.whose_of_gates(&gates, &limits)?;
    let stated = MeshStatement::default();
    let (auto, models) = chosen_models(&args.model, &stated, &limits)?;
    let normals = args.normals.limits(&parameters.fit)?;
    let order = GatedOrder {
        gates: &gates,
        auto,
        models,
        normals: normals.as_ref(),
        parameters: &parameters.fit,
        choice: parameters.choice,
    };
    let bar = Bar::over(Plan::BEAT);
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = from_files(&order, &limits, &monitor)
        .map_err(|error| anyhow!(error.with_advice()))
        .and_then(|made| Ok((made.files(&args.formats, &monitor)?, made)));
    bar.finish();
    let (mut files, made) = made?;
    files.push(made.page(&files, whose.as_ref()));
    if let Some(order) = dicom {
        let objects = made.dicom_files(&order.of_beat(&made));
        files.extend(objects.map_err(|error| anyhow!(error.with_advice()))?);
    }
    write_all(&args.output, &files)?;
    note!("{}", headline(&made));
    if let Some(perfusion) = &made.perfusion {
        note!("{}", normals_line(perfusion));
        for flag in &perfusion.flags {
            note!("warning: {flag}");
        }
    }
    let report = made.report();
    for warning in &report.warnings {
        note!("warning: {warning}");
    }
    for flag in &report.flags {
        note!("warning: {}", flag.reason);
    }
    Ok(())
}

fn headline(made: &GatedHeart) -> String {
    let line = figures::line(figures::beat::FIGURES, &made.report());
    match made.beat.ef_percent {
        Some(_) => line,
        None => format!("no beat: {line}"),
    }
}
