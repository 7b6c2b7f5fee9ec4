//! Recognises the format of a file by its first bytes.
//!
//! File names can be wrong and can get lost during an upload, so only the magic numbers count.

use super::foreign::{self, is_analyze};
use super::limits::ReadLimits;
use super::source::{Source, VolumeFile};
use super::{VolumeError, dicom, nifti, surface_file};
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::gates::GATE_COUNTS;

/// Unpacked bytes that are examined.
const EXAMINED_BYTES: usize = 1024;

/// Files that together hold one volume or several.
#[derive(Debug)]
pub(super) enum Recognised<'a> {
    /// A file with a NIfTI header and the file with its voxels, which may be the same.
    Nifti {
        header: &'a VolumeFile,
        voxels: &'a VolumeFile,
    },
    /// NIfTI files of one gate each, in their order.
    Gates(Vec<&'a VolumeFile>),
    /// DICOM files.
    Dicom(Vec<&'a VolumeFile>),
    /// A closed surface.
    Mesh(&'a VolumeFile),
    /// Volumes in memory.
    Arrays(&'a VolumeFile),
}

/// The kind of a single file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FileKind {
    NiftiSingle,
    NiftiHeader,
    Dicom,
    Arrays,
    Other,
}

/// The file that was found among others, and notes on the others.
pub(super) struct Found<'a> {
    pub volume: Recognised<'a>,
    /// The files that were left out.
    pub notes: Vec<String>,
}

/// Files by what they are.
#[derive(Default)]
struct Sorted<'a> {
    singles: Vec<&'a VolumeFile>,
    headers: Vec<&'a VolumeFile>,
    dicom: Vec<&'a VolumeFile>,
    arrays: Vec<&'a VolumeFile>,
    /// Files that are no volumes, with their first bytes.
    others: Vec<(&'a VolumeFile, Vec<u8>)>,
    empty: Vec<&'a VolumeFile>,
}

/// Most files that a warning names.
const MOST_NAMED: usize = 8;

/// Determines the format of `files`, which were found in the archive or folder `inside`, if they were.
///
/// A single file must be a volume. Of several, those that are none are left out: empty files, and
/// files that are neither NIfTI nor DICOM.
///
/// # Errors
/// [`VolumeError`] for unknown or unsupported formats, and for files that do not belong together.
pub(super) fn recognise<'a>(
    files: &'a [VolumeFile],
    inside: Option<&str>,
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Found<'a>, VolumeError> {
    let mut sorted = Sorted::default();
    for file in files {
        monitor.check()?;
        match look(file, limits) {
            Ok((FileKind::NiftiSingle, _)) => sorted.singles.push(file),
            Ok((FileKind::NiftiHeader, _)) => sorted.headers.push(file),
            Ok((FileKind::Dicom, _)) => sorted.dicom.push(file),
            Ok((FileKind::Arrays, _)) => sorted.arrays.push(file),
            Ok((FileKind::Other, start)) => sorted.others.push((file, start)),
            Err(VolumeError::Empty { .. }) if files.len() > 1 => sorted.empty.push(file),
            Err(error) => return Err(error),
        }
    }
    let volume = sorted.volume(inside, limits, monitor)?;
    Ok(Found {
        notes: sorted.notes(&volume),
        volume,
    })
}

