//! Figures over the values of a volume, and whether the values look like labels.
//!
//! The reader adds every portion right after decoding it, while it is still in the cache. Sums are
//! taken within portions, and their results are added in order.
//!
//! Labels are counted in two passes. [`Coherence`] compares neighbours in vector lanes, which costs
//! little and rejects almost every volume that holds counts. Only what passes it and holds whole
//! numbers alone goes through [`LabelCounts`], which works run by run.

use super::VolumeError;
use super::facts::{IntensitySummary, LabelCount};
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::survey::many_are_pieces;
use std::collections::BTreeMap;

/// Voxels per partial sum.
const VOXELS_PER_SUM: usize = 1 << 16;

/// Largest number of different values in a label map that is not one beyond doubt
/// ([`many_are_pieces`]).
const FEW_LABELS: usize = 256;

/// Largest number of labels that are listed.
const MOST_LABELS: usize = 4096;

/// Smallest share of labelled voxels in a label map whose neighbour along i has the same label. Organs
/// with coarse voxels reach 0.7 and more; noisy counts stay below 0.2.
const LEAST_COHERENCE: f64 = 0.5;

/// Figures over `voxels`, which are stored in rows of `row` voxels along i.
pub fn summarise(voxels: &[f32], row: usize) -> IntensitySummary {
    let mut tally = Tally::default();
    for portion in voxels.chunks(VOXELS_PER_SUM) {
        tally.add_portion(portion);
    }
    let quiet = Monitor::silent();
    let figures = tally.with_labels(voxels, row, &quiet);
    // Nobody cancels; without labels it is the same volume.
    figures.unwrap_or_else(|_| tally.summary(None))
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
        self.merge(&Tally::new(portion, Lanes::add_block));
    }

    /// As [`Tally::add_portion`], for voxels that are known to be whole and not missing.
    pub(super) fn add_whole_portion(&mut self, portion: &[f32]) {
        self.merge(&Tally::new(portion, Lanes::add_figures));
    }

    /// Figures over one portion, computed in lanes for the vector unit, block by block.
    fn new(portion: &[f32], add: impl Fn(&mut Lanes, &[f32; VALUES_PER_CHECK])) -> Self {
        let mut lanes = Lanes::new();
        let (blocks, rest) = portion.as_chunks::<VALUES_PER_CHECK>();
        for block in blocks {
            add(&mut lanes, block);
        }
        // The last block is padded with missing voxels, which are subtracted below.
        let mut last = [f32::NAN; VALUES_PER_CHECK];
        last[..rest.len()].copy_from_slice(rest);
        lanes.add_block(&last);
        let padding = (VALUES_PER_CHECK - rest.len()) as u64;
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

    /// Adds the figures of `other`.
    pub(super) fn merge(&mut self, other: &Tally) {
        self.minimum = self.minimum.min(other.minimum);
        self.maximum = self.maximum.max(other.maximum);
        self.sum += other.sum;
        self.finite += other.finite;
        self.missing += other.missing;
        self.fractional |= other.fractional;
    }

    /// Whether all values so far are whole or missing.
    pub(super) fn is_whole(&self) -> bool {
        !self.fractional
    }

    /// The figures over `voxels`, all of which have been added, with their labels if they look like a
    /// label map.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub(super) fn with_labels(
        &self,
        voxels: &[f32],
        row: usize,
        monitor: &Monitor,
    ) -> Result<IntensitySummary, Cancelled> {
        let labels = if self.is_whole() {
            labels(voxels, row, monitor)?
        } else {
            None
        };
        Ok(self.summary(labels))
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
const PARALLEL_VALUES: usize = 8;

/// Values per check for the rare cases: missing and fractional values.
const VALUES_PER_CHECK: usize = 16 * PARALLEL_VALUES;

/// From this value on, every `f32` is a whole number.
const WHOLE_FROM: f32 = 8_388_608.0;

/// Figures over every eighth voxel (arrays) and over all (scalars).
struct Lanes {
    minimum: [f32; PARALLEL_VALUES],
    maximum: [f32; PARALLEL_VALUES],
    sum: [f64; PARALLEL_VALUES],
    missing: u64,
    fractional: bool,
}

impl Lanes {
    fn new() -> Self {
        Self {
            minimum: [f32::INFINITY; PARALLEL_VALUES],
            maximum: [f32::NEG_INFINITY; PARALLEL_VALUES],
            sum: [0.0; PARALLEL_VALUES],
            missing: 0,
            fractional: false,
        }
    }

    /// Adds a block without branches on single values: most blocks have no missing values, and once a
    /// fraction has been found the search for fractions ends.
    fn add_block(&mut self, block: &[f32; VALUES_PER_CHECK]) {
        let missing = block.iter().map(|v| u64::from(v.is_nan())).sum::<u64>();
        self.missing += missing;
        match missing {
            0 => self.add_figures(block),
            _ => {
                self.add_extremes(block);
                let counted = block.map(|v| if v.is_nan() { 0.0 } else { v });
                self.add_sum(&counted);
            }
        }
        if !self.fractional {
            self.fractional = block.iter().fold(false, |any, v| {
                // Adding 2^23 rounds a number to a whole one.
                let size = v.abs();
                let whole = (size + WHOLE_FROM) - WHOLE_FROM == size || size >= WHOLE_FROM;
                any | !(whole | v.is_nan())
            });
        }
    }

    /// Adds a block of which no value is missing to minimum, maximum and sum.
    fn add_figures(&mut self, block: &[f32; VALUES_PER_CHECK]) {
        self.add_extremes(block);
        self.add_sum(block);
    }

    fn add_extremes(&mut self, block: &[f32; VALUES_PER_CHECK]) {
        for group in block.as_chunks::<PARALLEL_VALUES>().0 {
            for l in 0..PARALLEL_VALUES {
                // Comparisons with NaN are false.
                let (v, low, high) = (group[l], self.minimum[l], self.maximum[l]);
                self.minimum[l] = if v < low { v } else { low };
                self.maximum[l] = if v > high { v } else { high };
            }
        }
    }

    fn add_sum(&mut self, block: &[f32; VALUES_PER_CHECK]) {
        for group in block.as_chunks::<PARALLEL_VALUES>().0 {
            for l in 0..PARALLEL_VALUES {
                self.sum[l] += f64::from(group[l]);
            }
        }
    }
}

/// The labels of `voxels`, which are whole, if there are few different ones and neighbours are mostly
/// alike.
fn labels(
    voxels: &[f32],
    row: usize,
    monitor: &Monitor,
) -> Result<Option<Vec<LabelCount>>, Cancelled> {
    let mut coherence = Coherence::new(row);
    let portions = || voxels.chunks(VOXELS_PER_SUM);
    for (n, portion) in portions().enumerate() {
        monitor.check()?;
        coherence.add(n * VOXELS_PER_SUM, portion);
    }
    if !coherence.suits_labels() {
        return Ok(None);
    }
    let mut counts = LabelCounts::new();
    for portion in portions() {
        monitor.check()?;
        counts.add(portion);
    }
    Ok(counts.labels())
}

/// Whether a voxel has a label: not background and not missing.
fn is_labelled(voxel: f32) -> bool {
    // Comparisons with NaN are false.
    (voxel < 0.0) | (voxel > 0.0)
}

/// The exact value of a voxel that carries no label: a missing value or a fraction.
pub(super) const NO_LABEL: i64 = i64::MIN;

/// Counts of neighbours along i with different labels. Exact for volumes of whole numbers.
pub(super) struct Coherence {
    /// Voxels per row.
    row: usize,
    /// The last voxel added.
    last: f32,
    labelled: u64,
    /// Labelled voxels whose predecessor in the row has another label.
    ///
    /// A voxel next to background counts as coherent: only a neighbour with another label is
    /// evidence against a label map.
    conflicts: u64,
}

impl Coherence {
    /// No voxel yet, of rows of `row` voxels.
    pub(super) fn new(row: usize) -> Self {
        Self {
            row: row.max(1),
            last: 0.0,
            labelled: 0,
            conflicts: 0,
        }
    }

    /// Adds the voxels that follow on the first `before` voxels of the volume.
    pub(super) fn add(&mut self, before: usize, voxels: &[f32]) {
        let conflict = |a: f32, b: f32| u32::from(is_labelled(a) & is_labelled(b) & (a != b));
        let within = before % self.row;
        // The rest of a row that an earlier portion began, then whole rows.
        let (begun, rows) = match within {
            0 => (&[][..], voxels),
            _ => voxels.split_at(voxels.len().min(self.row - within)),
        };
        if let [next, ..] = begun {
            self.conflicts += u64::from(conflict(self.last, *next));
        }
        for line in std::iter::once(begun).chain(rows.chunks(self.row)) {
            // Sums of `u32` fill the lanes of the vector unit; a row has less than 2^32 voxels.
            let labelled: u32 = line.iter().map(|v| u32::from(is_labelled(*v))).sum();
            let pairs = line.iter().zip(line.iter().skip(1));
            let conflicts: u32 = pairs.map(|(a, b)| conflict(*a, *b)).sum();
            self.labelled += u64::from(labelled);
            self.conflicts += u64::from(conflicts);
        }
        self.last = voxels.last().copied().unwrap_or(self.last);
    }

    /// Whether there are labels, and neighbours are mostly alike.
    pub(super) fn suits_labels(&self) -> bool {
        let alike = self.labelled - self.conflicts;
        self.labelled > 0 && alike as f64 >= LEAST_COHERENCE * self.labelled as f64
    }
}

/// Labels below this number are counted in an array.
const SMALL_LABELS: usize = 4096;

/// Voxels of a label and the runs that they make up in array order.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct LabelRuns {
    voxels: u64,
    runs: u64,
}

