//! Files that are written whole or not at all, and the digests of files that are read.

use super::error::EvaluateError;
use crate::base::text::hex;
use crate::image::volume::VolumeFile;
use sha2::{Digest, Sha256};
use std::io;
use std::path::Path;

/// Writes `bytes` to a file beside `path` and renames it, so that a run that is killed leaves no
/// half file under this name.
///
/// # Errors
/// [`EvaluateError::Write`].
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), EvaluateError> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let beside = path.with_file_name(format!(".{name}.part"));
    std::fs::write(&beside, bytes)
        .and_then(|()| std::fs::rename(&beside, path))
        .map_err(|error| EvaluateError::Write {
            path: path.to_path_buf(),
            error,
        })
}

/// Makes a folder and those above it, where they are missing.
///
/// # Errors
/// [`EvaluateError::Write`].
pub fn make_folder(path: &Path) -> Result<(), EvaluateError> {
    std::fs::create_dir_all(path).map_err(|error| EvaluateError::Write {
        path: path.to_path_buf(),
        error,
    })
}

/// The SHA-256 of the stored bytes of a volume's files one after the other, hexadecimal.
///
/// # Errors
/// If one cannot be read.
pub fn sha256_of_volume(files: &[VolumeFile]) -> io::Result<String> {
    let mut hash = Sha256::new();
    for file in files {
        file.stream_stored(&mut |bytes| hash.update(bytes))?;
    }
    Ok(hex(&hash.finalize()))
}

/// The SHA-256 of files one after the other, hexadecimal.
///
/// # Errors
/// If one cannot be read.
pub fn sha256_of(paths: &[impl AsRef<Path>]) -> io::Result<String> {
    let mut hash = Sha256::new();
    for path in paths {
        hash.update(std::fs::read(path)?);
    }
    Ok(hex(&hash.finalize()))
}
