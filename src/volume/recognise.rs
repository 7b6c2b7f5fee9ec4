//! Recognises the format of a file by its first bytes.
//!
//! File names can be wrong and can get lost during an upload, so only the magic numbers count.

use super::limits::ReadLimits;
use super::source::{Source, VolumeFile};
use super::{VolumeError, dicom, nifti};

/// Unpacked bytes that are examined.
const EXAMINED: usize = 1024;

/// Files that together hold one volume or several.
#[derive(Debug)]
pub(super) enum Recognised<'a> {
    /// A file with a NIfTI header and the file with its voxels, which may be the same.
    Nifti {
        header: &'a VolumeFile,
        voxels: &'a VolumeFile,
    },
    /// DICOM files.
    Dicom(Vec<&'a VolumeFile>),
}

/// What a single file is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    NiftiSingle,
    NiftiHeader,
    Dicom,
    Other,
}

/// Determines the format of `files`.
///
/// # Errors
/// [`VolumeError`] for unknown or unsupported formats, and for files that do not belong together.
pub(super) fn recognise<'a>(
    files: &'a [VolumeFile],
    limits: &ReadLimits,
) -> Result<Recognised<'a>, VolumeError> {
    match files {
        [] => Err(VolumeError::NoFile),
        [file] => match look(file, limits)? {
            (FileKind::NiftiSingle, _) => Ok(Recognised::Nifti {
                header: file,
                voxels: file,
            }),
            (FileKind::NiftiHeader, _) => {
                nifti::check_header(file, limits)?;
                Err(VolumeError::ImageMissing {
                    file: file.name().into(),
                })
            }
            (FileKind::Dicom, _) => Ok(Recognised::Dicom(vec![file])),
            (FileKind::Other, start) => Err(refuse(file, &start)),
        },
        [a, b] => pair(a, b, limits),
        more => {
            for file in more {
                if look(file, limits)?.0 != FileKind::Dicom {
                    return Err(VolumeError::NotOneVolume { count: more.len() });
                }
            }
            Ok(Recognised::Dicom(more.iter().collect()))
        }
    }
}

/// Two files: one must be a header whose voxels are in the other.
fn pair<'a>(
    a: &'a VolumeFile,
    b: &'a VolumeFile,
    limits: &ReadLimits,
) -> Result<Recognised<'a>, VolumeError> {
    let (header, voxels) = match (look(a, limits)?, look(b, limits)?) {
        // A file of voxels may start with any bytes.
        ((FileKind::NiftiHeader, _), (FileKind::Other | FileKind::Dicom, _)) => (a, b),
        ((FileKind::Other | FileKind::Dicom, _), (FileKind::NiftiHeader, _)) => (b, a),
        ((FileKind::Dicom, _), (FileKind::Dicom, _)) => {
            return Ok(Recognised::Dicom(vec![a, b]));
        }
        ((FileKind::Other, start), (FileKind::Other, _)) if is_analyze(&start) => {
            return Err(refuse(a, &start));
        }
        ((FileKind::Other, _), (FileKind::Other, start)) if is_analyze(&start) => {
            return Err(refuse(b, &start));
        }
        _ => return Err(VolumeError::NotOneVolume { count: 2 }),
    };
    Ok(Recognised::Nifti { header, voxels })
}

/// The files of an archive that can hold volumes, in the order of their names.
///
/// # Errors
/// [`VolumeError`] if a file cannot be read, or the archive `name` holds no volume.
pub(super) fn volumes_among(
    files: Vec<VolumeFile>,
    name: &str,
    limits: &ReadLimits,
) -> Result<Vec<VolumeFile>, VolumeError> {
    let mut volumes = Vec::new();
    for file in files {
        match look(&file, limits) {
            Ok((FileKind::Other, _)) | Err(VolumeError::Empty { .. }) => {}
            Ok(_) => volumes.push(file),
            Err(error) => return Err(error),
        }
    }
    // Archives list their files in any order.
    volumes.sort_by(|a, b| a.name().cmp(b.name()));
    match volumes.is_empty() {
        true => Err(VolumeError::Unsupported {
            file: name.into(),
            format: "a zip archive without DICOM or NIfTI files".into(),
            fix: "Pack the files of one DICOM series into the archive.",
        }),
        false => Ok(volumes),
    }
}

