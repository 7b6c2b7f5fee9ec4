//! The lossless process (T.81, annex H).
//!
//! Each number is predicted from its neighbours left (`ra`), above (`rb`) and above left (`rc`), and
//! its difference to the prediction is coded, modulo 2^16. The first line of the frame and the first after
//! a restart are predicted from the left alone.

use super::super::{FrameError, FrameLayout, Pace};
use super::Header;
use super::bits::Bits;

/// Decodes the numbers of the scan.
pub(super) fn decode(
    header: &Header<'_>,
    bits: &mut Bits<'_>,
    layout: FrameLayout,
    pace: &mut Pace<'_>,
) -> Result<Vec<i32>, FrameError> {
    let table = header.difference_table()?;
    let columns = layout.columns;
    // B.2.4.4, and H.1.2.1, which speaks of lines.
    if !header.restart.is_multiple_of(columns) {
        return Err(FrameError::Wrong(format!(
            "the frame restarts after {} numbers, which is no multiple of its {columns} columns",
            header.restart
        )));
    }
    let interval = header.restart / columns;
    let point = u32::from(header.scan.approximation);
    let precision = header.bits - point;
    let mut values: Vec<i32> = Vec::with_capacity(layout.pixels());
    for row in 0..layout.rows {
        let restarts = interval > 0 && row > 0 && row.is_multiple_of(interval);
        if restarts {
            bits.restart(row / interval - 1)?;
        }
        let fresh = row == 0 || restarts;
        let above = values.len().saturating_sub(columns);
        for column in 0..columns {
            let predicted = match (fresh, column) {
                (true, 0) => 1 << (precision - 1),
                (true, _) => values[values.len() - 1],
                (false, 0) => values[above],
                (false, _) => {
                    let ra = values[values.len() - 1];
                    let [rc, rb] = [values[above + column - 1], values[above + column]];
                    predict(header.scan.first, [ra, rb, rc])
                }
            };
            let difference = match bits.symbol(table)? {
                size @ 0..=15 => bits.signed(size.into())?,
                16 => 1 << 15,
                size => {
                    let reason = format!("a JPEG difference has {size} bits; 16 is the most");
                    return Err(FrameError::Wrong(reason));
                }
            };
            let value = (predicted + difference) & 0xffff;
            if value >> precision != 0 {
                return Err(FrameError::Wrong(format!(
                    "row {row}, column {column} of the JPEG frame is {value}, beyond its \
                     {precision} bits"
                )));
            }
            values.push(value);
        }
        pace.step(columns)?;
    }
    values.iter_mut().for_each(|value| *value <<= point);
    Ok(values)
}

/// The prediction after table H.1.
fn predict(selection: u8, [ra, rb, rc]: [i32; 3]) -> i32 {
    match selection {
        1 => ra,
        2 => rb,
        3 => rc,
        4 => ra + rb - rc,
        5 => ra + ((rb - rc) >> 1),
        6 => rb + ((ra - rc) >> 1),
        _ => (ra + rb) >> 1,
    }
}
