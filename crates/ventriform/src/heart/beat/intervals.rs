//! The intervals of the figures of a beat.
//!
//! In: EDV, ESV, EF, the wall's volume, how well its thickness is known, and the share of it that is too dark to show its
//! motion. Out: intervals that hold the true figures in nine of ten hearts. The error's variance is that of a bright
//! heart of usual size, more where the wall is dark, where the cavity is small, and the less is known of the wall's
//! thickness ([`super::calibration`], estimated from simulated studies): muscle that is not there lies in the cavity.
//! The intervals hold what noise and blur do; they know nothing of an axis or a rim that lies wrong.

use super::calibration::{EDV_ERROR, EF_ERROR, ESV_ERROR};
use crate::base::numeric::error_terms::ErrorCauses;

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

/// What of a wall makes the figures of its beat uncertain.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WallCauses {
    /// Volume of the wall, ml.
    pub wall_ml: f64,
    /// Share of the wall that is too dark to show its motion, 0 to 1.
    pub dark_share: f64,
    /// Standard deviation of its mean thickness over the thickness.
    pub thickness_share: f64,
}

impl Intervals {
    /// About volumes of a cavity that were found within such a wall, ml.
    pub fn about(edv_ml: f64, esv_ml: f64, wall: &WallCauses) -> Self {
        let ef_percent = 100.0 * (1.0 - esv_ml / edv_ml);
        let uncertain_ml = wall.thickness_share * wall.wall_ml;
        let causes = |thickness: f64| ErrorCauses {
            cavity_ml: edv_ml,
            dark_share: wall.dark_share,
            thickness,
        };
        let of_edv = causes(uncertain_ml / edv_ml.max(1.0));
        let of_esv = causes(uncertain_ml / esv_ml.max(1.0));
        let [least, greatest] = EF_ERROR.ends(&causes(100.0 * of_edv.thickness));
        Self {
            edv_ml: EDV_ERROR.interval(edv_ml, &of_edv),
            esv_ml: ESV_ERROR.interval(esv_ml, &of_esv),
            ef_percent: [greatest, least].map(|error| (ef_percent - error).clamp(0.0, 100.0)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WALL: WallCauses = WallCauses {
        wall_ml: 150.0,
        dark_share: 0.0,
        thickness_share: 0.1,
    };

    #[test]
    fn dark_walls_small_hearts_and_walls_of_unknown_thickness_are_less_certain() {
        let width = |[low, high]: [f64; 2]| high - low;
        let usual = Intervals::about(120.0, 50.0, &WALL);
        assert!(width(usual.edv_ml) > 0.0 && width(usual.esv_ml) > 0.0);
        let dark = WallCauses {
            dark_share: 0.2,
            ..WALL
        };
        let unknown = WallCauses {
            thickness_share: 0.3,
            ..WALL
        };
        let share = |[low, high]: [f64; 2]| high / low;
        for other in [
            Intervals::about(120.0, 50.0, &dark),
            Intervals::about(120.0, 50.0, &unknown),
            Intervals::about(60.0, 25.0, &WALL),
        ] {
            assert!(width(other.ef_percent) > width(usual.ef_percent));
            assert!(share(other.edv_ml) >= share(usual.edv_ml));
            assert!(share(other.esv_ml) >= share(usual.esv_ml));
        }
        let unknown = Intervals::about(120.0, 50.0, &unknown);
        assert!(share(unknown.edv_ml) > share(usual.edv_ml));
        assert!(share(unknown.esv_ml) > share(usual.esv_ml));
    }

    /// A curve of nearly nothing, or of everything, leaves no interval beyond what volumes can be.
    #[test]
    fn ends_are_possible_figures() {
        for (edv, esv, dark_share) in [(20.0, 0.5, 1.0), (400.0, 399.0, 1.0), (30.0, 29.9, 0.0)] {
            let wall = WallCauses { dark_share, ..WALL };
            let intervals = Intervals::about(edv, esv, &wall);
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
