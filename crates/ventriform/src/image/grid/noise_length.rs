//! The length of an image's noise, which tells the filter of its reconstruction.
//!
//! In: samples on a grid, and which of them count. Out: a length, mm ([`noise_length_mm`]). With M4, M6 and M8 the mean
//! squares of the second, third and fourth derivatives, it is the square root of M4 / M6 - M6 / M8. Noise is white
//! before the reconstruction filters it; organs are smooth beside it, and the higher the derivative, the less of them is
//! left. Differences of neighbouring samples stand for derivatives.
//!
//! M4 / M6 and M6 / M8 are squares of mean wavelengths over 2π, the second one of shorter waves. A filter that ends
//! steeply, as that of Butterworth, makes both long; how much a wall is blurred follows from how far they are apart
//! (docs/log/walls.md). A single wave has the length 0, white noise behind a Gaussian of deviation s the length
//! s √(4 / 35).
//!
//! Guaranteed: the result does not depend on the values' unit or origin.
//!
//! Not guaranteed: that the filter alone makes it; where there are few counts, or none, edges of organs take part.

/// Least number of differences along an axis.
const MIN_DIFFERENCES: usize = 500;

/// The noise length of `values`, mm, from the differences about the samples whose index `counts`. The samples have the
/// `shape`, the first axis fastest; neighbours lie `spacing_mm` apart. `None` if too few samples count along every axis,
/// or nothing changes there.
pub fn noise_length_mm(
    values: &[f32],
    shape: [usize; 3],
    spacing_mm: [f64; 3],
    counts: impl Fn(usize) -> bool,
) -> Option<f64> {
    let [mut second, mut third, mut fourth] = [0.0; 3];
    for axis in 0..3 {
        if let Some(squares) = mean_squares(values, shape, axis, &counts) {
            let spacing_squared = spacing_mm[axis].powi(2);
            second += squares[0] / spacing_squared.powi(2);
            third += squares[1] / spacing_squared.powi(3);
            fourth += squares[2] / spacing_squared.powi(4);
        }
    }
    let squared = second / third - third / fourth;
    (third > 0.0 && fourth > 0.0).then(|| squared.max(0.0).sqrt())
}

