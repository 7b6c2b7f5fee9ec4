//! The noise of a pair of scans: how much the smoothed difference of their maps differs from zero where nothing changed.
//!
//! In: the difference of both maps and the same smoothed. Out: the pair's [`Noise`], and fields of noise like it
//! ([`fields`]). The steps:
//!
//! 1. A loss at stress raises one side of the difference. Only the places on the other side are used, unless there is far
//!    more on that: then uptake rose there, and the side of the losses is used.
//! 2. There, two figures tell the noise: the mean square of the smoothed difference, and that of what smoothing takes
//!    away ([`SMOOTH_PER_FINE_NOISE`]), which stands on many more independent places, but knows less of slow noise.
//! 3. The variance is the mean of both and of the usual pair's ([`USUAL_NOISE_POINTS`]), each by its degrees of freedom.
//! 4. Noise falls from apex to base as it does in unchanged hearts ([`ROW_NOISE_SHARES`]): fewer places of the map lie
//!    within the reach of the smoothing at the apex than elsewhere.
//! 5. Noise of reconstructed images is correlated over their resolution: a field is white noise under a Gaussian.
//!
//! Guaranteed: the same maps give the same noise and the same fields.
//!
//! Not guaranteed: what both scans share, such as attenuation. Where uptake rose in a part of the wall and fell in another,
//! the rise counts as noise.

use super::calibration::{
    MUSCLE_SD, MUSCLE_SD_PER_POINT, ROW_NOISE_SHARES, SMOOTH_PER_FINE_NOISE, USUAL_NOISE_POINTS,
};
use crate::base::geometry::random::{Purpose, normal, stream};
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::polar::{MapGaussian, RAY_COLUMNS, RAY_ROWS};

/// Rows of the map that [`ROW_NOISE_SHARES`] stand for; between them noise is linear, beyond them it is constant.
const SHARE_ROWS: [f64; 3] = [3.5, 11.5, 19.5];
/// Degrees of freedom of the smoothed difference, of what smoothing takes away, and of the usual pair.
const SMOOTH_FREEDOM: f64 = 20.0;
const FINE_FREEDOM: f64 = 40.0;
const USUAL_FREEDOM: f64 = 8.0;
/// Standard deviations of the Gaussian that correlates white noise as smoothed differences are, rows and columns.
const CORRELATION_PLACES: [f64; 2] = [2.1, 3.4];
/// Rows and columns on either side that it takes in.
const CORRELATION_REACH: [usize; 2] = [6, 10];
/// Quotient of the variances of both sides from which on the greater one is no noise: chance exceeds it in one of thirty
/// pairs.
const CHANGED_SIDE: f64 = 2.5;
/// Standard deviations by which the walls' volumes of one heart hardly differ.
const MUSCLE_SDS: f64 = 4.0;
/// The seed of all fields.
const FIELD_SEED: u64 = 60;

/// The noise of the smoothed difference of a pair.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation over the wall, per cent of the rest map's reference.
    pub points: f64,
    /// Root mean square of the smoothed difference on the side that is used, points.
    pub smooth_points: f64,
    /// The same of what smoothing takes away.
    pub fine_points: f64,
}

impl Noise {
    /// The noise of the usual pair.
    pub(super) const USUAL: Self = Self {
        points: USUAL_NOISE_POINTS,
        smooth_points: USUAL_NOISE_POINTS,
        fine_points: USUAL_NOISE_POINTS / SMOOTH_PER_FINE_NOISE,
    };

    /// The noise of a pair with this difference, before and after it was smoothed, points.
    pub(super) fn of_pair(raw: &[Option<f64>], smoothed: &[Option<f64>], areas: &[f64]) -> Self {
        let [gained, lost] = [-1.0, 1.0].map(|side| Self::of_side(side, raw, smoothed, areas));
        if gained.points.powi(2) > CHANGED_SIDE * lost.points.powi(2) {
            lost
        } else {
            gained
        }
    }

    /// The same by the places whose difference has the sign of `side`.
    fn of_side(side: f64, raw: &[Option<f64>], smoothed: &[Option<f64>], areas: &[f64]) -> Self {
        let (mut smooth, mut fine, mut area) = (0.0, 0.0, 0.0);
        for (index, (raw, smoothed)) in raw.iter().zip(smoothed).enumerate() {
            let (Some(raw), Some(slow)) = (*raw, smoothed.filter(|own| side * *own > 0.0)) else {
                continue;
            };
            let weight = areas[index] / row_share(index / RAY_COLUMNS).powi(2);
            smooth += weight * slow.powi(2);
            fine += weight * (raw - slow).powi(2);
            area += areas[index];
        }
        if area == 0.0 {
            return Self::USUAL;
        }
        let [smooth_points, fine_points] = [smooth, fine].map(|sum| (sum / area).sqrt());
        let told = [
            (SMOOTH_FREEDOM, smooth_points),
            (FINE_FREEDOM, SMOOTH_PER_FINE_NOISE * fine_points),
            (USUAL_FREEDOM, USUAL_NOISE_POINTS),
        ];
        let freedom: f64 = told.iter().map(|(freedom, _)| freedom).sum();
        let squares = told
            .iter()
            .map(|(freedom, points)| freedom * points * points);
        Self {
            points: (squares.sum::<f64>() / freedom).sqrt(),
            smooth_points,
            fine_points,
        }
    }

