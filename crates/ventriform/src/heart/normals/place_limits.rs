//! Limits of every place of the map, and what of a scan is compared with them.

use super::document::LimitMap;
use super::pattern::TermMatrix;
use crate::heart::polar::{PolarMap, RAY_COLUMNS, RAY_ROWS};

/// Variance of a coefficient that is added, so that a covariance has an inverse.
const LEAST_VARIANCE: f64 = 1e-8;

/// Normal mean and standard deviation of every place, row by row from apex to base; `None` where there are none.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaceLimits {
    /// Means, all above 0.
    pub mean: Vec<Option<f64>>,
    /// Standard deviations, all above 0.
    pub sd: Vec<Option<f64>>,
    /// Covariance of the coefficients of healthy people's patterns.
    pub covariance: TermMatrix,
}

/// The wall of a scan as limits see it: one entry for each place, row by row from apex to base.
#[derive(Debug, Clone, PartialEq)]
pub struct ScanPlaces {
    /// Uptake; `None` where there is no wall, or beyond the muscle's end.
    pub uptake: Vec<Option<f64>>,
    /// Area of wall, mm².
    pub area: Vec<f64>,
    /// Segment, 1 to 17.
    pub segment: Vec<usize>,
}

/// A place of a scan that has limits.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ComparedPlace {
    pub index: usize,
    pub uptake: f64,
    pub area: f64,
    pub mean: f64,
    pub sd: f64,
}

impl PlaceLimits {
    /// The places of the scan that have limits.
    pub(super) fn compared(&self, scan: &ScanPlaces) -> Vec<ComparedPlace> {
        let places = (0..scan.uptake.len()).filter_map(|index| {
            Some(ComparedPlace {
                index,
                uptake: scan.uptake[index]?,
                area: scan.area[index],
                mean: self.mean[index]?,
                sd: self.sd[index]?,
            })
        });
        places.collect()
    }

    /// The inverse of the covariance; a covariance that has none gives patterns that do not vary.
    pub(super) fn precision(&self) -> TermMatrix {
        let held = self.covariance + TermMatrix::identity() * LEAST_VARIANCE;
        let still = TermMatrix::identity() / LEAST_VARIANCE;
        held.cholesky().map_or(still, |solver| solver.inverse())
    }
}

impl ScanPlaces {
    /// The places of a map.
    pub fn from_map(map: &PolarMap) -> Self {
        Self {
            uptake: map
                .pixels
                .iter()
                .map(|pixel| {
                    pixel
                        .filter(crate::heart::polar::Pixel::is_muscle)
                        .map(|pixel| pixel.max)
                })
                .collect(),
            area: map
                .pixels
                .iter()
                .map(|pixel| pixel.map_or(0.0, |pixel| pixel.area))
                .collect(),
            segment: (0..RAY_ROWS * RAY_COLUMNS)
                .map(|index| map.segment_of(index / RAY_COLUMNS, index % RAY_COLUMNS))
                .collect(),
        }
    }
}

impl From<&LimitMap> for PlaceLimits {
    fn from(map: &LimitMap) -> Self {
        let flat = |rows: &[Vec<Option<f64>>]| rows.iter().flatten().copied().collect();
        Self {
            mean: flat(&map.mean),
            sd: flat(&map.sd),
            covariance: TermMatrix::from_fn(|a, b| map.pattern_covariance[a][b]),
        }
    }
}

impl From<&PlaceLimits> for LimitMap {
    /// Numbers to six places, covariances to twelve.
    fn from(limits: &PlaceLimits) -> Self {
        let round = |x: f64| (1e6 * x).round() / 1e6;
        let rows = |flat: &[Option<f64>]| -> Vec<Vec<Option<f64>>> {
            let rows = flat.chunks(RAY_COLUMNS);
            rows.map(|row| row.iter().map(|x| x.map(round)).collect())
                .collect()
        };
        Self {
            mean: rows(&limits.mean),
            sd: rows(&limits.sd),
            pattern_covariance: std::array::from_fn(|a| {
                std::array::from_fn(|b| (1e12 * limits.covariance[(a, b)]).round() / 1e12)
            }),
        }
    }
}
