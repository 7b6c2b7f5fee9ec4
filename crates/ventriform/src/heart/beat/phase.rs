//! When each part of the wall contracts: the first harmonic of its thickness.
//!
//! In: the wall at equal steps of the beat. Out: for every ray the phase at which it is thickest, in degrees of the
//! cycle from the beginning of the first gate (later is larger), and mean, deviation, bandwidth and entropy over the
//! wall. Each ray counts by its area times its amplitude; what does not move has no phase.

use std::f64::consts::TAU;

use nalgebra::Complex;

/// Share of the wall's median amplitude below which a ray has no phase.
const LEAST_AMPLITUDE_SHARE: f64 = 0.3;
/// Share of the wall within the bandwidth.
const BANDWIDTH_SHARE: f64 = 0.95;
/// Bins of the histogram, whose entropy is given.
pub const HISTOGRAM_BINS: usize = 60;

/// The phases of a wall.
#[derive(Debug, Clone, PartialEq)]
pub struct Phases {
    /// Phase of each ray, degrees, 0..360; `None` where it does not move.
    pub degrees: Vec<Option<f64>>,
    /// Amplitude of the first harmonic of each ray's thickness, per cent of its mean.
    pub amplitude_percent: Vec<f64>,
    /// Share of the wall's weight in each of [`HISTOGRAM_BINS`] equal bins.
    pub histogram: Vec<f64>,
    /// Circular mean, degrees.
    pub mean_degrees: f64,
    /// Standard deviation about the mean, degrees.
    pub sd_degrees: f64,
    /// The smallest arc that holds 95 per cent of the weight, degrees.
    pub bandwidth_degrees: f64,
    /// Entropy of the histogram as a share of that of an even one, per cent.
    pub entropy_percent: f64,
    /// Area of the wall that has a phase, as a share of the whole.
    pub moving_share: f64,
}

impl Phases {
    /// From the thickness of every ray at equal steps of the beat, the first at its beginning, and each ray's area.
    pub fn new(thickness: &[Vec<f64>], areas: &[f64]) -> Self {
        let steps = thickness.len() as f64;
        let harmonic = |ray: usize| -> (Complex<f64>, f64) {
            let (mut sum, mut mean) = (Complex::new(0.0, 0.0), 0.0);
            for (step, of_step) in thickness.iter().enumerate() {
                let angle = -TAU * step as f64 / steps;
                sum += Complex::from_polar(of_step[ray], angle);
                mean += of_step[ray];
            }
            (sum * (2.0 / steps), mean / steps)
        };
        let harmonics: Vec<(Complex<f64>, f64)> = (0..areas.len()).map(harmonic).collect();
        let amplitudes: Vec<f64> = harmonics.iter().map(|(h, _)| h.norm()).collect();
        let least = least_amplitude(&amplitudes, areas);
        let moves = |ray: usize| areas[ray] > 0.0 && amplitudes[ray] > least;
        let degrees: Vec<Option<f64>> = (0..areas.len())
            .map(|ray| {
                let degrees = (-harmonics[ray].0.arg()).to_degrees().rem_euclid(360.0);
                moves(ray).then_some(degrees)
            })
            .collect();
        let weighted: Vec<(f64, f64)> = (0..areas.len())
            .filter_map(|ray| Some((degrees[ray]?, areas[ray] * amplitudes[ray])))
            .collect();
        let whole: f64 = areas.iter().sum();
        let moving: f64 = (0..areas.len())
            .filter(|ray| moves(*ray))
            .map(|ray| areas[ray])
            .sum();
        let mean_degrees = circular_mean(&weighted);
        let histogram = histogram(&weighted);
        Self {
            sd_degrees: deviation(&weighted, mean_degrees),
            bandwidth_degrees: bandwidth(&weighted, mean_degrees),
            entropy_percent: entropy(&histogram),
            mean_degrees,
            histogram,
            moving_share: moving / whole.max(1e-9),
            amplitude_percent: (harmonics.iter())
                .map(|(h, mean)| 100.0 * h.norm() / mean.max(1e-9))
                .collect(),
            degrees,
        }
    }
}

/// The amplitude that a part of the wall must exceed to have a phase; parts without area are none of the wall.
pub(super) fn least_amplitude(amplitudes: &[f64], areas: &[f64]) -> f64 {
    let mut on: Vec<f64> = (areas.iter().zip(amplitudes))
        .filter(|(area, _)| **area > 0.0)
        .map(|(_, amplitude)| *amplitude)
        .collect();
    on.sort_by(f64::total_cmp);
    LEAST_AMPLITUDE_SHARE * on.get(on.len() / 2).copied().unwrap_or(0.0)
}

/// The circular mean of angles with weights, degrees, 0..360; NaN without weight.
pub fn circular_mean(weighted: &[(f64, f64)]) -> f64 {
    let sum: Complex<f64> = (weighted.iter())
        .map(|(degrees, weight)| Complex::from_polar(*weight, degrees.to_radians()))
        .sum();
    if sum.norm() > 0.0 {
        sum.arg().to_degrees().rem_euclid(360.0)
    } else {
        f64::NAN
    }
}

