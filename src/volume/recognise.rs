//! What a file is, told by its first bytes.
//!
//! Names lie and get lost on the way through HTTP; the magic numbers of the formats do not.

use super::source::{Source, VolumeFile};
use super::{ReadLimits, VolumeError, dicom, nifti};

/// How many unpacked bytes are looked at.
const LOOKED_AT: usize = 1024;

/// Files that make up one volume.
#[derive(Debug)]
pub(super) enum Recognised<'a> {
    /// A NIfTI header, and where the voxels stand.
    Nifti {
        header: &'a VolumeFile,
        voxels: &'a VolumeFile,
    },
    /// A DICOM file.
    Dicom(&'a VolumeFile),
}

/// One file's kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    NiftiSingle,
    NiftiHeader,
    Dicom,
    Other,
}

/// Finds out what `files` are together.
pub(super) fn recognise<'a>(
    files: &'a [VolumeFile],
    limits: &ReadLimits,
) -> Result<Recognised<'a>, VolumeError> {
    match files {
        [] => Err(VolumeError::NoFile),
        [file] => match look(file, limits)? {
            (Kind::NiftiSingle, _) => Ok(Recognised::Nifti {
                header: file,
                voxels: file,
            }),
            (Kind::NiftiHeader, _) => {
                nifti::check_header(file, limits)?;
                Err(VolumeError::ImageMissing {
                    file: file.name().into(),
                })
            }
            (Kind::Dicom, _) => Ok(Recognised::Dicom(file)),
            (Kind::Other, start) => Err(refuse(file, &start)),
        },
        [a, b] => pair(a, b, limits),
        more => Err(VolumeError::NotOneVolume { count: more.len() }),
    }
}

/// Two files: one of them must be a header that asks for the other.
fn pair<'a>(
    a: &'a VolumeFile,
    b: &'a VolumeFile,
    limits: &ReadLimits,
) -> Result<Recognised<'a>, VolumeError> {
    let (header, voxels) = match (look(a, limits)?, look(b, limits)?) {
        // Voxels may look like anything.
        ((Kind::NiftiHeader, _), (Kind::Other | Kind::Dicom, _)) => (a, b),
        ((Kind::Other | Kind::Dicom, _), (Kind::NiftiHeader, _)) => (b, a),
        ((Kind::Other, start), (Kind::Other, _)) if is_analyze(&start) => {
            return Err(refuse(a, &start));
        }
        ((Kind::Other, _), (Kind::Other, start)) if is_analyze(&start) => {
            return Err(refuse(b, &start));
        }
        _ => return Err(VolumeError::NotOneVolume { count: 2 }),
    };
    Ok(Recognised::Nifti { header, voxels })
}

/// The kind of `file` and its first bytes.
fn look(file: &VolumeFile, limits: &ReadLimits) -> Result<(Kind, Vec<u8>), VolumeError> {
    let mut start = vec![0; LOOKED_AT];
    let mut source = Source::open(file, limits.unpacked_bytes.max(LOOKED_AT as u64))?;
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
        (_, Some(b"n+2\0")) | (Some(b"n+1\0"), _) => Kind::NiftiSingle,
        (_, Some(b"ni2\0")) | (Some(b"ni1\0"), _) => Kind::NiftiHeader,
        _ if dicom::is_dicom(&start) => Kind::Dicom,
        _ => Kind::Other,
    };
    Ok((kind, start))
}

/// Analyze 7.5 has NIfTI-1's length field and no magic.
fn is_analyze(start: &[u8]) -> bool {
    let length = [348_i32.to_le_bytes(), 348_i32.to_be_bytes()];
    start.len() >= 348 && length.iter().any(|l| start.starts_with(l))
}

/// Names what `start` is, as far as it is known.
fn refuse(file: &VolumeFile, start: &[u8]) -> VolumeError {
    const CONVERT: &str = "Convert it to NIfTI (.nii.gz).";
    const ANALYZE: &str = "Convert it to NIfTI: Analyze does not say where left and right are.";
    let known: &[(usize, &[u8], &'static str)] = &[
        (0, b"CDF\x01", "a MINC 1 (netCDF) file"),
        (0, b"CDF\x02", "a MINC 1 (netCDF) file"),
        (0, b"\x89HDF\r\n", "an HDF5 file (MINC 2 is one)"),
        (0, b"NRRD", "an NRRD file"),
        (0, b"ObjectType", "a MetaImage header"),
        (0, b"NDims", "a MetaImage header"),
        (0, b"!INTERFILE", "an Interfile header"),
        (0, b"!interfile", "an Interfile header"),
        (0, b"MATRIX", "an ECAT 7 file"),
        (0, b"\x89PNG", "a PNG picture"),
        (0, b"\xff\xd8\xff", "a JPEG picture"),
        (0, b"GIF8", "a GIF picture"),
        (0, b"II*\0", "a TIFF picture"),
        (0, b"MM\0*", "a TIFF picture"),
        (0, b"%PDF", "a PDF document"),
        (0, b"PK\x03\x04", "a ZIP archive"),
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
            format: "an Analyze 7.5 header (its magic is not NIfTI's)".into(),
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
