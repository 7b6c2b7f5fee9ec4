//! The files in a folder, as a person exported them.
//!
//! In: a folder. Out: its files and those of the folders in it, in the order of their paths. Hidden
//! files and what accompanies images on a medium are left out, as in an archive; links to folders are
//! not followed, so that every folder is seen once.

use super::VolumeError;
use super::archive::is_company;
use super::limits::ReadLimits;
use super::source::VolumeFile;
use std::fs;
use std::path::{Path, PathBuf};

impl VolumeFile {
    /// The files that a person names by `paths`: each file, all files in a folder
    /// ([`files_in`]), and the other half of a single `.hdr` or `.img`.
    ///
    /// # Errors
    /// [`VolumeError`] if a folder cannot be read, is empty, or holds too many files.
    pub fn given(
        paths: &[impl AsRef<Path>],
        limits: &ReadLimits,
    ) -> Result<Vec<Self>, VolumeError> {
        let mut files = Vec::new();
        for path in paths {
            let path = path.as_ref();
            if path.is_dir() {
                files.extend(files_in(path, limits)?);
            } else if paths.len() == 1 {
                files.extend(Self::with_other_half(path));
            } else {
                files.push(Self::at(path).by_path());
            }
        }
        Ok(files)
    }
}

/// The files in `folder`.
///
/// # Errors
/// [`VolumeError`] if a folder cannot be read or holds no file, or if there are more than
/// [`ReadLimits::files`] files or folders within folders more than [`ReadLimits::folder_levels`] deep.
pub(super) fn files_in(folder: &Path, limits: &ReadLimits) -> Result<Vec<VolumeFile>, VolumeError> {
    let shown = folder.display().to_string();
    let too_large = |what, asked, limit| VolumeError::TooLarge {
        file: format!("the folder {shown}"),
        what,
        asked,
        limit,
    };
    let mut paths: Vec<PathBuf> = Vec::new();
    let mut open = vec![(folder.to_path_buf(), 1)];
    let mut seen = 0;
    while let Some((folder, depth)) = open.pop() {
        let io = |error: std::io::Error| VolumeError::Io {
            file: format!("the folder {}", folder.display()),
            reason: error.to_string(),
        };
        for entry in fs::read_dir(&folder).map_err(io)? {
            let entry = entry.map_err(io)?;
            seen += 1;
            if seen > limits.files {
                return Err(too_large("files", seen, limits.files));
            }
            let path = entry.path();
            let name = entry.file_name();
            let kind = entry.file_type().map_err(io)?;
            if is_company(&name.to_string_lossy()) {
                continue;
            }
            if kind.is_dir() {
                if depth >= limits.folder_levels {
                    let levels = limits.folder_levels as u64;
                    return Err(too_large("levels", depth as u64 + 1, levels));
                }
                open.push((path, depth + 1));
            } else if path.is_file() {
                paths.push(path);
            }
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(VolumeError::Empty {
            file: format!("the folder {shown}"),
        });
    }
    let name = |path: &Path| {
        let inside = path.strip_prefix(folder).unwrap_or(path);
        inside.to_string_lossy().into_owned()
    };
    let files = paths.iter().map(|path| VolumeFile::named(name(path), path));
    Ok(files.map(|file| file.found().by_path()).collect())
}