/// Voxels of each label.
pub(super) struct LabelCounts {
    small: Vec<LabelRuns>,
    other: BTreeMap<i64, LabelRuns>,
    /// Number of different labels.
    different: usize,
    /// The last voxel added.
    last: Option<i64>,
}

impl LabelCounts {
    /// No voxel yet.
    pub(super) fn new() -> Self {
        Self {
            small: vec![LabelRuns::default(); SMALL_LABELS],
            other: BTreeMap::new(),
            different: 0,
            last: None,
        }
    }

    /// Adds voxels, which are whole. After too many different labels nothing is counted any more.
    pub(super) fn add(&mut self, voxels: &[f32]) {
        for run in voxels.chunk_by(|a, b| a == b) {
            let label = is_labelled(run[0]).then_some(run[0] as i64);
            self.add_run(label, run.len());
        }
    }

    /// Adds voxels by their exact labels; [`NO_LABEL`] and 0 are none.
    pub(super) fn add_exact(&mut self, labels: &[i64]) {
        for run in labels.chunk_by(|a, b| a == b) {
            let label = Some(run[0]).filter(|label| !matches!(*label, 0 | NO_LABEL));
            self.add_run(label, run.len());
        }
    }

    fn add_run(&mut self, label: Option<i64>, length: usize) {
        let continues = self.last == label;
        self.last = label;
        let Some(label) = label else {
            return;
        };
        if self.different > MOST_LABELS {
            return;
        }
        let small = usize::try_from(label).ok();
        let count = match small.and_then(|label| self.small.get_mut(label)) {
            Some(count) => count,
            None => self.other.entry(label).or_default(),
        };
        self.different += usize::from(count.voxels == 0);
        count.voxels += length as u64;
        count.runs += u64::from(!continues);
    }

