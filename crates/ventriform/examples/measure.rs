//! Compares two masks: Jaccard and Dice indices, distance of their contours, volumes.
//!
//! ```text
//! cargo run --release -p ventriform --example measure -- mask.nii.gz expert.nii.gz
//! ```

use std::error::Error;
use ventriform::{measure, open_mask};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(mask), Some(expert)) = (arguments.next(), arguments.next()) else {
        return Err("usage: measure MASK EXPERT".into());
    };
    let found = measure(open_mask(mask)?, open_mask(expert)?)?;
    println!("Jaccard {:.3}, Dice {:.3}", found.jaccard, found.dice);
    if let Some(contours) = found.contours {
        println!("contours: {:.2} mm apart in the mean", contours.mean_mm);
    }
    let [ours, theirs] = found.volumes_ml;
    println!("volumes {ours:.1} and {theirs:.1} ml");
    Ok(())
}
