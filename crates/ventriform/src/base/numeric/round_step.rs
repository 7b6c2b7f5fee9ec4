//! Round numbers for the steps of scales and the bins of histograms.

/// The smallest of 1, 2, 5 times a power of ten that is not below `width`; 1 for 0 and less.
pub fn round_step(width: f64) -> f64 {
    if !(width > 0.0) {
        return 1.0;
    }
    let power = 10f64.powf(width.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= width)
        .unwrap_or(10.0);
    factor * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_the_next_round_number() {
        for (width, expected) in [
            (1.0, 1.0),
            (1.1, 2.0),
            (0.3, 0.5),
            (51.0, 100.0),
            (0.0, 1.0),
        ] {
            assert!(
                (round_step(width) - expected).abs() < 1e-12 * expected,
                "{width}"
            );
        }
    }
}
