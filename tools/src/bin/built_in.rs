//! Prints the built-in hearts, made anew from phantoms:
//! `cargo run --release -p ventriform-tools --bin built_in > crates/ventriform/src/segmentation/built_in/hearts.json`

use ventriform::progress::{Cancelled, Monitor};
use ventriform::segmentation::built_in::hearts_json;

fn main() -> Result<(), Cancelled> {
    print!("{}", hearts_json(&Monitor::silent())?);
    Ok(())
}