    /// The labels in rising order; `None` if there are too many, or so many that they are intensities.
    pub(super) fn labels(self) -> Option<Vec<LabelCount>> {
        let of = |(label, count): (&i64, &LabelRuns)| (*label, *count);
        let negative = self.other.range(..0).map(of);
        let small = (0..).zip(self.small.iter().copied());
        let large = self.other.range(0..).map(of);
        let all = negative.chain(small).chain(large);
        let present: Vec<_> = all.filter(|(_, count)| count.voxels > 0).collect();
        let runs = present
            .iter()
            .map(|(_, c)| (c.voxels as usize, c.runs as usize));
        let pieces = self.different <= FEW_LABELS || many_are_pieces(runs, false);
        (self.different <= MOST_LABELS && pieces).then(|| {
            let count = |(label, LabelRuns { voxels, .. })| LabelCount { label, voxels };
            present.into_iter().map(count).collect()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64;

    #[test]
    fn figures_are_those_of_the_definition() {
        let s = summarise(&[1.0, f32::NAN, -2.0, 4.5], 4);
        assert_eq!((s.minimum, s.maximum, s.sum), (-2.0, 4.5, 3.5));
        assert_eq!((s.finite, s.missing, s.mean), (3, 1, 3.5 / 3.0));
        assert!(!s.integral && s.labels.is_none());
    }

    #[test]
    fn portions_add_up() {
        let n = 3 * VOXELS_PER_SUM + 17;
        let voxels: Vec<f32> = (0..n).map(|i| (i % 7) as f32).collect();
        let sum: f64 = voxels.iter().map(|&v| f64::from(v)).sum();
        let s = summarise(&voxels, 128);
        assert_eq!((s.sum, s.minimum, s.maximum), (sum, 0.0, 6.0));
        assert_eq!((s.finite, s.missing, s.integral), (n as u64, 0, true));
    }

    #[test]
    fn whole_portions_have_the_same_figures() {
        for n in [1, VALUES_PER_CHECK, 2 * VOXELS_PER_SUM + 17] {
            let voxels: Vec<f32> = (0..n).map(|i| (i * 37 % 4001) as f32 - 300.0).collect();
            let (mut any, mut whole) = (Tally::default(), Tally::default());
            for portion in voxels.chunks(VOXELS_PER_SUM) {
                any.add_portion(portion);
                whole.add_whole_portion(portion);
            }
            assert_eq!(
                any.with_labels(&voxels, 128, &Monitor::silent()),
                whole.with_labels(&voxels, 128, &Monitor::silent())
            );
            assert!(whole.summary(None).integral);
        }
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

    /// Whether labels beyond 256 are pieces, by the definition: of the runs in array order, without those
    /// of the most frequent label.
    fn many_by_definition(voxels: &[f32], counts: &BTreeMap<i64, u64>) -> bool {
        let most = counts.iter().max_by_key(|(label, n)| (**n, **label));
        let (mut labelled, mut same) = (0_u64, 0_u64);
        for (n, &voxel) in voxels.iter().enumerate() {
            if voxel.is_nan() || voxel == 0.0 || Some(&(voxel as i64)) == most.map(|(l, _)| l) {
                continue;
            }
            labelled += 1;
            same += u64::from(n > 0 && voxels[n - 1] as i64 == voxel as i64);
        }
        labelled >= 1000 && same as f64 >= 0.6 * labelled as f64
    }

    /// The definition of labels, without regard to speed.
    fn labels_by_definition(voxels: &[f32], row: usize) -> Option<Vec<LabelCount>> {
        let mut counts: BTreeMap<i64, u64> = BTreeMap::new();
        let (mut labelled, mut alike) = (0_u64, 0_u64);
        for line in voxels.chunks(row.max(1)) {
            let mut previous = f32::NAN;
            for &voxel in line {
                if voxel.is_nan() || voxel == 0.0 {
                    previous = f32::NAN;
                    continue;
                }
                *counts.entry(voxel as i64).or_default() += 1;
                labelled += 1;
                alike += u64::from(previous.is_nan() || previous == voxel);
                previous = voxel;
            }
        }
        let coherent = alike as f64 >= LEAST_COHERENCE * labelled as f64;
        let few = counts.len() <= FEW_LABELS
            || counts.len() <= MOST_LABELS && many_by_definition(voxels, &counts);
        (labelled > 0 && few && coherent).then(|| {
            let count = |(label, voxels)| LabelCount { label, voxels };
            counts.into_iter().map(count).collect()
        })
    }

    #[test]
    fn labels_are_those_of_the_definition() {
        let mut random = Pcg64::seed_from_u64(7);
        let rare = [
            f32::NAN,
            -0.0,
            -1.0,
            4095.0,
            4096.0,
            -1e30,
            1e30,
            f32::INFINITY,
        ];
        let (mut some, mut none) = (0, 0);
        for round in 0..400 {
            // Runs of random lengths across the ends of rows and portions.
            let row = [1, 2, 7, 64, 1000][round % 5];
            let longest = [1, 2, 3, 9, 5000][round / 5 % 5];
            let kinds = [1, 3, 255, 256, 257, 5000][round % 6];
            let length = if round % 40 == 4 {
                2 * VOXELS_PER_SUM + 333
            } else {
                random.random_range(0..4000)
            };
            let mut voxels = Vec::new();
            while voxels.len() < length {
                let value = match random.random_range(0..50) {
                    0 => rare[random.random_range(0..rare.len())],
                    1..15 => 0.0,
                    _ => random.random_range(1..=kinds) as f32,
                };
                let run = random.random_range(1..=longest).min(length - voxels.len());
                voxels.extend(std::iter::repeat_n(value, run));
            }
            let expected = labels_by_definition(&voxels, row);
            match &expected {
                Some(_) => some += 1,
                None => none += 1,
            }
            let found = labels(&voxels, row, &Monitor::silent()).unwrap();
            assert_eq!(found, expected, "round {round}");
            // The same in portions of other lengths.
            let mut coherence = Coherence::new(row);
            let (mut before, mut counts) = (0, LabelCounts::new());
            for portion in voxels.chunks(97) {
                coherence.add(before, portion);
                counts.add(portion);
                before += portion.len();
            }
            let found = coherence.suits_labels().then(|| counts.labels()).flatten();
            assert_eq!(found, expected, "round {round} in portions");
        }
        assert!(some > 50 && none > 50, "{some} with labels, {none} without");
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
