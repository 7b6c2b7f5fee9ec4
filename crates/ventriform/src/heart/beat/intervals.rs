//! The intervals of the figures of a beat.
//!
//! In: EDV, ESV, EF and the share of the wall that is too dark to show its motion. Out: intervals that hold the true
//! figures in nine of ten hearts. The error's variance is that of a bright heart of usual size, more where the wall is
//! dark and where the cavity is small ([`super::calibration`], estimated from simulated studies). The intervals hold
//! what noise, blur and the unknown thickness of the wall do; they know nothing of an axis or a rim that lies wrong.

use super::calibration::{EDV_ERROR, EF_ERROR, ESV_ERROR};

/// Intervals that hold the true figures of nine of ten hearts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Intervals {
    /// Of the end-diastolic volume, ml.
    pub edv_ml: [f64; 2],
    /// Of the end-systolic volume, ml.
    pub esv_ml: [f64; 2],
    /// Of the ejection fraction, per cent.
    pub ef_percent: [f64; 2],
}

impl Intervals {
    /// About volumes that were found, ml, where `dark_share` of the wall is too dark to show its motion.
    pub fn about(edv_ml: f64, esv_ml: f64, dark_share: f64) -> Self {
        let ef_percent = 100.0 * (1.0 - esv_ml / edv_ml);
        let [least, greatest] = EF_ERROR.ends(edv_ml, dark_share);
        Self {
            edv_ml: EDV_ERROR.interval(edv_ml, edv_ml, dark_share),
            esv_ml: ESV_ERROR.interval(esv_ml, edv_ml, dark_share),
            ef_percent: [greatest, least].map(|error| (ef_percent - error).clamp(0.0, 100.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dark_walls_and_small_hearts_are_less_certain() {
        let width = |[low, high]: [f64; 2]| high - low;
        let usual = Intervals::about(120.0, 50.0, 0.0);
        assert!(width(usual.edv_ml) > 0.0 && width(usual.esv_ml) > 0.0);
        for other in [
            Intervals::about(120.0, 50.0, 0.2),
            Intervals::about(60.0, 25.0, 0.0),
        ] {
            assert!(width(other.ef_percent) > width(usual.ef_percent));
            let share = |[low, high]: [f64; 2]| high / low;
            assert!(share(other.edv_ml) > share(usual.edv_ml));
            assert!(share(other.esv_ml) >= share(usual.esv_ml));
        }
    }

    /// A curve of nearly nothing, or of everything, leaves no interval beyond what volumes can be.
    #[test]
    fn ends_are_possible_figures() {
        for (edv, esv, dark) in [(20.0, 0.5, 1.0), (400.0, 399.0, 1.0), (30.0, 29.9, 0.0)] {
            let intervals = Intervals::about(edv, esv, dark);
            for [low, high] in [intervals.edv_ml, intervals.esv_ml, intervals.ef_percent] {
                assert!(
                    0.0 <= low && low <= high && high.is_finite(),
                    "{intervals:?}"
                );
            }
            assert!(intervals.ef_percent[1] <= 100.0);
        }
    }
}
