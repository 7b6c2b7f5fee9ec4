//! The parts that all instruments share.

pub mod simulator;
pub mod statistics;
pub mod walls;

use std::io;
use std::path::{Path, PathBuf};

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
