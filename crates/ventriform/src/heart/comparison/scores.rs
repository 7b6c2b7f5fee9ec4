//! The scores of both scans with what noise lets them be.
//!
//! In: both scans beside normal limits, and their change with its noise. Out: [`ScoreAnswers`]: each score with the 5th
//! and 95th percentile over draws of correlated noise on the maps, and whether it is abnormal: a summed score of 4 or
//! more, a summed difference score of 2 or more (Hendel et al., J Nucl Cardiol 2009), a twentieth of the wall or of the
//! greatest score.
//!
//! Guaranteed: the same maps give the same intervals; an interval holds its score.
//!
//! Not guaranteed: the scale of each scan and its limits are taken as they are.

use super::answers::{Answer, DRAWS};
use super::difference::Change;
use super::noise::fields;
use super::scale::Sides;
use crate::base::progress::{Cancelled, Monitor};
use crate::heart::normals::{NoisyScores, Perfusion, ScanPlaces};

/// The least abnormal summed score of a scan.
const ABNORMAL_SUM: f64 = 4.0;
/// The least abnormal summed difference score.
const ABNORMAL_DIFFERENCE: f64 = 2.0;
/// The least abnormal extent and deficit, per cent.
const ABNORMAL_PERCENT: f64 = 5.0;

/// Scores at stress and at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoreAnswers {
    /// Summed score at stress.
    pub sss: Answer,
    /// Summed score at rest.
    pub srs: Answer,
    /// Summed difference score.
    pub sds: Answer,
    /// Shares of the wall below the limit, at stress and at rest, per cent.
    pub extent: [Answer; 2],
    /// Deficit scores at stress and at rest, per cent of the greatest.
    pub deficit: [Answer; 2],
}

impl ScoreAnswers {
    /// The scores of the scans at stress and at rest, whose maps `sides` are, and which differ by `change`.
    ///
    /// # Errors
    /// [`Cancelled`].
    pub fn new(
        perfusion: [&Perfusion; 2],
        sides: &Sides<'_>,
        change: &Change,
        monitor: &Monitor,
    ) -> Result<Self, Cancelled> {
        let areas = ScanPlaces::from_map(sides.rest).area;
        // One point of the difference at stress and at rest, image units, of noise that both scans share evenly.
        let point = sides.rest.reference / 100.0 * std::f64::consts::FRAC_1_SQRT_2;
        let units = [change.scale * point, point];
        let noise = fields(&areas, 2 * DRAWS, monitor)?;
        let draws: Vec<[NoisyScores; 2]> = (noise.chunks_exact(2))
            .map(|pair| {
                monitor.check()?;
                Ok([0, 1].map(|scan| {
                    let noise =
                        |index: usize| units[scan] * change.noise.at(index) * pair[scan][index];
                    perfusion[scan].with_noise(noise)
                }))
            })
            .collect::<Result<_, _>>()?;
        let found = perfusion.map(|own| own.with_noise(|_| 0.0));
        let answer = |abnormal: f64, of: &dyn Fn(&[NoisyScores; 2]) -> f64| {
            let drawn: Vec<f64> = draws.iter().map(of).collect();
            Answer::of_score(of(&found), &drawn, abnormal)
        };
        Ok(Self {
            sss: answer(ABNORMAL_SUM, &|both| f64::from(both[0].summed_score())),
            srs: answer(ABNORMAL_SUM, &|both| f64::from(both[1].summed_score())),
            sds: answer(ABNORMAL_DIFFERENCE, &|both| {
                f64::from(both[0].more_than(&both[1]))
            }),
            extent: [0, 1].map(|scan| answer(ABNORMAL_PERCENT, &|both| both[scan].extent_percent)),
            deficit: [0, 1]
                .map(|scan| answer(ABNORMAL_PERCENT, &|both| both[scan].deficit_percent)),
        })
    }
}
