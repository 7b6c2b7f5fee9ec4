//! The mean thickness of a wall, from how thick it looks: what is known, and how well.
//!
//! In: the mean thickness of the apparent wall, the size of its cavity, what the calibration on usual hearts takes the
//! wall for, and what is known of the image's resolution. Out: mean, deviation and interval of the thickness
//! ([`WallThickness`]).
//!
//! 1. Blur of a width F makes a wall of thickness t look as wide as a blurred slab of [`SLAB_SHARE`] t does
//!    ([`blur_correction::width`]); the mean over wall and beat is thinner than where its edges are seen.
//! 2. F is stated, or follows from the length of the image's noise
//!    ([`noise_length`](crate::image::grid::noise_length)), which tells the filter, and from the size of the cavity, since
//!    small hearts move more for their size; never from the wall's own width. Each with its deviation
//!    ([`Resolution`](super::resolution_terms)).
//! 3. Before the width is looked at, the heart is a usual one, as thick as the calibration says
//!    ([`USUAL_SHARE`] of all hearts), or of any thickness ([`BROAD_PRIOR`]).
//! 4. The product of 1 to 3 over a grid of t and F is the posterior. Its mean is the thickness, its 5th and 95th
//!    percentiles are the interval.
//!
//! Below 11 mm the width tells next to nothing at usual resolutions: a slab of 6 mm looks as wide as one of 10. There the
//! interval is as wide as the prior.
//!
//! The constants are estimated by `scripts/measure/calibrate_thickness.py`; docs/log/walls.md has the figures of
//! held-out hearts, and of a real scan behind several filters.
//!
//! Not guaranteed: cameras that blur otherwise than those of the simulator do. State `resolution` for them, as
//! [`protocol_resolution`](super::protocol_resolution) finds it.

use super::blur_correction;
use super::thickness_calibration::{RESOLUTION, SLAB_SHARE};
use std::sync::OnceLock;

/// Standard deviation of the resolution of one image about that of its protocol, mm: patients move differently.
pub(super) const PATIENT_SD_MM: f64 = 0.8;
/// Standard deviation of the apparent mean thickness by noise, mm.
const WIDTH_SD_MM: f64 = 0.5;
/// Share of hearts whose walls are usual.
const USUAL_SHARE: f64 = 0.4;
/// Standard deviation of a usual wall about what the calibration takes it for, mm.
const USUAL_SD_MM: f64 = 1.1;
/// Median of the thickness of all other walls over what the calibration takes them for, and the standard deviation of
/// its logarithm.
const BROAD_PRIOR: (f64, f64) = (1.2, 0.42);

/// Least and greatest thickness, and the steps between, mm.
const THICKNESS_GRID_MM: (f64, f64, usize) = (4.0, 0.25, 89);
/// Least and greatest resolution, and the steps between, mm.
const RESOLUTION_GRID_MM: (f64, f64, usize) = (2.0, 0.25, 113);

/// How a wall looks, and what is known of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallLook {
    /// Mean thickness of the apparent wall, mm.
    pub apparent_mm: f64,
    /// Volume of its cavity, ml.
    pub cavity_ml: f64,
    /// Mean thickness that the calibration on usual hearts takes the wall for, mm.
    pub usual_mm: f64,
    /// The length of the image's noise, mm, where it can be told.
    pub noise_length_mm: Option<f64>,
    /// The image's resolution, mm, if it is stated.
    pub resolution_mm: Option<f64>,
}

/// The mean thickness of a wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallThickness {
    /// Its mean, mm.
    pub mean_mm: f64,
    /// Its standard deviation, mm.
    pub sd_mm: f64,
    /// Nine of ten walls lie between these, mm.
    pub interval_mm: [f64; 2],
    /// What it follows from.
    pub look: WallLook,
}

