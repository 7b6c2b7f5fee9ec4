//! The object as one bit for each voxel, with a border of outside voxels around it.
//!
//! A [`Labels`] covers a box of the volume and one layer more on every side; that layer is
//! always outside, so the object's surface is always closed. Rows run along i and are packed
//! in 64-bit words; comparing neighbours is a shift of whole rows.

use rayon::prelude::*;

/// Inside/outside labels of the voxels of a box.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Labels {
    /// First voxel of the box in the volume.
    pub origin: [usize; 3],
    /// Voxels of the box along i, j, k; the border comes on top.
    pub extent: [usize; 3],
    words: usize,
    rows: [usize; 2],
    bits: Vec<u64>,
}

impl Labels {
    /// A box of `extent` voxels at `origin`, all outside.
    pub fn empty(origin: [usize; 3], extent: [usize; 3]) -> Self {
        // One bit of border on each side, and one more so that i + 1 always has a word.
        let words = (extent[0] + 2).div_ceil(64);
        let rows = [extent[1] + 2, extent[2] + 2];
        Self {
            origin,
            extent,
            words,
            rows,
            bits: vec![0; words * rows[0] * rows[1]],
        }
    }

    /// Labels every voxel of the box for which `values` (the volume's array of `shape`) is at
    /// least `level`. NaN is outside.
    pub fn threshold(
        values: &[f32],
        shape: [usize; 3],
        origin: [usize; 3],
        extent: [usize; 3],
        level: f32,
    ) -> Self {
        let mut labels = Self::empty(origin, extent);
        let (words, rows) = (labels.words, labels.rows[0]);
        labels
            .bits
            .par_chunks_mut(words * rows)
            .enumerate()
            .skip(1)
            .take(extent[2])
            .for_each(|(k, plane)| {
                for j in 0..extent[1] {
                    let start =
                        origin[0] + shape[0] * (origin[1] + j + shape[1] * (origin[2] + k - 1));
                    let row = &values[start..start + extent[0]];
                    pack(row, level, &mut plane[(j + 1) * words..(j + 2) * words]);
                }
            });
        labels
    }

    /// Words in a row.
    pub fn words(&self) -> usize {
        self.words
    }

    /// Rows in a plane and planes, border included.
    pub fn rows(&self) -> [usize; 2] {
        self.rows
    }

    /// Row (j, k), border included: bit i + 1 is voxel i of the box.
    pub fn row(&self, j: usize, k: usize) -> &[u64] {
        let start = (j + self.rows[0] * k) * self.words;
        &self.bits[start..start + self.words]
    }

    fn place(&self, [i, j, k]: [usize; 3]) -> (usize, u64) {
        let bit = i + 1;
        let row = (j + 1) + self.rows[0] * (k + 1);
        (row * self.words + bit / 64, 1 << (bit % 64))
    }

    /// Whether voxel `p` of the box is inside.
    pub fn get(&self, p: [usize; 3]) -> bool {
        let (word, bit) = self.place(p);
        self.bits[word] & bit != 0
    }

    /// Labels voxel `p` of the box.
    pub fn set(&mut self, p: [usize; 3], inside: bool) {
        let (word, bit) = self.place(p);
        if inside {
            self.bits[word] |= bit;
        } else {
            self.bits[word] &= !bit;
        }
    }

    /// Number of inside voxels.
    pub fn count(&self) -> usize {
        self.bits.iter().map(|w| w.count_ones() as usize).sum()
    }

    /// Inside voxels of the box in array order.
    pub fn voxels(&self) -> impl Iterator<Item = [usize; 3]> + '_ {
        (0..self.rows[1]).flat_map(|k| self.voxels_of_plane(k))
    }

    /// [`Self::voxels`] for many threads.
    pub fn par_voxels(&self) -> impl ParallelIterator<Item = [usize; 3]> + '_ {
        (0..self.rows[1])
            .into_par_iter()
            .flat_map_iter(|k| self.voxels_of_plane(k))
    }

    /// Inside voxels of plane `k`, border included in the number.
    fn voxels_of_plane(&self, k: usize) -> impl Iterator<Item = [usize; 3]> + '_ {
        let plane = self.words * self.rows[0];
        let bits = &self.bits[k * plane..(k + 1) * plane];
        bits.iter().enumerate().flat_map(move |(at, &word)| {
            let (j, word_in_row) = (at / self.words, at % self.words);
            set_bits(word).map(move |bit| [64 * word_in_row + bit - 1, j - 1, k - 1])
        })
    }

    /// Number of voxels that are inside in one and outside in the other.
    ///
    /// # Panics
    /// If the boxes differ.
    pub fn differing(&self, other: &Self) -> usize {
        assert_eq!((self.origin, self.extent), (other.origin, other.extent));
        self.bits
            .iter()
            .zip(&other.bits)
            .map(|(a, b)| (a ^ b).count_ones() as usize)
            .sum()
    }

    /// The smallest box (first voxel, extent, in the coordinates of this box) that holds the
    /// inside, or `None` for an empty object.
    pub fn bounds(&self) -> Option<([usize; 3], [usize; 3])> {
        let mut low = [usize::MAX; 3];
        let mut high = [0; 3];
        for k in 0..self.rows[1] {
            for j in 0..self.rows[0] {
                let row = self.row(j, k);
                let Some(first) = row.iter().position(|&w| w != 0) else {
                    continue;
                };
                let last = row.iter().rposition(|&w| w != 0).unwrap_or(first);
                let ends = [
                    64 * first + row[first].trailing_zeros() as usize,
                    64 * last + 63 - row[last].leading_zeros() as usize,
                ];
                for (axis, (a, b)) in [(ends[0], ends[1]), (j, j), (k, k)].into_iter().enumerate() {
                    low[axis] = low[axis].min(a);
                    high[axis] = high[axis].max(b);
                }
            }
        }
        (low[0] != usize::MAX).then(|| {
            (
                low.map(|l| l - 1),
                [0, 1, 2].map(|axis| high[axis] - low[axis] + 1),
            )
        })
    }

    /// The Euler characteristic of the object under 6-connectivity: voxels - pairs of
    /// face neighbours + 2×2 squares - 2×2×2 blocks. Components - handles + cavities.
    pub fn euler_characteristic(&self) -> i64 {
        let mut chi = 0i64;
        let mut shifted = vec![0u64; self.words];
        for k in 0..self.rows[1] - 1 {
            for j in 0..self.rows[0] - 1 {
                let rows = [
                    self.row(j, k),
                    self.row(j + 1, k),
                    self.row(j, k + 1),
                    self.row(j + 1, k + 1),
                ];
                if rows[0].iter().all(|&w| w == 0) {
                    continue;
                }
                for w in 0..self.words {
                    let plane = |r: &[u64]| (r[w], following(r, w));
                    let [(a, a1), (b, b1), (c, c1), (d, d1)] = rows.map(plane);
                    shifted[w] = a1;
                    let n = |x: u64| i64::from(x.count_ones());
                    chi += n(a) - n(a & a1) - n(a & b) - n(a & c);
                    chi += n(a & a1 & b & b1) + n(a & a1 & c & c1) + n(a & b & c & d);
                    chi -= n(a & a1 & b & b1 & c & c1 & d & d1);
                }
            }
        }
        chi
    }
}

