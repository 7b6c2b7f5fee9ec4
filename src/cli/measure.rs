//! `ventriform measure`: how well two masks agree.

use super::segment::read;
use crate::grid::agreement::compare;
use crate::grid::voxelise::Mask;
use crate::progress::Monitor;
use crate::segmentation::{agreement_json, on_grid};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;

/// Compares two masks: Jaccard E_J, mean contour distance E_CD, Dice, Hausdorff.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform measure out/mask.nii.gz expert.nii.gz
prints JSON; B is the reference. A mask on another grid is taken over by its place in the
patient.")]
pub struct MeasureArgs {
    /// The mask to judge; voxels above 0.5 belong to it
    #[arg(value_name = "A")]
    a: PathBuf,
    /// The reference
    #[arg(value_name = "B")]
    b: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// Where a file cannot be read, or the masks lie in different places.
pub fn run(args: &MeasureArgs) -> Result<()> {
    let monitor = Monitor::silent();
    let a = read(std::slice::from_ref(&args.a), None, &monitor)?.volume;
    let b = read(std::slice::from_ref(&args.b), None, &monitor)?.volume;
    let judged = Mask {
        shape: a.shape,
        voxels: a.voxels.iter().map(|v| *v > 0.5).collect(),
    };
    if !judged.voxels.contains(&true) {
        bail!(
            "{}: the mask is empty: no voxel is above 0.5",
            args.a.display()
        );
    }
    let reference = on_grid(&b, &a, &monitor).with_context(|| format!("{}", args.b.display()))?;
    let agreement = compare(&judged, &reference, a.frame.spacing(), &monitor)?;
    println!(
        "{}",
        serde_json::to_string_pretty(&agreement_json(&agreement))?
    );
    Ok(())
}
