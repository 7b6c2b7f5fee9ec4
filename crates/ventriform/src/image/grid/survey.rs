//! Range of a volume, missing values, and whether it is a label map.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::volume::Volume;

/// More distinct values than this are intensities, unless they are a label map beyond doubt.
const FEW_LABELS: usize = 256;
/// More distinct values than this are intensities.
pub const MOST_LABELS: usize = 1 << 16;
/// Least share of the voxels of the labels, without those of the most frequent one, whose next voxel
/// along i carries the same label, in a map of more than [`FEW_LABELS`] labels. The most frequent one
/// is left out because the air of a CT is as even as a label.
const PIECEWISE_OF_MANY: f64 = 0.6;
/// Labelled voxels from which the share says something.
const MIN_LABELLED_VOXELS: usize = 1000;
/// Least share of labelled voxels whose next voxel along i carries the same label: a label map
/// consists of pieces, an image with few counts does not.
const MIN_PIECEWISE_SHARE: f64 = 0.5;

/// Voxels between two looks at the cancel token.
const VOXELS_PER_CHECK: usize = 1 << 18;
/// Rows of voxels between two looks at the cancel token.
const ROWS_PER_CHECK: usize = 1024;

/// The content of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct Survey {
    /// Smallest value that is not NaN or infinite; 0 where there is none.
    pub minimum: f32,
    /// Largest value that is not NaN or infinite; 0 where there is none.
    pub maximum: f32,
    /// Voxels that are NaN or infinite.
    pub not_finite: usize,
    /// Number of voxels that are finite.
    pub finite: usize,
    /// Voxel counts of the labels other than 0, if this is a label map.
    pub labels: Option<BTreeMap<i64, usize>>,
}

/// Finds the range of `volume`, counts the missing values, and counts the labels if it is a label
/// map.
///
/// # Errors
/// [`Cancelled`].
pub fn survey(volume: &Volume, monitor: &Monitor) -> Result<Survey, Cancelled> {
    let (minimum, maximum, not_finite) = range(&volume.voxels, monitor)?;
    let finite = volume.voxels.len() - not_finite;
    Ok(Survey {
        minimum,
        maximum,
        not_finite,
        finite,
        labels: label_map(volume, monitor)?,
    })
}

/// Smallest and largest finite value (0 where there is none), and how many are not finite.
///
/// # Errors
/// [`Cancelled`].
pub fn range(values: &[f32], monitor: &Monitor) -> Result<(f32, f32, usize), Cancelled> {
    let parts: Vec<(f32, f32, usize)> = values
        .par_chunks(1 << 18)
        .map(|part| {
            monitor.check()?;
            Ok(range_of_part(part))
        })
        .collect::<Result<_, Cancelled>>()?;
    let minimum = parts.iter().map(|p| p.0).fold(f32::INFINITY, f32::min);
    let maximum = parts.iter().map(|p| p.1).fold(f32::NEG_INFINITY, f32::max);
    let not_finite = parts.iter().map(|p| p.2).sum();
    Ok(if not_finite == values.len() {
        (0.0, 0.0, not_finite)
    } else {
        (minimum, maximum, not_finite)
    })
}

fn range_of_part(values: &[f32]) -> (f32, f32, usize) {
    let (mut minimum, mut maximum) = (f32::INFINITY, f32::NEG_INFINITY);
    let mut not_finite = 0;
    for chunk in values.chunks(1 << 10) {
        // Branchless and in lanes, so that it vectorises; 0 · NaN and 0 · ∞ are NaN and stay.
        const PARALLEL_VALUES: usize = 16;
        let mut lows = [f32::INFINITY; PARALLEL_VALUES];
        let mut highs = [f32::NEG_INFINITY; PARALLEL_VALUES];
        let mut sums = [0f32; PARALLEL_VALUES];
        let (groups, rest) = chunk.as_chunks::<PARALLEL_VALUES>();
        // Values that do not fill the lanes are read twice.
        let mut last = [chunk[0]; PARALLEL_VALUES];
        last[..rest.len()].copy_from_slice(rest);
        for group in groups.iter().chain([&last]) {
            for l in 0..PARALLEL_VALUES {
                let v = group[l];
                lows[l] = if v < lows[l] { v } else { lows[l] };
                highs[l] = if v > highs[l] { v } else { highs[l] };
                sums[l] += v * 0.0;
            }
        }
        let mut low = lows.into_iter().fold(f32::INFINITY, f32::min);
        let mut high = highs.into_iter().fold(f32::NEG_INFINITY, f32::max);
        if sums.iter().any(|s| s.is_nan()) {
            (low, high) = (f32::INFINITY, f32::NEG_INFINITY);
            for &v in chunk {
                if v.is_finite() {
                    low = low.min(v);
                    high = high.max(v);
                } else {
                    not_finite += 1;
                }
            }
        }
        minimum = minimum.min(low);
        maximum = maximum.max(high);
    }
    (minimum, maximum, not_finite)
}