    /// Whether walls whose volumes have this quotient may be of one heart.
    pub fn explains_muscle(self, quotient: f64) -> bool {
        let deviation = MUSCLE_SD.hypot(MUSCLE_SD_PER_POINT * self.points);
        quotient.ln().abs() <= MUSCLE_SDS * deviation
    }

    /// Standard deviation at a place of the map, points.
    pub fn at(self, index: usize) -> f64 {
        self.points * row_share(index / RAY_COLUMNS)
    }
}

/// Noise in a row of the map, as a share of that of the wall.
fn row_share(row: usize) -> f64 {
    let [apical, middle, basal] = ROW_NOISE_SHARES;
    let row = row as f64;
    let between = |[from, to]: [f64; 2], [first, last]: [f64; 2]| {
        first + (last - first) * ((row - from) / (to - from)).clamp(0.0, 1.0)
    };
    let [start, turn, end] = SHARE_ROWS;
    if row < turn {
        between([start, turn], [apical, middle])
    } else {
        between([turn, end], [middle, basal])
    }
}

/// `count` fields of correlated noise on the places of a map with these areas, row by row from apex to base: of mean
/// square 1 in every row.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn fields(
    areas: &[f64],
    count: usize,
    monitor: &Monitor,
) -> Result<Vec<Vec<f64>>, Cancelled> {
    let gaussian = MapGaussian::new(CORRELATION_PLACES, CORRELATION_REACH);
    let mut random = stream(FIELD_SEED, Purpose::ComparisonNoise);
    let mut made: Vec<Vec<f64>> = (0..count)
        .map(|_| {
            monitor.check()?;
            let white = areas
                .iter()
                .map(|_| normal(&mut random))
                .collect::<Vec<_>>();
            Ok(gaussian.means(&white, areas))
        })
        .collect::<Result<_, _>>()?;
    for row in 0..RAY_ROWS {
        let own = row * RAY_COLUMNS..(row + 1) * RAY_COLUMNS;
        let squares: f64 = (made.iter())
            .flat_map(|field| &field[own.clone()])
            .map(|value| value * value)
            .sum();
        let deviation = (squares / (count * RAY_COLUMNS) as f64).sqrt();
        if deviation > 0.0 {
            let values = made.iter_mut().flat_map(|field| &mut field[own.clone()]);
            values.for_each(|value| *value /= deviation);
        }
    }
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: usize = RAY_ROWS * RAY_COLUMNS;

    fn difference(field: &[f64], noise: Noise) -> Vec<Option<f64>> {
        let place = |(index, value): (usize, &f64)| Some(value * noise.at(index));
        field.iter().enumerate().map(place).collect()
    }

    /// A loss raises the other side only: the noise that is found hardly follows it.
    #[test]
    fn a_loss_is_no_noise() {
        let areas = vec![10.0; PLACES];
        let noise = Noise {
            points: 8.0,
            ..Noise::USUAL
        };
        let fine = noise.points / SMOOTH_PER_FINE_NOISE;
        for field in fields(&areas, 8, &Monitor::silent()).unwrap() {
            let smoothed = difference(&field, noise);
            let raw_of = |smoothed: &[Option<f64>]| -> Vec<Option<f64>> {
                let places = smoothed.iter().enumerate();
                let sign = |index: usize| if index.is_multiple_of(2) { fine } else { -fine };
                places
                    .map(|(index, own)| {
                        Some((*own)? + sign(index) * row_share(index / RAY_COLUMNS))
                    })
                    .collect()
            };
            let found = Noise::of_pair(&raw_of(&smoothed), &smoothed, &areas).points;
            assert!((found / 8.0 - 1.0).abs() < 0.25, "{found}");
            let lost: Vec<Option<f64>> = (smoothed.iter().enumerate())
                .map(|(index, own)| {
                    let inside = index / RAY_COLUMNS > 8 && index % RAY_COLUMNS < 20;
                    Some((*own)? + if inside { 50.0 } else { 0.0 })
                })
                .collect();
            let beside = Noise::of_pair(&raw_of(&lost), &lost, &areas).points;
            assert!((beside / found - 1.0).abs() < 0.15, "{beside} {found}");
            // Nor is a gain.
            let gained: Vec<Option<f64>> = lost.iter().map(|own| own.map(|own| -own)).collect();
            let beside = Noise::of_pair(&raw_of(&gained), &gained, &areas).points;
            assert!((beside / 8.0 - 1.0).abs() < 0.35, "{beside}");
        }
    }

    /// Neighbours are alike, places far apart are not, and every row has the same deviation.
    #[test]
    fn fields_are_correlated_over_the_resolution() {
        let forty = || fields(&vec![10.0; PLACES], 40, &Monitor::silent()).unwrap();
        let made = forty();
        let mean = |of: &dyn Fn(&[f64]) -> f64| {
            made.iter().map(|field| of(field)).sum::<f64>() / made.len() as f64
        };
        let product = |apart: usize| {
            mean(&|field| {
                let row = &field[12 * RAY_COLUMNS..13 * RAY_COLUMNS];
                let pairs = (0..RAY_COLUMNS).map(|c| row[c] * row[(c + apart) % RAY_COLUMNS]);
                pairs.sum::<f64>() / RAY_COLUMNS as f64
            })
        };
        assert!((product(0) - 1.0).abs() < 1e-9);
        assert!(product(2) > 0.8 && product(30).abs() < 0.2);
        assert_eq!(made, forty());
    }
}
