//! The wall of a ventricle in prolate spheroidal coordinates.
//!
//! A point of the wall is named by two angles that it keeps through the beat: mu from the apex (0) towards the base,
//! theta around the long axis (0 lateral, 90 degrees anterior, 180 septal). lambda counts from the long axis outward;
//! with the focal length d, x = d sinh(lambda) sin(mu) cos(theta), y = d sinh(lambda) sin(mu) sin(theta),
//! z = d cosh(lambda) cos(mu). The volume within lambda of a column of (mu, theta) is
//! d^3 sin(mu) (F(lambda) - F(0)), F = cosh^3 / 3 - cosh cos^2(mu).

use std::f64::consts::{PI, TAU};

/// Points from the apex to beyond the base.
pub const RINGS: usize = 76;
/// Points around the axis.
pub const SPOKES: usize = 72;
/// mu of the last ring, rad.
pub const MU_MAX: f64 = 150.0 * PI / 180.0;
/// From ring to ring, rad.
pub const MU_STEP: f64 = MU_MAX / (RINGS - 1) as f64;
/// From spoke to spoke, rad.
pub const THETA_STEP: f64 = TAU / SPOKES as f64;

/// A number at every material point, at index `ring * SPOKES + spoke`.
#[derive(Debug, Clone, PartialEq)]
pub struct Map(pub Vec<f64>);

impl Map {
    /// The same number everywhere.
    pub fn filled(value: f64) -> Self {
        Self(vec![value; RINGS * SPOKES])
    }

    /// A number of mu and theta, rad.
    pub fn from_fn(value: impl Fn(f64, f64) -> f64) -> Self {
        Self(
            (0..RINGS * SPOKES)
                .map(|at| value(mu(at), theta(at)))
                .collect(),
        )
    }

    /// A number of each point's index.
    pub fn from_index(value: impl Fn(usize) -> f64) -> Self {
        Self((0..RINGS * SPOKES).map(value).collect())
    }

    /// The value between points, mu and theta in rad; mu is kept on the map.
    pub fn at(&self, mu: f64, theta: f64) -> f64 {
        let u = (mu / MU_STEP).clamp(0.0, RINGS as f64 - 1.001);
        let v = (theta / THETA_STEP).rem_euclid(SPOKES as f64);
        let (i, j) = (u as usize, (v as usize).min(SPOKES - 1));
        let (f, g) = (u - i as f64, v - j as f64);
        let next = if j + 1 < SPOKES { j + 1 } else { 0 };
        let on = |i: usize| (1.0 - g) * self.0[i * SPOKES + j] + g * self.0[i * SPOKES + next];
        (1.0 - f) * on(i) + f * on(i + 1)
    }

    /// Blurred by normal distributions, whose deviations are in points.
    pub fn smoothed(&self, sd: f64) -> Self {
        let reach = (4.0 * sd).ceil() as isize;
        let weight = |k: isize| (-0.5 * (k as f64 / sd).powi(2)).exp();
        let sum: f64 = (-reach..=reach).map(weight).sum();
        let around = Self::from_index(|at| {
            let (ring, spoke) = (at / SPOKES, (at % SPOKES) as isize);
            let near = |k: isize| (spoke + k).rem_euclid(SPOKES as isize) as usize;
            let all = (-reach..=reach).map(|k| weight(k) * self.0[ring * SPOKES + near(k)]);
            all.sum::<f64>() / sum
        });
        Self::from_index(|at| {
            let (ring, spoke) = ((at / SPOKES) as isize, at % SPOKES);
            let near = |k: isize| (ring + k).clamp(0, RINGS as isize - 1) as usize;
            let all = (-reach..=reach).map(|k| weight(k) * around.0[near(k) * SPOKES + spoke]);
            all.sum::<f64>() / sum
        })
    }

    /// The mean over the points, by weights.
    pub fn mean(&self, weights: &Map) -> f64 {
        let total: f64 = weights.0.iter().sum();
        let sum: f64 = self.0.iter().zip(&weights.0).map(|(v, w)| v * w).sum();
        sum / total
    }

    /// The mean of a ring.
    pub fn ring_mean(&self, ring: usize) -> f64 {
        self.0[ring * SPOKES..(ring + 1) * SPOKES]
            .iter()
            .sum::<f64>()
            / SPOKES as f64
    }
}

/// mu of a point, rad.
pub fn mu(at: usize) -> f64 {
    (at / SPOKES) as f64 * MU_STEP
}

