//! Prints the built-in hearts, made anew from phantoms:
//! `cargo run --release -p ventriform-evaluation --bin built_in > crates/ventriform/src/runs/segmentation/built_in/hearts.json`

use ventriform::base::progress::{Cancelled, Monitor};
use ventriform::runs::segmentation::built_in::hearts_json;

fn main() -> Result<(), Cancelled> {
    print!("{}", hearts_json(&Monitor::silent())?);
    Ok(())
}
