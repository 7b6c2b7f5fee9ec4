//! Segments the left ventricle in a volume by the built-in hearts and writes all files: mask, polar map, report.
//!
//! ```text
//! cargo run --release -p ventriform --example segment -- scan.nii.gz folder
//! ```

use std::error::Error;
use ventriform::{FitParameters, Monitor, open, segment};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let (Some(scan), Some(folder)) = (arguments.next(), arguments.next()) else {
        return Err("usage: segment SCAN FOLDER".into());
    };
    let made = segment(&open(scan)?, &FitParameters::default())?;
    let report = made.report();
    println!("wall {:.1} ml", report.volumes_ml.wall);
    println!("confidence {:.2}", report.fit.confidence);
    for flag in &report.flags {
        println!("{}: {}", flag.code, flag.reason);
    }
    std::fs::create_dir_all(&folder)?;
    for file in made.files(&[], None, &Monitor::silent())? {
        std::fs::write(format!("{folder}/{}", file.name), file.bytes)?;
    }
    Ok(())
}