/// theta of a point, rad.
pub fn theta(at: usize) -> f64 {
    (at % SPOKES) as f64 * THETA_STEP
}

/// The function F of the page.
pub fn column(lambda: f64, mu: f64) -> f64 {
    let c = lambda.cosh();
    c * (c * c / 3.0 - mu.cos().powi(2))
}

/// Millimetres along lambda, or mu, of a change of 1, over the focal length.
pub fn metric(lambda: f64, mu: f64) -> f64 {
    lambda.sinh().hypot(mu.sin())
}

/// The lambda outside `inner` at which the column has F = `target` (Newton).
pub fn solve_column(inner: f64, target: f64, mu: f64) -> f64 {
    let c2 = mu.cos().powi(2);
    let mut lambda = inner + 0.35;
    for _ in 0..14 {
        let (sinh, cosh) = (lambda.sinh(), lambda.cosh());
        let slope = (sinh * (cosh * cosh - c2)).max(1e-4);
        let miss = cosh * (cosh * cosh / 3.0 - c2) - target;
        lambda = (lambda - miss / slope).clamp(inner + 1e-3, inner + 3.0);
    }
    lambda
}

/// The volume within `lambda` below the base, mm^3. `base` is the mu of the base at each spoke, rad.
pub fn volume(lambda: &Map, focal_mm: f64, base: &[f64]) -> f64 {
    let rows = lambda.0.chunks(SPOKES).enumerate();
    let sum: f64 = rows
        .map(|(ring, row)| {
            let mu = ring as f64 * MU_STEP;
            let (sin, inner) = (mu.sin(), column(0.0, mu));
            let along = row.iter().zip(base).map(|(lambda, base)| {
                let below = ((base - mu) / MU_STEP + 0.5).clamp(0.0, 1.0);
                if below > 0.0 {
                    below * (column(*lambda, mu) - inner)
                } else {
                    0.0
                }
            });
            sin * along.sum::<f64>()
        })
        .sum();
    focal_mm.powi(3) * sum * MU_STEP * THETA_STEP
}

/// The AHA segment of a point at a share of the way from the base (0) to the cavity's apex (1).
pub fn aha_segment(way: f64, theta: f64) -> usize {
    let degrees = theta.to_degrees().rem_euclid(360.0);
    let six = 1 + (((degrees - 60.0).rem_euclid(360.0) / 60.0) as usize).min(5);
    let four = 13 + (((degrees - 45.0).rem_euclid(360.0) / 90.0) as usize).min(3);
    match way {
        w if w < 1.0 / 3.0 => six,
        w if w < 2.0 / 3.0 => six + 6,
        w if w < 1.0 => four,
        _ => 17,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_volume_of_half_a_spheroid_is_that_of_its_formula() {
        // mu up to 90 degrees is the half with z > 0 of a spheroid with half axes d cosh and d sinh.
        let (lambda, d) = (0.6_f64, 40.0);
        let found = volume(&Map::filled(lambda), d, &[PI / 2.0; SPOKES]);
        let known = 2.0 / 3.0 * PI * d.powi(3) * lambda.sinh().powi(2) * lambda.cosh();
        assert!((found / known - 1.0).abs() < 1e-3, "{found} {known}");
    }

    #[test]
    fn a_solved_column_has_its_volume() {
        for (inner, mu, more) in [(0.1, 0.3, 0.02), (0.5, 1.2, 0.4), (0.03, 0.0, 0.01)] {
            let target = column(inner, mu) + more;
            let outer = solve_column(inner, target, mu);
            assert!((column(outer, mu) - target).abs() < 1e-9, "{inner} {mu}");
        }
    }

    #[test]
    fn segments_are_numbered_as_the_aha_does() {
        let at = |way: f64, degrees: f64| aha_segment(way, degrees.to_radians());
        // Anterior, septal walls, inferior, lateral walls.
        assert_eq!(
            [90.0, 150.0, 210.0, 270.0, 330.0, 30.0].map(|d| at(0.1, d)),
            [1, 2, 3, 4, 5, 6]
        );
        assert_eq!([90.0, 150.0, 30.0].map(|d| at(0.5, d)), [7, 8, 12]);
        assert_eq!(
            [90.0, 180.0, 270.0, 0.0].map(|d| at(0.9, d)),
            [13, 14, 15, 16]
        );
        assert_eq!(at(1.0, 10.0), 17);
    }
}
