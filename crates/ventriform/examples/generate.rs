//! Makes a surface model of a volume, NIfTI or DICOM, and writes it as glTF with its report beside it.
//!
//! ```text
//! cargo run --release -p ventriform --example generate -- scan.nii.gz heart.glb
//! ```

use std::error::Error;
use std::path::Path;
use ventriform::{Format, ModelParameters, Monitor, ReadLimits, VolumeFile, encode, generate};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scan), Some(output)) = (arguments.next(), arguments.next()) else {
        return Err("usage: generate SCAN OUTPUT.glb".into());
    };
    let file = VolumeFile::in_memory(scan.clone(), std::fs::read(&scan)?);
    let parameters = ModelParameters::from_pairs([("points", "150")])?;
    let model = generate(
        &[file],
        &parameters,
        &ReadLimits::default(),
        &Monitor::silent(),
    )?;
    for line in model.report.headlines() {
        println!("{line}");
    }
    std::fs::write(
        &output,
        encode(Format::Glb, &model.mesh, &model.metadata())?,
    )?;
    let report = Path::new(&output).with_extension("report.json");
    std::fs::write(report, model.report.to_json_text())?;
    Ok(())
}
