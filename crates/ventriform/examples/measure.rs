//! Compares two masks on one grid: Jaccard and Dice indices, distances between their contours, volumes.
//!
//! ```text
//! cargo run --release -p ventriform --example measure -- mask.nii.gz expert.nii.gz
//! ```

use std::error::Error;
use ventriform::volume::{self, ReadOptions};
use ventriform::{Mask, Monitor, ReadLimits, Volume, VolumeFile, compare};

fn read(path: &str) -> Result<(Mask, Volume), Box<dyn Error>> {
    let file = VolumeFile::in_memory(path, std::fs::read(path)?);
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    let volume = volume::read(&[file], &options, &limits, &Monitor::silent())?.volume;
    let mask = Mask {
        shape: volume.shape,
        voxels: volume.voxels.iter().map(|value| *value > 0.5).collect(),
    };
    Ok((mask, volume))
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(mask), Some(expert)) = (arguments.next(), arguments.next()) else {
        return Err("usage: measure MASK EXPERT".into());
    };
    let ((mask, volume), (expert, _)) = (read(&mask)?, read(&expert)?);
    let found = compare(&mask, &expert, volume.frame.spacing(), &Monitor::silent())?;
    println!("Jaccard {:.3}, Dice {:.3}", found.jaccard, found.dice);
    if let Some(contours) = found.contours {
        println!("contours: {:.2} mm apart in the mean", contours.mean_mm);
    }
    let [ours, theirs] = found.volumes_ml;
    println!("volumes {ours:.1} and {theirs:.1} ml");
    Ok(())
}
