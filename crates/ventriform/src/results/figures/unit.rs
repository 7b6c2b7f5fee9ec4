//! Units of figures.

use ventriform_dicom::write::code::{Code, ucum};

/// A unit, as people write it and as UCUM codes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Unit {
    /// As it is written beside a figure; empty for none.
    pub symbol: &'static str,
    /// Its code.
    pub code: Code,
}

impl Unit {
    /// Millilitres.
    pub const MILLILITRE: Self = Self::new("ml", ucum("ml", "milliliter"));
    /// Grams.
    pub const GRAM: Self = Self::new("g", ucum("g", "gram"));
    /// Millimetres.
    pub const MILLIMETRE: Self = Self::new("mm", ucum("mm", "mm"));
    /// Widths of a voxel.
    pub const VOXEL: Self = Self::new("voxels", ucum("{voxel}", "voxels"));
    /// Milliseconds.
    pub const MILLISECOND: Self = Self::new("ms", ucum("ms", "millisecond"));
    /// Degrees of an angle or of the cycle.
    pub const DEGREE: Self = Self::new("°", ucum("deg", "degree"));
    /// Per cent.
    pub const PERCENT: Self = Self::new("%", ucum("%", "Percent"));
    /// Differences of figures in per cent.
    pub const POINT: Self = Self::new("points", ucum("%", "Percent"));
    /// End-diastolic volumes per second.
    pub const EDV_PER_SECOND: Self =
        Self::new("EDV/s", ucum("{EDV}/s", "end-diastolic volumes per second"));
    /// Standard deviations of healthy people.
    pub const DEVIATION: Self = Self::new("SD", ucum("{SD}", "standard deviations"));
    /// Scores of segments and their sums.
    pub const SCORE: Self = Self::new("", ucum("{score}", "score"));
    /// Sums of the scores of 17 segments, each 0 to 4.
    pub const SUMMED_SCORE: Self = Self::new("of 68", ucum("{score}", "score"));
    /// Ratios, indices and counts.
    pub const ONE: Self = Self::new("", ucum("1", "no units"));
    /// Indices between 0 and 1.
    pub const OF_ONE: Self = Self::new("of 1", ucum("1", "no units"));

    const fn new(symbol: &'static str, code: Code) -> Self {
        Self { symbol, code }
    }
}