/// Mean squares of the second, third and fourth differences along an axis. `None` if too few count.
fn mean_squares(
    values: &[f32],
    shape: [usize; 3],
    axis: usize,
    counts: impl Fn(usize) -> bool,
) -> Option<[f64; 3]> {
    let step: usize = shape[..axis].iter().product();
    let length = step * shape[axis];
    let (mut sums, mut count) = ([0.0; 3], 0);
    for first in (0..values.len()).step_by(length.max(1)) {
        let last = (first + length).min(values.len());
        for index in first..last.saturating_sub(4 * step) {
            if !counts(index + 2 * step) {
                continue;
            }
            let [a, b, c, d, e] = [0, 1, 2, 3, 4].map(|n| f64::from(values[index + n * step]));
            let second = b - 2.0 * c + d;
            let third = d - 3.0 * c + 3.0 * b - a;
            let fourth = a - 4.0 * b + 6.0 * c - 4.0 * d + e;
            for (sum, difference) in sums.iter_mut().zip([second, third, fourth]) {
                *sum += difference * difference;
            }
            count += 1;
        }
    }
    (count >= MIN_DIFFERENCES).then(|| sums.map(|sum| sum / count as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::Vec3;
    use crate::base::geometry::frame::VoxelToPatient;
    use crate::base::geometry::random::{Purpose, stream};
    use crate::image::grid::Volume;
    use crate::image::grid::field::Field;
    use rand::RngExt;
    use std::f64::consts::TAU;

    fn length(field: &Field) -> f64 {
        noise_length_mm(field.values(), field.shape(), field.spacing(), |_| true).unwrap()
    }

    /// Two waves of wave numbers p and q and equal slopes: with M(n) = p^(n-2) + q^(n-2), where their differences are
    /// those of waves that are sampled, 2 sin(p s / 2) / s in place of p.
    #[test]
    fn that_of_two_waves_follows_from_their_wave_numbers() {
        let (shape, spacing_mm) = ([61, 60, 59], [2.0, 1.5, 2.5]);
        let frame = VoxelToPatient::centred(shape, spacing_mm, Vec3::zeros()).unwrap();
        for (axis, step) in spacing_mm.into_iter().enumerate() {
            let span_mm = (shape[axis] - 4) as f64 * step;
            let waves = [4.0, 7.0].map(|count| TAU * count / span_mm);
            let value = |p: &Vec3| waves.iter().map(|k| (k * p[axis]).sin() / k).sum::<f64>();
            let field = Field::new(&Volume::sampled(shape, frame.clone(), value), None, 0.0);
            let sampled = waves.map(|k| 2.0 * (0.5 * k * step).sin() / step);
            let moment = |order: i32| -> f64 {
                let terms = waves.iter().zip(&sampled);
                terms.map(|(k, own)| (own.powi(order) / k).powi(2)).sum()
            };
            let expected = (moment(2) / moment(3) - moment(3) / moment(4)).sqrt();
            let found = length(&field);
            assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
        }
    }

    /// The spectrum of white noise behind a Gaussian of deviation s is exp(-s² k²) along each axis, so that the mean
    /// squares of its second, third and fourth derivatives are 3 / 4 s⁴, 15 / 8 s⁶ and 105 / 16 s⁸ over a common factor.
    #[test]
    fn that_of_filtered_noise_is_the_filter_s_and_smooth_organs_or_a_unit_change_little() {
        let (shape, spacing_mm) = ([48; 3], [2.0; 3]);
        let frame = VoxelToPatient::centred(shape, spacing_mm, Vec3::zeros()).unwrap();
        for deviation_mm in [4.0, 5.0] {
            let mut random = stream(7, Purpose::Measure);
            let noise: Vec<f32> = (0..shape.iter().product())
                .map(|_| random.random::<f32>() - 0.5)
                .collect();
            let field = Field::new(&Volume::sampled(shape, frame.clone(), |_| 0.0), None, 0.0);
            let mut field = field.with_values(noise);
            field
                .blur(deviation_mm, &crate::base::progress::Monitor::silent())
                .unwrap();
            let found = length(&field);
            let expected = deviation_mm * (4.0_f64 / 35.0).sqrt();
            assert!((found / expected - 1.0).abs() < 0.15, "{found} {expected}");
            let organ = |index: usize| 1e-3 * ((index % 48) as f32 / 20.0).sin();
            let values = field.values().iter().enumerate();
            let beside = values.map(|(index, value)| 900.0 * (value + organ(index)) + 4.0);
            let with_organ = length(&field.clone().with_values(beside.collect()));
            assert!(
                (with_organ / found - 1.0).abs() < 0.15,
                "{with_organ} {found}"
            );
        }
    }

    #[test]
    fn what_does_not_count_takes_no_part_and_of_too_little_nothing_is_said() {
        let mut random = stream(3, Purpose::Measure);
        let (shape, spacing_mm) = ([24; 3], [3.0; 3]);
        let half = shape[0] * shape[1] * shape[2] / 2;
        let noise: Vec<f32> = (0..2 * half).map(|_| random.random::<f32>()).collect();
        let mut changed = noise.clone();
        changed[half..].fill(5.0);
        let of = |values: &[f32], counts: &dyn Fn(usize) -> bool| {
            noise_length_mm(values, shape, spacing_mm, counts)
        };
        let margin = 3 * shape[0] * shape[1];
        let first = |index: usize| index + margin < half;
        assert!(of(&noise, &first).is_some());
        assert_eq!(of(&noise, &first), of(&changed, &first));
        assert_eq!(of(&noise, &|_| false), None);
        assert_eq!(of(&[4.0; 13824], &|_| true), None);
        assert_eq!(noise_length_mm(&[], [0; 3], [1.0; 3], |_| true), None);
    }
}
