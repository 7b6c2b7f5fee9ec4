//! `ventriform reconstruct`: a volume of projections.

use super::Bar;
use super::dicom_args::moment;
use super::limit_args::LimitArgs;
use super::output::{note, write_file};
use super::parameter_args::{TableArgs, UnusableArgument};
use super::volume_args::volume_files;
use anyhow::{Result, anyhow};
use clap::Args;
use std::path::PathBuf;
use ventriform::base::progress::{CancelToken, Monitor};
use ventriform::image::reconstruct::Reconstruction;
use ventriform::image::volume::nifti;
use ventriform::image::volume::{Reconstructed, reconstructed};
use ventriform::results::export::dicom::{
    DicomError, Moment, SourceScan, StatedIdentity, identity, nuclear_image,
};
use ventriform::runs::advice::Explain;

/// Reconstruct slices of raw projections (DICOM NM TOMO, GATED TOMO)
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform reconstruct raw.dcm -o volume.nii.gz
  ventriform reconstruct gated-raw.dcm -o gates.nii.gz --osem-iterations 4 --filter-cut-off-per-cm 0.4
  ventriform reconstruct gated-raw.dcm -o sum.nii.gz --sum
  ventriform reconstruct raw.dcm -o slices.dcm
Writes one volume, or of gated projections a volume for each gate along the fourth dimension, which `beat` takes.
All commands take projections as they take slices, reconstructed with the defaults below.
Attenuation, scatter and the collimator's resolution are not corrected.")]
pub struct ReconstructArgs {
    /// The projections: a DICOM NM image of the Image Type TOMO or GATED TOMO
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    /// File to write: .nii.gz, .nii, or .dcm for a Nuclear Medicine Image of the projections' patient and study
    #[arg(short, long = "output", value_name = "OUT")]
    output: PathBuf,
    /// One volume of the counts of all gates
    #[arg(long)]
    sum: bool,
    /// Date and time of a DICOM file; with the same time, the same input gives the same bytes [default: now]
    #[arg(long, value_name = "RFC3339")]
    made_at: Option<String>,
    #[command(flatten)]
    how: TableArgs<Reconstruction>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If the projections cannot be read or the file cannot be written.
pub fn run(args: &ReconstructArgs) -> Result<()> {
    let how = args.how.parameters().map_err(UnusableArgument::from)?;
    let name = args.output.to_string_lossy();
    let ends = |ending: &str| name.to_ascii_lowercase().ends_with(ending);
    if ![".nii.gz", ".nii", ".dcm"].into_iter().any(ends) {
        let reason = format!("{name}: name the file .nii.gz, .nii or .dcm");
        return Err(UnusableArgument::new(reason).into());
    }
    let limits = args.limits.limits()?;
    let files = volume_files(&args.input, &limits)?;
    let bar = Bar::start();
    let monitor = Monitor::new(&bar, CancelToken::new());
    let made = reconstructed(&files, &how, args.sum, &limits, &monitor);
    bar.finish();
    let made = made.map_err(|error| anyhow!(error.with_advice()))?;
    let bytes = if ends(".dcm") {
        let made_at = moment(args.made_at.as_deref())?;
        nuclear(&made, &how, made_at).map_err(|error| anyhow!(error.with_advice()))?
    } else {
        nifti::write_gates(&made.volumes, made.gate_ms, ends(".gz"))?
    };
    write_file(&args.output, &bytes)?;
    note!("Written: {name}, {}", described(&made));
    for warning in &made.facts.warnings {
        note!("warning: {warning}");
    }
    Ok(())
}

/// The volumes as a Nuclear Medicine Image.
fn nuclear(made: &Reconstructed, how: &Reconstruction, at: Moment) -> Result<Vec<u8>, DicomError> {
    let whose = identity(made.provenance.as_ref(), &StatedIdentity::default())?;
    let first = &made.volumes[0];
    let scan = SourceScan::new(whose, first.frame.clone(), first.shape, false, at);
    let derivation = format!("reconstructed by ventriform: {how}");
    nuclear_image(
        &scan,
        &made.volumes,
        made.gate_ms,
        "reconstructed slices",
        &derivation,
    )
}

/// Size and number of the volumes.
fn described(made: &Reconstructed) -> String {
    let [nx, ny, nz] = made.facts.shape;
    let mm = made.facts.spacing_mm[0];
    let size = format!("{nx} x {ny} x {nz} voxels of {mm:.2} mm");
    match made.volumes.len() {
        1 => size,
        gates => format!("{gates} gates of {size}"),
    }
}
