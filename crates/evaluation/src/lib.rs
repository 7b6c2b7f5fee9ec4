//! The parts that all instruments share.

pub mod simulator;
pub mod statistics;
pub mod walls;

use anyhow::{Result, anyhow};
use std::io;
use std::path::{Path, PathBuf};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::ComparisonParameters;
use ventriform::runs::rest_stress::{ComparedHearts, ComparisonOrder, from_files};

/// Prints `columns`, and what `rows` makes of each folder that the command line names. Folders of which it makes nothing
/// are named on standard error.
pub fn print_table(columns: &str, rows: impl Fn(&Path) -> Result<Vec<String>>) {
    println!("{columns}");
    for folder in std::env::args().skip(1) {
        match rows(Path::new(&folder)) {
            Ok(rows) => rows.iter().for_each(|row| println!("{row}")),
            Err(error) => eprintln!("{folder} is left out: {error:#}"),
        }
    }
}

/// The scans of that file name in the folders `stress` and `rest` of a pair, compared.
///
/// # Errors
/// If a file cannot be read or has no heart.
pub fn compared(
    pair: &Path,
    file: &str,
    parameters: &ComparisonParameters,
) -> Result<ComparedHearts> {
    let [stress, rest] =
        ["stress", "rest"].map(|scan| [VolumeFile::at(pair.join(scan).join(file))]);
    let order = ComparisonOrder {
        stress: &stress,
        rest: &rest,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters,
    };
    from_files(&order, &ReadLimits::default(), &Monitor::silent())
        .map_err(|error| anyhow!("{error}"))
}

/// The cases in `folders`, sorted: the name of the folder and the path of each case that has the file `needed`.
///
/// # Errors
/// If a folder cannot be read.
pub fn cases(
    folders: impl IntoIterator<Item = PathBuf>,
    needed: &str,
) -> io::Result<Vec<(String, PathBuf)>> {
    let mut cases = Vec::new();
    for folder in folders {
        for entry in std::fs::read_dir(&folder)? {
            cases.push((name_of(&folder), entry?.path()));
        }
    }
    cases.retain(|(_, case)| case.join(needed).exists());
    cases.sort();
    Ok(cases)
}

/// The last part of a path.
pub fn name_of(path: &Path) -> String {
    let name = path.file_name().map(|name| name.to_string_lossy());
    name.unwrap_or_default().into_owned()
}
