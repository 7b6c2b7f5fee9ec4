//! The wall that changed, and where it ends.
//!
//! In: a smoothed difference on the places of a map, the uptake beside which it stands, and the pair's noise. Out: the
//! places that changed. The steps:
//!
//! 1. A difference counts by the noise of its place. Places beyond [`SEED_SHARE`] of the limit ([`LIMIT_SDS`]) that
//!    touch by a side are one region; it counts if it exceeds the limit somewhere.
//! 2. A loss is a share of the uptake that was there. The depth of a region is the share that all but the deepest
//!    part of it lose ([`DEPTH_QUANTILE`]): the greatest share follows noise.
//! 3. The region ends at half of its depth: there the border of an even loss stays where it is, however the image is
//!    blurred.
//!
//! Not guaranteed: of two defects that touch, the one of less than half the depth of the other is left out.

use super::calibration::LIMIT_SDS;
use super::noise::Noise;
use crate::base::numeric::disjoint_sets::{set_numbers, singletons, unite};
use crate::base::numeric::order::weighted_quantile;
use crate::heart::polar::{RAY_COLUMNS, RAY_ROWS};

/// Share of the limit down to which a region reaches before its depth is known.
const SEED_SHARE: f64 = 0.35;
/// Share of a region's area that loses less than its depth.
const DEPTH_QUANTILE: f64 = 0.85;
/// Share of its depth at which a region ends.
const BORDER_SHARE: f64 = 0.5;

/// A difference of two maps, to one side of which wall may have changed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Field<'a> {
    /// Smoothed difference, points; positive where uptake was lost.
    pub difference: &'a [Option<f64>],
    /// Uptake that was there, smoothed likewise, per cent of the same reference.
    pub uptake: &'a [f64],
    /// Areas of the places, mm².
    pub areas: &'a [f64],
    /// The pair's noise.
    pub noise: Noise,
}

/// The wall that changed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Changed {
    /// Whether a place lies within the border of a region.
    pub within: Vec<bool>,
    /// Whether it lies in a region, or in what noise and blur make of its surroundings.
    pub about: Vec<bool>,
}

impl Field<'_> {
    /// The difference of a place in units of the limit.
    fn limits(&self, index: usize) -> Option<f64> {
        let own = self.difference[index]?;
        Some(own / (LIMIT_SDS * self.noise.at(index)))
    }

    /// The share of its uptake that a place lost.
    fn lost_share(&self, index: usize) -> f64 {
        self.difference[index].map_or(0.0, |own| own / self.uptake[index].max(1.0))
    }

    /// The places that changed.
    pub(super) fn changed(&self) -> Changed {
        let mut found = Changed {
            within: vec![false; self.difference.len()],
            about: vec![false; self.difference.len()],
        };
        for region in self.regions() {
            let peak = region.iter().filter_map(|index| self.limits(*index));
            if peak.fold(0.0, f64::max) <= 1.0 {
                continue;
            }
            let border = BORDER_SHARE * self.depth(&region);
            for index in region {
                found.about[index] = true;
                found.within[index] = self.lost_share(index) > border;
            }
        }
        found
    }

    /// Connected places beyond a share of the limit.
    fn regions(&self) -> Vec<Vec<usize>> {
        let beyond: Vec<bool> = (0..self.difference.len())
            .map(|index| self.limits(index).is_some_and(|own| own > SEED_SHARE))
            .collect();
        let mut parent = singletons(beyond.len());
        for index in 0..beyond.len() {
            let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
            let beside = row * RAY_COLUMNS + (column + 1) % RAY_COLUMNS;
            let below = (row + 1 < RAY_ROWS).then_some(index + RAY_COLUMNS);
            for other in below.into_iter().chain([beside]) {
                if beyond[index] && beyond[other] {
                    unite(&mut parent, index as u32, other as u32);
                }
            }
        }
        let mut regions = vec![Vec::new(); beyond.len()];
        for (index, number) in set_numbers(&mut parent).into_iter().enumerate() {
            if beyond[index] {
                regions[number as usize].push(index);
            }
        }
        regions.retain(|region| !region.is_empty());
        regions
    }

    /// The share that [`DEPTH_QUANTILE`] of the region's area lose less than.
    fn depth(&self, region: &[usize]) -> f64 {
        let shares = region.iter();
        let shares = shares.map(|index| (self.lost_share(*index), self.areas[*index]));
        weighted_quantile(shares.collect(), DEPTH_QUANTILE).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLACES: usize = RAY_ROWS * RAY_COLUMNS;

    /// A loss of a third of the circle in the rows beyond the eighth, with a blurred border, of a wall of 80 %.
    fn loss(share: f64) -> Vec<Option<f64>> {
        let of = |distance: f64, width: f64| 1.0 / (1.0 + (-distance / width).exp());
        (0..PLACES)
            .map(|index| {
                let column = (index % RAY_COLUMNS) as f64 - 29.5;
                let row = (index / RAY_COLUMNS) as f64;
                Some(80.0 * share * of(10.0 - column.abs(), 1.2) * of(row - 7.5, 0.8))
            })
            .collect()
    }

    fn changed(difference: &[Option<f64>]) -> Changed {
        let field = Field {
            difference,
            uptake: &[80.0; PLACES],
            areas: &[10.0; PLACES],
            noise: Noise {
                points: 4.0,
                ..Noise::USUAL
            },
        };
        field.changed()
    }

    /// The share is that of the wall which truly lost uptake, however much of it was lost.
    #[test]
    fn a_defect_ends_at_half_of_its_own_depth() {
        let truth = (20 * (RAY_ROWS - 8)) as f64;
        for share in [0.25, 0.4, 0.6, 0.9] {
            let found = changed(&loss(share)).within;
            let places = found.iter().filter(|is| **is).count() as f64;
            assert!((places / truth - 1.0).abs() < 0.08, "{share}: {places}");
        }
        assert!(!changed(&loss(0.1)).about.contains(&true));
    }

    /// A region that lies across the first column is one region.
    #[test]
    fn a_region_closes_about_the_circle() {
        let turned: Vec<Option<f64>> = {
            let known = loss(0.4);
            let from = |index: usize| {
                let (row, column) = (index / RAY_COLUMNS, index % RAY_COLUMNS);
                row * RAY_COLUMNS + (column + 30) % RAY_COLUMNS
            };
            (0..PLACES).map(|index| known[from(index)]).collect()
        };
        let count = |found: &Changed| found.within.iter().filter(|is| **is).count();
        assert_eq!(count(&changed(&turned)), count(&changed(&loss(0.4))));
        // The other way round nothing was lost.
        let gained: Vec<Option<f64>> = turned.iter().map(|own| own.map(|own| -own)).collect();
        assert!(!changed(&gained).about.contains(&true));
    }
}
