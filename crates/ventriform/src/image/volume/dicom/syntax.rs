//! Finds the start of the data set, its encoding and the compression of its pixels.
//!
//! After PS3.10, a file begins with 128 bytes of preamble, `DICM`, and group 0002 in Explicit VR
//! Little Endian, which names the transfer syntax. Old files lack the preamble or all three. They
//! are recognised as DICOM if they begin with an element of group 0002 or 0008, as a data set does.
//!
//! The first element of the data set shows its encoding. A transfer syntax that contradicts it is an
//! error of its own, because whatever is read by the wrong one makes no sense.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::{Source, VolumeFile};
use super::attributes::clip;
use super::codec::{Compression, Process};
use dicom_encoding::transfer_syntax::{Endianness, TransferSyntax, TransferSyntaxIndex};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use std::fmt;

/// Group 0002 must end within this many bytes.
const META_REACH: usize = 64 * 1024;

const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";

/// Deflated Explicit VR Little Endian, the only transfer syntax that compresses whole data sets.
const DEFLATED_UID: &str = "1.2.840.10008.1.2.1.99";

/// The transfer syntaxes that are read.
pub(super) fn read() -> impl Iterator<Item = &'static str> {
    let whole = [IMPLICIT_LITTLE, EXPLICIT_LITTLE, EXPLICIT_BIG, DEFLATED_UID];
    whole
        .into_iter()
        .chain(COMPRESSED_SYNTAXES.iter().map(|(uid, _)| *uid))
}

/// The transfer syntaxes with compressed pixels that are read. A lossless one never holds numbers that
/// were changed.
const COMPRESSED_SYNTAXES: [(&str, Compression); 8] = [
    ("1.2.840.10008.1.2.5", Compression::Rle),
    (
        "1.2.840.10008.1.2.4.50",
        Compression::Jpeg(Process::Baseline),
    ),
    (
        "1.2.840.10008.1.2.4.57",
        Compression::Jpeg(Process::Lossless),
    ),
    (
        "1.2.840.10008.1.2.4.70",
        Compression::Jpeg(Process::Lossless),
    ),
    (
        "1.2.840.10008.1.2.4.80",
        Compression::JpegLs { near: false },
    ),
    ("1.2.840.10008.1.2.4.81", Compression::JpegLs { near: true }),
    (
        "1.2.840.10008.1.2.4.90",
        Compression::Jpeg2000 {
            irreversible: false,
        },
    ),
    (
        "1.2.840.10008.1.2.4.91",
        Compression::Jpeg2000 { irreversible: true },
    ),
];

/// Start and encoding of a data set.
pub(super) struct Syntax {
    /// Offset of the data set's first byte in the unpacked file.
    pub data_set: u64,
    /// The encoding of the data set.
    pub transfer_syntax: &'static TransferSyntax,
    /// Whether the data set is deflated. Its offsets count inflated bytes.
    pub deflated: bool,
    /// Compression of the pixels.
    pub compression: Compression,
    /// Whether the file is gzipped.
    pub gzip: bool,
    /// Media Storage SOP Class UID (0002,0002).
    pub media_class: Option<String>,
}

impl Syntax {
    /// Opens `file` at the start of its data set.
    ///
    /// # Errors
    /// [`VolumeError`] if the file cannot be read.
    pub(super) fn open(&self, file: &VolumeFile, limit: u64) -> Result<Source, VolumeError> {
        if self.deflated {
            return Source::inflate(file, self.data_set, limit);
        }
        let mut source = Source::open(file, limit)?;
        source.skip_to(self.data_set)?;
        Ok(source)
    }

    /// Compares the transfer syntax with the data set, which begins with `stored`.
    ///
    /// # Errors
    /// [`VolumeError::Field`] if they contradict each other.
    fn check(
        &self,
        file: &VolumeFile,
        stored: &[u8],
        limits: &ReadLimits,
    ) -> Result<(), VolumeError> {
        let ts = self.transfer_syntax;
        let wrong = |reason: String| VolumeError::Field {
            file: file.name().into(),
            field: "Transfer Syntax UID (0002,0010)",
            value: format!("{} ({})", ts.uid(), ts.name()),
            reason,
            byte: Some(self.data_set),
        };
        let deflate = || {
            let mut start = [0; 8];
            let mut source = Source::inflate(file, self.data_set, limits.unpacked_bytes).ok()?;
            let there = source.fill(&mut start).ok()?;
            encoding(start.get(..there)?)
        };
        if self.deflated {
            return match (encoding(stored), deflate(), stored) {
                (_, Some(Encoding::ExplicitLittle), _) => Ok(()),
                (_, Some(other), _) => Err(wrong(format!("the inflated data set is in {other}"))),
                (Some(plain), ..) => Err(wrong(format!(
                    "the data set is not deflated, but in {plain}"
                ))),
                (None, None, [0x1f, 0x8b, ..]) => Err(wrong(
                    "the data set begins with a gzip header; expected a raw deflate stream".into(),
                )),
                (None, None, [first, second, ..]) if is_zlib(*first, *second) => Err(wrong(
                    "the data set begins with a zlib header; expected a raw deflate stream \
                     (PS3.5 A.5)"
                        .into(),
                )),
                _ => Ok(()),
            };
        }
        let expected = match (ts.uid(), ts.endianness()) {
            (IMPLICIT_LITTLE, _) => Encoding::ImplicitLittle,
            (_, Endianness::Big) => Encoding::ExplicitBig,
            (_, Endianness::Little) => Encoding::ExplicitLittle,
        };
        match encoding(stored) {
            Some(found) if found != expected => Err(wrong(format!("the data set is in {found}"))),
            Some(_) => Ok(()),
            None => match deflate() {
                Some(Encoding::ExplicitLittle) => Err(wrong("the data set is deflated".into())),
                _ => Ok(()),
            },
        }
    }

