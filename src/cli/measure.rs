//! `ventriform measure`: the agreement of two masks.

use super::output::json;
use super::segment::read;
use crate::grid::agreement::compare;
use crate::grid::voxelise::Mask;
use crate::progress::Monitor;
use crate::segmentation::{agreement_json, on_grid};
use anyhow::{Context, Result, bail};
use clap::Args;
use std::path::PathBuf;

/// Compare two masks: Jaccard E_J, mean contour distance E_CD, Dice, Hausdorff
#[derive(Debug, Args)]
#[command(after_help = "Example:
  ventriform measure out/mask.nii.gz expert.nii.gz
Prints JSON. If the masks lie on different grids, B is resampled to the grid of A by its position
in the patient.")]
pub struct MeasureArgs {
    /// Mask to judge; voxels above 0.5 belong to it
    #[arg(value_name = "A")]
    a: PathBuf,
    /// Reference mask
    #[arg(value_name = "B")]
    b: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// If a file cannot be read, a mask is empty, or the masks do not overlap in space.
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
            "{}: the mask is empty, as no voxel is above 0.5; give a mask with values 0 and 1",
            args.a.display()
        );
    }
    let reference = on_grid(&b, &a, &monitor).with_context(|| format!("{}", args.b.display()))?;
    let agreement = compare(&judged, &reference, a.frame.spacing(), &monitor)?;
    json(&serde_json::to_string_pretty(&agreement_json(&agreement))?);
    Ok(())
}
