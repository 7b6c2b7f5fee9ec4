//! Order statistics, and sorting of as many values as a file may have.

use crate::base::progress::{Cancelled, Monitor};
use std::cmp::Ordering;

/// Values that are sorted, or merged, between two checks of the cancel token.
const VALUES_PER_CHECK: usize = 1 << 16;

/// Sorts values, of which those that compare equal are the same, until the caller cancels.
///
/// # Errors
/// [`Cancelled`]; the values are then in any order, and some may be there twice.
pub fn sort_watched<T: Copy>(
    values: &mut Vec<T>,
    compare: impl Fn(&T, &T) -> Ordering,
    monitor: &Monitor<'_>,
) -> Result<(), Cancelled> {
    for run in values.chunks_mut(VALUES_PER_CHECK) {
        monitor.check()?;
        run.sort_unstable_by(&compare);
    }
    let mut width = VALUES_PER_CHECK;
    let mut merged = Vec::new();
    while width < values.len() {
        merged.clear();
        merged.reserve(values.len());
        for pair in values.chunks(2 * width) {
            let (mut a, mut b) = pair.split_at(width.min(pair.len()));
            while let ([first, a_rest @ ..], [second, b_rest @ ..]) = (a, b) {
                if merged.len().is_multiple_of(VALUES_PER_CHECK) {
                    monitor.check()?;
                }
                if compare(second, first) == Ordering::Less {
                    merged.push(*second);
                    b = b_rest;
                } else {
                    merged.push(*first);
                    a = a_rest;
                }
            }
            merged.extend_from_slice(a);
            merged.extend_from_slice(b);
        }
        std::mem::swap(values, &mut merged);
        width *= 2;
    }
    Ok(())
}

/// The `q`-quantile, 0..=1, of ascending numbers: linear interpolation between the two neighbours
/// of place q (n - 1), as NumPy's default.
///
/// # Panics
/// If there are no numbers.
pub fn quantile(sorted: &[f64], q: f64) -> f64 {
    let place = q * (sorted.len() - 1) as f64;
    let below = place.floor() as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (sorted[above] - sorted[below]) * place.fract()
}

/// The least of these values below or at which `share`, 0..=1, of the weight lies; `None` without values. Each is a value
/// with its weight.
pub fn weighted_quantile(mut values: Vec<(f64, f64)>, share: f64) -> Option<f64> {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let all: f64 = values.iter().map(|(_, weight)| weight).sum();
    let mut below = 0.0;
    let found = values.iter().find(|(_, weight)| {
        below += weight;
        below >= share * all
    });
    found.map(|(value, _)| *value)
}

/// The middle one of these numbers in order; of two in the middle the greater.
///
/// # Panics
/// If there are no numbers.
pub fn upper_median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_of_twice_the_weight_counts_as_two() {
        let weighted = vec![(3.0, 1.0), (1.0, 2.0), (2.0, 1.0)];
        let each = |share| weighted_quantile(weighted.clone(), share);
        assert_eq!(
            [0.5, 0.6, 0.75, 1.0].map(each),
            [1.0, 2.0, 2.0, 3.0].map(Some)
        );
        assert_eq!(weighted_quantile(Vec::new(), 0.5), None);
    }

    #[test]
    fn many_values_are_sorted_as_few_are() {
        for count in [0, 1, 5, VALUES_PER_CHECK, 3 * VALUES_PER_CHECK + 7] {
            let mut values: Vec<u64> = (0..count as u64).map(|n| n * 7919 % 65_537).collect();
            let mut expected = values.clone();
            expected.sort_unstable();
            sort_watched(&mut values, u64::cmp, &Monitor::silent()).unwrap();
            assert!(values == expected, "{count}");
        }
    }

    #[test]
    fn quantiles_are_interpolated_between_neighbours() {
        let numbers = [1.0, 2.0, 4.0];
        assert_eq!(
            [0.0, 0.25, 0.5, 0.75, 1.0].map(|q| quantile(&numbers, q)),
            [1.0, 1.5, 2.0, 3.0, 4.0]
        );
        assert_eq!(quantile(&[7.0], 0.3), 7.0);
    }
}
