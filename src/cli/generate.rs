//! `ventriform generate`: a surface model from a volume.

use super::limit_args::LimitArgs;
use super::output::{note, write_file};
use super::volume_args::volume_files;
use super::{Bar, ModelArgs, UnusableArgument};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::{Path, PathBuf};
use ventriform::base::progress::{CancelToken, Monitor};
use ventriform::image::volume::Provenance;
use ventriform::image::volume::{self, ReadOptions};
use ventriform::results::export::open_part::open_part;
use ventriform::results::export::{self, Format, Part};
use ventriform::results::report::{MeasuredSurface, ModelReport};
use ventriform::runs::advice::Explain;
use ventriform::runs::pipeline::{self, Model};

/// Make a surface model from a volume
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform generate spect.nii.gz -o lv.glb
  ventriform generate spect.nii.gz -o lv.stl -o lv.json --points 200 --report report.html
  ventriform generate organs.nii.gz -o liver.ply --label 1 --adaptive 0.25
  ventriform generate pair.hdr pair.img -o lv.vtp --iso 50%
  ventriform generate series/*.dcm -o lv.glb")]
pub struct GenerateArgs {
    /// The volume: NIfTI (.nii, .nii.gz, or a .hdr and .img pair) or DICOM (a multi-frame NM, PET, CT or
    /// MR file, all files of one series, or a zip or folder of them)
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// File to write the model to; the extension chooses the format: glb, gltf, stl, ply, obj, vtp,
    /// vtk or json (repeatable)
    #[arg(short, long = "output", value_name = "OUT", required = true)]
    output: Vec<PathBuf>,
    /// File to write the quality report to: .json or .html (repeatable)
    #[arg(long, value_name = "FILE")]
    report: Vec<PathBuf>,
    /// Leave patient, study and series out of the HTML report
    #[arg(long)]
    deidentify: bool,
    /// Write only this part of a left ventricle's wall, as an open surface
    #[arg(long, value_name = "PART", value_parser = parse_part)]
    part: Option<Part>,
    /// Print only errors
    #[arg(short, long)]
    quiet: bool,
    #[command(flatten)]
    model: ModelArgs,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If the volume cannot be read, no model can be made of it, or a file cannot be written. Nothing
/// is written unless the model is complete.
pub fn run(args: &GenerateArgs) -> Result<()> {
    let formats = output_formats(&args.output)?;
    check_report_names(&args.report)?;
    let parameters = args.model.parameters().map_err(UnusableArgument::from)?;
    let limits = args.limits.limits()?;
    let files = volume_files(&args.input, &limits)?;
    let bar = Bar::start();
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = pipeline::generate(&files, &parameters, &limits, &monitor);
    bar.finish();
    let model = made.map_err(|error| anyhow::anyhow!(error.with_advice()))?;
    let surface = model.measured_surface();
    let metadata = model.metadata_with_distance(&surface, &monitor)?;
    let (mesh, metadata) = match args.part {
        Some(part) => open_part(&model.mesh, &metadata, part).with_context(|| {
            format!(
                "the model has no {}: only models of a left ventricle's wall have parts; leave out --part",
                part.as_str()
            )
        })?,
        None => (model.mesh.clone(), metadata),
    };
    for (path, format) in args.output.iter().zip(formats) {
        let bytes = export::encode(format, &mesh, &metadata)?;
        write_file(path, &bytes)?;
    }
    let options = ReadOptions {
        frame: parameters.frame,
    };
    let whose = if !args.deidentify {
        volume::provenance(&files, &options, &limits, &monitor)?
    } else {
        None
    };
    for path in &args.report {
        let text = report_text(path, &model, whose.as_ref(), &surface, &monitor)?;
        write_file(path, text.as_bytes())?;
    }
    if !args.quiet {
        print_summary(&model.report);
    }
    Ok(())
}

/// Reads the name of a part of the wall.
pub(super) fn parse_part(text: &str) -> Result<Part, String> {
    Part::named(text)
        .ok_or_else(|| format!("give one of {}", Part::ALL.map(Part::as_str).join(", ")))
}

fn output_formats(outputs: &[PathBuf]) -> Result<Vec<Format>> {
    outputs
        .iter()
        .map(|path| {
            Format::from_extension(&extension(path)).with_context(|| {
                format!(
                    "{}: the extension is not a known format; use glb, gltf, stl, ply, obj, vtp, \
                     vtk or json",
                    path.display()
                )
            })
        })
        .collect()
}

fn check_report_names(reports: &[PathBuf]) -> Result<()> {
    for path in reports {
        if !matches!(extension(path).as_str(), "json" | "html") {
            bail!(
                "{}: a report must end in .json or .html; rename the file",
                path.display()
            );
        }
    }
    Ok(())
}

fn report_text(
    path: &Path,
    model: &Model,
    whose: Option<&Provenance>,
    surface: &MeasuredSurface<'_>,
    monitor: &Monitor,
) -> Result<String> {
    Ok(match extension(path).as_str() {
        "html" => {
            let closeness = surface.closeness(&model.mesh, monitor)?;
            model.report_html(Some(&closeness), whose)
        }
        _ => model.report.to_json_text(),
    })
}

fn extension(path: &Path) -> String {
    path.extension()
        .map(|e| e.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

/// Prints the main figures and all warnings on standard error.
pub fn print_summary(report: &ModelReport) {
    for line in report.headlines() {
        note!("{line}");
    }
    for warning in &report.warnings {
        note!("warning: {warning}");
    }
}