impl WallThickness {
    /// That of a wall that looks like this.
    pub fn new(look: &WallLook) -> Self {
        let [resolution_mm, resolution_sd_mm] = match look.resolution_mm {
            Some(stated) => [stated, PATIENT_SD_MM],
            None => RESOLUTION.of(look.cavity_ml, look.noise_length_mm),
        };
        let of_resolution: Vec<f64> = grid(RESOLUTION_GRID_MM)
            .map(|resolution| normal(resolution, resolution_mm, resolution_sd_mm))
            .collect();
        let sum = of_resolution.iter().sum::<f64>().max(f64::MIN_POSITIVE);
        let posterior: Vec<f64> = (prior(look.usual_mm).iter())
            .zip(widths().chunks_exact(RESOLUTION_GRID_MM.2))
            .map(|(prior, widths)| {
                let seen: f64 = (widths.iter().zip(&of_resolution))
                    .map(|(width, share)| normal(look.apparent_mm, *width, WIDTH_SD_MM) * share)
                    .sum();
                // A width that no wall has leaves the prior.
                prior * (seen / sum + 1e-12)
            })
            .collect();
        Self::of_posterior(*look, &posterior)
    }

    /// That of a wall whose muscle is stated, and which therefore is so thick.
    pub fn stated(mean_mm: f64, look: WallLook) -> Self {
        Self {
            mean_mm,
            sd_mm: 0.0,
            interval_mm: [mean_mm; 2],
            look,
        }
    }

    /// Its standard deviation over its mean.
    pub fn sd_share(&self) -> f64 {
        self.sd_mm / self.mean_mm
    }

    fn of_posterior(look: WallLook, posterior: &[f64]) -> Self {
        let sum: f64 = posterior.iter().sum();
        let [mean_mm, variance] = mean_and_variance(grid(THICKNESS_GRID_MM), posterior);
        let percentile = |share: f64| {
            let mut below = 0.0;
            for (t, p) in grid(THICKNESS_GRID_MM).zip(posterior) {
                if below + p >= share * sum {
                    let within = (share * sum - below) / p - 0.5;
                    return t + within * THICKNESS_GRID_MM.1;
                }
                below += p;
            }
            grid(THICKNESS_GRID_MM).last().unwrap_or(mean_mm)
        };
        Self {
            mean_mm,
            sd_mm: variance.sqrt(),
            interval_mm: [percentile(0.05), percentile(0.95)],
            look,
        }
    }
}

impl WallLook {
    /// How well each resolution of the grid explains this width, over a constant: the mean over the thicknesses that are
    /// likely before it is looked at.
    pub(super) fn likelihoods(&self) -> Vec<f64> {
        let prior = prior(self.usual_mm);
        let mut likelihoods = vec![0.0; RESOLUTION_GRID_MM.2];
        for (prior, widths) in prior
            .iter()
            .zip(widths().chunks_exact(RESOLUTION_GRID_MM.2))
        {
            for (likelihood, width) in likelihoods.iter_mut().zip(widths) {
                *likelihood += prior * normal(self.apparent_mm, *width, WIDTH_SD_MM);
            }
        }
        likelihoods
    }
}

/// The resolutions of the grid, mm.
pub(super) fn resolutions_mm() -> impl Iterator<Item = f64> + Clone {
    grid(RESOLUTION_GRID_MM)
}

fn grid((least, step, count): (f64, f64, usize)) -> impl Iterator<Item = f64> + Clone {
    (0..count).map(move |n| least + step * n as f64)
}

/// Mean and variance of `values` that have these weights.
pub(super) fn mean_and_variance(
    values: impl Iterator<Item = f64> + Clone,
    weights: &[f64],
) -> [f64; 2] {
    let sum: f64 = weights.iter().sum();
    let mean_of = |of: &dyn Fn(f64) -> f64| {
        let terms = values.clone().zip(weights);
        terms.map(|(value, weight)| of(value) * weight).sum::<f64>() / sum
    };
    let mean = mean_of(&|value| value);
    [mean, mean_of(&|value| (value - mean).powi(2))]
}

/// A normal density over its greatest value.
pub(super) fn normal(value: f64, mean: f64, sd: f64) -> f64 {
    (-0.5 * ((value - mean) / sd).powi(2)).exp()
}

/// The share of each thickness of the grid before the width is looked at.
fn prior(usual_mm: f64) -> Vec<f64> {
    let (median, sd) = BROAD_PRIOR;
    let median_mm = median * usual_mm.max(THICKNESS_GRID_MM.0);
    let usual = |t: f64| normal(t, usual_mm, USUAL_SD_MM);
    let broad = |t: f64| normal(t.ln(), median_mm.ln(), sd) / t;
    let usual_sum = grid(THICKNESS_GRID_MM).map(usual).sum::<f64>().max(1e-12);
    let broad_sum = grid(THICKNESS_GRID_MM).map(broad).sum::<f64>();
    grid(THICKNESS_GRID_MM)
        .map(|t| USUAL_SHARE * usual(t) / usual_sum + (1.0 - USUAL_SHARE) * broad(t) / broad_sum)
        .collect()
}

