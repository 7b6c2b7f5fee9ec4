//! Whether a file holds voxels and their place and nothing else.
//!
//! A NIfTI file can name a patient: in a DICOM header or another extension, in one of its fields of text (`descrip`,
//! `aux_file`, `db_name`, `intent_name`), in the name that gzip keeps of the packed file, and in bytes that no
//! reader asks for: between the header and the voxels, after them, after the packed data. Whether text that is there
//! names somebody cannot be told, so a file is bare only if there is none but the `descrip` that this program writes.

use super::super::VolumeError;
use super::super::limits::ReadLimits;
use super::super::source::{ReadSeek, Source, VolumeFile};
use super::header::Header;
use super::write::FILE_DESCRIPTION;
use crate::base::progress::{Monitor, Stage};
use flate2::bufread::GzDecoder;
use std::io::{self, BufRead, BufReader, ErrorKind, Read, Seek};
use std::ops::Range;

/// Bytes of the headers of both versions.
const NIFTI1_BYTES: usize = 348;
const NIFTI2_BYTES: usize = 540;

/// The fields of a NIfTI-1 header that hold text: `data_type` and `db_name`, `descrip` and
/// `aux_file`, `intent_name`.
const FIRST_TEXT: [Range<usize>; 3] = [4..32, 148..252, 328..344];

/// Those of a NIfTI-2 header: `descrip` and `aux_file`, `intent_name`, `unused_str`.
const SECOND_TEXT: [Range<usize>; 3] = [240..344, 508..524, 525..540];

/// Flags of a gzip member that something precedes its data: other fields, a name, a comment.
const GZIP_FIELD_FLAGS: u8 = 4 | 8 | 16;

/// Bytes read at a time.
const PORTION_BYTES: usize = 128 << 10;

/// Whether `file` is a NIfTI file of one part that holds voxels, where they lie and nothing else. Reads it
/// to its end.
///
/// # Errors
/// [`VolumeError::Io`] and [`VolumeError::Cancelled`].
pub fn is_bare(
    file: &VolumeFile,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<bool, VolumeError> {
    let mut source = Source::open(file, limits.unpacked_bytes)?;
    let header = match Header::read(&mut source) {
        Ok(header) if !header.pair => header,
        Ok(_) | Err(_) => return Ok(false),
    };
    let size = header.data_type.size() as u64;
    let sizes = header.dim.iter().map(|&n| n as u64);
    let voxels = sizes.fold(size, u64::saturating_mul);
    let end = header.vox_offset.saturating_add(voxels);
    let io = |error: io::Error| VolumeError::Io {
        file: file.name().into(),
        reason: error.to_string(),
    };
    let mut bytes = file.bytes().map_err(io)?;
    let mut mark = [0; 4];
    let read = bytes.read_exact(&mut mark);
    match read.and_then(|()| bytes.rewind()) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(false),
        Err(error) => return Err(io(error)),
    }
    let packed = BufReader::with_capacity(PORTION_BYTES, bytes);
    if mark[..2] != [0x1f, 0x8b] {
        let mut plain = packed;
        return Ok(Content::read(&mut plain, end, monitor, &io)?
            .is_some_and(|content| content.is_bare(&header)));
    }
    if mark[3] & GZIP_FIELD_FLAGS != 0 {
        return Ok(false);
    }
    let mut member: GzDecoder<BufReader<Box<dyn ReadSeek>>> = GzDecoder::new(packed);
    let content = Content::read(&mut member, end, monitor, &io)?;
    let alone = || Ok(member.into_inner().fill_buf().map_err(io)?.is_empty());
    match content {
        Some(content) if content.is_bare(&header) => alone(),
        _ => Ok(false),
    }
}

/// The bytes before the voxels.
struct Content(Vec<u8>);

impl Content {
    /// Reads unpacked bytes to their end. `None` if there are more or fewer than `end`, or they cannot be unpacked.
    fn read(
        from: &mut impl Read,
        end: u64,
        monitor: &Monitor<'_>,
        io: &impl Fn(io::Error) -> VolumeError,
    ) -> Result<Option<Self>, VolumeError> {
        let (mut start, mut count) = (Vec::new(), 0_u64);
        let mut portion = vec![0; PORTION_BYTES];
        loop {
            let read = match from.read(&mut portion) {
                Ok(0) => break,
                Ok(read) => read,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                // A damaged member.
                Err(error)
                    if matches!(
                        error.kind(),
                        ErrorKind::InvalidInput | ErrorKind::InvalidData | ErrorKind::UnexpectedEof
                    ) =>
                {
                    return Ok(None);
                }
                Err(error) => return Err(io(error)),
            };
            if start.len() < PORTION_BYTES {
                start.extend_from_slice(&portion[..read]);
            }
            count += read as u64;
            if count > end {
                return Ok(None);
            }
            monitor.report(Stage::Read, count as f64 / end as f64)?;
        }
        Ok((count == end).then_some(Self(start)))
    }