/// Word `w` of the row moved by one voxel: bit b is voxel b + 1's.
pub fn following(row: &[u64], w: usize) -> u64 {
    row[w] >> 1 | row.get(w + 1).map_or(0, |next| next << 63)
}

/// The numbers of the set bits, ascending.
pub fn set_bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (word != 0).then(|| {
            let bit = word.trailing_zeros() as usize;
            word &= word - 1;
            bit
        })
    })
}

/// Writes `value >= level` of `row` into bits 1.. of `words`.
fn pack(row: &[f32], level: f32, words: &mut [u64]) {
    let mut carry = 0;
    for (chunk, word) in row.chunks(64).zip(words.iter_mut()) {
        let bits = pack_word(chunk, level);
        *word = bits << 1 | carry;
        carry = bits >> 63;
    }
    if carry != 0 {
        words[row.len() / 64] |= carry;
    }
}

fn pack_word(chunk: &[f32], level: f32) -> u64 {
    let mut bits = 0;
    for (eight, place) in chunk.chunks(8).zip((0..).step_by(8)) {
        let mut byte = 0u64;
        if let Ok(eight) = <[f32; 8]>::try_from(eight) {
            for b in 0..8 {
                byte |= u64::from(eight[b] >= level) << b;
            }
        } else {
            for (b, value) in eight.iter().enumerate() {
                byte |= u64::from(*value >= level) << b;
            }
        }
        bits |= byte << place;
    }
    bits
}

#[cfg(test)]
impl Labels {
    /// A shape to test with: `extent` voxels from the origin, those that `inside` names.
    pub fn of_shape(extent: [usize; 3], inside: impl Fn([usize; 3]) -> bool) -> Self {
        let mut labels = Labels::empty([0; 3], extent);
        for n in 0..extent.iter().product::<usize>() {
            let p = [
                n % extent[0],
                n / extent[0] % extent[1],
                n / extent[0] / extent[1],
            ];
            labels.set(p, inside(p));
        }
        labels
    }
}

#[cfg(test)]
mod tests {
    use crate::image::grid::labels::*;

    #[test]
    fn threshold_equals_one_comparison_for_each_voxel() {
        for nx in [1, 7, 61, 62, 63, 64, 65, 126, 127, 128, 130] {
            let shape = [nx, 3, 2];
            let values: Vec<f32> = (0..nx * 6).map(|n| ((n * 7919) % 13) as f32).collect();
            let labels = Labels::threshold(&values, shape, [0; 3], shape, 6.0);
            let plain = Labels::of_shape(shape, |[i, j, k]| values[i + nx * (j + 3 * k)] >= 6.0);
            assert_eq!(labels, plain, "{nx}");
            assert_eq!(labels.voxels().count(), labels.count());
            assert!(labels.voxels().all(|p| labels.get(p)));
            let in_parallel: Vec<[usize; 3]> = labels.par_voxels().collect();
            assert!(labels.voxels().eq(in_parallel));
        }
    }

    #[test]
    fn euler_characteristic_counts_components_handles_and_cavities() {
        let solid = Labels::of_shape([70, 4, 4], |_| true);
        assert_eq!(solid.euler_characteristic(), 1);
        let ring = Labels::of_shape([66, 5, 3], |[i, j, _]| {
            !((1..65).contains(&i) && (1..4).contains(&j))
        });
        assert_eq!(ring.euler_characteristic(), 0);
        let shell = Labels::of_shape([5, 5, 5], |p| p.iter().any(|&x| x == 0 || x == 4));
        assert_eq!(shell.euler_characteristic(), 2);
        // Two voxels that touch along an edge are two components.
        let pair = Labels::of_shape([2, 2, 1], |[i, j, _]| i == j);
        assert_eq!(pair.euler_characteristic(), 2);
    }

    #[test]
    fn bounds_are_tight() {
        let labels = Labels::of_shape([80, 6, 5], |p| p == [3, 2, 1] || p == [77, 4, 1]);
        assert_eq!(labels.bounds(), Some(([3, 2, 1], [75, 3, 1])));
        assert_eq!(Labels::empty([0; 3], [4; 3]).bounds(), None);
    }
}
