//! Files inside a zip archive.
//!
//! In: one file. Out: the files in it, to be read where they lie, without unpacking them to disk or
//! memory. The directory of the archive is read by `zip`, after its size was checked. What an entry
//! unpacks to is bounded by the size that the directory states, and the sum of those sizes by the
//! limit of unpacked bytes.
//!
//! Checksums of entries are not verified: a damaged entry shows in what is read of it.
//!
//! Entries that accompany images on a medium are left out: folders, hidden files and DICOMDIR.

use super::VolumeError;
use super::limits::ReadLimits;
use super::source::VolumeFile;
use std::io::{Read, Seek, SeekFrom};
use zip::{CompressionMethod, ZipArchive};

/// Most files in an archive.
pub(super) const MOST_FILES: u64 = 8192;

/// Most bytes of an archive's directory.
const MOST_DIRECTORY: u64 = 4 << 20;

/// Bytes at the end of a file among which the directory's end record begins.
const END_REACH: u64 = 22 + 0xffff;

/// The files in `file` if that is a zip archive.
///
/// # Errors
/// [`VolumeError`] for damaged, encrypted or oversized archives.
pub(super) fn files_in(
    file: &VolumeFile,
    limits: &ReadLimits,
) -> Result<Option<Vec<VolumeFile>>, VolumeError> {
    let io = |e: std::io::Error| VolumeError::Io {
        file: file.name().into(),
        reason: e.to_string(),
    };
    let mut bytes = file.bytes().map_err(io)?;
    let mut mark = [0; 4];
    let marked = bytes.read_exact(&mut mark).is_ok() && mark == *b"PK\x03\x04";
    if !marked {
        return Ok(None);
    }
    let corrupt = |reason: String| VolumeError::Corrupt {
        file: file.name().into(),
        byte: 0,
        reason,
    };
    let size = bytes.seek(SeekFrom::End(0)).map_err(io)?;
    let begin = size.saturating_sub(END_REACH);
    bytes.seek(SeekFrom::Start(begin)).map_err(io)?;
    let mut end = Vec::new();
    bytes.read_to_end(&mut end).map_err(io)?;
    let too_large = |what, asked, limit| VolumeError::TooLarge {
        file: file.name().into(),
        what,
        asked,
        limit,
    };
    // Every record that the library may take for the end record.
    let records = end
        .windows(22)
        .filter(|record| record.starts_with(b"PK\x05\x06"));
    for record in records {
        let count = u64::from(u16::from_le_bytes([record[10], record[11]]));
        if count > MOST_FILES {
            return Err(too_large("files in the archive", count, MOST_FILES));
        }
        let directory = [record[12], record[13], record[14], record[15]];
        let directory = u64::from(u32::from_le_bytes(directory));
        if directory > MOST_DIRECTORY {
            let what = "bytes in the archive's directory";
            return Err(too_large(what, directory, MOST_DIRECTORY));
        }
    }
    bytes.rewind().map_err(io)?;
    let mut archive = ZipArchive::new(bytes).map_err(|e| corrupt(e.to_string()))?;
    let mut files = Vec::new();
    let mut total = 0_u64;
    for number in 0..archive.len() {
        let entry = archive.by_index_raw(number);
        let entry = entry.map_err(|e| corrupt(e.to_string()))?;
        let name = entry.name().map_err(|e| corrupt(e.to_string()))?;
        if entry.is_dir() || is_company(&name) {
            continue;
        }
        let deflated = match entry.compression() {
            _ if entry.encrypted() => {
                return Err(VolumeError::Unsupported {
                    file: file.name().into(),
                    format: "an encrypted zip archive".into(),
                    fix: "Send the archive without a password.",
                });
            }
            CompressionMethod::Stored => false,
            CompressionMethod::Deflated => true,
            other => {
                return Err(VolumeError::Unsupported {
                    file: file.name().into(),
                    format: format!("a zip archive packed by {other}"),
                    fix: "Pack the archive with deflate, or send the files themselves.",
                });
            }
        };
        total = total.saturating_add(entry.size());
        if total > limits.unpacked_bytes {
            let limit = limits.unpacked_bytes;
            return Err(too_large("unpacked bytes", total, limit));
        }
        let begin = entry.data_start();
        let begin = begin.ok_or_else(|| corrupt("an entry has no place".into()))?;
        let sizes = [entry.compressed_size(), entry.size()];
        files.push(VolumeFile::inside(file, name, begin, sizes, deflated));
    }
    Ok(Some(files))
}

/// Whether the entry of that name accompanies images and is none.
pub(super) fn is_company(name: &str) -> bool {
    let mut parts = name.split(['/', '\\']);
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    parts.any(|part| part == "__MACOSX") || last.starts_with('.') || last == "DICOMDIR"
}
