//! Lists of numbers as summaries and histograms.

use serde::{Deserialize, Serialize};

use crate::base::numeric::order::quantile;
use crate::base::numeric::round_step::round_step;

/// Mean, spread and percentiles of a list of numbers. All zero for an empty list.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Summary {
    /// Arithmetic mean.
    pub mean: f64,
    /// Root of the mean square.
    pub rms: f64,
    /// Standard deviation over the mean.
    pub cv: f64,
    /// Smallest.
    pub min: f64,
    /// 5th percentile.
    pub p5: f64,
    /// 50th percentile.
    pub median: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Summary {
    /// The summary of `values`. Sums run in their order.
    pub fn from_values(values: &[f64]) -> Self {
        if values.is_empty() {
            return Self::default();
        }
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let variance = values.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n;
        let mut sorted = values.to_vec();
        sorted.sort_unstable_by(f64::total_cmp);
        Self {
            mean,
            rms: (mean * mean + variance).sqrt(),
            cv: if mean == 0.0 {
                0.0
            } else {
                variance.sqrt() / mean
            },
            min: sorted[0],
            p5: quantile(&sorted, 0.05),
            median: quantile(&sorted, 0.5),
            p95: quantile(&sorted, 0.95),
            max: sorted[sorted.len() - 1],
        }
    }
}

/// Counts over equal bins, before and after optimisation side by side. The bin [lower,
/// lower + width) is the first; the last one includes its upper end.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema))]
pub struct Histogram {
    /// Lower end of the first bin.
    pub lower: f64,
    /// Width of a bin.
    pub width: f64,
    /// Counts of the re-tiled mesh.
    pub retiled: Vec<usize>,
    /// Counts of the optimised mesh.
    pub optimised: Vec<usize>,
}

impl Histogram {
    /// 20 to 42 bins of a round width over the range of both lists.
    pub fn continuous(retiled: &[f64], optimised: &[f64]) -> Self {
        let (min, max) = range(retiled, optimised);
        let width = round_step((max - min) / 40.0);
        Self::with_bins(
            (min / width).floor() * width,
            max,
            width,
            retiled,
            optimised,
        )
    }

    /// One bin for each whole number.
    pub fn discrete(retiled: &[f64], optimised: &[f64]) -> Self {
        let (min, max) = range(retiled, optimised);
        Self::with_bins(min.floor(), max, 1.0, retiled, optimised)
    }

    fn with_bins(lower: f64, max: f64, width: f64, retiled: &[f64], optimised: &[f64]) -> Self {
        let bins = ((max - lower) / width).floor() as usize + 1;
        let count = |values: &[f64]| {
            let mut counts = vec![0; bins];
            for x in values {
                let bin = ((x - lower) / width) as usize;
                counts[bin.min(bins - 1)] += 1;
            }
            counts
        };
        Self {
            lower,
            width,
            retiled: count(retiled),
            optimised: count(optimised),
        }
    }
}

/// Smallest and largest finite number of both lists; (0, 0) without any.
fn range(a: &[f64], b: &[f64]) -> (f64, f64) {
    let finite = || a.iter().chain(b).copied().filter(|x| x.is_finite());
    let min = finite().fold(f64::INFINITY, f64::min);
    let max = finite().fold(f64::NEG_INFINITY, f64::max);
    if min <= max { (min, max) } else { (0.0, 0.0) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_linear_between_neighbours() {
        let summary = Summary::from_values(&[4.0, 1.0, 3.0, 2.0, 5.0]);
        assert_eq!((summary.min, summary.median, summary.max), (1.0, 3.0, 5.0));
        assert!((summary.p5 - 1.2).abs() < 1e-12);
        assert!((summary.p95 - 4.8).abs() < 1e-12);
        assert!((summary.rms - 11f64.sqrt()).abs() < 1e-12);
        assert!((summary.cv - 2f64.sqrt() / 3.0).abs() < 1e-12);
        assert_eq!(Summary::from_values(&[]), Summary::default());
    }

    #[test]
    fn every_number_falls_into_its_bin() {
        let before: Vec<f64> = (0..1000).map(|i| f64::from(i) * 0.0371).collect();
        let after = [3.0, 17.2, 41.0];
        let histogram = Histogram::continuous(&before, &after);
        assert_eq!(histogram.retiled.iter().sum::<usize>(), before.len());
        assert_eq!(histogram.optimised.iter().sum::<usize>(), after.len());
        assert!((20..=42).contains(&histogram.retiled.len()));
        for (bin, &count) in histogram.retiled.iter().enumerate() {
            let lower = histogram.lower + histogram.width * bin as f64;
            let inside = |x: &&f64| (lower..lower + histogram.width).contains(*x);
            assert_eq!(before.iter().filter(inside).count(), count);
        }
    }

    #[test]
    fn equal_numbers_and_none_at_all_make_a_histogram_too() {
        assert_eq!(Histogram::discrete(&[6.0; 4], &[6.0]).retiled, [4]);
        assert_eq!(Histogram::continuous(&[0.5], &[0.5]).optimised, [1]);
        assert_eq!(Histogram::continuous(&[], &[]).retiled, [0]);
    }
}
