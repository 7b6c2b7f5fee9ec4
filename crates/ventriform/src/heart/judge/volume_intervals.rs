//! The intervals of the volumes of the anatomical wall and of its cavity.
//!
//! In: both volumes and the share of the wall that is dark. Out: intervals that hold the true volumes in nine of ten
//! hearts, as those of a beat do ([`crate::base::numeric::error_terms`]): wider where the wall is dark and, of the cavity,
//! where it is small. The constants ([`super::volume_calibration`]) are estimated from simulated hearts of all kinds,
//! lost fits among them. docs/log/walls.md has the figures of held-out hearts.
//!
//! Not guaranteed: other ways of drawing where the ventricle ends at its base. The simulator's true cavity ends at the
//! plane of the rim.

use super::volume_calibration::{CAVITY_ERROR, WALL_ERROR};

/// Intervals that hold the true volumes of nine of ten hearts, ml.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeIntervals {
    /// Of the anatomical wall.
    pub wall_ml: [f64; 2],
    /// Of its cavity.
    pub cavity_ml: [f64; 2],
}

impl VolumeIntervals {
    /// About the volumes that were found, ml, where `dark_share` of the wall takes up less than half as much as its
    /// bright part does.
    pub fn about(wall_ml: f64, cavity_ml: f64, dark_share: f64) -> Self {
        let dark_share = dark_share.clamp(0.0, 1.0);
        Self {
            wall_ml: WALL_ERROR.interval(wall_ml, cavity_ml, dark_share),
            cavity_ml: CAVITY_ERROR.interval(cavity_ml, cavity_ml, dark_share),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn volumes_of_dark_and_small_hearts_are_less_certain() {
        let ratio = |[low, high]: [f64; 2]| high / low;
        let usual = VolumeIntervals::about(150.0, 90.0, 0.0);
        let dark = VolumeIntervals::about(150.0, 90.0, 0.4);
        let small = VolumeIntervals::about(150.0, 30.0, 0.0);
        assert!(ratio(dark.cavity_ml) > ratio(usual.cavity_ml));
        assert!(ratio(dark.wall_ml) > ratio(usual.wall_ml));
        assert!(ratio(small.cavity_ml) > ratio(usual.cavity_ml));
    }

    #[test]
    fn ends_are_possible_volumes_about_the_one_that_was_found() {
        for (wall, cavity, dark) in [(150.0, 90.0, 0.0), (60.0, 0.2, 1.0), (400.0, 600.0, -0.1)] {
            let intervals = VolumeIntervals::about(wall, cavity, dark);
            for (found, [low, high]) in [(wall, intervals.wall_ml), (cavity, intervals.cavity_ml)] {
                assert!(0.0 < low && low < found && found < high && high.is_finite());
            }
        }
    }
}
