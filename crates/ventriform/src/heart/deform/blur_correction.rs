//! Thickness that blur adds to a wall.
//!
//! A slab of thickness w and uptake 1, seen with a Gaussian of full width F at half maximum
//! (s = F / 2.355), shows the profile f(x) = [Φ(x + w/2) - Φ(x - w/2)] with
//! Φ(x) = erf(x / √2 s) / 2. Its full width W at half maximum is what
//! [`WallEdge::Apparent`](crate::heart::deform::WallEdge::Apparent) measures. W grows with w from F (an
//! infinitely thin wall) and approaches w for walls much thicker than F, so w follows from W and F
//! by bisection.
//!
//! Neglected: the wall's curvature, activity in the blood, uptake that varies across the wall.
//! Walls thinner than F / 2 can hardly be distinguished; the result is at least F / 2.

use crate::image::grid::blur::FWHM_PER_SIGMA;
use std::f64::consts::SQRT_2;

/// Thickness that a blur of `resolution` mm (full width at half maximum) adds to a wall that
/// looks `apparent` mm thick, mm.
pub fn excess(apparent: f64, resolution: f64) -> f64 {
    if !(resolution > 0.0 && apparent > 0.0) {
        return 0.0;
    }
    let least = (0.5 * resolution).min(apparent);
    let (mut low, mut high) = (least, apparent);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if width(middle, resolution) < apparent {
            low = middle;
        } else {
            high = middle;
        }
    }
    apparent - 0.5 * (low + high)
}

/// The blur (full width at half maximum, mm) that makes a slab of `thickness` mm look `apparent` mm
/// thick: the resolution of an image whose walls are known. 0 if the slab does not look thicker.
pub fn resolution_of(thickness: f64, apparent: f64) -> f64 {
    let (mut low, mut high) = (0.0, apparent.max(0.0));
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if width(thickness, middle) < apparent {
            low = middle;
        } else {
            high = middle;
        }
    }
    low
}

/// Full width at half maximum of a slab of `thickness` mm, blurred by `resolution` mm.
fn width(thickness: f64, resolution: f64) -> f64 {
    let scale = 1.0 / (SQRT_2 * resolution / FWHM_PER_SIGMA);
    let half = 0.5 * thickness;
    let value = |x: f64| erf((x + half) * scale) - erf((x - half) * scale);
    let level = 0.5 * value(0.0);
    let (mut low, mut high) = (0.0, half + 2.0 * resolution);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if value(middle) > level {
            low = middle;
        } else {
            high = middle;
        }
    }
    low + high
}

/// The error function within 1.5e-7 (Abramowitz and Stegun 1964, 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let series = [
        1.061_405_429,
        -1.453_152_027,
        1.421_413_741,
        -0.284_496_736,
        0.254_829_592,
    ];
    let sum = series.iter().fold(0.0, |sum, a| (sum + a) * t);
    (1.0 - sum * (-x * x).exp()).copysign(x)
}

#[cfg(test)]
mod tests {
    use crate::heart::deform::blur_correction::*;

    #[test]
    fn thin_walls_look_as_thick_as_the_blur_and_thick_ones_as_they_are() {
        assert!((width(0.05, 12.0) - 12.0).abs() < 0.05);
        assert!((width(60.0, 12.0) - 60.0).abs() < 1e-3);
        assert!(excess(60.0, 12.0).abs() < 1e-3);
        assert_eq!(excess(14.0, 0.0), 0.0);
        // Thinner than any blurred wall: the least result, half the resolution.
        assert!((excess(9.0, 12.0) - 3.0).abs() < 1e-6);
    }

    #[test]
    fn the_excess_is_what_a_blurred_slab_shows() {
        for resolution in [8.0, 11.5, 16.0] {
            for thickness in [8.5, 11.0, 15.0] {
                // The slab convolved numerically.
                let s = resolution / FWHM_PER_SIGMA;
                let step = 0.01;
                let value = |x: f64| -> f64 {
                    (0..(thickness / step) as usize)
                        .map(|n| {
                            let y = -0.5 * thickness + (n as f64 + 0.5) * step;
                            (-0.5 * ((x - y) / s).powi(2)).exp()
                        })
                        .sum()
                };
                let level = 0.5 * value(0.0);
                let mut x = 0.0;
                while value(x) > level {
                    x += 0.01;
                }
                let found = 2.0 * x - excess(2.0 * x, resolution);
                assert!((found - thickness).abs() < 0.1, "{found} for {thickness}");
                let blur = resolution_of(thickness, 2.0 * x);
                assert!((blur - resolution).abs() < 0.2, "{blur} for {resolution}");
            }
        }
    }

    /// Values of Abramowitz and Stegun's table 7.1.
    #[test]
    fn the_error_function_is_that_of_the_tables() {
        for (x, value) in [
            (0.0, 0.0),
            (0.2, 0.222_702_589),
            (0.5, 0.520_499_878),
            (1.0, 0.842_700_793),
            (1.5, 0.966_105_146),
            (2.0, 0.995_322_265),
        ] {
            assert!((erf(x) - value).abs() < 2e-7 && (erf(-x) + value).abs() < 2e-7);
        }
    }
}