    fn is_bare(&self, header: &Header) -> bool {
        let (size, texts, descrip) = if header.is_second() {
            (NIFTI2_BYTES, SECOND_TEXT, 240)
        } else {
            (NIFTI1_BYTES, FIRST_TEXT, 148)
        };
        let blank = |bytes: Option<&[u8]>| bytes.is_some_and(|bytes| bytes.iter().all(|b| *b == 0));
        let own = |text: &Range<usize>| {
            let rest = self.0.get(text.clone())?.strip_prefix(FILE_DESCRIPTION);
            (text.start == descrip).then_some(rest?)
        };
        let texts = texts
            .iter()
            .all(|text| blank(self.0.get(text.clone())) || blank(own(text)));
        // Four bytes announce extensions, which the rest holds.
        let voxels = usize::try_from(header.vox_offset).unwrap_or(usize::MAX);
        texts && blank(self.0.get(size..voxels))
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::super::super::phantom::{PhantomParameters, phantom};
    use super::super::{StoredType, write};
    use super::*;
    use flate2::{Compression, GzBuilder};
    use std::io::Write as _;

    fn bare(bytes: &[u8]) -> bool {
        let file = VolumeFile::in_memory("a.nii", bytes.to_vec());
        is_bare(&file, &ReadLimits::default(), &Monitor::silent()).unwrap()
    }

    fn scan(gzip: bool) -> Vec<u8> {
        let parameters = PhantomParameters {
            shape: [16; 3],
            spacing_mm: [12.0; 3],
            ..PhantomParameters::default()
        };
        let scan = phantom(&parameters, &Monitor::silent()).unwrap().volume;
        write(&scan, StoredType::Int16, gzip).unwrap()
    }

    fn packed(bytes: &[u8], builder: GzBuilder) -> Vec<u8> {
        let mut packer = builder.write(Vec::new(), Compression::fast());
        packer.write_all(bytes).unwrap();
        packer.finish().unwrap()
    }

    #[test]
    fn a_file_is_bare_only_where_no_byte_of_text_has_room() {
        let plain = scan(false);
        assert!(bare(&plain) && bare(&scan(true)));
        assert!(bare(&packed(&plain, GzBuilder::new())));
        assert!(!bare(&packed(&plain, GzBuilder::new().filename("doe.nii"))));
        assert!(!bare(&packed(&plain, GzBuilder::new().comment("doe"))));
        assert!(!bare(&packed(
            &plain,
            GzBuilder::new().extra(b"doe".to_vec())
        )));
        for at in FIRST_TEXT
            .into_iter()
            .flatten()
            .chain(NIFTI1_BYTES..NIFTI1_BYTES + 4)
        {
            let mut named = plain.clone();
            named[at] = b'd';
            assert!(!bare(&named), "{at}");
            assert!(!bare(&packed(&named, GzBuilder::new())), "{at}");
        }
        // An extension, a gap, what follows the voxels, a second member, and bytes after the first one.
        for (flag, length) in [(1, 16), (0, 16), (1, 200_000)] {
            let mut extended = plain.clone();
            extended[NIFTI1_BYTES] = flag;
            extended[108..112].copy_from_slice(&(352.0 + length as f32).to_le_bytes());
            let mut field = vec![0; length];
            field[8..11].copy_from_slice(b"doe");
            extended.splice(352..352, field);
            assert!(!bare(&extended), "{flag} {length}");
        }
        assert!(!bare(&[&plain[..], b"doe"].concat()));
        assert!(!bare(&plain[..plain.len() - 1]));
        let member = packed(&plain, GzBuilder::new());
        assert!(!bare(&[&member[..], b"doe"].concat()));
        assert!(!bare(
            &[&member[..], &packed(b"doe", GzBuilder::new())].concat()
        ));
        for other in [&b""[..], b"\x1f\x8b", b"PK\x03\x04 and so on", &[0; 400]] {
            assert!(!bare(other));
        }
    }
}
