//! Finds the start of the data set and its encoding.
//!
//! After PS3.10, a file begins with 128 bytes of preamble, `DICM`, and group 0002 in Explicit VR
//! Little Endian, which names the transfer syntax. Old files lack the preamble or all three. They
//! are recognised as DICOM if they begin with an element of group 0002 or 0008, as a data set does.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::{Source, VolumeFile};
use super::attributes::clip;
use dicom_encoding::transfer_syntax::{TransferSyntax, TransferSyntaxIndex};
use dicom_transfer_syntax_registry::TransferSyntaxRegistry;

/// Group 0002 must end within this many bytes.
const META_REACH: usize = 64 * 1024;

const IMPLICIT_LITTLE: &str = "1.2.840.10008.1.2";
const EXPLICIT_LITTLE: &str = "1.2.840.10008.1.2.1";
const EXPLICIT_BIG: &str = "1.2.840.10008.1.2.2";

/// Deflated Explicit VR Little Endian, the only transfer syntax that compresses whole data sets.
const DEFLATED: &str = "1.2.840.10008.1.2.1.99";

/// Start and encoding of a data set.
pub(super) struct Syntax {
    /// Offset of the data set's first byte in the unpacked file.
    pub data_set: u64,
    /// The encoding.
    pub transfer_syntax: &'static TransferSyntax,
}

/// Whether a file that begins with `start` is a DICOM file.
pub(in super::super) fn is_dicom(start: &[u8]) -> bool {
    start.get(128..132) == Some(b"DICM") || guess(start).is_some()
}

/// Guesses the encoding of a data set that has no group 0002 and begins with `start`.
fn guess(start: &[u8]) -> Option<&'static TransferSyntax> {
    let first: &[u8; 8] = start.first_chunk()?;
    let vr = first[4].is_ascii_uppercase() && first[5].is_ascii_uppercase();
    match (&first[..4], vr) {
        ([8, 0, 0..=0x70, 0] | [2, 0, 0..=2, 0], true) => {
            TransferSyntaxRegistry.get(EXPLICIT_LITTLE)
        }
        ([0, 8, 0, 0..=0x70], true) => TransferSyntaxRegistry.get(EXPLICIT_BIG),
        // Implicit VR: the length of the value is even and below 65536.
        ([8, 0, 0..=0x70, 0], false) if first[4].is_multiple_of(2) && first[6..] == [0, 0] => {
            TransferSyntaxRegistry.get(IMPLICIT_LITTLE)
        }
        _ => None,
    }
}

/// Finds the data set of `file`.
///
/// # Errors
/// [`VolumeError::Unsupported`] for compressed or unknown transfer syntaxes, and
/// [`VolumeError::Field`] if group 0002 is damaged or the encoding cannot be determined.
pub(super) fn find(file: &VolumeFile, limits: &ReadLimits) -> Result<Syntax, VolumeError> {
    let reach = META_REACH.min(usize::try_from(limits.unpacked_bytes).unwrap_or(META_REACH));
    let mut start = vec![0; reach];
    let there = Source::open(file, limits.unpacked_bytes)?.fill(&mut start)?;
    start.truncate(there);
    let begin = match start.get(128..132) {
        Some(b"DICM") => 132,
        _ => 0,
    };
    let meta = Meta::read(&start, begin).ok_or_else(|| VolumeError::Field {
        file: file.name().into(),
        field: "File Meta Information (0002,xxxx)",
        value: "cut off".into(),
        reason: format!("the group must end within {META_REACH} bytes"),
        byte: Some(begin as u64),
    })?;
    let transfer_syntax = match &meta.transfer_syntax {
        Some(uid) => known(uid, file)?,
        None => guess(&start[meta.end..]).ok_or_else(|| VolumeError::Field {
            file: file.name().into(),
            field: "Transfer Syntax UID (0002,0010)",
            value: "missing".into(),
            reason: "the encoding cannot be determined from the first element either".into(),
            byte: Some(meta.end as u64),
        })?,
    };
    Ok(Syntax {
        data_set: meta.end as u64,
        transfer_syntax,
    })
}

/// The transfer syntax with `uid`, if it is uncompressed.
fn known(uid: &str, file: &VolumeFile) -> Result<&'static TransferSyntax, VolumeError> {
    let refuse = |format: String| VolumeError::Unsupported {
        file: file.name().into(),
        format,
        fix: "Store it uncompressed, in Explicit VR Little Endian (1.2.840.10008.1.2.1).",
    };
    match TransferSyntaxRegistry.get(uid) {
        Some(syntax) if syntax.is_codec_free() && uid != DEFLATED => Ok(syntax),
        Some(syntax) => Err(refuse(format!("a DICOM file in {} ({uid})", syntax.name()))),
        None => {
            let uid = clip(uid);
            Err(refuse(format!(
                "a DICOM file in an unknown transfer syntax ({uid})"
            )))
        }
    }
}

/// Content of group 0002.
struct Meta {
    end: usize,
    transfer_syntax: Option<String>,
}

impl Meta {
    /// Reads the elements of group 0002 at `begin`; `None` if the last one is cut off.
    fn read(start: &[u8], begin: usize) -> Option<Self> {
        let mut meta = Self {
            end: begin,
            transfer_syntax: None,
        };
        while let Some([2, 0, element @ ..]) = start[meta.end..].first_chunk::<8>() {
            let long = matches!(
                &element[2..4],
                b"OB" | b"OW" | b"UN" | b"UT" | b"SQ" | b"OF"
            );
            let (value, length) = match long {
                true => {
                    let length = start.get(meta.end + 8..)?.first_chunk()?;
                    (meta.end + 12, u32::from_le_bytes(*length) as usize)
                }
                false => {
                    let length = [element[4], element[5]];
                    (meta.end + 8, usize::from(u16::from_le_bytes(length)))
                }
            };
            let end = value.checked_add(length)?;
            let bytes = start.get(value..end)?;
            if element[..2] == [0x10, 0] {
                let text = String::from_utf8_lossy(bytes);
                meta.transfer_syntax = Some(text.trim_matches(['\0', ' ']).to_owned());
            }
            meta.end = end;
        }
        Some(meta)
    }
}