/// Voxels of a label and the runs along i that they make up.
#[derive(Debug, Clone, Copy, Default)]
struct LabelRuns {
    voxels: usize,
    runs: usize,
}

/// Whether the labels of a map of more than 256 are pieces: of their voxels, without those of the most
/// frequent label, three fifths continue a run. `counts` has the voxels and runs of each label. Too few
/// voxels tell nothing; then `undecided`.
pub fn many_are_pieces(counts: impl Iterator<Item = (usize, usize)>, undecided: bool) -> bool {
    let (mut voxels, mut runs, mut greatest) = (0, 0, (0, 0));
    for label in counts {
        voxels += label.0;
        runs += label.1;
        greatest = greatest.max(label);
    }
    let (voxels, runs) = (voxels - greatest.0, runs - greatest.1);
    if voxels < MIN_LABELLED_VOXELS {
        return undecided;
    }
    (voxels - runs) as f64 >= PIECEWISE_OF_MANY * voxels as f64
}

/// Counts the voxels of every label but 0; `None` if the values are intensities. Missing values count
/// as 0.
///
/// # Errors
/// [`Cancelled`].
pub fn label_map(
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Option<BTreeMap<i64, usize>>, Cancelled> {
    let mut counts: BTreeMap<i64, LabelRuns> = BTreeMap::new();
    let pieces = |counts: &BTreeMap<i64, LabelRuns>, undecided| {
        many_are_pieces(counts.values().map(|l| (l.voxels, l.runs)), undecided)
    };
    let (mut labelled, mut same) = (0usize, 0usize);
    let mut many = false;
    for (index, row) in volume.voxels.chunks(volume.shape[0]).enumerate() {
        if index.is_multiple_of(ROWS_PER_CHECK) {
            monitor.check()?;
            if many && !pieces(&counts, true) {
                return Ok(None);
            }
        }
        for run in row.chunk_by(|a, b| a == b || a.is_nan() && b.is_nan()) {
            let value = run[0];
            if value == 0.0 || value.is_nan() {
                continue;
            }
            // Beyond 2^63 there are no labels.
            if value.fract() != 0.0 || !(value.abs() < 9.2e18) {
                return Ok(None);
            }
            let label = counts.entry(value as i64).or_default();
            label.voxels += run.len();
            label.runs += 1;
            labelled += run.len();
            same += run.len() - 1;
            let grainy = labelled > MIN_LABELLED_VOXELS && (same as f64) < 0.25 * labelled as f64;
            if counts.len() > MOST_LABELS || grainy {
                return Ok(None);
            }
            if counts.len() > FEW_LABELS && !many {
                many = true;
                if !pieces(&counts, true) {
                    return Ok(None);
                }
            }
        }
    }
    // A constant volume is no label map.
    let everything = labelled == volume.voxels.len() && counts.len() == 1;
    let piecewise = if many {
        pieces(&counts, false)
    } else {
        counts.len() <= 1 || same as f64 >= MIN_PIECEWISE_SHARE * labelled as f64
    };
    let counts = counts.into_iter().map(|(label, l)| (label, l.voxels));
    Ok((labelled > 0 && piecewise && !everything).then(|| counts.collect()))
}

/// The voxels of every value if all are whole numbers, 0 and the background among them; `None` for
/// intensities. Unlike [`label_map`] it asks nothing of how they lie. Missing values are not counted.
///
/// # Errors
/// [`Cancelled`].
pub fn whole_values(
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Option<BTreeMap<i64, usize>>, Cancelled> {
    let mut counts: BTreeMap<i64, usize> = BTreeMap::new();
    for portion in volume.voxels.chunks(VOXELS_PER_CHECK) {
        monitor.check()?;
        for run in portion.chunk_by(|a, b| a == b) {
            let value = run[0];
            if value.is_nan() {
                continue;
            }
            if value.fract() != 0.0 || !(value.abs() < 9.2e18) || counts.len() > MOST_LABELS {
                return Ok(None);
            }
            *counts.entry(value as i64).or_default() += run.len();
        }
    }
    Ok((!counts.is_empty() && counts.len() <= MOST_LABELS).then_some(counts))
}

/// The objects of a map with the label counts `labels` (0 left out), and the value of its background.
///
/// The background is 0, unless most of the volume's border has another value that cannot be an object:
/// a negative one, one of a map without any 0, or one that nine tenths of the border have. Then 0 is
/// an object like any other.
///
/// # Errors
/// [`Cancelled`].
pub fn objects(
    volume: &Volume,
    labels: &BTreeMap<i64, usize>,
    monitor: &Monitor,
) -> Result<(BTreeMap<i64, usize>, i64), Cancelled> {
    let value = |v: f32| if v.is_nan() { 0 } else { v as i64 };
    let [nx, ny, nz] = volume.shape;
    let mut border: BTreeMap<i64, usize> = BTreeMap::new();
    let mut all = 0;
    for (row, voxels) in volume.voxels.chunks(nx).enumerate() {
        if row.is_multiple_of(ROWS_PER_CHECK) {
            monitor.check()?;
        }
        let (j, k) = (row % ny, row / ny);
        let whole = j == 0 || k == 0 || j + 1 == ny || k + 1 == nz;
        let ends = [voxels[0], voxels[nx - 1]];
        let seen = if whole { voxels } else { &ends[..] };
        all += seen.len();
        for run in seen.chunk_by(|a, b| a == b) {
            *border.entry(value(run[0])).or_default() += run.len();
        }
    }
    let most = border
        .iter()
        .max_by_key(|(label, n)| (**n, std::cmp::Reverse(**label)));
    let (outer, share) = most.map_or((0, 0.0), |(l, n)| (*l, *n as f64 / all as f64));
    let zeros = volume.voxels.len() - labels.values().sum::<usize>();
    let surrounds = match zeros {
        0 => share > 0.5,
        _ => outer < 0 && share > 0.5 || share >= 0.9,
    };
    let mut objects = labels.clone();
    if outer == 0 || !surrounds {
        return Ok((objects, 0));
    }
    objects.remove(&outer);
    // Missing values are no object.
    let mut zeros = 0;
    for portion in volume.voxels.chunks(VOXELS_PER_CHECK) {
        monitor.check()?;
        zeros += portion.iter().filter(|v| **v == 0.0).count();
    }
    if zeros > 0 {
        objects.insert(0, zeros);
    }
    Ok((objects, outer))
}

/// Otsu's threshold of the values in `rows` (IEEE SMC 1979), 256 bins between minimum and
/// maximum.
///
/// # Errors
/// [`Cancelled`].
pub fn otsu(
    rows: &[&[f32]],
    minimum: f32,
    maximum: f32,
    monitor: &Monitor,
) -> Result<f32, Cancelled> {
    const HISTOGRAM_BINS: usize = 256;
    let (low, width) = (f64::from(minimum), f64::from(maximum) - f64::from(minimum));
    let scale = HISTOGRAM_BINS as f64 / width;
    let counted = |rows: &[&[f32]]| {
        monitor.check()?;
        let mut histogram = [0u64; HISTOGRAM_BINS];
        for v in rows.iter().flat_map(|row| row.iter()) {
            if v.is_finite() {
                let bin = ((f64::from(*v) - low) * scale) as usize;
                histogram[bin.min(HISTOGRAM_BINS - 1)] += 1;
            }
        }
        Ok(histogram)
    };
    let histogram = rows.par_chunks(256).map(counted).try_reduce(
        || [0; HISTOGRAM_BINS],
        |a, b| Ok(std::array::from_fn(|bin| a[bin] + b[bin])),
    )?;
    let total = histogram.iter().sum::<u64>() as f64;
    let weighted = |(bin, n): (usize, &u64)| bin as f64 * *n as f64;
    let all: f64 = histogram.iter().enumerate().map(weighted).sum();
    let (mut below, mut sum) = (0.0, 0.0);
    let mut best = (f64::NEG_INFINITY, 0);
    for bin in 0..HISTOGRAM_BINS {
        below += histogram[bin] as f64;
        sum += bin as f64 * histogram[bin] as f64;
        let above = total - below;
        if below > 0.0 && above > 0.0 {
            let between = below * above * (sum / below - (all - sum) / above).powi(2);
            if between > best.0 {
                best = (between, bin);
            }
        }
    }
    Ok((low + (best.1 as f64 + 1.0) / HISTOGRAM_BINS as f64 * width) as f32)
}

#[cfg(test)]
mod tests {
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::grid::survey::*;

    fn volume(shape: [usize; 3], value: impl Fn(usize) -> f32) -> Volume {
        Volume {
            shape,
            voxels: (0..shape.iter().product()).map(value).collect(),
            frame: VoxelToPatient::centred(shape, [1.0; 3], Vec3::zeros()).unwrap(),
            integral: true,
        }
    }

    #[test]
    fn label_maps_are_told_from_counts() {
        let map = volume([20, 4, 2], |n| ((n / 10) % 3) as f32);
        let labels = survey(&map, &Monitor::silent()).unwrap().labels.unwrap();
        assert_eq!(labels.keys().copied().collect::<Vec<_>>(), [1, 2]);
        let labelled = map.voxels.iter().filter(|v| **v > 0.0).count();
        assert_eq!(labels.values().sum::<usize>(), labelled);
        let counts = volume([40, 40, 2], |n| ((n * 7919) % 23) as f32);
        assert_eq!(survey(&counts, &Monitor::silent()).unwrap().labels, None);
        assert_eq!(
            survey(&volume([20, 4, 2], |n| n as f32 * 0.5), &Monitor::silent())
                .unwrap()
                .labels,
            None
        );
        assert_eq!(
            survey(&volume([20, 4, 2], |_| 3.0), &Monitor::silent())
                .unwrap()
                .labels,
            None
        );
    }

    #[test]
    fn many_labels_are_told_from_counts() {
        // 512 and 8000 blocks, numbered from 1 and beyond 2^24.
        for (across, first) in [(8, 1_usize), (20, 1), (8, 1 << 25)] {
            let side = 3 * across;
            let blocks = volume([side; 3], |n| {
                let [i, j, k] = [n % side, n / side % side, n / side / side].map(|x| x / 3);
                // Steps of 4: 32-bit floats tell them apart up to 2^26.
                (first + 4 * (i + across * (j + across * k))) as f32
            });
            let labels = survey(&blocks, &Monitor::silent()).unwrap().labels.unwrap();
            assert_eq!(labels.len(), across.pow(3));
            assert!(labels.values().all(|n| *n == 27));
        }
        // Counts of more than 256 kinds, smooth ones, and tissue in even air.
        for of in [
            |n: usize| ((n * 7919) % 997) as f32,
            |n: usize| (n % 60 + n / 60 % 60 + n / 3600) as f32 * 3.0,
            |n: usize| {
                if n % 60 < 45 {
                    -1024.0
                } else {
                    ((n * 31) % 1511) as f32
                }
            },
        ] {
            let scan = volume([60, 60, 60], of);
            assert_eq!(survey(&scan, &Monitor::silent()).unwrap().labels, None);
        }
    }

    #[test]
    fn the_background_is_what_surrounds() {
        let ball = |inside: f32, outside: f32| {
            volume([21; 3], move |n| {
                let centre = [n % 21, n / 21 % 21, n / 441].map(|x| x as f64 - 10.0);
                let within = centre.iter().map(|x| x * x).sum::<f64>() < 49.0;
                if within { inside } else { outside }
            })
        };
        let found = |v: &Volume| {
            let labels = label_map(v, &Monitor::silent()).unwrap().unwrap();
            let (objects, background) = objects(v, &labels, &Monitor::silent()).unwrap();
            (objects.into_keys().collect::<Vec<_>>(), background)
        };
        assert_eq!(found(&ball(1.0, 0.0)), (vec![1], 0));
        assert_eq!(found(&ball(255.0, f32::NAN)), (vec![255], 0));
        assert_eq!(found(&ball(-1.0, 0.0)), (vec![-1], 0));
        assert_eq!(found(&ball(1.0, -1.0)), (vec![1], -1));
        assert_eq!(found(&ball(0.0, -1.0)), (vec![0], -1));
        assert_eq!(found(&ball(7.0, -1024.0)), (vec![7], -1024));
        assert_eq!(found(&ball(0.0, 255.0)), (vec![0], 255));
        assert_eq!(found(&ball(2.0, 1.0)), (vec![2], 1));
        // An object that is cut off at the border stays one.
        let slab = volume([20, 20, 20], |n| f32::from(u8::from(n % 20 < 12)));
        assert_eq!(found(&slab), (vec![1], 0));
    }

    #[test]
    fn range_skips_what_is_not_finite() {
        let odd = volume([50, 10, 10], |n| match n {
            7 => f32::NAN,
            4500 => f32::INFINITY,
            n => 0.5 - n as f32,
        });
        let seen = survey(&odd, &Monitor::silent()).unwrap();
        assert_eq!(
            (seen.minimum, seen.maximum, seen.not_finite),
            (-4998.5, 0.5, 2)
        );
    }

    #[test]
    fn otsu_separates_two_clusters() {
        let values: Vec<f32> = (0..1000)
            .map(|n| if n % 4 == 0 { 9.0 } else { 1.0 } + (n % 10) as f32 * 0.05)
            .collect();
        let rows: Vec<&[f32]> = values.chunks(100).collect();
        let level = otsu(&rows, 1.0, 9.45, &Monitor::silent()).unwrap();
        assert!((1.45..=9.0).contains(&level), "{level}");
    }
}
