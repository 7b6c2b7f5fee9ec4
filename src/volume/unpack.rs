//! Gzip in one go.
//!
//! In: a packed file. Out: all of its bytes, or `None` where reading it in portions is the better
//! way. With input and output both in memory, libdeflate unpacks about twice as fast as any
//! decoder that may have to stop and go on (measured on noisy 16-bit voxels: 12 ms instead of
//! 22). That takes memory for both, hence only small files are unpacked so; and it says little
//! of what is wrong with a damaged file, hence whatever is not as it should be is left to the
//! portions.
//!
//! Guaranteed: the bytes are those that reading in portions would have given, their checksum is
//! right, and no more memory is taken than [`MOST`] and the file's own size.

use libdeflater::Decompressor;
use std::io::{self, Read, Seek, SeekFrom};

/// Most bytes to unpack at once: some 40 ms of work, in which nobody looks at the cancel token.
const MOST: u64 = 16 << 20;

/// A gzip member ends with the checksum and the length of what it holds, four bytes each.
const TRAILER: usize = 8;

/// Unpacks `packed`, a gzipped file of `stored` bytes, if it is one member of at least `least`
/// bytes and at most `limit`.
///
/// # Errors
/// Those of the file; of the data none.
pub(super) fn at_once(
    packed: &mut (impl Read + Seek),
    stored: u64,
    least: u64,
    limit: u64,
) -> io::Result<Option<Vec<u8>>> {
    if stored > MOST || stored < TRAILER as u64 {
        return Ok(None);
    }
    let mut trailer = [0; TRAILER];
    packed.seek(SeekFrom::End(-(TRAILER as i64)))?;
    packed.read_exact(&mut trailer)?;
    let word = |at: usize| [0, 1, 2, 3].map(|k| trailer[at + k]);
    let (checksum, length) = (u32::from_le_bytes(word(0)), u32::from_le_bytes(word(4)));
    if u64::from(length) < least || u64::from(length) > limit.min(MOST) {
        return Ok(None);
    }
    let mut file = Vec::with_capacity(stored as usize);
    packed.rewind()?;
    packed.take(stored).read_to_end(&mut file)?;
    let mut bytes = vec![0; length as usize];
    let unpacked = Decompressor::new().gzip_decompress(&file, &mut bytes);
    // Only the first member was unpacked and checked: it must be the one that ends the file.
    let whole = unpacked == Ok(bytes.len()) && libdeflater::crc32(&bytes) == checksum;
    Ok(whole.then_some(bytes))
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
        at_once(&mut Cursor::new(packed), packed.len() as u64, least, limit).unwrap()
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