/// The lag of an angle behind another, degrees, -180..180.
pub fn behind(degrees: f64, other: f64) -> f64 {
    (degrees - other + 180.0).rem_euclid(360.0) - 180.0
}

fn deviation(weighted: &[(f64, f64)], mean: f64) -> f64 {
    let whole: f64 = weighted.iter().map(|(_, w)| w).sum();
    let squares = weighted.iter().map(|(d, w)| w * behind(*d, mean).powi(2));
    (squares.sum::<f64>() / whole).sqrt()
}

fn bandwidth(weighted: &[(f64, f64)], mean: f64) -> f64 {
    let mut sorted: Vec<(f64, f64)> = (weighted.iter())
        .map(|(degrees, weight)| (behind(*degrees, mean), *weight))
        .collect();
    sorted.sort_by(|a, b| a.0.total_cmp(&b.0));
    let whole: f64 = sorted.iter().map(|(_, w)| w).sum();
    let mut least = 360.0f64;
    let (mut end, mut within) = (0, 0.0);
    // Twice round, so that an arc may pass the end of the circle.
    let round = |n: usize| sorted[n % sorted.len()].0 + 360.0 * (n / sorted.len()) as f64;
    for (begin, (from, weight)) in sorted.iter().enumerate() {
        while within < BANDWIDTH_SHARE * whole - 1e-9 * whole && end < begin + sorted.len() {
            within += sorted[end % sorted.len()].1;
            end += 1;
        }
        if end > begin && within >= BANDWIDTH_SHARE * whole - 1e-9 * whole {
            least = least.min(round(end - 1) - from);
        }
        within -= weight;
    }
    least
}

fn histogram(weighted: &[(f64, f64)]) -> Vec<f64> {
    let mut bins = vec![0.0; HISTOGRAM_BINS];
    let whole: f64 = weighted.iter().map(|(_, w)| w).sum();
    for (degrees, weight) in weighted {
        let bin = (degrees / 360.0 * HISTOGRAM_BINS as f64) as usize;
        bins[bin.min(HISTOGRAM_BINS - 1)] += weight / whole;
    }
    bins
}

fn entropy(histogram: &[f64]) -> f64 {
    let filled = histogram.iter().filter(|share| **share > 0.0);
    let sum: f64 = filled.map(|share| -share * share.ln()).sum();
    100.0 * sum / (histogram.len() as f64).ln()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cosine(late_degrees: f64, amplitude: f64, steps: usize) -> Vec<f64> {
        (0..steps)
            .map(|n| {
                let angle = TAU * n as f64 / steps as f64 - late_degrees.to_radians();
                10.0 + amplitude * angle.cos()
            })
            .collect()
    }

    fn wall(rays: &[Vec<f64>]) -> Vec<Vec<f64>> {
        (0..rays[0].len())
            .map(|step| rays.iter().map(|ray| ray[step]).collect())
            .collect()
    }

    #[test]
    fn the_phase_of_a_cosine_is_where_it_is_largest() {
        let late = [0.0, 20.0, 135.0, 250.0, 359.0];
        let rays = late.map(|late| cosine(late, 2.0, 24));
        let phases = Phases::new(&wall(&rays), &[1.0; 5]);
        for (found, late) in phases.degrees.iter().zip(late) {
            assert!(behind(found.unwrap(), late).abs() < 1e-9);
        }
        assert!((phases.amplitude_percent[0] - 20.0).abs() < 1e-9);
    }

    /// Two walls 40 degrees apart about the beginning of the cycle: mean, deviation and arc of two points.
    #[test]
    fn statistics_are_those_of_the_circle() {
        let rays = [cosine(340.0, 2.0, 24), cosine(20.0, 2.0, 24)];
        let phases = Phases::new(&wall(&rays), &[1.0, 1.0]);
        assert!(behind(phases.mean_degrees, 0.0).abs() < 1e-6);
        assert!((phases.sd_degrees - 20.0).abs() < 1e-6);
        assert!((phases.bandwidth_degrees - 40.0).abs() < 1e-6);
        let even = 2f64.ln() / (HISTOGRAM_BINS as f64).ln();
        assert!((phases.entropy_percent - 100.0 * even).abs() < 1e-6);
        // The arc with 95 per cent leaves out a twentieth.
        let rays: Vec<Vec<f64>> = (0..40)
            .map(|n| cosine(if n < 38 { n as f64 } else { 180.0 }, 2.0, 24))
            .collect();
        let phases = Phases::new(&wall(&rays), &[1.0; 40]);
        assert!((phases.bandwidth_degrees - 37.0).abs() < 1e-6);
    }

    #[test]
    fn a_wall_that_does_not_move_has_no_phase() {
        let rays = [
            cosine(0.0, 2.0, 24),
            cosine(0.0, 2.0, 24),
            cosine(90.0, 0.1, 24),
        ];
        let phases = Phases::new(&wall(&rays), &[1.0, 1.0, 2.0]);
        assert_eq!(phases.degrees[2], None);
        assert!((phases.moving_share - 0.5).abs() < 1e-9);
    }
}
