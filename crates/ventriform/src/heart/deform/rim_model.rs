//! The calibrated model of a ventricle's rim: the shape that rims have, how much of a distance from it is taken back,
//! and what the ends of the signal change.
//!
//! In: angles about the long axis, and a distance of the rim from its shape. Out: heights and the distance by which
//! the rim moves. The constants are in [`calibration`](super::calibration).

use super::rim_frame::{RIM_DIRECTIONS, rim_angle};
use super::signal_end::SignalEnds;

/// Harmonics of the rim's shape: the cosines and sines of one to three times the angle.
pub const RIM_HARMONICS: usize = 3;
/// Coefficients of the rim's shape.
pub const RIM_TERMS: usize = 2 * RIM_HARMONICS;

/// Coefficients of a distance in every direction: its mean, and those of [`RIM_TERMS`].
const WAVES: usize = RIM_TERMS + 1;

/// Ends of the signal, at half of the heart's, from which on a wall counts as dark at its base, and up to which it
/// counts as partly so, mm basal of the rim.
const DARK_ENDS_MM: [f64; 2] = [-9.0, -3.0];

/// Coefficients of one harmonic of the rim's height towards the apex, shares of the heart's length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimHarmonic {
    /// Of the cosine of a multiple of the angle from lateral over anterior.
    pub cosine: f64,
    /// Of its sine.
    pub sine: f64,
}

/// The shape of the rims of hearts.
#[derive(Debug)]
pub struct RimShape {
    /// Mean coefficients, of one to three times the angle.
    pub mean: [RimHarmonic; RIM_HARMONICS],
    /// Inverse of the coefficients' covariance, in the order of [`RimShape::mean_terms`].
    pub precision: [[f64; RIM_TERMS]; RIM_TERMS],
}

impl RimShape {
    /// Mean coefficients: cosine and sine of each harmonic in turn.
    pub fn mean_terms(&self) -> [f64; RIM_TERMS] {
        let [first, second, third] = self.mean;
        [
            first.cosine,
            first.sine,
            second.cosine,
            second.sine,
            third.cosine,
            third.sine,
        ]
    }
}

/// The distance by which a rim moves towards the base, a piecewise linear function of the distance by which it lies
/// nearer to the apex than its shape.
#[derive(Debug)]
pub struct RimCorrection {
    /// Result at distance 0, mm.
    pub intercept_mm: f64,
    /// Slope.
    pub slope: f64,
    /// Size of the distance from which the slope changes, mm.
    pub bend_mm: f64,
    /// Addition to the slope beyond the bend, where the wall is short.
    pub short_slope: f64,
    /// Reduction of the slope beyond the bend, where the wall is long.
    pub long_slope: f64,
    /// Range of the result, mm.
    pub range_mm: [f64; 2],
}

impl RimCorrection {
    /// Distance towards the base by which a rim is moved that lies `distance` mm too near to the apex, mm.
    pub fn at(&self, distance: f64) -> f64 {
        let beyond = (distance - self.bend_mm).max(0.0) * self.short_slope
            + (-distance - self.bend_mm).max(0.0) * self.long_slope;
        let [least, greatest] = self.range_mm;
        (self.intercept_mm + self.slope * distance + beyond).clamp(least, greatest)
    }
}

/// What tells where the rim of a fitted heart is.
#[derive(Debug, Clone, PartialEq)]
pub struct RimEvidence {
    /// From the middle rim, as the sensors left it, to the apex, mm.
    pub length_mm: f64,
    /// Distances towards the base by which the rim's shape moves it in every direction, mm.
    pub by_shape_mm: Vec<f64>,
    /// Where the image's signal ends.
    pub ends: SignalEnds,
}

/// How far the rim of a fit may be off: the standard deviation of its height, about the same in every direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RimDeviation {
    /// Where the direction's own ends of the signal lie as the rim does, mm.
    pub least_mm: f64,
    /// For each mm by which they scatter about it.
    pub per_scatter: f64,
}

impl RimDeviation {
    /// Standard deviation of the height of a rim settled by this `evidence`, mm.
    pub fn predicted(&self, evidence: &RimEvidence) -> f64 {
        let ends = &evidence.ends.of_direction;
        let mean = ends.iter().sum::<f64>() / RIM_DIRECTIONS as f64;
        let squares: f64 = ends.iter().map(|end| (end - mean).powi(2)).sum();
        let scatter = (squares / RIM_DIRECTIONS as f64).sqrt();
        self.least_mm.hypot(self.per_scatter * scatter)
    }
}

