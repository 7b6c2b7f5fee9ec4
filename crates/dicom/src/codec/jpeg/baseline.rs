//! The baseline process (T.81, annexes A and F): blocks of 8 x 8 numbers by their cosine transform.
//!
//! The inverse transform is that of the Independent JPEG Group's `jidctint.c` (Loeffler, Ligtenberg and
//! Moschytz 1989, in integers), so that the numbers are the same as those of programs that use libjpeg,
//! bit by bit.

use super::super::{FrameError, FrameLayout, Pace};
use super::Header;
use super::bits::{Bits, Table};

/// Place in a block of each coefficient as it is stored (figure A.6).
const ZIGZAG_POSITIONS: [u8; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20,
    13, 6, 7, 14, 21, 28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59,
    52, 45, 38, 31, 39, 46, 53, 60, 61, 54, 47, 55, 62, 63,
];

/// Largest sizes of differences and coefficients, bits (F.1.2).
const DIFFERENCE_BITS: u8 = 11;
const COEFFICIENT_BITS: u8 = 10;

/// Decodes the numbers of the scan.
pub(super) fn decode(
    header: &Header<'_>,
    bits: &mut Bits<'_>,
    layout: FrameLayout,
    pace: &mut Pace<'_>,
) -> Result<Vec<i32>, FrameError> {
    let differences = header.difference_table()?;
    let coefficients = header.coefficients.get(header.scan.tables[1]);
    let coefficients = coefficients
        .and_then(Option::as_ref)
        .ok_or("the JPEG scan has no Huffman table for coefficients")?;
    let place = header.frame.map_or(0, |frame| frame.quantisation);
    let steps = header.quantisation.get(usize::from(place));
    let steps = steps
        .copied()
        .flatten()
        .ok_or("the JPEG frame has no table of quantisation")?;
    let mut values = vec![0; layout.pixels()];
    let mut level = 0;
    let mut blocks = 0;
    for top in (0..layout.rows).step_by(8) {
        for left in (0..layout.columns).step_by(8) {
            if header.restart > 0 && blocks > 0 && blocks % header.restart == 0 {
                bits.restart(blocks / header.restart - 1)?;
                level = 0;
            }
            blocks += 1;
            let mut block = read_block(bits, [differences, coefficients], &steps, &mut level)?;
            transform(&mut block);
            let (wide, high) = (8.min(layout.columns - left), 8.min(layout.rows - top));
            for y in 0..high {
                let begin = (top + y) * layout.columns + left;
                let row = &mut values[begin..begin + wide];
                for (value, number) in row.iter_mut().zip(&block[8 * y..]) {
                    *value = (number + 128).clamp(0, 255) as i32;
                }
            }
        }
        pace.step(8 * layout.columns)?;
    }
    Ok(values)
}

/// Reads the coefficients of a block, times their steps (F.2.2). `level` is the first coefficient of the
/// block before.
fn read_block(
    bits: &mut Bits<'_>,
    [differences, coefficients]: [&Table; 2],
    steps: &[u8; 64],
    level: &mut i32,
) -> Result<[i64; 64], FrameError> {
    let too_large = |size: u8| FrameError::Wrong(format!("a JPEG coefficient has {size} bits"));
    let mut block = [0; 64];
    let size = bits.symbol(differences)?;
    if size > DIFFERENCE_BITS {
        return Err(too_large(size));
    }
    *level = level.saturating_add(bits.signed(size.into())?);
    block[0] = i64::from(*level) * i64::from(steps[0]);
    let mut k = 1;
    while k < 64 {
        let symbol = bits.symbol(coefficients)?;
        let (run, size) = (usize::from(symbol >> 4), symbol & 15);
        match (run, size) {
            // The rest is 0.
            (0, 0) => break,
            (15, 0) => k += 16,
            (_, 1..=COEFFICIENT_BITS) if k + run < 64 => {
                k += run;
                let value = bits.signed(size.into())?;
                block[usize::from(ZIGZAG_POSITIONS[k])] = i64::from(value) * i64::from(steps[k]);
                k += 1;
            }
            (_, 1..=COEFFICIENT_BITS) => {
                return Err("the JPEG coefficients exceed their block".into());
            }
            _ => return Err(too_large(size)),
        }
    }
    if k <= 64 {
        Ok(block)
    } else {
        Err("the JPEG coefficients exceed their block".into())
    }
}

/// Bits behind the point of the constants, and those kept between the passes.
const CONSTANT_BITS: u32 = 13;
const PASS_BITS: u32 = 2;

/// The inverse cosine transform of columns and rows.
pub(super) fn transform(block: &mut [i64; 64]) {
    for column in 0..8 {
        pass(block, column, 8, CONSTANT_BITS - PASS_BITS);
    }
    for row in 0..8 {
        pass(block, 8 * row, 1, CONSTANT_BITS + PASS_BITS + 3);
    }
}

/// Transforms the eight numbers from `first` on, `step` apart, and drops `scale` bits.
fn pass(block: &mut [i64; 64], first: usize, step: usize, scale: u32) {
    let n: [i64; 8] = std::array::from_fn(|k| block[first + k * step]);
    // The constants are those of the source, times 2^13.
    let z = (n[2] + n[6]) * 4433;
    let (even2, even3) = (z - n[6] * 15137, z + n[2] * 6270);
    let even0 = (n[0] + n[4]) << CONSTANT_BITS;
    let even1 = (n[0] - n[4]) << CONSTANT_BITS;
    let even = [even0 + even3, even1 + even2, even1 - even2, even0 - even3];
    let [z1, z2, z3, z4] = [n[7] + n[1], n[5] + n[3], n[7] + n[3], n[5] + n[1]];
    let z5 = (z3 + z4) * 9633;
    let (z1, z2) = (-z1 * 7373, -z2 * 20995);
    let (z3, z4) = (z5 - z3 * 16069, z5 - z4 * 3196);
    let odd = [
        n[1] * 12299 + z1 + z4,
        n[3] * 25172 + z2 + z3,
        n[5] * 16819 + z2 + z4,
        n[7] * 2446 + z1 + z3,
    ];
    let rounded = |value: i64| (value + (1 << (scale - 1))) >> scale;
    for k in 0..4 {
        block[first + k * step] = rounded(even[k] + odd[k]);
        block[first + (7 - k) * step] = rounded(even[k] - odd[k]);
    }
}
