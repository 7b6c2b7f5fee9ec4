//! The difference of two polar maps of one heart, and what it says of places, segments and territories.

use super::calibration::DIFFERENCE_SD_POINTS;
use super::scale::{Sides, matched};
use super::turn::{self, Turn};
use crate::model::wall::{RAY_COLUMNS, RAY_ROWS};
use crate::normals::ScanPlaces;
use crate::polar::{ARTERY_NAMES, territory};

/// Loss of uptake at stress beyond which wall is reversible, per cent of the rest map's reference.
pub const REVERSIBLE_POINTS: f64 = 2.5 * DIFFERENCE_SD_POINTS;
/// Standard deviations of the smoothing of the difference, rows and columns.
const SMOOTHING: [f64; 2] = [1.2, 2.4];

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
    /// Uptake at stress, scaled to rest, per cent of the rest map's reference, on the places of the rest map: row by
    /// row from apex to base; `None` without muscle in both.
    pub stress_percent: Vec<Option<f64>>,
    /// Uptake at rest, per cent of the reference.
    pub rest_percent: Vec<Option<f64>>,
    /// Rest less stress, smoothed, points: positive where stress lacks uptake.
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
        let turn = Turn::of(sides);
        let rest = ScanPlaces::of(sides.rest);
        let stress = ScanPlaces {
            uptake: turn::turned(sides.stress, turn.degrees),
            ..rest.clone()
        };
        let reference = sides.rest.reference;
        let matched = matched(&stress, &rest, reference)?;
        let percent = |uptake: Option<f64>, other: Option<f64>, unit: f64| {
            other?;
            Some(100.0 * uptake? / unit)
        };
        let pairs = || rest.uptake.iter().zip(&stress.uptake);
        let rest_percent: Vec<Option<f64>> = pairs()
            .map(|(rest, stress)| percent(*rest, *stress, reference))
            .collect();
        let stress_percent: Vec<Option<f64>> = pairs()
            .map(|(rest, stress)| percent(*stress, *rest, reference * matched.counts))
            .collect();
        let raw: Vec<Option<f64>> = (rest_percent.iter().zip(&stress_percent))
            .map(|(rest, stress)| Some((*rest)? - (*stress)?))
            .collect();
        let difference_points = smoothed(&raw, &rest.area);
        let threshold = 100.0 * sides.rest.threshold;
        let mut of_segment = [Sums::default(); 17];
        for index in 0..raw.len() {
            let (Some(stress), Some(at_rest), Some(difference)) = (
                stress_percent[index],
                rest_percent[index],
                difference_points[index],
            ) else {
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
            stress_percent,
            rest_percent,
            difference_points,
            reversible_percent: whole.reversible_percent,
            fixed_percent: whole.fixed_percent,
            segments: std::array::from_fn(|index| ComparedSegment {
                segment: index + 1,
                figures: of_segment[index].figures(),
            }),
            territories: ARTERY_NAMES.map(|name| {
                let own = (1..=17).filter(|segment| territory(*segment) == name);
                let sums = own.fold(Sums::default(), |sum, segment| {
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

/// The weighted means of the values about every place that has one, each by its area and a Gaussian over rows and
/// columns.
fn smoothed(values: &[Option<f64>], areas: &[f64]) -> Vec<Option<f64>> {
    let kernel = |sigma: f64| -> Vec<f64> {
        let reach = (3.0 * sigma).ceil() as i64;
        (-reach..=reach)
            .map(|away| (-0.5 * (away as f64 / sigma).powi(2)).exp())
            .collect()
    };
    let [of_rows, of_columns] = SMOOTHING.map(kernel);
    let [row_reach, column_reach] = [&of_rows, &of_columns].map(|kernel| kernel.len() as i64 / 2);
    let about = |index: usize| {
        values[index]?;
        let (row, column) = ((index / RAY_COLUMNS) as i64, (index % RAY_COLUMNS) as i64);
        let (mut sum, mut weight) = (0.0, 0.0);
        for (r, of_row) in (row - row_reach..).zip(&of_rows) {
            if !(0..RAY_ROWS as i64).contains(&r) {
                continue;
            }
            for (c, of_column) in (column - column_reach..).zip(&of_columns) {
                let at = r as usize * RAY_COLUMNS + c.rem_euclid(RAY_COLUMNS as i64) as usize;
                if let Some(value) = values[at] {
                    let own = of_row * of_column * areas[at];
                    sum += own * value;
                    weight += own;
                }
            }
        }
        (weight > 0.0).then(|| sum / weight)
    };
    (0..values.len()).map(about).collect()
}
