//! The smoothness of an image: the length over which its values change.
//!
//! In: samples on a grid. Out: a length, mm ([`smoothness_mm`]): the root mean square of the first derivatives over
//! that of the second ones. It grows with whatever blurred the image, the camera and the filters of the reconstruction
//! alike. Differences of neighbouring samples stand for derivatives.
//!
//! A wave of length λ has the smoothness λ / 2π, whatever its height and phase. An image of many waves has the mean of
//! its waves, weighted towards the short ones, so noise should be blurred away before.
//!
//! Guaranteed: the result does not depend on the values' unit or origin.
//!
//! Not guaranteed: that equal cameras and filters give equal lengths; organs of other shapes and more noise give
//! others.

/// Least number of second differences along an axis.
const MIN_DIFFERENCES: usize = 200;

/// The smoothness of `values`, mm. They have the `shape`, the first axis fastest; neighbours lie `spacing_mm` apart.
/// `None` if there are too few samples along every axis, or no change of slope.
pub fn smoothness_mm(values: &[f32], shape: [usize; 3], spacing_mm: [f64; 3]) -> Option<f64> {
    let mut first = 0.0;
    let mut second = 0.0;
    for axis in 0..3 {
        if let Some([slope, bend]) = mean_squares(values, shape, axis) {
            let squared_mm2 = spacing_mm[axis] * spacing_mm[axis];
            first += slope / squared_mm2;
            second += bend / (squared_mm2 * squared_mm2);
        }
    }
    (second > 0.0).then(|| (first / second).sqrt())
}

/// Mean squares of the first and of the second differences along an axis. `None` if there are too few.
fn mean_squares(values: &[f32], shape: [usize; 3], axis: usize) -> Option<[f64; 2]> {
    let step: usize = shape[..axis].iter().product();
    let block = step * shape[axis];
    let (mut first, mut second, mut count) = (0.0, 0.0, 0);
    for block in values.chunks_exact(block.max(1)) {
        let Some(rest) = block.get(2 * step..) else {
            continue;
        };
        for ((before, here), after) in block.iter().zip(&block[step..]).zip(rest) {
            let [slope, next] = [here - before, after - here].map(f64::from);
            first += slope * slope;
            second += (next - slope) * (next - slope);
            count += 1;
        }
    }
    let count = (count >= MIN_DIFFERENCES).then_some(count as f64)?;
    Some([first / count, second / count])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::image::grid::Volume;
    use crate::image::grid::field::Field;
    use std::f64::consts::TAU;

    fn sampled(shape: [usize; 3], spacing_mm: [f64; 3], value: impl Fn(&Vec3) -> f64) -> Field {
        let frame = VoxelToPatient::centred(shape, spacing_mm, Vec3::zeros()).unwrap();
        Field::new(&Volume::sampled(shape, frame, value), None, 0.0)
    }

    fn smoothness(field: &Field) -> f64 {
        smoothness_mm(field.values(), field.shape(), field.spacing()).unwrap()
    }

    /// Of whole waves, since the slopes and the bends of a part of one differ.
    #[test]
    fn that_of_a_wave_is_its_length_over_two_pi() {
        let (shape, spacing_mm) = ([61, 62, 63], [2.0, 1.5, 2.5]);
        for axis in 0..3 {
            for waves in [2.0, 3.0] {
                let length_mm = (shape[axis] - 2) as f64 * spacing_mm[axis] / waves;
                let wave = |p: &Vec3| 3.0 + 7.0 * (TAU * p[axis] / length_mm).sin();
                let found = smoothness(&sampled(shape, spacing_mm, wave));
                let expected = length_mm / TAU;
                assert!((found / expected - 1.0).abs() < 0.02, "{found} {expected}");
            }
        }
    }

    /// A Gaussian of deviation s has mean squares 3 / 4 s² and 9 / 4 s⁴ of its slopes and bends along the axes, over a
    /// common factor, so its smoothness is s times √(2 / 3).
    #[test]
    fn that_of_a_blurred_point_grows_with_the_blur_and_a_unit_changes_nothing() {
        for deviation_mm in [6.0, 9.0, 12.0] {
            let point = |p: &Vec3| (-0.5 * (p.norm() / deviation_mm).powi(2)).exp();
            let field = sampled([60; 3], [2.0; 3], point);
            let found = smoothness(&field);
            let expected = deviation_mm * (2.0_f64 / 3.0).sqrt();
            assert!((found / expected - 1.0).abs() < 0.03, "{found} {expected}");
            let scaled = field.values().iter().map(|value| 8.0 * value + 64.0);
            let scaled = field.clone().with_values(scaled.collect());
            assert!((smoothness(&scaled) / found - 1.0).abs() < 1e-3);
        }
    }

    #[test]
    fn nothing_is_said_of_few_or_equal_samples() {
        assert_eq!(smoothness_mm(&[], [0; 3], [1.0; 3]), None);
        assert_eq!(smoothness_mm(&[1.0; 8], [2; 3], [1.0; 3]), None);
        assert_eq!(smoothness_mm(&[1.0; 1000], [10; 3], [1.0; 3]), None);
    }
}
