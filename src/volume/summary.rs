//! Figures over the values of a volume, and whether the values look like labels.
//!
//! The reader adds every portion right after decoding it, while it is still in the cache. Sums are
//! taken within portions, and their results are added in order.

use super::VolumeError;
use super::facts::{IntensitySummary, LabelCount};
use std::collections::BTreeMap;

/// Voxels per partial sum.
const PORTION: usize = 1 << 16;

/// Largest number of different values in a label map.
const MOST_LABELS: usize = 256;

/// Smallest share of labelled voxels in a label map whose neighbour along i has the same label. Organs
/// with coarse voxels reach 0.7 and more; noisy counts stay below 0.2.
const LEAST_COHERENCE: f64 = 0.5;

/// Figures over `voxels`, which are stored in rows of `row` voxels along i.
pub fn summarise(voxels: &[f32], row: usize) -> IntensitySummary {
    let mut tally = Tally::default();
    for portion in voxels.chunks(PORTION) {
        tally.add_portion(portion);
    }
    tally.with_labels(voxels, row)
}

/// A warning if all values are the same.
///
/// # Errors
/// [`VolumeError::NoFiniteVoxel`] if every voxel is missing.
pub(super) fn judge(
    intensity: &IntensitySummary,
    file: &str,
) -> Result<Option<String>, VolumeError> {
    if intensity.finite == 0 {
        return Err(VolumeError::NoFiniteVoxel { file: file.into() });
    }
    let value = intensity.minimum;
    let constant = value == intensity.maximum;
    Ok(constant.then(|| format!("Every voxel has the value {value}: the volume shows no object.")))
}

/// Running figures over one volume or several.
#[derive(Debug, Clone, Copy)]
pub(super) struct Tally {
    minimum: f32,
    maximum: f32,
    sum: f64,
    finite: u64,
    missing: u64,
    fractional: bool,
}

impl Default for Tally {
    fn default() -> Self {
        Self {
            minimum: f32::INFINITY,
            maximum: f32::NEG_INFINITY,
            sum: 0.0,
            finite: 0,
            missing: 0,
            fractional: false,
        }
    }
}

impl Tally {
    /// Adds the voxels of the next portion.
    pub(super) fn add_portion(&mut self, portion: &[f32]) {
        self.merge(&Tally::of(portion));
    }

    /// Figures over one portion, computed in lanes for the vector unit.
    fn of(portion: &[f32]) -> Self {
        let mut lanes = Lanes::new();
        let (blocks, rest) = portion.as_chunks::<BLOCK>();
        for block in blocks {
            lanes.add_block(block);
        }
        // The last block is padded with missing voxels, which are subtracted below.
        let mut last = [f32::NAN; BLOCK];
        last[..rest.len()].copy_from_slice(rest);
        lanes.add_block(&last);
        let padding = (BLOCK - rest.len()) as u64;
        let missing = lanes.missing - padding;
        Self {
            minimum: lanes.minimum.into_iter().fold(f32::INFINITY, f32::min),
            maximum: lanes.maximum.into_iter().fold(f32::NEG_INFINITY, f32::max),
            sum: lanes.sum.iter().sum(),
            finite: portion.len() as u64 - missing,
            missing,
            fractional: lanes.fractional,
        }
    }

    fn merge(&mut self, other: &Tally) {
        self.minimum = self.minimum.min(other.minimum);
        self.maximum = self.maximum.max(other.maximum);
        self.sum += other.sum;
        self.finite += other.finite;
        self.missing += other.missing;
        self.fractional |= other.fractional;
    }

    /// The figures over `voxels`, all of which have been added, with their labels if they look like a
    /// label map.
    pub(super) fn with_labels(&self, voxels: &[f32], row: usize) -> IntensitySummary {
        let labels = match self.fractional {
            false => labels(voxels, row),
            true => None,
        };
        self.summary(labels)
    }

    /// The figures so far; all zero if no voxel is finite.
    pub(super) fn summary(&self, labels: Option<Vec<LabelCount>>) -> IntensitySummary {
        let any = self.finite > 0;
        IntensitySummary {
            minimum: if any { self.minimum } else { 0.0 },
            maximum: if any { self.maximum } else { 0.0 },
            mean: self.sum / self.finite.max(1) as f64,
            sum: self.sum,
            finite: self.finite,
            missing: self.missing,
            integral: any && !self.fractional,
            labels,
        }
    }
}

/// Values processed side by side.
const LANES: usize = 8;

/// Values per check for the rare cases: missing and fractional values.
const BLOCK: usize = 16 * LANES;

/// From this value on, every `f32` is a whole number.
const WHOLE: f32 = 8_388_608.0;

/// Figures over every eighth voxel (arrays) and over all (scalars).
struct Lanes {
    minimum: [f32; LANES],
    maximum: [f32; LANES],
    sum: [f64; LANES],
    missing: u64,
    fractional: bool,
}

