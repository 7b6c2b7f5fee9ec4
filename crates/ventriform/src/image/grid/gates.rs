//! The conditions under which volumes are the gates of one study.

use std::ops::RangeInclusive;

/// Gates that a study may have: fewer do not show a beat, more no scanner makes.
pub const GATE_COUNTS: RangeInclusive<usize> = 6..=32;

/// Farthest that a gate's voxels may lie from those of the first gate, mm.
pub const SAME_PLACE_MM: f64 = 0.01;
