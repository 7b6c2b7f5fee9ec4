//! The difference of two polar maps of one heart, and what it says of places, segments and territories.

use super::answers::Answers;
use super::calibration::LIMIT_SDS;
use super::noise::Noise;
use super::scale::Sides;
use super::side_by_side::{Changes, Compared};
use super::turn::Turn;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::polar::{ARTERY_NAMES, segments_of};

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
    /// The noise of the difference.
    pub noise: Noise,
    /// Shares of the compared wall that changed, with what noise lets them be.
    pub answers: Answers,
    /// What stress lacks in and about the wall that is reversible, per cent of the whole wall's uptake at rest.
    pub lost_percent: f64,
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
    /// Loss of uptake that noise does not explain, per cent of the rest map's reference.
    pub fn limit_points(&self) -> f64 {
        LIMIT_SDS * self.noise.points
    }

    /// The change between two maps; `None` where no wall can be compared, or one of them has no uptake.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn between(sides: &Sides<'_>, monitor: &Monitor) -> Result<Option<Self>, Cancelled> {
        let turn = Turn::from_sides(sides);
        let Some(both) = Compared::new(sides, turn.degrees) else {
            return Ok(None);
        };
        let changes = both.changes(&both.difference);
        let mut of_segment = [Sums::default(); 17];
        for index in 0..both.areas.len() {
            let (Some(stress), Some(at_rest), Some(difference)) =
                (both.stress[index], both.rest[index], both.difference[index])
            else {
                continue;
            };
            let area = both.areas[index];
            let counted = |is: bool| if is { area } else { 0.0 };
            let sums = &mut of_segment[both.segment[index] - 1];
            *sums = sums.add(Sums {
                area,
                stress: area * stress,
                rest: area * at_rest,
                difference: area * difference,
                reversible: counted(changes.lost.within[index]),
                fixed: counted(both.is_fixed(&changes, index, [stress, at_rest])),
            });
        }
        let all = of_segment.into_iter().fold(Sums::default(), Sums::add);
        let wall = sides.rest.pixels.iter().flatten();
        let wall: f64 = wall.map(|pixel| pixel.area).sum();
        Ok(Some(Self {
            turn,
            scale: both.matched.counts,
            matched_percent: 100.0 * both.matched.share,
            compared_percent: 100.0 * all.area / wall,
            noise: both.noise,
            answers: Answers::new(&both, monitor)?,
            lost_percent: lost_percent(&both, &changes),
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
            difference_points: both.difference,
        }))
    }
}

/// What stress lacks in and about the wall that is reversible, per cent of the whole wall's uptake at rest.
fn lost_percent(both: &Compared, changes: &Changes) -> f64 {
    let (mut lost, mut whole) = (0.0, 0.0);
    for (index, area) in both.areas.iter().enumerate() {
        let about = changes.lost.about[index];
        let own = both.difference[index].filter(|_| about);
        lost += area * own.unwrap_or(0.0);
        whole += area * both.uptake[index];
    }
    100.0 * lost / whole
}
