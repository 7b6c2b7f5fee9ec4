//! Files in formats that are not read: what they are, by their content, and how to make a readable file of them.
//!
//! A format may be that of volumes, of archives, of what stands in for a file that was not fetched, or of
//! pictures and documents. Of several files in a folder, an archive or an upload, the one in the format that
//! comes first in this order is named.

use super::VolumeError;
use super::limits::ReadLimits;
use super::source::{Source, VolumeFile};

/// What a format holds, from the most to the least telling.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Holds {
    Volumes,
    Files,
    NoFile,
    Documents,
}
use Holds::{Documents, Files, NoFile, Volumes};

/// A format that is not read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Foreign {
    holds: Holds,
    /// Its name with an article.
    name: &'static str,
    /// What to do to send what the file holds.
    fix: &'static str,
}

/// How a format is recognised.
enum Sign {
    /// These bytes at this place.
    Bytes(usize, &'static [u8]),
    /// The first word that is no space, in small letters.
    Word(&'static str),
    /// A line that begins with this text, in small letters.
    Line(&'static str),
    Test(fn(&[u8]) -> bool),
}
use Sign::{Bytes, Line, Test, Word};

const ANALYZE: &str = "Convert it to NIfTI: Analyze files do not state which side is left.";
const ITK: &str = "Convert it to NIfTI (.nii.gz), for example with SimpleITK: \
    SimpleITK.WriteImage(SimpleITK.ReadImage(\"the file\"), \"scan.nii.gz\"), or with 3D Slicer.";
const INTERFILE: &str = "Convert it to NIfTI (.nii.gz), for example with XMedCon: medcon -f the.h33 -c nifti, or \
    export the scan as DICOM.";
const FREESURFER: &str = "Convert it to NIfTI (.nii.gz), for example with FreeSurfer: mri_convert the.mgz scan.nii.gz, \
    or with nibabel: nibabel.save(nibabel.Nifti1Image.from_image(nibabel.load(\"the.mgz\")), \"scan.nii.gz\").";
const PHILIPS: &str = "Convert it to NIfTI (.nii.gz), for example with dcm2niix: dcm2niix -z y the.par, with the .rec \
    file beside it.";
const MINC: &str =
    "Convert it to NIfTI (.nii.gz), for example with the MINC tools: mnc2nii the.mnc scan.nii.";
const AFNI: &str =
    "Convert it to NIfTI (.nii.gz), for example with AFNI: 3dAFNItoNIFTI the+orig.HEAD.";
const NUMPY: &str = "Convert it to NIfTI (.nii.gz) with the size and place of its voxels, for example with nibabel: \
    nibabel.save(nibabel.Nifti1Image(array, affine), \"scan.nii.gz\").";
const MATLAB: &str = "Convert it to NIfTI (.nii.gz) with the size and place of its voxels, for example in MATLAB: \
    niftiwrite(volume, \"scan\", info), or export the scan as DICOM.";
const CONVERT: &str = "Convert it to NIfTI (.nii.gz).";
const PICTURE: &str = "Send the scan itself, as DICOM or NIfTI (.nii.gz): a picture does not state where its pixels \
    lie in the patient. Convert it to NIfTI (.nii.gz) only with the size and place of its voxels.";
const UNPACK: &str = "Unpack it, and send the files in it or a zip archive of them.";
const LFS: &str = "Fetch the file itself (git lfs pull), and send that.";
const ANNEX: &str = "Fetch the file itself (git annex get, or datalad get), and send that.";
const PAGE: &str = "Download the file again: the server answered with a page, such as a login or an error, in its \
    place.";
const DOCUMENT: &str = "Send the scan itself, as DICOM or NIfTI (.nii.gz).";

/// Every format that is named, with its signs; the first of which one is found counts.
const FORMATS: &[(Holds, &str, &str, &[Sign])] = &[
    (
        Volumes,
        "an Analyze 7.5 header (it has no NIfTI magic)",
        ANALYZE,
        &[Test(is_analyze)],
    ),
    (
        Volumes,
        "a MINC 1 (netCDF) file",
        MINC,
        &[Bytes(0, b"CDF\x01"), Bytes(0, b"CDF\x02")],
    ),
    (
        Volumes,
        "a MATLAB file",
        MATLAB,
        &[
            Bytes(0, b"MATLAB 5.0 MAT-file"),
            Bytes(0, b"MATLAB 7.3 MAT-file"),
        ],
    ),
    (
        Volumes,
        "an HDF5 file (for example MINC 2)",
        MINC,
        &[Bytes(0, b"\x89HDF\r\n")],
    ),
    (Volumes, "an NRRD file", ITK, &[Bytes(0, b"NRRD")]),
    (Volumes, "a MetaImage header", ITK, &[Test(is_meta_image)]),
    (
        Volumes,
        "an Interfile header",
        INTERFILE,
        &[Word("!interfile"), Line("!interfile")],
    ),
    (Volumes, "an ECAT 7 file", CONVERT, &[Bytes(0, b"MATRIX")]),
    (
        Volumes,
        "a Philips PAR header",
        PHILIPS,
        &[
            Line("# === data description file"),
            Line("# === general information"),
        ],
    ),
    (
        Volumes,
        "a FreeSurfer MGH file (.mgh, .mgz)",
        FREESURFER,
        &[Test(is_mgh)],
    ),
    (
        Volumes,
        "a GIPL file",
        ITK,
        &[
            Bytes(252, b"\xef\xff\xe9\xb0"),
            Bytes(252, b"\x2a\xe3\x89\xb8"),
        ],
    ),
    (
        Volumes,
        "an AFNI header",
        AFNI,
        &[
            Line("type = string-attribute"),
            Line("type = integer-attribute"),
            Line("type = float-attribute"),
            Line("type  = string-attribute"),
            Line("type  = integer-attribute"),
            Line("type  = float-attribute"),
        ],
    ),
    (
        Volumes,
        "a NumPy array (.npy)",
        NUMPY,
        &[Bytes(0, b"\x93NUMPY")],
    ),
    (Volumes, "a VTK image", ITK, &[Test(is_vtk_image)]),
    (
        Files,
        "a ZIP archive in an archive",
        UNPACK,
        &[Bytes(0, b"PK\x03\x04")],
    ),
    (
        Files,
        "an empty ZIP archive",
        DOCUMENT,
        &[Bytes(0, b"PK\x05\x06")],
    ),
    (
        Files,
        "a part of a ZIP archive in several files",
        UNPACK,
        &[Bytes(0, b"PK\x07\x08")],
    ),
    (
        Files,
        "a 7z archive",
        UNPACK,
        &[Bytes(0, b"7z\xbc\xaf\x27\x1c")],
    ),
    (Files, "a RAR archive", UNPACK, &[Bytes(0, b"Rar!\x1a\x07")]),
    (
        Files,
        "an ISO 9660 image of a disc",
        UNPACK,
        &[
            Bytes(0x8001, b"CD001"),
            Bytes(0x8801, b"CD001"),
            Bytes(0x9001, b"CD001"),
        ],
    ),
    (
        Files,
        "a UDF image of a disc",
        UNPACK,
        &[Bytes(0x8001, b"BEA01"), Bytes(0x8801, b"NSR0")],
    ),
    (Files, "a bzip2 file", UNPACK, &[Bytes(0, b"BZh")]),
    (Files, "an xz file", UNPACK, &[Bytes(0, b"\xfd7zXZ")]),
    (
        Files,
        "a Zstandard file",
        UNPACK,
        &[Bytes(0, b"\x28\xb5\x2f\xfd")],
    ),
    (
        Files,
        "an LZ4 file",
        UNPACK,
        &[Bytes(0, b"\x04\x22\x4d\x18")],
    ),
    (Files, "an lzip file", UNPACK, &[Bytes(0, b"LZIP")]),
    (
        Files,
        "a file packed by compress (.Z)",
        UNPACK,
        &[Bytes(0, b"\x1f\x9d")],
    ),
    (Files, "gzipped twice", UNPACK, &[Bytes(0, b"\x1f\x8b\x08")]),
    (Files, "a tar archive", UNPACK, &[Bytes(257, b"ustar")]),
    (
        NoFile,
        "a Git LFS pointer, not the file that it stands for",
        LFS,
        &[
            Word("version https://git-lfs.github.com/"),
            Word("version https://hawser.github.com/"),
        ],
    ),
    (
        NoFile,
        "a git-annex pointer, not the file that it stands for",
        ANNEX,
        &[
            Word("/annex/objects/"),
            Word("../.git/annex/objects/"),
            Word(".git/annex/objects/"),
        ],
    ),
    (
        NoFile,
        "an HTML page",
        PAGE,
        &[
            Word("<!doctype html"),
            Word("<html"),
            Word("<head"),
            Word("<body"),
            Test(is_page_after_comment),
        ],
    ),
    (Documents, "a PNG image", PICTURE, &[Bytes(0, b"\x89PNG")]),
    (
        Documents,
        "a JPEG image",
        PICTURE,
        &[Bytes(0, b"\xff\xd8\xff")],
    ),
    (
        Documents,
        "a JPEG 2000 image",
        PICTURE,
        &[Bytes(4, b"jP  \r\n"), Bytes(0, b"\xff\x4f\xff\x51")],
    ),
    (Documents, "a GIF image", PICTURE, &[Bytes(0, b"GIF8")]),
    (Documents, "a BMP image", PICTURE, &[Test(is_bmp)]),
    (Documents, "a WebP image", PICTURE, &[Bytes(8, b"WEBP")]),
    (
        Documents,
        "a TIFF image",
        PICTURE,
        &[Bytes(0, b"II*\0"), Bytes(0, b"MM\0*")],
    ),
    (
        Documents,
        "a BigTIFF image",
        PICTURE,
        &[Bytes(0, b"II+\0"), Bytes(0, b"MM\0+")],
    ),
    (
        Documents,
        "a film (MP4 or QuickTime)",
        PICTURE,
        &[Bytes(4, b"ftyp")],
    ),
    (Documents, "a PDF document", DOCUMENT, &[Bytes(0, b"%PDF")]),
    (Documents, "a ROOT file", CONVERT, &[Bytes(0, b"root\0")]),
    (
        Documents,
        "a pickled Python object",
        NUMPY,
        &[
            Bytes(0, b"\x80\x03c"),
            Bytes(0, b"\x80\x04\x95"),
            Bytes(0, b"\x80\x05\x95"),
        ],
    ),
    (
        Documents,
        "an OLE document of Office",
        DOCUMENT,
        &[Bytes(0, b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1")],
    ),
    (Documents, "an XML document", CONVERT, &[Word("<?xml")]),
    (Documents, "a JSON document", CONVERT, &[Word("{")]),
];

/// Bytes that are examined: an image of a disc is recognised by its first volume descriptor.
const EXAMINED_BYTES: usize = 0x9001 + 5;

impl Foreign {
    /// The format of the file that begins with `start`; `None` if it is not known.
    fn from_start(start: &[u8]) -> Option<Self> {
        let small = start[..start.len().min(1024)].to_ascii_lowercase();
        let text = trimmed(&small);
        let found = |sign: &Sign| match sign {
            Bytes(at, magic) => start.get(*at..).is_some_and(|rest| rest.starts_with(magic)),
            Word(word) => text.starts_with(word.as_bytes()),
            Line(begin) => lines(text).any(|line| line.starts_with(begin.as_bytes())),
            Test(test) => test(start),
        };
        let mut formats = FORMATS.iter();
        let (holds, name, fix, _) = formats.find(|(.., signs)| signs.iter().any(found))?;
        Some(Self {
            holds: *holds,
            name,
            fix,
        })
    }

    fn refuse(self, file: &VolumeFile) -> VolumeError {
        VolumeError::Unsupported {
            file: file.name().to_owned(),
            format: self.name.into(),
            fix: self.fix,
        }
    }
}

/// `text` without a byte order mark and spaces before it.
fn trimmed(text: &[u8]) -> &[u8] {
    text.strip_prefix(b"\xef\xbb\xbf")
        .unwrap_or(text)
        .trim_ascii_start()
}

fn lines(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|b| matches!(b, b'\n' | b'\r'))
        .map(<[u8]>::trim_ascii)
}

/// Whether a file without NIfTI magic is an Analyze 7.5 header, which has the same length field.
pub(super) fn is_analyze(start: &[u8]) -> bool {
    let length = [348_i32.to_le_bytes(), 348_i32.to_be_bytes()];
    start.len() >= 348 && length.iter().any(|l| start.starts_with(l))
}

/// Whether the lines are those of a MetaImage header, in whatever order.
fn is_meta_image(start: &[u8]) -> bool {
    let small = start[..start.len().min(1024)].to_ascii_lowercase();
    let keys = |key: &[u8]| {
        lines(trimmed(&small)).any(|line| {
            let rest = line.strip_prefix(key);
            rest.is_some_and(|rest| rest.trim_ascii_start().starts_with(b"="))
        })
    };
    keys(b"ndims") || keys(b"objecttype") || (keys(b"dimsize") && keys(b"elementtype"))
}

/// Whether the numbers are those of an MGH header: version 1, four sizes, a type of data.
fn is_mgh(start: &[u8]) -> bool {
    let (numbers, _) = start.as_chunks::<4>();
    let numbers: Vec<i32> = numbers
        .iter()
        .take(6)
        .map(|n| i32::from_be_bytes(*n))
        .collect();
    let [1, sizes @ .., kind] = &numbers[..] else {
        return false;
    };
    start.len() >= 284
        && sizes.iter().all(|size| (1..=100_000).contains(size))
        && matches!(kind, 0 | 1 | 3 | 4 | 10)
}

/// Whether it is an XML file of the Visualization Toolkit with voxels.
fn is_vtk_image(start: &[u8]) -> bool {
    let start = &start[..start.len().min(1024)];
    let holds = |text: &[u8]| start.windows(text.len()).any(|part| part == text);
    holds(b"<VTKFile") && holds(b"ImageData")
}

fn is_bmp(start: &[u8]) -> bool {
    // Two letters alone are too little: a reserved field of zeros follows the size.
    start.starts_with(b"BM") && start.get(6..10) == Some(&[0; 4]) && start.len() >= 54
}

/// Whether it is a page that begins with a comment.
fn is_page_after_comment(start: &[u8]) -> bool {
    let small = start[..start.len().min(1024)].to_ascii_lowercase();
    let text = trimmed(&small);
    text.starts_with(b"<!--")
        && [&b"<html"[..], b"<!doctype html"]
            .iter()
            .any(|tag| text.windows(tag.len()).any(|part| part == *tag))
}

/// As many bytes of `file` as tell its format; `start` if more cannot be read.
fn beginning(file: &VolumeFile, start: &[u8], limits: &ReadLimits) -> Vec<u8> {
    let read = || -> Result<Vec<u8>, VolumeError> {
        let mut source = Source::open(file, limits.unpacked_bytes.max(EXAMINED_BYTES as u64))?;
        let mut bytes = vec![0; EXAMINED_BYTES];
        let there = source.fill(&mut bytes)?;
        bytes.truncate(there);
        Ok(bytes)
    };
    read().unwrap_or_else(|_| start.to_vec())
}

/// The error for a file that is not supported, with the name of its format if its content, of which `start` is the
/// beginning, shows it.
pub(super) fn refuse(file: &VolumeFile, start: &[u8], limits: &ReadLimits) -> VolumeError {
    match Foreign::from_start(&beginning(file, start, limits)) {
        Some(foreign) => foreign.refuse(file),
        None => VolumeError::Unrecognised {
            file: file.name().to_owned(),
            start: start[..start.len().min(16)].escape_ascii().to_string(),
        },
    }
}

/// The error for `others`, which were given together, found in the archive or folder `inside` if they were, and of
/// which none is a volume; `None` if none is in a known format.
pub(super) fn refuse_all(
    others: &[(&VolumeFile, Vec<u8>)],
    inside: Option<&str>,
    limits: &ReadLimits,
) -> Option<VolumeError> {
    let each = others.iter().map(|(file, start)| {
        let foreign = Foreign::from_start(&beginning(file, start, limits))?;
        Some((foreign, *file))
    });
    let known = each.flatten();
    let (foreign, file) = known.min_by_key(|(foreign, file)| (foreign.holds, file.name()))?;
    Some(match inside {
        None => foreign.refuse(file),
        Some(name) => VolumeError::Unsupported {
            file: name.into(),
            format: format!(
                "an archive or folder without DICOM or NIfTI files, in which {} is {}",
                file.name(),
                foreign.name
            ),
            fix: foreign.fix,
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_told_by_its_content() {
        let at =
            |place: usize, magic: &[u8]| [vec![0; place], magic.to_vec(), vec![0; 300]].concat();
        let mgh: Vec<u8> = [1, 64, 64, 64, 1, 3]
            .iter()
            .flat_map(|n: &i32| n.to_be_bytes())
            .collect();
        let analyze = [348_i32.to_le_bytes().to_vec(), vec![0; 344]].concat();
        for (bytes, word) in [
            (analyze, "Analyze"),
            (b"ObjectType = Image\nNDims = 3\n".to_vec(), "MetaImage"),
            (b"NDims=3\nDimSize = 4 4 4\n".to_vec(), "MetaImage"),
            (
                b"Comment = made by hand\r\nDimSize = 4 4 4\r\nElementType = MET_FLOAT\r\n"
                    .to_vec(),
                "MetaImage",
            ),
            (b"!INTERFILE :=\n".to_vec(), "Interfile"),
            (b"; made by hand\n!interfile:=\n".to_vec(), "Interfile"),
            (b"  \n!Interfile :=\n".to_vec(), "Interfile"),
            (b"# === DATA DESCRIPTION FILE =====\n".to_vec(), "PAR"),
            (at(0, &mgh), "MGH"),
            (at(252, b"\xef\xff\xe9\xb0"), "GIPL"),
            (
                b"\ntype = string-attribute\nname = HISTORY\n".to_vec(),
                "AFNI",
            ),
            (at(0, b"\x93NUMPY\x01\0v\0{'descr': '<u2'"), "NumPy"),
            (at(0, b"MATLAB 5.0 MAT-file, Platform: GLNXA64"), "MATLAB"),
            (at(0, b"MATLAB 7.3 MAT-file, Platform: GLNXA64"), "MATLAB"),
            (
                b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\">".to_vec(),
                "VTK",
            ),
            (at(0, b"7z\xbc\xaf\x27\x1c\0\x04"), "7z"),
            (at(0, b"Rar!\x1a\x07\0"), "RAR"),
            (at(0, b"Rar!\x1a\x07\x01\0"), "RAR"),
            (at(0x8001, b"CD001\x01"), "ISO 9660"),
            (at(257, b"ustar\0"), "tar"),
            (
                b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 1\n".to_vec(),
                "Git LFS",
            ),
            (
                b"/annex/objects/SHA256E-s1--0.nii.gz\n".to_vec(),
                "git-annex",
            ),
            (b"<!DOCTYPE html><html>".to_vec(), "HTML"),
            (b"\xef\xbb\xbf\r\n<HTML><head>".to_vec(), "HTML"),
            (b"<!-- login --><html>".to_vec(), "HTML"),
            (at(0, b"II+\0\x08\0\0\0"), "BigTIFF"),
            (at(0, b"MM\0+\0\x08\0\0"), "BigTIFF"),
            (at(0, b"II*\0"), "a TIFF"),
            (
                b"<?xml version=\"1.0\"?><Error><Code>AccessDenied</Code></Error>".to_vec(),
                "XML",
            ),
        ] {
            let found = Foreign::from_start(&bytes);
            assert!(
                found.is_some_and(|f| f.name.contains(word)),
                "{word}: {found:?}"
            );
        }
        for unknown in [&b"plain text"[..], b"", b"BM", &[0; 400], b"<svg", b"8BPS"] {
            assert_eq!(Foreign::from_start(unknown), None, "{unknown:?}");
        }
    }

    #[test]
    fn the_most_telling_of_several_files_is_named() {
        let file = |name: &str, bytes: &[u8]| VolumeFile::in_memory(name, bytes.to_vec());
        let files = [
            file("readme.html", b"<html>"),
            file("x.raw", &[7; 600]),
            file("x.mhd", b"ObjectType = Image\nNDims = 3\n"),
            file("x.png", b"\x89PNG\r\n"),
        ];
        let named = |files: &[VolumeFile], inside| {
            let others: Vec<_> = files
                .iter()
                .map(|f| (f, f.memory().unwrap().to_vec()))
                .collect();
            let error = refuse_all(&others, inside, &ReadLimits::default());
            error.map(|error| error.to_string())
        };
        let alone = named(&files, None).unwrap();
        assert_eq!(alone, "x.mhd is a MetaImage header, which is not supported");
        let inside = named(&files, Some("x.zip")).unwrap();
        assert!(
            inside.contains("x.zip is an archive or folder") && inside.contains("x.mhd is a Meta")
        );
        assert_eq!(named(&files[1..2], None), None);
    }
}
