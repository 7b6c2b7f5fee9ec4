//! Makes a surface model of a volume, NIfTI or DICOM, and writes it as glTF.
//!
//! ```text
//! cargo run --release -p ventriform --example generate -- scan.nii.gz heart.glb
//! ```

use std::error::Error;
use ventriform::{Format, ModelParameters, encode, generate, open};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scan), Some(output)) = (arguments.next(), arguments.next()) else {
        return Err("usage: generate SCAN OUTPUT.glb".into());
    };
    let parameters = ModelParameters::from_pairs([("points", "150")])?;
    let model = generate(&open(scan)?, &parameters)?;
    for line in model.report.headlines() {
        println!("{line}");
    }
    let bytes = encode(Format::Glb, &model.mesh, &model.metadata())?;
    std::fs::write(output, bytes)?;
    Ok(())
}