/// Coefficients of one coefficient of a rim's distance.
#[derive(Debug)]
pub struct RimTerms {
    /// Of 1, mm.
    pub constant: f64,
    /// Of the heart's length, mm per mm.
    pub length: f64,
    /// Of the coefficients of [`RimEvidence::by_shape_mm`].
    pub by_shape: [f64; WAVES],
    /// Of those of [`SignalEnds::of_heart`].
    pub of_heart: [f64; WAVES],
    /// Of those of [`SignalEnds::of_direction`].
    pub of_direction: [f64; WAVES],
}

/// The mean, cosines and sines of the distance by which a rim moves towards the base: linear functions of the evidence.
///
/// They are the expected values of a Gaussian distribution of rims and evidence together.
#[derive(Debug)]
pub struct RimRegression {
    /// Functions of the mean, and of cosine and sine of one to three times the angle.
    pub terms: [RimTerms; WAVES],
    /// Range of the lengths that it comes from, mm; lengths beyond it count as its ends.
    pub length_range_mm: [f64; 2],
    /// Range of the result, mm.
    pub range_mm: [f64; 2],
}

impl RimRegression {
    /// Distances towards the base by which the rim moves in every direction, mm. Where the wall is dark at its base,
    /// the rim does not lie apical of where its shape puts it.
    pub fn shifts(&self, evidence: &RimEvidence) -> Vec<f64> {
        let [shortest, longest] = self.length_range_mm;
        let length = evidence.length_mm.clamp(shortest, longest);
        let ends = &evidence.ends;
        let [by_shape, of_heart, of_direction] = [
            &evidence.by_shape_mm[..],
            &ends.of_heart,
            &ends.of_direction,
        ]
        .map(waves_of);
        let waves: [f64; WAVES] = std::array::from_fn(|n| {
            let terms = &self.terms[n];
            terms.constant
                + terms.length * length
                + product(&terms.by_shape, &by_shape)
                + product(&terms.of_heart, &of_heart)
                + product(&terms.of_direction, &of_direction)
        });
        let [least, greatest] = self.range_mm;
        (0..RIM_DIRECTIONS)
            .map(|direction| {
                let shift = product(&waves, &waves_at(direction)).clamp(least, greatest);
                let by_shape = evidence.by_shape_mm[direction];
                let trusted = trusted(ends.of_heart[direction]);
                by_shape + (shift - by_shape) * if shift < by_shape { trusted } else { 1.0 }
            })
            .collect()
    }
}

/// How far a signal that ends at `end` moves the rim towards the apex of where its shape puts it, 0 to 1.
///
/// A wall that is dark at its base, a defect, looks like a shorter wall. Taken for one, the defect would be cut off.
fn trusted(end: f64) -> f64 {
    let [dark, bright] = DARK_ENDS_MM;
    ((end - dark) / (bright - dark)).clamp(0.0, 1.0)
}

/// Values in a direction of 1, and of cosine and sine of one to three times its angle.
fn waves_at(direction: usize) -> [f64; WAVES] {
    let angle = rim_angle(direction);
    std::array::from_fn(|n| match (n, n.div_ceil(2) as f64 * angle) {
        (0, _) => 1.0,
        (n, times) if n % 2 == 1 => times.cos(),
        (_, times) => times.sin(),
    })
}

/// Mean, cosines and sines of a distance in every direction, by least squares: the waves are orthogonal.
fn waves_of(distances: &[f64]) -> [f64; WAVES] {
    let mut sums = [0.0; WAVES];
    for (direction, distance) in distances.iter().enumerate() {
        for (sum, wave) in sums.iter_mut().zip(waves_at(direction)) {
            *sum += distance * wave;
        }
    }
    let share = 1.0 / RIM_DIRECTIONS as f64;
    std::array::from_fn(|n| sums[n] * if n == 0 { share } else { 2.0 * share })
}

