//! The difference of two polar maps of one heart, and what it says of places, segments and territories.

use super::calibration::DIFFERENCE_SD_POINTS;
use super::scale::{Sides, matched};
use super::turn::{self, Turn};
use crate::heart::normals::ScanPlaces;
use crate::heart::polar::{ARTERY_NAMES, MapGaussian, segments_of};

/// Loss of uptake at stress beyond which wall is reversible, per cent of the rest map's reference.
pub const REVERSIBLE_POINTS: f64 = 2.5 * DIFFERENCE_SD_POINTS;
/// Standard deviations of the smoothing of the difference, rows and columns.
const SMOOTHING_PLACES: [f64; 2] = [1.2, 2.4];
/// Rows and columns on either side that it takes in.
const SMOOTHING_REACH: [usize; 2] = [4, 8];

/// The change from rest to stress.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Turn of the stress map against the rest map.
    pub turn: Turn,
    /// Counts of the stress scan that are one count of the rest scan where nothing changed.
    pub scale: f64,
    /// Share of the wall by which stress was scaled, per cent.
    pub matched_percent: f64,
    /// Share of the wall with muscle in both maps, per cent.
    pub compared_percent: f64,
    /// Rest less stress, smoothed, per cent of the rest map's reference, on its places: row by row from apex to base,
    /// positive where stress lacks uptake; `None` without muscle in both.
    pub difference_points: Vec<Option<f64>>,
    /// Share of the compared wall that loses more than [`REVERSIBLE_POINTS`], per cent.
    pub reversible_percent: f64,
    /// Share of the compared wall below the rest map's threshold in both, per cent.
    pub fixed_percent: f64,
    /// The segments 1 to 17.
    pub segments: [ComparedSegment; 17],
    /// The territories LAD, LCX and RCA.
    pub territories: [ComparedTerritory; 3],
}

/// A segment at stress and at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedSegment {
    /// 1 to 17.
    pub segment: usize,
    /// Its figures.
    pub figures: PartFigures,
}

/// The wall of an artery at stress and at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComparedTerritory {
    /// LAD, LCX or RCA.
    pub name: &'static str,
    /// Its figures.
    pub figures: PartFigures,
}

/// Figures of a part of the wall: means over its area.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PartFigures {
    /// Uptake at stress, scaled to rest, per cent of the rest map's reference; `None` where nothing can be compared,
    /// as for the others.
    pub stress_percent: Option<f64>,
    /// Uptake at rest, per cent of the reference.
    pub rest_percent: Option<f64>,
    /// Rest less stress, points.
    pub difference_points: Option<f64>,
    /// Share of its compared area that is reversible, per cent.
    pub reversible_percent: f64,
    /// Share of its compared area that is fixed, per cent.
    pub fixed_percent: f64,
}

/// Sums over places.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    area: f64,
    stress: f64,
    rest: f64,
    difference: f64,
    reversible: f64,
    fixed: f64,
}

impl Sums {
    fn add(self, other: Self) -> Self {
        Self {
            area: self.area + other.area,
            stress: self.stress + other.stress,
            rest: self.rest + other.rest,
            difference: self.difference + other.difference,
            reversible: self.reversible + other.reversible,
            fixed: self.fixed + other.fixed,
        }
    }

    fn figures(&self) -> PartFigures {
        let mean = |sum: f64| (self.area > 0.0).then(|| sum / self.area);
        let percent = |sum: f64| mean(sum).map_or(0.0, |share| 100.0 * share);
        PartFigures {
            stress_percent: mean(self.stress),
            rest_percent: mean(self.rest),
            difference_points: mean(self.difference),
            reversible_percent: percent(self.reversible),
            fixed_percent: percent(self.fixed),
        }
    }
}

impl Change {
    /// The change between two maps; `None` where no wall can be compared, or one of them has no uptake.
    pub fn between(sides: &Sides<'_>) -> Option<Self> {
        let turn = Turn::from_sides(sides);
        let rest = ScanPlaces::from_map(sides.rest);
        let stress = ScanPlaces {
            uptake: turn::turned(sides.stress, turn.degrees),
            ..rest.clone()
        };
        let reference = sides.rest.reference;
        let matched = matched(&stress, &rest, reference)?;
        // Uptake at stress and at rest, per cent of the rest map's reference.
        let percents: Vec<Option<[f64; 2]>> = (stress.uptake.iter().zip(&rest.uptake))
            .map(|(stress, rest)| {
                let stress = 100.0 * (*stress)? / (reference * matched.counts);
                Some([stress, 100.0 * (*rest)? / reference])
            })
            .collect();
        let raw: Vec<Option<f64>> = (percents.iter())
            .map(|both| both.map(|[stress, rest]| rest - stress))
            .collect();
        let difference_points = smoothed(&raw, &rest.area);
        let threshold = 100.0 * sides.rest.threshold;
        let mut of_segment = [Sums::default(); 17];
        for (index, (both, difference)) in percents.iter().zip(&difference_points).enumerate() {
            let (Some([stress, at_rest]), Some(difference)) = (*both, *difference) else {
                continue;
            };
            let area = rest.area[index];
            let counted = |is: bool| if is { area } else { 0.0 };
            let reversible = difference > REVERSIBLE_POINTS;
            let sums = &mut of_segment[rest.segment[index] - 1];
            *sums = sums.add(Sums {
                area,
                stress: area * stress,
                rest: area * at_rest,
                difference: area * difference,
                reversible: counted(reversible),
                fixed: counted(!reversible && stress < threshold && at_rest < threshold),
            });
        }
        let all = of_segment.into_iter().fold(Sums::default(), Sums::add);
        let wall: f64 = rest.area.iter().sum();
        let whole = all.figures();
        Some(Self {
            turn,
            scale: matched.counts,
            matched_percent: 100.0 * matched.share,
            compared_percent: 100.0 * all.area / wall,
            difference_points,
            reversible_percent: whole.reversible_percent,
            fixed_percent: whole.fixed_percent,
            segments: std::array::from_fn(|index| ComparedSegment {
                segment: index + 1,
                figures: of_segment[index].figures(),
            }),
            territories: ARTERY_NAMES.map(|name| {
                let sums = segments_of(name).fold(Sums::default(), |sum, segment| {
                    sum.add(of_segment[segment - 1])
                });
                ComparedTerritory {
                    name,
                    figures: sums.figures(),
                }
            }),
        })
    }
}

/// The differences in the mean over neighbouring places that have one, each by its area and a Gaussian.
fn smoothed(differences: &[Option<f64>], areas: &[f64]) -> Vec<Option<f64>> {
    let values: Vec<f64> = differences.iter().map(|own| own.unwrap_or(0.0)).collect();
    let weights: Vec<f64> = (differences.iter().zip(areas))
        .map(|(own, area)| own.map_or(0.0, |_| *area))
        .collect();
    let means = MapGaussian::new(SMOOTHING_PLACES, SMOOTHING_REACH).means(&values, &weights);
    (means.into_iter().zip(&weights))
        .map(|(mean, weight)| (*weight > 0.0).then_some(mean))
        .collect()
}
