//! Changes of the beat from rest to stress, each with an interval and a verdict.
//!
//! In: a figure of both beats, which are fitted by themselves, and the noise of the pair. Out: an [`Answer`]. The error of
//! a change is that of simulated pairs whose truth is known ([`ChangeError`](super::ChangeError)). What matters is the
//! program's choice: 5 points of the ejection fraction, and about a third of what a healthy segment moves and thickens.
//!
//! Of segments, the intervals hold all 17 changes together in nine of ten pairs (Bonferroni): otherwise two segments of
//! every unchanged heart would have changed.

use super::answers::{Answer, HALF_WIDTH_SDS};
use super::beat_calibration as constants;
use super::figure_change::{ChangingFigure, by_difference, by_share};

/// Ejection fraction.
pub const EF: ChangingFigure = by_difference("ef_percent", 5.0, constants::EF);
/// End-diastolic volume.
pub const EDV: ChangingFigure = by_share("edv_ml", 15.0, constants::EDV);
/// End-systolic volume.
pub const ESV: ChangingFigure = by_share("esv_ml", 20.0, constants::ESV);
/// Inward motion of a segment, mm.
pub const SEGMENT_MOTION: ChangingFigure =
    by_difference("motion_mm", 2.5, constants::SEGMENT_MOTION);
/// Thickening of a segment, points.
pub const SEGMENT_THICKENING: ChangingFigure =
    by_difference("thickening_percent", 15.0, constants::SEGMENT_THICKENING);

/// Standard deviations from the mean to the ends of an interval of a segment: 1 - 0.1 / 17 of a normal distribution.
const SEGMENT_HALF_WIDTH_SDS: f64 = 2.755;

/// The change of a figure of the whole ventricle.
pub fn answer(figure: &ChangingFigure, [rest, stress]: [f64; 2], noise_points: f64) -> Answer {
    of_width(figure, [rest, stress], noise_points, HALF_WIDTH_SDS)
}

/// The change of a figure of a segment.
pub fn segment_answer(figure: &ChangingFigure, values: [f64; 2], noise_points: f64) -> Answer {
    of_width(figure, values, noise_points, SEGMENT_HALF_WIDTH_SDS)
}

fn of_width(figure: &ChangingFigure, [rest, stress]: [f64; 2], noise: f64, sds: f64) -> Answer {
    let change = figure.within([rest, stress], noise, sds);
    Answer {
        value: change.change,
        interval: change.interval,
        verdict: change.verdict,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::comparison::Verdict;

    #[test]
    fn a_segment_needs_a_larger_change_than_a_ventricle() {
        let noise = 5.0;
        let deviation = SEGMENT_MOTION.error.of_noise(noise);
        let change = [8.0, 8.0 - 2.0 * deviation];
        assert_eq!(answer(&SEGMENT_MOTION, change, noise).verdict, Verdict::Yes);
        let segment = segment_answer(&SEGMENT_MOTION, change, noise);
        assert_ne!(segment.verdict, Verdict::Yes);
        assert!(segment.interval[0] < segment.value && segment.value < segment.interval[1]);
    }

    #[test]
    fn a_lower_ejection_fraction_at_stress_is_a_negative_change() {
        let found = answer(&EF, [60.0, 40.0], 5.0);
        assert_eq!((found.value, found.verdict), (-20.0, Verdict::Yes));
        assert_eq!(answer(&EF, [60.0, 60.0], 30.0).verdict, Verdict::CannotTell);
    }
}