/// The width of each wall of the grid behind each resolution of the grid, mm, resolutions running fastest.
fn widths() -> &'static [f64] {
    static WIDTHS: OnceLock<Vec<f64>> = OnceLock::new();
    WIDTHS.get_or_init(|| {
        let each = |thickness: f64| {
            let slab = SLAB_SHARE * thickness;
            grid(RESOLUTION_GRID_MM).map(move |resolution| blur_correction::width(slab, resolution))
        };
        grid(THICKNESS_GRID_MM).flat_map(each).collect()
    })
}

#[cfg(test)]
mod tests {
    use super::super::resolution_terms::ResolutionTerms;
    use super::*;

    fn look(apparent_mm: f64, resolution_mm: Option<f64>) -> WallLook {
        WallLook {
            apparent_mm,
            cavity_ml: ResolutionTerms::CAVITY_ML,
            usual_mm: 10.5,
            noise_length_mm: Some(ResolutionTerms::NOISE_LENGTH_MM),
            resolution_mm,
        }
    }

    /// Walls that look as wide as the slab of the model does.
    #[test]
    fn a_thick_wall_behind_a_known_blur_is_found_and_its_interval_holds_it() {
        for resolution in [9.0, 12.0, 15.0] {
            for thickness in [8.0, 11.0, 14.0, 17.0, 20.0] {
                let apparent = blur_correction::width(SLAB_SHARE * thickness, resolution);
                let found = WallThickness::new(&look(apparent, Some(resolution)));
                let [least, greatest] = found.interval_mm;
                assert!(
                    least < thickness && thickness < greatest,
                    "{found:?} for {thickness}"
                );
                if thickness >= resolution + 3.0 {
                    assert!((found.mean_mm - thickness).abs() < 1.5, "{found:?}");
                }
            }
        }
    }

    #[test]
    fn wider_walls_are_thicker_and_less_is_known_where_the_resolution_is_not() {
        let [known, unknown] = [Some(14.5), None].map(|resolution| {
            [14.0, 16.0, 18.0, 20.0, 22.0]
                .map(|apparent| WallThickness::new(&look(apparent, resolution)))
        });
        for found in [&known, &unknown] {
            assert!(
                found.is_sorted_by(|a, b| a.mean_mm < b.mean_mm),
                "{found:?}"
            );
        }
        let width = |found: &WallThickness| found.interval_mm[1] - found.interval_mm[0];
        for (known, unknown) in known.iter().zip(&unknown).skip(2) {
            assert!(width(known) < width(unknown) && known.sd_mm < unknown.sd_mm);
        }
        // A usual width leaves a usual wall.
        assert!((unknown[1].mean_mm - 10.5).abs() < 1.0, "{:?}", unknown[1]);
    }

    /// Noise that a smooth filter made explains a wide wall.
    #[test]
    fn the_longer_the_noise_the_thinner_the_wall() {
        let of = |noise_length_mm| {
            WallThickness::new(&WallLook {
                noise_length_mm,
                ..look(19.0, None)
            })
        };
        let [sharp, usual, smooth] = [1.3, 2.1, 4.0].map(|length| of(Some(length)));
        assert!(sharp.mean_mm > usual.mean_mm && usual.mean_mm > smooth.mean_mm);
        assert!(of(None).sd_mm > 0.9 * usual.sd_mm);
    }

    #[test]
    fn every_look_has_a_thickness_within_its_interval() {
        for apparent_mm in [0.0, 3.0, 60.0] {
            for usual_mm in [-2.0, 0.0, 12.0, 80.0] {
                for resolution_mm in [None, Some(0.5), Some(29.0)] {
                    let found = WallThickness::new(&WallLook {
                        usual_mm,
                        cavity_ml: 0.0,
                        noise_length_mm: None,
                        ..look(apparent_mm, resolution_mm)
                    });
                    let [least, greatest] = found.interval_mm;
                    assert!(
                        least <= found.mean_mm && found.mean_mm <= greatest,
                        "{found:?}"
                    );
                    assert!(found.sd_mm.is_finite() && (3.0..30.0).contains(&found.mean_mm));
                }
            }
        }
    }
}
