//! Unpacks a gzipped file in one step.
//!
//! In: a packed file. Out: all of its bytes, or `None` if it has to be read in portions. With input
//! and output in memory, libdeflate unpacks about twice as fast as a streaming decoder (12 ms instead
//! of 22 ms for 4 MiB of noisy 16-bit voxels). Since this needs memory for both, it is limited to
//! small files. Since libdeflate reports few details about damaged data, every irregular file is left
//! to the streaming decoder.
//!
//! The result is allocated as 32-bit words, so that voxels of four bytes can be decoded in place.
//!
//! Guaranteed: the bytes are the same as those of the streaming decoder, their checksum is correct,
//! and the memory taken is at most [`MAX_UNPACKED_BYTES`] plus the size of the file.

use flate2::bufread::GzDecoder;
use libdeflater::Decompressor;
use std::io::{self, Cursor, Read, Seek, SeekFrom};

/// Most bytes to unpack at once: about 40 ms of work, during which cancellation is not checked.
const MAX_UNPACKED_BYTES: u64 = 16 << 20;

/// Length of the checksum and the size at the end of a gzip member, four bytes each.
const TRAILER_BYTES: usize = 8;

/// The bytes of an unpacked file, stored in 32-bit words.
#[derive(Default)]
pub(super) struct Unpacked {
    words: Vec<f32>,
    length: usize,
}

impl Unpacked {
    /// `length` zero bytes.
    fn zeros(length: usize) -> Self {
        Self {
            words: vec![0.0; length.div_ceil(size_of::<f32>())],
            length,
        }
    }

    /// The unpacked bytes.
    pub(super) fn bytes(&self) -> &[u8] {
        &bytemuck::cast_slice(&self.words)[..self.length]
    }

    fn bytes_mut(&mut self) -> &mut [u8] {
        &mut bytemuck::cast_slice_mut(&mut self.words)[..self.length]
    }

    /// The words, of which the last is padded with zeros.
    pub(super) fn into_words(self) -> Vec<f32> {
        self.words
    }
}

/// Unpacks `packed`, a gzipped file of `stored` bytes, if it consists of one member that unpacks to
/// `least` to `limit` bytes.
///
/// # Errors
/// If the file cannot be read. Damaged data give `None`.
pub(super) fn at_once(
    packed: &mut (impl Read + Seek),
    stored: u64,
    least: u64,
    limit: u64,
) -> io::Result<Option<Unpacked>> {
    if stored > MAX_UNPACKED_BYTES || stored < TRAILER_BYTES as u64 {
        return Ok(None);
    }
    let mut trailer = [0; TRAILER_BYTES];
    packed.seek(SeekFrom::End(-(TRAILER_BYTES as i64)))?;
    packed.read_exact(&mut trailer)?;
    let [c0, c1, c2, c3, l0, l1, l2, l3] = trailer;
    let checksum = u32::from_le_bytes([c0, c1, c2, c3]);
    let length = u32::from_le_bytes([l0, l1, l2, l3]);
    if !(least..=limit.min(MAX_UNPACKED_BYTES)).contains(&u64::from(length)) {
        return Ok(None);
    }
    let mut file = Vec::with_capacity(stored as usize);
    packed.rewind()?;
    packed.take(stored).read_to_end(&mut file)?;
    let Some(deflated) = after_header(&file) else {
        return Ok(None);
    };
    let mut unpacked = Unpacked::zeros(length as usize);
    let bytes = unpacked.bytes_mut();
    // The trailer belongs to the first member only if no other member follows; then both agree.
    let whole = Decompressor::new().deflate_decompress(deflated, bytes) == Ok(bytes.len())
        && libdeflater::crc32(bytes) == checksum;
    Ok(whole.then_some(unpacked))
}

/// The bytes after the header of the member at the start of `file`.
fn after_header(file: &[u8]) -> Option<&[u8]> {
    let member = GzDecoder::new(Cursor::new(file));
    // The decoder has read only the header so far.
    member.header()?;
    file.get(member.get_ref().position() as usize..)
}

#[cfg(test)]
mod tests {
    use super::*;
    use flate2::{Compression, write::GzEncoder};
    use std::io::{Cursor, Write};

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn try_at_once(packed: &[u8], least: u64, limit: u64) -> Option<Vec<u8>> {
        let unpacked = at_once(&mut Cursor::new(packed), packed.len() as u64, least, limit);
        Some(unpacked.unwrap()?.bytes().to_vec())
    }

    #[test]
    fn one_whole_member_comes_out_and_all_else_is_left() {
        let bytes: Vec<u8> = (0..100_000u32)
            .map(|n| (n.wrapping_mul(n) >> 7) as u8)
            .collect();
        let packed = gzip(&bytes);
        assert_eq!(try_at_once(&packed, 100_000, 100_000), Some(bytes));
        assert_eq!(try_at_once(&packed, 100_001, 200_000), None);
        assert_eq!(try_at_once(&packed, 100, 99_999), None);
        let half = gzip(b"half");
        for (what, file) in [
            ("nothing", Vec::new()),
            ("cut off", packed[..packed.len() - 1].to_vec()),
            ("padded", [&packed[..], &[0; 9]].concat()),
            ("two members", [&packed[..], &half].concat()),
            ("two as long", [half, gzip(b"flah")].concat()),
            (
                "a false length",
                [&packed[..packed.len() - 4], &[1, 0, 0, 0]].concat(),
            ),
        ] {
            assert_eq!(try_at_once(&file, 1, 1 << 20), None, "{what}");
        }
        let mut damaged = packed;
        damaged[5000] ^= 4;
        assert_eq!(try_at_once(&damaged, 1, 1 << 20), None);
    }
}
