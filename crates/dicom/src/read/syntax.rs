//! Finds the start of the data set, its encoding and the compression of its pixels.
//!
//! After PS3.10, a file begins with 128 bytes of preamble, `DICM`, and group 0002 in Explicit VR
//! Little Endian, which names the transfer syntax. Old files lack the preamble or all three. They
//! are recognised as DICOM if they begin with an element of group 0002 or 0008, as a data set does.
//!
//! The first element of the data set shows its encoding. A transfer syntax that contradicts it is an
//! error of its own, because whatever is read by the wrong one makes no sense.

use super::ReadError;
use super::attributes::clip;
use crate::codec::{Compression, Process};
use dicom_encoding::transfer_syntax::{Endianness, TransferSyntax, TransferSyntaxIndex};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;
use flate2::read::DeflateDecoder;
use std::fmt;
use std::io::Read;

/// Group 0002 must end within this many bytes.
const META_REACH: usize = 64 * 1024;

/// Bytes at the beginning of a file that show its encoding: group 0002, and enough of a deflated data set for its
/// first element.
pub const START_BYTES: usize = META_REACH + 4096;

const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";

/// Deflated Explicit VR Little Endian, the only transfer syntax that compresses whole data sets.
const DEFLATED_UID: &str = "1.2.840.10008.1.2.1.99";

/// UIDs of the transfer syntaxes that are read.
pub fn read_syntaxes() -> impl Iterator<Item = &'static str> {
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
pub struct Syntax {
    /// Offset of the data set's first byte in the unpacked file.
    pub data_set: u64,
    /// The encoding of the data set.
    pub transfer_syntax: &'static TransferSyntax,
    /// Whether the data set is deflated. Its offsets count inflated bytes.
    pub deflated: bool,
    /// Compression of the pixels.
    pub compression: Compression,
    /// Media Storage SOP Class UID (0002,0002).
    pub media_class: Option<String>,
}

impl Syntax {
    /// The place and encoding of the data set of the file `name`, which begins with `start`: its first
    /// [`START_BYTES`] unpacked bytes, fewer if it is shorter.
    ///
    /// # Errors
    /// [`ReadError::Unsupported`] for transfer syntaxes that are not read, and
    /// [`ReadError::Field`] if group 0002 is damaged or the encoding cannot be determined.
    pub fn new(name: &str, start: &[u8]) -> Result<Self, ReadError> {
        let meta = Meta::new(start).map_err(|begin| ReadError::Field {
            file: name.into(),
            field: "File Meta Information (0002,xxxx)",
            value: "cut off".into(),
            reason: format!("the group must end within {META_REACH} bytes"),
            byte: Some(begin as u64),
        })?;
        let unknown = || ReadError::Field {
            file: name.into(),
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
        let (Some(transfer_syntax), Some(compression)) = (transfer_syntax, compression) else {
            return Err(refuse(name, transfer_syntax, uid));
        };
        let found = Self {
            data_set: meta.end as u64,
            transfer_syntax,
            deflated,
            compression,
            media_class: meta.media_class,
        };
        // Without group 0002 the first element was asked already.
        if meta.transfer_syntax.is_some() {
            found.check(name, &start[meta.end..])?;
        }
        Ok(found)
    }

    /// Compares the transfer syntax with the data set, which begins with `stored`.
    ///
    /// # Errors
    /// [`ReadError::Field`] if they contradict each other.
    fn check(&self, name: &str, stored: &[u8]) -> Result<(), ReadError> {
        let ts = self.transfer_syntax;
        let wrong = |reason: String| ReadError::Field {
            file: name.into(),
            field: "Transfer Syntax UID (0002,0010)",
            value: format!("{} ({})", ts.uid(), ts.name()),
            reason,
            byte: Some(self.data_set),
        };
        let deflate = || encoding(&inflated(stored));
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
    pub fn is_implicit(&self) -> bool {
        self.transfer_syntax.uid() == IMPLICIT_LITTLE
    }
}

/// Whether a file that begins with `start` is a DICOM file.
pub fn is_dicom(start: &[u8]) -> bool {
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

/// The Media Storage SOP Class UID (0002,0002) of a file that begins with `start`, whatever transfer syntax it is in.
pub fn media_class(start: &[u8]) -> Option<String> {
    Meta::new(start).ok()?.media_class
}

/// The first bytes of the data set that is deflated in `packed`, or in bytes that begin so.
fn inflated(packed: &[u8]) -> Vec<u8> {
    let mut start = vec![0; 8];
    let mut source = DeflateDecoder::new(packed);
    let mut there = 0;
    // A stream that ends too early or is damaged gives the bytes before that.
    while let Ok(got @ 1..) = source.read(&mut start[there..]) {
        there += got;
    }
    start.truncate(there);
    start
}

fn refuse(name: &str, syntax: Option<&TransferSyntax>, uid: &str) -> ReadError {
    let syntax = syntax.map_or("an unknown transfer syntax", TransferSyntax::name);
    ReadError::Unsupported {
        file: name.into(),
        format: format!("a DICOM file in {syntax} ({})", clip(uid)),
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
    /// Reads group 0002 of a file that begins with `start`.
    ///
    /// # Errors
    /// Where the group begins, if its last element is cut off.
    fn new(start: &[u8]) -> Result<Self, usize> {
        let begin = match start.get(128..132) {
            Some(b"DICM") => 132,
            _ => 0,
        };
        let reach = &start[..start.len().min(META_REACH)];
        Self::read(reach, begin).ok_or(begin)
    }

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