fn product(a: &[f64; WAVES], b: &[f64; WAVES]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::deform::calibration::{RIM_DEVIATION, RIM_REGRESSION};

    fn evidence(distance: impl Fn(usize) -> f64) -> RimEvidence {
        let of: [f64; RIM_DIRECTIONS] = std::array::from_fn(distance);
        RimEvidence {
            length_mm: 80.0,
            by_shape_mm: of.to_vec(),
            ends: SignalEnds {
                of_heart: of,
                of_direction: of,
            },
        }
    }

    /// A regression that takes the shape's distance as it is.
    fn identity() -> RimRegression {
        let unit = |n: usize| std::array::from_fn(|m| f64::from(u8::from(n == m)));
        RimRegression {
            terms: std::array::from_fn(|n| RimTerms {
                constant: 0.0,
                length: 0.0,
                by_shape: unit(n),
                of_heart: [0.0; WAVES],
                of_direction: [0.0; WAVES],
            }),
            length_range_mm: [50.0, 120.0],
            range_mm: [-12.0, 20.0],
        }
    }

    #[test]
    fn waves_of_a_rim_come_back() {
        let wave = |d: usize| {
            let angle = rim_angle(d);
            3.0 - 2.0 * angle.cos() + (2.0 * angle).sin() - 0.5 * (3.0 * angle).cos()
        };
        let shifts = identity().shifts(&evidence(wave));
        for (direction, shift) in shifts.iter().enumerate() {
            assert!((shift - wave(direction)).abs() < 1e-12);
        }
        // What is no wave of three or less is left out.
        let shifts = identity().shifts(&evidence(|d| (7.0 * rim_angle(d)).cos()));
        assert!(shifts.iter().all(|shift| shift.abs() < 1e-12));
        let shifts = identity().shifts(&evidence(|_| 55.0));
        assert!(shifts.iter().all(|shift| *shift == 20.0));
    }

    #[test]
    fn lengths_beyond_the_range_count_as_its_ends() {
        let mut regression = identity();
        regression.terms[0].length = 0.1;
        let at = |length_mm: f64| {
            regression.shifts(&RimEvidence {
                length_mm,
                ..evidence(|_| 0.0)
            })[0]
        };
        assert!((at(80.0) - 8.0).abs() < 1e-9 && (at(20.0) - 5.0).abs() < 1e-9);
        assert!((at(500.0) - 12.0).abs() < 1e-9);
    }

    /// Ends of a third of the directions lie 12 mm apical: the rim moves by what the others tell, and there not towards
    /// the apex. Where signal goes on, it moves towards the base.
    #[test]
    fn a_dark_base_is_not_cut_off() {
        let dark = |direction: usize| direction < RIM_DIRECTIONS / 3;
        let of: [f64; RIM_DIRECTIONS] = std::array::from_fn(|d| if dark(d) { -12.0 } else { 6.0 });
        let mut regression = identity();
        for terms in &mut regression.terms {
            (terms.of_heart, terms.by_shape) = (terms.by_shape, [0.0; WAVES]);
        }
        let shifts = regression.shifts(&RimEvidence {
            length_mm: 80.0,
            by_shape_mm: vec![1.5; RIM_DIRECTIONS],
            ends: SignalEnds {
                of_heart: of,
                of_direction: of,
            },
        });
        for (direction, shift) in shifts.iter().enumerate() {
            let alone = product(&waves_of(&of), &waves_at(direction));
            assert!(
                (shift - alone.max(1.5)).abs() < 1e-9 || !dark(direction),
                "{direction}: {shift}"
            );
        }
        assert!(
            (shifts[RIM_DIRECTIONS / 6] - 1.5).abs() < 1e-9,
            "{shifts:?}"
        );
        assert!(shifts[RIM_DIRECTIONS * 2 / 3] > 4.0, "{shifts:?}");
        // At an end between the two, by a share.
        assert!((trusted(-6.0) - 0.5).abs() < 1e-12 && trusted(-2.0) >= 1.0);
    }

    /// Ends that scatter by 5 mm make the rim less certain; where they all are does not matter.
    #[test]
    fn a_rim_is_as_sure_as_its_ends_agree() {
        let level = |end: f64| RIM_DEVIATION.predicted(&evidence(|_| end));
        assert!((level(0.0) - RIM_DEVIATION.least_mm).abs() < 1e-9);
        assert!((level(9.0) - level(0.0)).abs() < 1e-9);
        let apart = RIM_DEVIATION.predicted(&evidence(|d| if d % 2 == 0 { 5.0 } else { -5.0 }));
        assert!((1.5..3.0).contains(&(apart / level(0.0))), "{apart}");
    }

    /// A signal that goes on by 4 mm moves the rim by less than that, and towards the base; so does a rim that is
    /// shorter than its shape.
    #[test]
    fn the_rim_follows_signal_and_shape() {
        let level = |by_shape: f64, end: f64| {
            let ends = evidence(|_| end).ends;
            let shifts = RIM_REGRESSION.shifts(&RimEvidence {
                ends,
                ..evidence(|_| by_shape)
            });
            shifts.iter().sum::<f64>() / RIM_DIRECTIONS as f64
        };
        let usual = level(1.0, 1.0);
        assert!((-3.0..4.0).contains(&usual), "{usual}");
        let more = level(1.0, 5.0) - usual;
        assert!((0.3..4.0).contains(&more), "{more}");
        let shorter = level(5.0, 1.0) - usual;
        assert!((1.0..6.0).contains(&shorter), "{shorter}");
    }
}
