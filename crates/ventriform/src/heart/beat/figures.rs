//! The figures of a beat: volumes, rates, and each segment's motion, thickening and phase.
//!
//! In: a [`BeatFit`], the polar map of the summed image, whose segments each ray belongs to. Out: [`Beat`]. End
//! diastole and end systole are the extremes of the volume curve, from which the gates' width has been taken off; the
//! gates nearest to them are named too. Segments are means over the area of their inner surface at end diastole.

use super::beside;
use super::counts::WallCounts;
use super::fit::{BeatFit, Volumes};
use super::flags::{self, BeatFlag, FlagFacts};
use super::intervals::{Intervals, WallCauses};
use super::moment::{Contraction, WallMoment, area_vectors};
use super::phase::{Phases, circular_mean};
use super::study::GatedStudy;
use crate::heart::model::wall::RAY_COLUMNS;
use crate::heart::polar::PolarMap;

/// Moments of the curve.
pub const CURVE_MOMENTS: usize = 96;
/// Moments at which the thickness is taken for the phase.
const PHASE_MOMENTS: usize = 24;
/// Fewest gates that tell rates of ejection and filling.
pub const RATE_GATES: usize = 16;

/// An extreme of the volume curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Extreme {
    /// When, in turns of the beat from the beginning of the first gate.
    pub turns: f64,
    /// Volume of the cavity, ml.
    pub cavity_ml: f64,
    /// The gate with the extreme of the gates' volumes, from 0.
    pub gate: usize,
}

/// How fast the ventricle empties and fills.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rates {
    /// Greatest rate of ejection, end-diastolic volumes per second.
    pub peak_ejection_per_s: f64,
    /// Greatest rate of filling, end-diastolic volumes per second.
    pub peak_filling_per_s: f64,
    /// From end systole to the greatest rate of filling, ms.
    pub time_to_peak_filling_ms: f64,
}

/// A segment of the wall through the beat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SegmentMotion {
    /// 1..=17.
    pub segment: usize,
    /// Motion of the inner surface inward from end diastole to end systole, mm.
    pub motion_mm: f64,
    /// Thickening from end diastole to end systole, per cent.
    pub thickening_percent: f64,
    /// The same by the counts of the wall, per cent; `None` without counts at end diastole.
    pub thickening_counts_percent: Option<f64>,
    /// Phase of the greatest thickness, degrees; `None` where the segment does not move.
    pub phase_degrees: Option<f64>,
}

/// A beat and its figures.
#[derive(Debug)]
pub struct Beat {
    /// The wall through the beat.
    pub fit: BeatFit,
    /// [`CURVE_MOMENTS`] equal steps from the beginning of the first gate.
    pub curve: Vec<Volumes>,
    /// Each gate's volumes.
    pub gates: Vec<Volumes>,
    /// The factor that brought each gate to equal counts.
    pub factors: Vec<f64>,
    /// The curve's largest volume.
    pub end_diastole: Extreme,
    /// The curve's smallest volume.
    pub end_systole: Extreme,
    /// Share of the end-diastolic volume that is ejected, per cent; `None` if the gates are no beat.
    pub ef_percent: Option<f64>,
    /// Intervals about the figures; `None` if the gates are no beat.
    pub intervals: Option<Intervals>,
    /// Rates, or why there are none.
    pub rates: Result<Rates, String>,
    /// Segments 1 to 17; those without wall are left out.
    pub segments: Vec<SegmentMotion>,
    /// Phases of the wall.
    pub phases: Phases,
    /// Motion and thickening of every ray.
    pub contraction: Contraction,
    /// Counts of every ray.
    pub counts: WallCounts,
    /// Reasons to look closer.
    pub flags: Vec<BeatFlag>,
}

impl Beat {
    /// The figures of `fit`. `rr_ms` is the R-R interval, ms, where it is known.
    pub fn new(fit: BeatFit, study: &GatedStudy, map: &PolarMap, rr_ms: Option<f64>) -> Self {
        let curve = fit.curve(CURVE_MOMENTS);
        let gates = fit.gates();
        let end_diastole = extreme(&curve, &gates, |a, b| a > b);
        let end_systole = extreme(&curve, &gates, |a, b| a < b);
        let before = fit.moment(end_diastole.turns);
        let after = fit.moment(end_systole.turns);
        let contraction = Contraction::between(&before, &after);
        let phases = phases(&fit, &before);
        let counts = WallCounts::new(study, &fit);
        let ends = [end_diastole, end_systole].map(|end| counts.at(end.turns));
        let segments = segments(map, &contraction, &phases, &ends);
        let ejected = 100.0 * (1.0 - end_systole.cavity_ml / end_diastole.cavity_ml);
        let flags = flags::raised(&FlagFacts {
            orders_as_smooth: fit.orders_as_smooth,
            ef_percent: ejected,
            losses: &study.losses,
            dark_share: fit.dark_share(),
            esv_ml: end_systole.cavity_ml,
            moving_share: phases.moving_share,
            phase_noise_degrees: fit.phase_noise_degrees,
            share_outside: fit.share_outside,
            beside: beside::found(study, &fit, &counts, map),
            motions: (segments.iter())
                .map(|segment| (segment.segment, segment.motion_mm))
                .collect(),
        });
        let denied = flags.iter().any(BeatFlag::denies_a_beat);
        Self {
            rates: if denied {
                Err("the gates show no beat".into())
            } else {
                rates(&curve, fit.gate_count(), end_systole.turns, rr_ms)
            },
            factors: study.factors.clone(),
            intervals: (!denied).then(|| {
                let wall = WallCauses {
                    wall_ml: mean_wall_ml(&curve),
                    dark_share: fit.dark_share(),
                    thickness_share: fit.thickness_share,
                };
                Intervals::about(end_diastole.cavity_ml, end_systole.cavity_ml, &wall)
            }),
            ef_percent: (!denied).then_some(ejected),
            fit,
            curve,
            gates,
            end_diastole,
            end_systole,
            segments,
            phases,
            contraction,
            counts,
            flags,
        }
    }