impl Lanes {
    fn new() -> Self {
        Self {
            minimum: [f32::INFINITY; LANES],
            maximum: [f32::NEG_INFINITY; LANES],
            sum: [0.0; LANES],
            missing: 0,
            fractional: false,
        }
    }

    /// Adds a block without branches on single values: most blocks have no missing values, and once a
    /// fraction has been found the search for fractions ends.
    fn add_block(&mut self, block: &[f32; BLOCK]) {
        let missing = block.iter().map(|v| u64::from(v.is_nan())).sum::<u64>();
        self.missing += missing;
        for group in block.as_chunks::<LANES>().0 {
            for l in 0..LANES {
                // Comparisons with NaN are false.
                let (v, low, high) = (group[l], self.minimum[l], self.maximum[l]);
                self.minimum[l] = if v < low { v } else { low };
                self.maximum[l] = if v > high { v } else { high };
                let counted = if missing > 0 && v.is_nan() { 0.0 } else { v };
                self.sum[l] += f64::from(counted);
            }
        }
        if !self.fractional {
            self.fractional = block.iter().fold(false, |any, v| {
                // Adding 2^23 rounds a number to a whole one.
                let size = v.abs();
                let whole = (size + WHOLE) - WHOLE == size || size >= WHOLE;
                any | !(whole | v.is_nan())
            });
        }
    }
}

/// The labels of `voxels`, which are whole, if there are few different ones and neighbours are mostly
/// alike.
fn labels(voxels: &[f32], row: usize) -> Option<Vec<LabelCount>> {
    let mut counts: BTreeMap<i64, u64> = BTreeMap::new();
    let (mut labelled, mut alike) = (0_u64, 0_u64);
    for line in voxels.chunks(row.max(1)) {
        let mut previous = 0;
        for run in line.chunk_by(|a, b| a == b) {
            let length = run.len() as u64;
            let label = run[0] as i64;
            if label == 0 || run[0].is_nan() {
                previous = 0;
                continue;
            }
            *counts.entry(label).or_default() += length;
            if counts.len() > MOST_LABELS {
                return None;
            }
            labelled += length;
            // A voxel next to background counts as coherent: only a neighbour with another label
            // is evidence against a label map.
            alike += length - u64::from(previous != 0);
            previous = label;
        }
    }
    let coherent = alike as f64 >= LEAST_COHERENCE * labelled as f64;
    (labelled > 0 && coherent).then(|| {
        let count = |(label, voxels)| LabelCount { label, voxels };
        counts.into_iter().map(count).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_those_of_the_definition() {
        let s = summarise(&[1.0, f32::NAN, -2.0, 4.5], 4);
        assert_eq!((s.minimum, s.maximum, s.sum), (-2.0, 4.5, 3.5));
        assert_eq!((s.finite, s.missing, s.mean), (3, 1, 3.5 / 3.0));
        assert!(!s.integral && s.labels.is_none());
    }

    #[test]
    fn portions_add_up() {
        let n = 3 * PORTION + 17;
        let voxels: Vec<f32> = (0..n).map(|i| (i % 7) as f32).collect();
        let sum: f64 = voxels.iter().map(|&v| f64::from(v)).sum();
        let s = summarise(&voxels, 128);
        assert_eq!((s.sum, s.minimum, s.maximum), (sum, 0.0, 6.0));
        assert_eq!((s.finite, s.missing, s.integral), (n as u64, 0, true));
    }

    #[test]
    fn blocks_are_labels_and_counts_are_not() {
        let organ = |i: usize| {
            if i % 20 < 8 {
                1.0 + (i / 100) as f32
            } else {
                0.0
            }
        };
        let blocks: Vec<f32> = (0..400).map(organ).collect();
        let labels = summarise(&blocks, 20).labels.unwrap();
        assert_eq!(labels.len(), 4);
        assert_eq!((labels[0].label, labels[0].voxels), (1, 40));
        let counts: Vec<f32> = (0..400).map(|i| (i * 37 % 41) as f32).collect();
        assert!(summarise(&counts, 20).labels.is_none());
    }

    #[test]
    fn whole_numbers_are_told_at_every_size() {
        for whole in [0.0, -3.0, 4_194_305.0, 8_388_607.0, 16_777_213.0, -1e30] {
            assert!(summarise(&[whole], 1).integral, "{whole}");
        }
        for part in [0.5, -1e-30, 4_194_304.5, 8_388_606.5] {
            assert!(!summarise(&[part], 1).integral, "{part}");
        }
    }

    #[test]
    fn a_volume_without_numbers_has_no_values() {
        let s = summarise(&[f32::NAN; 5], 5);
        assert_eq!((s.finite, s.missing, s.mean), (0, 5, 0.0));
        assert!(!s.integral && s.labels.is_none());
    }
}
