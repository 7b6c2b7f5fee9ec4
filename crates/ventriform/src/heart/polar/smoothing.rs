//! Means over neighbouring places of a map.

use super::{RAY_COLUMNS, RAY_ROWS};

/// A Gaussian over the rows and the columns of a map.
#[derive(Debug, Clone)]
pub struct MapGaussian {
    /// Weights of rows 0, 1, 2, ... away.
    rows: Vec<f64>,
    /// Weights of columns 0, 1, 2, ... away.
    columns: Vec<f64>,
}

impl MapGaussian {
    /// With these standard deviations, and as many rows and columns on either side: at most [`RAY_ROWS`] and half of
    /// [`RAY_COLUMNS`].
    pub fn new(sigma: [f64; 2], reach: [usize; 2]) -> Self {
        let weights = |sigma: f64, reach: usize| -> Vec<f64> {
            (0..=reach)
                .map(|step| (-0.5 * (step as f64 / sigma).powi(2)).exp())
                .collect()
        };
        let [rows, columns] = [0, 1].map(|axis| weights(sigma[axis], reach[axis]));
        Self { rows, columns }
    }

    /// The means of `values` about every place, row by row from apex to base, each by its own weight and the Gaussian;
    /// 0 where no place about has a weight.
    pub fn means(&self, values: &[f64], weights: &[f64]) -> Vec<f64> {
        let weighted: Vec<f64> = (values.iter().zip(weights))
            .map(|(value, weight)| value * weight)
            .collect();
        let sums = self.sums(&weighted).into_iter().zip(self.sums(weights));
        sums.map(|(sum, weight)| if weight > 0.0 { sum / weight } else { 0.0 })
            .collect()
    }

    fn sums(&self, values: &[f64]) -> Vec<f64> {
        let along: Vec<f64> = (0..values.len())
            .map(|index| {
                let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
                let reach = self.rows.len() - 1;
                let near = row.saturating_sub(reach)..(row + reach + 1).min(RAY_ROWS);
                near.map(|other| {
                    self.rows[other.abs_diff(row)] * values[other * RAY_COLUMNS + column]
                })
                .sum()
            })
            .collect();
        (0..values.len())
            .map(|index| {
                let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
                let at = |column: usize| along[row * RAY_COLUMNS + column % RAY_COLUMNS];
                let beside = (1..self.columns.len()).map(|step| {
                    self.columns[step] * (at(column + step) + at(column + RAY_COLUMNS - step))
                });
                at(column) + beside.sum::<f64>()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against the definition, place by place.
    #[test]
    fn means_are_weighted_by_distance_and_by_the_places_own_weights() {
        let (sigma, reach) = ([1.2, 2.4], [4_i64, 8_i64]);
        let wave = |n: usize, by: f64| (n as f64 * by).sin();
        let count = RAY_ROWS * RAY_COLUMNS;
        let values: Vec<f64> = (0..count).map(|n| wave(n, 0.7)).collect();
        let weights: Vec<f64> = (0..count).map(|n| wave(n, 1.3).max(0.0)).collect();
        let found = MapGaussian::new(sigma, [4, 8]).means(&values, &weights);
        for index in (0..count).step_by(37) {
            let (row, column) = ((index / RAY_COLUMNS) as i64, (index % RAY_COLUMNS) as i64);
            let (mut sum, mut weight) = (0.0, 0.0);
            for r in (row - reach[0]).max(0)..=(row + reach[0]).min(RAY_ROWS as i64 - 1) {
                for c in column - reach[1]..=column + reach[1] {
                    let other =
                        r as usize * RAY_COLUMNS + c.rem_euclid(RAY_COLUMNS as i64) as usize;
                    let apart = [(r - row) as f64 / sigma[0], (c - column) as f64 / sigma[1]];
                    let own = weights[other] * (-0.5 * (apart[0].powi(2) + apart[1].powi(2))).exp();
                    sum += own * values[other];
                    weight += own;
                }
            }
            assert!((found[index] - sum / weight).abs() < 1e-12, "{index}");
        }
        assert!(MapGaussian::new(sigma, [4, 8]).means(&values, &vec![0.0; count])[0] == 0.0);
    }
}