    /// Volume that is ejected, ml; `None` if the gates are no beat.
    pub fn stroke_ml(&self) -> Option<f64> {
        let ejected = self.end_diastole.cavity_ml - self.end_systole.cavity_ml;
        self.ef_percent.map(|_| ejected)
    }

    /// Muscle of the wall in the mean of the curve, ml.
    pub fn mean_wall_ml(&self) -> f64 {
        mean_wall_ml(&self.curve)
    }

    /// Whether the gates are a beat, and enough of the wall moves, more than noise does, to have phases.
    pub fn has_phases(&self) -> bool {
        let unreliable = |flag: &BeatFlag| matches!(flag, BeatFlag::PhaseUnreliable { .. });
        self.ef_percent.is_some() && !self.flags.iter().any(unreliable)
    }
}

fn mean_wall_ml(curve: &[Volumes]) -> f64 {
    curve.iter().map(|volumes| volumes.wall_ml).sum::<f64>() / curve.len() as f64
}

fn extreme(curve: &[Volumes], gates: &[Volumes], beyond: impl Fn(f64, f64) -> bool) -> Extreme {
    let most = |volumes: &[Volumes]| {
        (1..volumes.len()).fold(0, |found, n| {
            if beyond(volumes[n].cavity_ml, volumes[found].cavity_ml) {
                n
            } else {
                found
            }
        })
    };
    let moment = most(curve);
    Extreme {
        turns: moment as f64 / curve.len() as f64,
        cavity_ml: curve[moment].cavity_ml,
        gate: most(gates),
    }
}

fn phases(fit: &BeatFit, diastole: &WallMoment) -> Phases {
    let thickness: Vec<Vec<f64>> = (0..PHASE_MOMENTS)
        .map(|n| fit.moment(n as f64 / PHASE_MOMENTS as f64).thickness)
        .collect();
    let areas: Vec<f64> = (area_vectors(&diastole.inner).iter().zip(&diastole.on))
        .map(|(area, on)| if *on { area.norm() } else { 0.0 })
        .collect();
    Phases::new(&thickness, &areas)
}

/// `counts` are those of every ray at end diastole and at end systole.
fn segments(
    map: &PolarMap,
    contraction: &Contraction,
    phases: &Phases,
    counts: &[Vec<f64>; 2],
) -> Vec<SegmentMotion> {
    let of = |segment: usize| {
        let own: Vec<usize> = (0..contraction.areas.len())
            .filter(|ray| contraction.areas[*ray] > 0.0)
            .filter(|ray| map.segment_of(ray / RAY_COLUMNS, ray % RAY_COLUMNS) == segment)
            .collect();
        let area: f64 = own.iter().map(|ray| contraction.areas[*ray]).sum();
        let mean = |values: &[f64]| {
            let sum: f64 = own
                .iter()
                .map(|ray| contraction.areas[*ray] * values[*ray])
                .sum();
            sum / area
        };
        let moving: Vec<(f64, f64)> = (own.iter())
            .filter_map(|ray| {
                let weight = contraction.areas[*ray] * phases.amplitude_percent[*ray];
                Some((phases.degrees[*ray]?, weight))
            })
            .collect();
        // The quotient of the means: single dark rays have no quotient.
        let [before, after] = [0, 1].map(|end| mean(&counts[end]));
        (area > 0.0).then(|| SegmentMotion {
            segment,
            thickening_counts_percent: (before > 0.0).then(|| 100.0 * (after / before - 1.0)),
            motion_mm: mean(&contraction.motion_mm),
            thickening_percent: mean(&contraction.thickening_percent),
            phase_degrees: Some(circular_mean(&moving)).filter(|mean| mean.is_finite()),
        })
    };
    (1..=17).filter_map(of).collect()
}

fn rates(
    curve: &[Volumes],
    gates: usize,
    end_systole: f64,
    rr_ms: Option<f64>,
) -> Result<Rates, String> {
    let Some(rr_ms) = rr_ms else {
        return Err("the R-R interval is not known: give it, or a file that states it".into());
    };
    if gates < RATE_GATES {
        return Err(format!(
            "{gates} gates do not show how fast the volume changes: {RATE_GATES} or more do"
        ));
    }
    let count = curve.len();
    let largest = curve.iter().map(|v| v.cavity_ml).fold(f64::MIN, f64::max);
    let slope = |n: usize| {
        let [before, after] = [n + count - 1, n + 1].map(|n| curve[n % count].cavity_ml);
        (after - before) / 2.0 * count as f64 / (rr_ms / 1000.0) / largest
    };
    let slopes: Vec<f64> = (0..count).map(slope).collect();
    let filling = (1..count).fold(
        0,
        |found, n| if slopes[n] > slopes[found] { n } else { found },
    );
    let fastest = slopes.iter().copied().fold(f64::MAX, f64::min);
    let wait = (filling as f64 / count as f64 - end_systole).rem_euclid(1.0);
    Ok(Rates {
        peak_ejection_per_s: -fastest,
        peak_filling_per_s: slopes[filling],
        time_to_peak_filling_ms: wait * rr_ms,
    })
}
