//! `ventriform inspect`: what a file says about itself.

use super::limit_args::LimitArgs;
use super::output::json;
use super::volume_args::volume_files;
use anyhow::Result;
use clap::Args;
use std::path::PathBuf;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{self, ReadOptions};
use ventriform::results::report::{self, FileFacts};
use ventriform::runs::advice::Explain;

/// Print what is read of a volume: size, place, values, gates and, of DICOM, whose scan it is
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  ventriform inspect scan.dcm
  ventriform inspect series.zip | jq .dicom.series_uid
Prints JSON. The values under `dicom` are personal data.")]
pub struct InspectArgs {
    /// The volume: NIfTI (.nii, .nii.gz, or a .hdr and .img pair) or DICOM (one file, all files of one
    /// series, or a zip or folder of them)
    #[arg(value_name = "IN", required = true, num_args = 1..)]
    input: Vec<PathBuf>,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Runs the command.
///
/// # Errors
/// If the volume cannot be read.
pub fn run(args: &InspectArgs) -> Result<()> {
    let (limits, monitor) = (args.limits.limits()?, Monitor::silent());
    let files = volume_files(&args.input, &limits)?;
    let facts = volume::inspect(&files, &limits, &monitor);
    let facts = facts.map_err(|error| anyhow::anyhow!(error.with_advice()))?;
    let first = ReadOptions { frame: Some(0) };
    let from = volume::provenance(&files, &first, &limits, &monitor)
        .map_err(|error| anyhow::anyhow!(error.with_advice()))?;
    let mut shown = report::object(&FileFacts::from_facts(&facts));
    shown.insert("gates".into(), serde_json::to_value(facts.gates)?);
    if let Some(from) = from {
        shown.insert("dicom".into(), serde_json::to_value(from)?);
    }
    json(&serde_json::to_string_pretty(&shown)?);
    Ok(())
}
