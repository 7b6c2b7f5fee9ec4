//! The place of a scan's grid as its NIfTI header states it, for the masks that are written of the scan.
//!
//! A header states the place up to three times: qform, sform and spacing, each with a code, in a unit.
//! Which of them a program follows differs: ITK prefers the qform unless only the sform has a code,
//! nibabel the sform. A mask lies on its scan in all of them only if it states the same fields with the
//! same values; an affine computed from one of them cannot do that.

use super::header::Header;

/// The fields that state the place of a NIfTI file's grid, as in the file.
#[derive(Debug, Clone, PartialEq)]
pub struct StatedGrid {
    /// Number of dimensions of a file with one volume on this grid. Trailing dimensions of length 1 count;
    /// of a file with several volumes there are 3.
    pub(super) rank: usize,
    pub(super) pixdim: [f64; 8],
    pub(super) xyzt_units: i32,
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    pub(super) quatern: [f64; 3],
    pub(super) qoffset: [f64; 3],
    pub(super) srow: [[f64; 4]; 3],
}

impl StatedGrid {
    pub(super) fn from_header(header: &Header) -> Self {
        Self {
            rank: match header.frames {
                1 => header.dim.len(),
                _ => 3,
            },
            pixdim: header.pixdim,
            xyzt_units: header.xyzt_units,
            qform_code: header.qform_code,
            sform_code: header.sform_code,
            quatern: header.quatern,
            qoffset: header.qoffset,
            srow: header.srow,
        }
    }
}
