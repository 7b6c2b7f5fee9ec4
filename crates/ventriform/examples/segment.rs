//! Segments the left ventricle in a volume by the built-in hearts, prints its figures and writes all files: mask,
//! mesh, polar map, report.
//!
//! ```text
//! cargo run --release -p ventriform --example segment -- scan.nii.gz folder
//! ```

use std::error::Error;
use std::path::Path;
use ventriform::segmentation::{SegmentationOrder, from_files};
use ventriform::{FitParameters, Format, Monitor, ReadLimits, VolumeFile};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scan), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("usage: segment SCAN FOLDER".into());
    };
    let parameters = FitParameters::default();
    let order = SegmentationOrder {
        volume: &[VolumeFile::in_memory(scan.clone(), std::fs::read(&scan)?)],
        expert: None,
        auto: true,
        models: Vec::new(),
        reader: None,
        normals: None,
        parameters: &parameters,
    };
    let quiet = Monitor::silent();
    let made = from_files(&order, &ReadLimits::default(), &quiet)?;
    let report = made.report();
    println!(
        "wall {:.1} ml, cavity {:?} ml",
        report.volumes_ml.wall, report.volumes_ml.cavity
    );
    println!("confidence {:.2}", report.fit.confidence);
    for flag in &report.flags {
        println!("{}: {}", flag.code, flag.reason);
    }
    std::fs::create_dir_all(&folder)?;
    for file in made.files(&[Format::Glb, Format::Stl], None, &quiet)? {
        std::fs::write(Path::new(&folder).join(file.name), file.bytes)?;
    }
    Ok(())
}
