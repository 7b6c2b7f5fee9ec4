//! The voxels that are read of files, for `scripts/check/dicom_codecs.py`.
//!
//!     cargo run -p ventriform-evaluation --bin voxels -- FILE...
//!
//! Reads each FILE as a volume by itself. Beside it, FILE.f32 holds its voxels as little endian `f32`, and
//! FILE.error the message if it is refused.

use std::io;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, VolumeFile};

fn main() -> io::Result<()> {
    for path in std::env::args().skip(1) {
        let files = [VolumeFile::at(Path::new(&path))];
        let (options, limits) = (ReadOptions::default(), ReadLimits::default());
        match volume::read(&files, &options, &limits, &Monitor::silent()) {
            Ok(reading) => {
                let voxels = reading.volume.voxels.iter();
                let bytes: Vec<u8> = voxels.flat_map(|v| v.to_le_bytes()).collect();
                std::fs::write(format!("{path}.f32"), bytes)?;
            }
            Err(error) => std::fs::write(format!("{path}.error"), error.to_string())?,
        }
    }
    Ok(())
}
