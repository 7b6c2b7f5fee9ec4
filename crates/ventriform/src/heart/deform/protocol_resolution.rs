//! The resolution of the images of one protocol, from many scans of it.
//!
//! In: how the walls of the scans look ([`WallLook`]), all of one camera, collimator, reconstruction and filter. Out: the
//! resolution about a usual cavity, and how well it is known ([`ProtocolResolution`]).
//!
//! One wall that looks thick may be thick, or blurred. Of many people's walls most are usual:
//!
//! 1. Before the walls are looked at, the resolution is that which the mean length of the noise tells, with the deviation
//!    that it has for a scan alone ([`wall_thickness`](super::wall_thickness)).
//! 2. Each wall says how likely every resolution is, whatever its thickness. The images of one protocol differ by
//!    [`PATIENT_SD_MM`], and by what a small cavity adds.
//! 3. The product of 1 and 2 is the posterior. Its deviation and [`PEOPLE_SD_MM`] together are the deviation.
//!
//! docs/log/walls.md has the figures of simulated cohorts.
//!
//! Not guaranteed: people most of whom have thick walls, as those of a clinic for hypertrophy. They make the resolution
//! look up to .7 mm wider than it is.

use super::resolution_terms::ResolutionTerms;
use super::thickness_calibration::RESOLUTION;
use super::wall_thickness::{PATIENT_SD_MM, WallLook, mean_and_variance, normal, resolutions_mm};

/// Standard deviation of the resolution that is found, by the walls that a protocol's people have, mm.
const PEOPLE_SD_MM: f64 = 0.4;

/// The resolution of a protocol's images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProtocolResolution {
    /// Full width of a point at half its maximum, motion and filters included, about a usual cavity, mm.
    pub mean_mm: f64,
    /// Its standard deviation, mm.
    pub sd_mm: f64,
    /// What the length of the noise alone says, mm.
    pub by_noise_mm: f64,
}

impl ProtocolResolution {
    /// Scans below which little is known.
    pub const FEW_SCANS: usize = 12;

    /// That of the images in which walls look so; `None` without any.
    pub fn new(looks: &[WallLook]) -> Option<Self> {
        if looks.is_empty() {
            return None;
        }
        let lengths: Vec<f64> = looks
            .iter()
            .filter_map(|look| look.noise_length_mm)
            .collect();
        let length =
            (!lengths.is_empty()).then(|| lengths.iter().sum::<f64>() / lengths.len() as f64);
        let [by_noise_mm, by_noise_sd_mm] = RESOLUTION.of(ResolutionTerms::CAVITY_ML, length);
        let mut logarithms: Vec<f64> = resolutions_mm()
            .map(|resolution| -0.5 * ((resolution - by_noise_mm) / by_noise_sd_mm).powi(2))
            .collect();
        for look in looks {
            let likelihoods = look.likelihoods();
            let more_mm = RESOLUTION.of_cavity_mm(look.cavity_ml);
            for (logarithm, resolution) in logarithms.iter_mut().zip(resolutions_mm()) {
                *logarithm += mean_about(&likelihoods, resolution + more_mm)
                    .max(1e-12)
                    .ln();
            }
        }
        let greatest = logarithms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let shares: Vec<f64> = logarithms.iter().map(|l| (l - greatest).exp()).collect();
        let [mean_mm, variance] = mean_and_variance(resolutions_mm(), &shares);
        Some(Self {
            mean_mm,
            sd_mm: (variance + PEOPLE_SD_MM.powi(2)).sqrt(),
            by_noise_mm,
        })
    }
}

/// The mean likelihood of the images whose protocol has this resolution.
fn mean_about(likelihoods: &[f64], resolution_mm: f64) -> f64 {
    let weights = || resolutions_mm().map(|own| normal(own, resolution_mm, PATIENT_SD_MM));
    let sum: f64 = (weights().zip(likelihoods))
        .map(|(weight, likelihood)| weight * likelihood)
        .sum();
    sum / weights().sum::<f64>().max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::super::blur_correction;
    use super::super::thickness_calibration::SLAB_SHARE;
    use super::*;

    /// The looks of people whose walls are between 8 and 13 mm thick, behind a blur.
    fn people(resolution_mm: f64, count: usize) -> Vec<WallLook> {
        (0..count)
            .map(|n| {
                let share = (n as f64 + 0.5) / count as f64;
                let thickness_mm = 8.0 + 5.0 * share;
                WallLook {
                    apparent_mm: blur_correction::width(SLAB_SHARE * thickness_mm, resolution_mm),
                    cavity_ml: ResolutionTerms::CAVITY_ML,
                    usual_mm: 10.5,
                    noise_length_mm: Some(ResolutionTerms::NOISE_LENGTH_MM),
                    resolution_mm: None,
                }
            })
            .collect()
    }

    /// A camera that blurs otherwise than its noise says is known from its scans.
    #[test]
    fn many_usual_walls_tell_the_resolution() {
        for resolution_mm in [11.0, 13.0, 15.0, 17.0] {
            let found = ProtocolResolution::new(&people(resolution_mm, 20)).unwrap();
            assert!((found.mean_mm - resolution_mm).abs() < 0.7, "{found:?}");
            assert_eq!(found.by_noise_mm, RESOLUTION.usual_mm);
        }
    }

    #[test]
    fn the_more_scans_the_more_is_known() {
        let [few, more] =
            [2, 24].map(|count| ProtocolResolution::new(&people(14.0, count)).unwrap());
        assert!(few.sd_mm > more.sd_mm && more.sd_mm >= PEOPLE_SD_MM);
        assert_eq!(ProtocolResolution::new(&[]), None);
    }

    /// The order of the scans does not matter, and neither does what was stated.
    #[test]
    fn only_how_walls_look_counts() {
        let looks = people(14.0, 9);
        let mut other: Vec<WallLook> = looks.iter().rev().copied().collect();
        other[0].resolution_mm = Some(9.0);
        let [a, b] = [looks, other].map(|looks| ProtocolResolution::new(&looks).unwrap());
        assert!((a.mean_mm - b.mean_mm).abs() < 1e-9 && (a.sd_mm - b.sd_mm).abs() < 1e-9);
    }
}
