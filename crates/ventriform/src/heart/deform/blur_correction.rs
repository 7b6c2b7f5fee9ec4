//! Thickness that blur adds to a wall.
//!
//! A slab of thickness w and uptake 1, seen with a Gaussian of full width F at half maximum
//! (s = F / 2.355), shows the profile f(x) = [Φ(x + w/2) - Φ(x - w/2)] with
//! Φ(x) = erf(x / √2 s) / 2. Its full width W at half maximum is what
//! [`WallEdge::Apparent`](crate::heart::deform::WallEdge::Apparent) measures. W grows with w from F (an
//! infinitely thin wall) and approaches w for walls much thicker than F.
//!
//! Neglected: the wall's curvature, activity in the blood, uptake that varies across the wall.
//! Walls thinner than F / 2 can hardly be distinguished.

use crate::base::numeric::normal::erf;
use crate::image::grid::blur::FWHM_PER_SIGMA;
use std::f64::consts::SQRT_2;

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
pub fn width(thickness: f64, resolution: f64) -> f64 {
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

#[cfg(test)]
mod tests {
    use crate::heart::deform::blur_correction::*;

    #[test]
    fn thin_walls_look_as_thick_as_the_blur_and_thick_ones_as_they_are() {
        assert!((width(0.05, 12.0) - 12.0).abs() < 0.05);
        assert!((width(60.0, 12.0) - 60.0).abs() < 1e-3);
        assert_eq!(resolution_of(14.0, 12.0), 0.0);
    }

    #[test]
    fn a_slab_looks_as_wide_as_its_convolution() {
        for resolution in [8.0, 11.5, 16.0] {
            for thickness in [8.5, 11.0, 15.0] {
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
                let found = width(thickness, resolution);
                assert!((found - 2.0 * x).abs() < 0.05, "{found} for {thickness}");
                let blur = resolution_of(thickness, 2.0 * x);
                assert!((blur - resolution).abs() < 0.2, "{blur} for {resolution}");
            }
        }
    }
}