impl<'a> Sorted<'a> {
    /// The one volume among the files.
    fn volume(
        &self,
        inside: Option<&str>,
        limits: &ReadLimits,
        monitor: &Monitor,
    ) -> Result<Recognised<'a>, VolumeError> {
        let kinds = [self.singles.len(), self.headers.len(), self.dicom.len()];
        match (kinds, &self.others[..]) {
            ([0, 0, 0], []) if self.arrays.len() == 1 => Ok(Recognised::Arrays(self.arrays[0])),
            _ if !self.arrays.is_empty() => Err(self.not_one(inside)),
            ([1, 0, 0], _) => Ok(Recognised::Nifti {
                header: self.singles[0],
                voxels: self.singles[0],
            }),
            // Whoever names several files says that they belong together; a folder or an archive may hold anything.
            ([singles, 0, 0], []) if self.may_be_gates(singles, inside) => {
                Ok(Recognised::Gates(self.singles.clone()))
            }
            ([0, 1, _], _) => self.pair(self.headers[0], inside, limits),
            ([0, 0, dicom], _) if dicom > 0 => Ok(Recognised::Dicom(self.dicom.clone())),
            ([0, 0, 0], []) if self.empty.is_empty() => Err(VolumeError::NoFile),
            ([0, 0, 0], others) => {
                if let Some(mesh) = only_mesh(others, limits, monitor)? {
                    return Ok(Recognised::Mesh(mesh));
                }
                let analyze = others.iter().find(|(_, start)| is_analyze(start));
                if let Some((file, start)) = analyze {
                    return Err(foreign::refuse(file, start, limits));
                }
                if let Some(error) = foreign::refuse_all(others, inside, limits) {
                    return Err(error);
                }
                Err(match (others, inside) {
                    ([(file, start)], None) if self.empty.is_empty() => {
                        foreign::refuse(file, start, limits)
                    }
                    (_, Some(name)) => VolumeError::Unsupported {
                        file: name.into(),
                        format: "an archive or folder without DICOM or NIfTI files".into(),
                        fix: "Give the files of one DICOM series, or one NIfTI file.",
                    },
                    ([], None) => VolumeError::NoFile,
                    _ => self.not_one(inside),
                })
            }
            _ => Err(self.not_one(inside)),
        }
    }

    /// Whether so many NIfTI files, found in the archive or folder `inside`, can be one gate each.
    fn may_be_gates(&self, singles: usize, inside: Option<&str>) -> bool {
        GATE_COUNTS.contains(&singles) && inside.is_none() && self.empty.is_empty()
    }

    /// A header and the file with its voxels: the `.img` of the same name, or the only `.img`, or the
    /// only other file.
    fn pair(
        &self,
        header: &'a VolumeFile,
        inside: Option<&str>,
        limits: &ReadLimits,
    ) -> Result<Recognised<'a>, VolumeError> {
        // A file of voxels may start with any bytes.
        let others = self.others.iter().map(|(file, _)| *file);
        let others: Vec<&VolumeFile> = others.chain(self.dicom.iter().copied()).collect();
        let images = others.iter().filter(|file| stem(file, ".img").is_some());
        let images: Vec<&VolumeFile> = images.copied().collect();
        let own = stem(header, ".hdr");
        let named = images
            .iter()
            .find(|image| own.is_some() && stem(image, ".img") == own);
        let voxels = match (named, &images[..], &others[..]) {
            (Some(image), ..) | (None, [image], _) | (None, [], [image]) => *image,
            (None, [], []) => {
                nifti::check_header(header, limits)?;
                return Err(VolumeError::ImageMissing {
                    file: header.name().into(),
                });
            }
            _ => return Err(self.not_one(inside)),
        };
        let rest = self.dicom.iter().any(|file| !std::ptr::eq(*file, voxels));
        if rest {
            Err(self.not_one(inside))
        } else {
            Ok(Recognised::Nifti { header, voxels })
        }
    }

    /// The refusal of files that are several volumes, or none.
    fn not_one(&self, inside: Option<&str>) -> VolumeError {
        let named = |count: usize, kind: &str| match count {
            0 => None,
            1 => Some(format!("1 {kind}")),
            count => Some(format!("{count} {kind}s")),
        };
        // Each of them could be read alone.
        let volumes = named(self.singles.len(), "NIfTI file").map(|counted| {
            let mut names: Vec<&str> = self.singles.iter().map(|file| file.name()).collect();
            names.sort_unstable();
            let more = match names.len().saturating_sub(MOST_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            names.truncate(MOST_NAMED);
            format!("{counted} ({}{more})", names.join(", "))
        });
        let kinds = [
            volumes,
            named(self.headers.len(), "NIfTI header"),
            named(self.dicom.len(), "DICOM file"),
            named(self.arrays.len(), "array"),
            named(self.others.len(), "other file"),
            named(self.empty.len(), "empty file"),
        ];
        let kinds: Vec<String> = kinds.into_iter().flatten().collect();
        VolumeError::NotOneVolume {
            place: inside.unwrap_or("the upload").to_owned(),
            held: kinds.join(", "),
        }
    }

    /// The files that were left out of those a person named, and the empty ones.
    fn notes(&self, volume: &Recognised<'_>) -> Vec<String> {
        let used = |file: &VolumeFile| match volume {
            Recognised::Nifti { voxels, .. } => std::ptr::eq(file, *voxels),
            Recognised::Gates(_) | Recognised::Dicom(_) | Recognised::Arrays(_) => false,
            Recognised::Mesh(mesh) => std::ptr::eq(file, *mesh),
        };
        let foreign = self.others.iter().map(|(file, _)| *file);
        let foreign: Vec<&VolumeFile> = foreign
            .filter(|file| !file.was_found() && !used(file))
            .collect();
        let list = |files: &[&VolumeFile]| {
            let names: Vec<&str> = files.iter().take(MOST_NAMED).map(|f| f.name()).collect();
            let more = match files.len().saturating_sub(MOST_NAMED) {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            format!("{}{more}", names.join(", "))
        };
        let mut notes = Vec::new();
        if !foreign.is_empty() {
            let list = list(&foreign);
            notes.push(format!(
                "Files that are neither NIfTI nor DICOM were left out: {list}."
            ));
        }
        if !self.empty.is_empty() {
            let list = list(&self.empty);
            notes.push(format!("Files without content were left out: {list}."));
        }
        notes
    }
}

/// The mesh among files that are no volumes, if there is one.
fn only_mesh<'a>(
    others: &[(&'a VolumeFile, Vec<u8>)],
    limits: &ReadLimits,
    monitor: &Monitor,
) -> Result<Option<&'a VolumeFile>, Cancelled> {
    let mut only = None;
    for (file, start) in others {
        if surface_file::recognise(file, start, limits, monitor)?.is_none() {
            continue;
        }
        if only.is_some() {
            return Ok(None);
        }
        only = Some(*file);
    }
    Ok(only)
}

/// The name of `file` without `ending` and `.gz`, in lower case; `None` if it ends otherwise.
fn stem(file: &VolumeFile, ending: &str) -> Option<String> {
    let name = file.name().to_lowercase();
    let bare = name.strip_suffix(".gz").unwrap_or(&name);
    bare.strip_suffix(ending).map(str::to_owned)
}

/// The kind of `file`, and its first bytes.
fn look(file: &VolumeFile, limits: &ReadLimits) -> Result<(FileKind, Vec<u8>), VolumeError> {
    if file.arrays().is_some() {
        return Ok((FileKind::Arrays, Vec::new()));
    }
    let mut start = vec![0; EXAMINED_BYTES];
    let mut source = Source::open(file, limits.unpacked_bytes.max(EXAMINED_BYTES as u64))?;
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
