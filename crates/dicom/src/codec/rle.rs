//! Run lengths after PS3.5 annex G.
//!
//! A header of 16 numbers gives the count of segments and where they begin. Segment n holds byte n of
//! all numbers, the most significant first, packed as in TIFF (`PackBits`).

use super::FrameLayout;

const HEADER_BYTES: usize = 64;

/// Decodes the frame in `bytes`.
///
/// # Errors
/// The problem of the bytes.
pub(super) fn decode(bytes: &[u8], layout: FrameLayout) -> Result<Vec<u8>, String> {
    let header = bytes
        .get(..HEADER_BYTES)
        .ok_or("the RLE header is cut off")?;
    let (numbers, _) = header.as_chunks::<4>();
    let numbers: Vec<usize> = numbers
        .iter()
        .map(|n| u32::from_le_bytes(*n) as usize)
        .collect();
    let (segments, offsets) = (numbers[0], &numbers[1..]);
    if segments != layout.size {
        return Err(format!(
            "the RLE frame has {segments} segments; expected {} for one component of {} bits",
            layout.size,
            8 * layout.size
        ));
    }
    let mut decoded = vec![0; layout.pixels() * layout.size];
    for segment in 0..segments {
        let begin = offsets[segment];
        let end = if segment + 1 < segments {
            offsets[segment + 1]
        } else {
            bytes.len()
        };
        let packed = bytes.get(begin..end).filter(|_| begin >= HEADER_BYTES);
        let packed = packed.ok_or("an RLE segment lies outside its frame")?;
        // The most significant byte comes last in a little endian number.
        let place = layout.size - 1 - segment;
        let mut out = decoded[place..].iter_mut().step_by(layout.size);
        unpack(packed, layout.pixels(), &mut out)?;
    }
    Ok(decoded)
}

/// Unpacks `count` bytes. Bytes beyond those are padding.
fn unpack<'a>(
    mut packed: &[u8],
    count: usize,
    out: &mut impl Iterator<Item = &'a mut u8>,
) -> Result<(), String> {
    let cut = || "an RLE segment is too short".to_owned();
    let mut done = 0;
    while done < count {
        let (&mark, rest) = packed.split_first().ok_or_else(cut)?;
        let length = match mark {
            0..=127 => usize::from(mark) + 1,
            128 => 0,
            129..=255 => 257 - usize::from(mark),
        };
        let wanted = length.min(count - done);
        if mark < 128 {
            // The last literal run may be cut where the padding begins.
            let literal = rest.get(..wanted).ok_or_else(cut)?;
            out.zip(literal)
                .take(wanted)
                .for_each(|(to, from)| *to = *from);
            packed = rest.get(length..).unwrap_or_default();
        } else if length > 0 {
            let (&value, rest) = rest.split_first().ok_or_else(cut)?;
            out.take(wanted).for_each(|to| *to = value);
            packed = rest;
        } else {
            packed = rest;
        }
        done += wanted;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn literals_runs_and_bytes_come_out_in_order() {
        let layout = FrameLayout {
            columns: 3,
            rows: 2,
            size: 2,
            bits: 16,
            signed: false,
        };
        // High bytes 1 1 1 1 2 3; low bytes 9 8 7 7 7 7, then padding.
        let high = [253, 1, 1, 2, 3];
        let low = [1, 9, 8, 128, 253, 7, 0];
        let mut frame = vec![0; HEADER_BYTES];
        frame[0] = 2;
        frame[4] = HEADER_BYTES as u8;
        frame[8] = (HEADER_BYTES + high.len()) as u8;
        frame.extend(high);
        frame.extend(low);
        let numbers = [0x109, 0x108, 0x107, 0x107, 0x207, 0x307];
        let expected: Vec<u8> = numbers.into_iter().flat_map(u16::to_le_bytes).collect();
        assert_eq!(decode(&frame, layout).as_ref(), Ok(&expected));
        for cut in 0..frame.len() - 1 {
            assert!(decode(&frame[..cut], layout).is_err(), "{cut}");
        }
        let mut outside = frame.clone();
        outside[8] = 255;
        assert!(decode(&outside, layout).is_err());
        frame[0] = 3;
        assert!(decode(&frame, layout).is_err());
    }
}