    /// Whether the data set is in Implicit VR.
    pub(super) fn is_implicit(&self) -> bool {
        self.transfer_syntax.uid() == IMPLICIT_LITTLE
    }
}

/// Whether a file that begins with `start` is a DICOM file.
pub(in super::super) fn is_dicom(start: &[u8]) -> bool {
    start.get(128..132) == Some(b"DICM") || guess(start).is_some()
}

/// Guesses the encoding of a data set that has no group 0002 and begins with `start`.
fn guess(start: &[u8]) -> Option<&'static TransferSyntax> {
    let first: &[u8; 8] = start.first_chunk()?;
    match (&first[..4], encoding(start)?) {
        ([8, 0, 0..=0x70, 0] | [2, 0, 0..=2, 0], Encoding::ExplicitLittle) => {
            TransferSyntaxRegistry.get(EXPLICIT_LITTLE)
        }
        ([0, 8, 0, 0..=0x70], Encoding::ExplicitBig) => TransferSyntaxRegistry.get(EXPLICIT_BIG),
        ([8, 0, 0..=0x70, 0], Encoding::ImplicitLittle) => {
            TransferSyntaxRegistry.get(IMPLICIT_LITTLE)
        }
        _ => None,
    }
}

/// Encoding of the elements of a data set.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Encoding {
    ImplicitLittle,
    ExplicitLittle,
    ExplicitBig,
    /// No transfer syntax of the standard.
    ImplicitBig,
}

impl fmt::Display for Encoding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::ImplicitLittle => "Implicit VR Little Endian",
            Self::ExplicitLittle => "Explicit VR Little Endian",
            Self::ExplicitBig => "Explicit VR Big Endian",
            Self::ImplicitBig => "Implicit VR Big Endian",
        })
    }
}

/// The encoding of a data set that begins with `start`, if its first element shows it: its group is a low
/// even number; a value representation is two capital letters, a length even and below 65536.
fn encoding(start: &[u8]) -> Option<Encoding> {
    let first: &[u8; 8] = start.first_chunk()?;
    let explicit = first[4].is_ascii_uppercase() && first[5].is_ascii_uppercase();
    let is_group = |group: u8| group > 0 && group <= 0x20 && group.is_multiple_of(2);
    match (first, explicit) {
        ([group, 0, ..], true) if is_group(*group) => Some(Encoding::ExplicitLittle),
        ([0, group, ..], true) if is_group(*group) => Some(Encoding::ExplicitBig),
        // Implicit VR: the length of the value is even and below 65536.
        ([group, 0, _, _, low, _, 0, 0], false) if is_group(*group) && low.is_multiple_of(2) => {
            Some(Encoding::ImplicitLittle)
        }
        ([0, group, _, _, 0, 0, _, low], false) if is_group(*group) && low.is_multiple_of(2) => {
            Some(Encoding::ImplicitBig)
        }
        _ => None,
    }
}

/// Whether two bytes are the header of a zlib stream (RFC 1950).
fn is_zlib(first: u8, second: u8) -> bool {
    first & 0x0f == 8 && first >> 4 <= 7 && u16::from_be_bytes([first, second]).is_multiple_of(31)
}