/// The kind of `file`, and its first bytes.
fn look(file: &VolumeFile, limits: &ReadLimits) -> Result<(FileKind, Vec<u8>), VolumeError> {
    let mut start = vec![0; EXAMINED];
    let mut source = Source::open(file, limits.unpacked_bytes.max(EXAMINED as u64))?;
    let there = source.fill(&mut start)?;
    start.truncate(there);
    if start.is_empty() {
        return Err(match source.capacity() {
            0 => VolumeError::Empty {
                file: file.name().into(),
            },
            _ => source.truncated(348, 0),
        });
    }
    let kind = match (start.get(344..348), start.get(4..8)) {
        (_, Some(b"n+2\0")) | (Some(b"n+1\0"), _) => FileKind::NiftiSingle,
        (_, Some(b"ni2\0")) | (Some(b"ni1\0"), _) => FileKind::NiftiHeader,
        _ if dicom::is_dicom(&start) => FileKind::Dicom,
        _ => FileKind::Other,
    };
    Ok((kind, start))
}

/// Whether a file without NIfTI magic is an Analyze 7.5 header, which has the same length field.
fn is_analyze(start: &[u8]) -> bool {
    let length = [348_i32.to_le_bytes(), 348_i32.to_be_bytes()];
    start.len() >= 348 && length.iter().any(|l| start.starts_with(l))
}

/// The error for a file that is not supported, with the name of its format if `start` shows it.
fn refuse(file: &VolumeFile, start: &[u8]) -> VolumeError {
    const CONVERT: &str = "Convert it to NIfTI (.nii.gz).";
    const ANALYZE: &str = "Convert it to NIfTI: Analyze files do not state which side is left.";
    let known: &[(usize, &[u8], &'static str)] = &[
        (0, b"CDF\x01", "a MINC 1 (netCDF) file"),
        (0, b"CDF\x02", "a MINC 1 (netCDF) file"),
        (0, b"\x89HDF\r\n", "an HDF5 file (for example MINC 2)"),
        (0, b"NRRD", "an NRRD file"),
        (0, b"ObjectType", "a MetaImage header"),
        (0, b"NDims", "a MetaImage header"),
        (0, b"!INTERFILE", "an Interfile header"),
        (0, b"!interfile", "an Interfile header"),
        (0, b"MATRIX", "an ECAT 7 file"),
        (0, b"\x89PNG", "a PNG image"),
        (0, b"\xff\xd8\xff", "a JPEG image"),
        (0, b"GIF8", "a GIF image"),
        (0, b"II*\0", "a TIFF image"),
        (0, b"MM\0*", "a TIFF image"),
        (0, b"%PDF", "a PDF document"),
        (0, b"PK\x03\x04", "a ZIP archive in an archive"),
        (0, b"BZh", "a bzip2 file"),
        (0, b"\xfd7zXZ", "an xz file"),
        (0, b"\x28\xb5\x2f\xfd", "a Zstandard file"),
        (0, GZIP_AGAIN, "gzipped twice"),
        (257, b"ustar", "a tar archive"),
        (0, b"glTF", "a glTF model"),
        (0, b"ply\n", "a PLY model"),
        (0, b"solid ", "an STL model"),
        (0, b"<?xml", "an XML document"),
        (0, b"<!DOCTYPE", "an HTML page"),
        (0, b"{", "a JSON document"),
    ];
    let name = file.name().to_owned();
    if is_analyze(start) {
        return VolumeError::Unsupported {
            file: name,
            format: "an Analyze 7.5 header (it has no NIfTI magic)".into(),
            fix: ANALYZE,
        };
    }
    for (at, magic, format) in known {
        if start.get(*at..).is_some_and(|rest| rest.starts_with(magic)) {
            return VolumeError::Unsupported {
                file: name,
                format: (*format).into(),
                fix: CONVERT,
            };
        }
    }
    VolumeError::Unrecognised {
        file: name,
        start: start[..start.len().min(16)].escape_ascii().to_string(),
    }
}

const GZIP_AGAIN: &[u8] = &[0x1f, 0x8b, 0x08];
