//! Figures over pairs of numbers.

/// The mean; 0 of nothing.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Pearson's correlation of two series.
pub fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let (mean_a, mean_b) = (mean(a), mean(b));
    let sum = |of: &dyn Fn(f64, f64) -> f64| -> f64 {
        a.iter()
            .zip(b)
            .map(|(a, b)| of(a - mean_a, b - mean_b))
            .sum()
    };
    sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt()
}

/// The chance that a figure of `ill` is greater than one of `well`; equal ones count half. NaN if there are
/// none of either.
pub fn area_under_curve(ill: &[f64], well: &[f64]) -> f64 {
    let greater = ill.iter().flat_map(|ill| {
        well.iter().map(move |well| {
            if ill > well {
                1.0
            } else if ill < well {
                0.0
            } else {
                0.5
            }
        })
    });
    greater.sum::<f64>() / (ill.len() * well.len()) as f64
}