/// Finds the data set of `file`.
///
/// # Errors
/// [`VolumeError::Unsupported`] for transfer syntaxes that are not read, and
/// [`VolumeError::Field`] if group 0002 is damaged or the encoding cannot be determined.
pub(super) fn find(file: &VolumeFile, limits: &ReadLimits) -> Result<Syntax, VolumeError> {
    let (start, begin, gzip) = beginning(file, limits)?;
    let meta = Meta::read(&start, begin).ok_or_else(|| VolumeError::Field {
        file: file.name().into(),
        field: "File Meta Information (0002,xxxx)",
        value: "cut off".into(),
        reason: format!("the group must end within {META_REACH} bytes"),
        byte: Some(begin as u64),
    })?;
    let unknown = || VolumeError::Field {
        file: file.name().into(),
        field: "Transfer Syntax UID (0002,0010)",
        value: "missing".into(),
        reason: "the encoding cannot be determined from the first element either".into(),
        byte: Some(meta.end as u64),
    };
    let uid = match &meta.transfer_syntax {
        Some(uid) => uid.as_str(),
        None => guess(&start[meta.end..]).ok_or_else(unknown)?.uid(),
    };
    let transfer_syntax = TransferSyntaxRegistry.get(uid);
    let deflated = uid == DEFLATED_UID;
    let listed = COMPRESSED_SYNTAXES.iter().find(|(known, _)| *known == uid);
    let compression = match (transfer_syntax, listed) {
        (Some(_), Some((_, compression))) => Some(*compression),
        (Some(syntax), None) if deflated || syntax.is_codec_free() => Some(Compression::None),
        _ => None,
    };
    match (transfer_syntax, compression) {
        (Some(transfer_syntax), Some(compression)) => {
            let found = Syntax {
                data_set: meta.end as u64,
                transfer_syntax,
                deflated,
                compression,
                gzip,
                media_class: meta.media_class,
            };
            // Without group 0002 the first element was asked already.
            if meta.transfer_syntax.is_some() {
                found.check(file, &start[meta.end..], limits)?;
            }
            Ok(found)
        }
        _ => Err(refuse(file, transfer_syntax, uid)),
    }
}

/// The first bytes of `file`, where group 0002 begins in them, and whether the file is gzipped.
fn beginning(
    file: &VolumeFile,
    limits: &ReadLimits,
) -> Result<(Vec<u8>, usize, bool), VolumeError> {
    let reach = META_REACH.min(usize::try_from(limits.unpacked_bytes).unwrap_or(META_REACH));
    let mut start = vec![0; reach];
    let mut source = Source::open(file, limits.unpacked_bytes)?;
    let there = source.fill(&mut start)?;
    start.truncate(there);
    let begin = match start.get(128..132) {
        Some(b"DICM") => 132,
        _ => 0,
    };
    Ok((start, begin, source.is_gzip()))
}

/// The Media Storage SOP Class UID (0002,0002) of `file`, whatever transfer syntax it is in.
///
/// # Errors
/// [`VolumeError`] if the file cannot be read.
pub(super) fn media_class(
    file: &VolumeFile,
    limits: &ReadLimits,
) -> Result<Option<String>, VolumeError> {
    let (start, begin, _) = beginning(file, limits)?;
    Ok(Meta::read(&start, begin).and_then(|meta| meta.media_class))
}

fn refuse(file: &VolumeFile, syntax: Option<&TransferSyntax>, uid: &str) -> VolumeError {
    let name = syntax.map_or("an unknown transfer syntax", TransferSyntax::name);
    VolumeError::Unsupported {
        file: file.name().into(),
        format: format!("a DICOM file in {name} ({})", clip(uid)),
        fix: "Send it uncompressed, or in RLE, JPEG Lossless, JPEG-LS or JPEG 2000.",
    }
}

/// Content of group 0002.
struct Meta {
    end: usize,
    transfer_syntax: Option<String>,
    media_class: Option<String>,
}

impl Meta {
    /// Reads the elements of group 0002 at `begin`; `None` if the last one is cut off.
    fn read(start: &[u8], begin: usize) -> Option<Self> {
        let mut meta = Self {
            end: begin,
            transfer_syntax: None,
            media_class: None,
        };
        while let Some([2, 0, element @ ..]) = start[meta.end..].first_chunk::<8>() {
            let long = matches!(
                &element[2..4],
                b"OB" | b"OW" | b"UN" | b"UT" | b"SQ" | b"OF"
            );
            let (value, length) = if long {
                let length = start.get(meta.end + 8..)?.first_chunk()?;
                (meta.end + 12, u32::from_le_bytes(*length) as usize)
            } else {
                let length = [element[4], element[5]];
                (meta.end + 8, usize::from(u16::from_le_bytes(length)))
            };
            let end = value.checked_add(length)?;
            let bytes = start.get(value..end)?;
            let text = || {
                let text = String::from_utf8_lossy(bytes);
                Some(text.trim_matches(['\0', ' ']).to_owned())
            };
            match element[..2] {
                [0x10, 0] => meta.transfer_syntax = text(),
                [0x02, 0] => meta.media_class = text().filter(|class| !class.is_empty()),
                _ => {}
            }
            meta.end = end;
        }
        Some(meta)
    }
}
