//! Monotone cubic curves through points (Fritsch and Carlson 1980, slopes by Fritsch and Butland 1984).

/// A curve that rises and falls only where its points do, repeated every 1 along x.
#[derive(Debug, Clone)]
pub struct PeriodicCurve {
    x: Vec<f64>,
    y: Vec<f64>,
    slope: Vec<f64>,
}

impl PeriodicCurve {
    /// The curve through `points` (x from 0 to less than 1, rising).
    pub fn new(points: &[[f64; 2]]) -> Self {
        let mut x = Vec::with_capacity(3 * points.len());
        let mut y = Vec::with_capacity(3 * points.len());
        for turn in [-1.0, 0.0, 1.0] {
            x.extend(points.iter().map(|p| p[0] + turn));
            y.extend(points.iter().map(|p| p[1]));
        }
        let step: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
        let rise: Vec<f64> = (0..step.len())
            .map(|i| (y[i + 1] - y[i]) / step[i])
            .collect();
        let mut slope = vec![0.0; x.len()];
        for i in 1..x.len() - 1 {
            let [before, after] = [rise[i - 1], rise[i]];
            if before * after > 0.0 {
                let [w1, w2] = [2.0 * step[i] + step[i - 1], step[i] + 2.0 * step[i - 1]];
                slope[i] = (w1 + w2) / (w1 / before + w2 / after);
            }
        }
        Self { x, y, slope }
    }

    /// Value and slope at `at`.
    pub fn at(&self, at: f64) -> (f64, f64) {
        let at = at.rem_euclid(1.0);
        let i = self
            .x
            .partition_point(|x| *x <= at)
            .clamp(1, self.x.len() - 1)
            - 1;
        let step = self.x[i + 1] - self.x[i];
        let t = (at - self.x[i]) / step;
        let [a, b] = [self.y[i], self.y[i + 1]];
        let [m, n] = [self.slope[i] * step, self.slope[i + 1] * step];
        let value = a + t * (m + t * (3.0 * (b - a) - 2.0 * m - n + t * (2.0 * (a - b) + m + n)));
        let slope =
            m + t * (2.0 * (3.0 * (b - a) - 2.0 * m - n) + 3.0 * t * (2.0 * (a - b) + m + n));
        (value, slope / step)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_meets_its_points_and_stays_between_them() {
        let points = [[0.0, 0.0], [0.1, 0.2], [0.4, 1.0], [0.6, 0.5], [0.9, 0.1]];
        let curve = PeriodicCurve::new(&points);
        for [x, y] in points {
            assert!((curve.at(x).0 - y).abs() < 1e-12);
            assert!((curve.at(x + 3.0).0 - y).abs() < 1e-9);
        }
        for step in 0..1000 {
            let value = curve.at(f64::from(step) / 1000.0).0;
            assert!((0.0..=1.0).contains(&value));
        }
    }

    #[test]
    fn the_slope_is_the_difference_of_near_values() {
        let curve = PeriodicCurve::new(&[[0.0, 0.0], [0.3, 1.0], [0.5, 0.6], [0.8, 0.3]]);
        for step in 0..97 {
            let at = (f64::from(step) + 0.5) / 97.0;
            let apart = (curve.at(at + 1e-6).0 - curve.at(at - 1e-6).0) / 2e-6;
            assert!((curve.at(at).1 - apart).abs() < 1e-4, "{at}");
        }
    }
}
