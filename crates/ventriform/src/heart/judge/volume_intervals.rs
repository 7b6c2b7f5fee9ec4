//! The intervals of the volumes of the anatomical wall and of its cavity.
//!
//! In: both volumes, the share of the wall that is dark and how well its thickness is known. Out: intervals that hold the
//! true volumes in nine of ten hearts, as those of a beat do ([`crate::base::numeric::error_terms`]): the wider, the less
//! is known of the wall's thickness, and, of the cavity, the smaller it is beside its wall. The constants
//! ([`super::volume_calibration`]) are estimated from simulated hearts of all kinds, lost fits among them.
//! docs/log/walls.md has the figures of held-out hearts.
//!
//! Not guaranteed: other ways of drawing where the ventricle ends at its base. The simulator's true cavity ends at the
//! plane of the rim.

use super::volume_calibration::{CAVITY_ERROR, WALL_ERROR};
use crate::base::numeric::error_terms::ErrorCauses;
use crate::heart::deform::wall_thickness::WallThickness;

/// Standard deviation of a wall's mean thickness over the thickness, where nothing is known of it.
const UNKNOWN_THICKNESS_SHARE: f64 = 0.35;

/// Intervals that hold the true volumes of nine of ten hearts, ml.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VolumeIntervals {
    /// Of the anatomical wall.
    pub wall_ml: [f64; 2],
    /// Of its cavity.
    pub cavity_ml: [f64; 2],
    /// Share of hearts like this one whose true cavity is within [`VolumeIntervals::RIGHT_SHARE`] of the one found.
    pub size_confidence: f64,
}

impl VolumeIntervals {
    /// Share of a cavity by which it may be off and still counts as right.
    pub const RIGHT_SHARE: f64 = 0.2;

    /// About the volumes that were found, ml, where `dark_share` of the wall takes up less than half as much as its
    /// bright part does, and its mean thickness is what `thickness` says. A wall that is thicker by some share has as
    /// much more volume, and so much less of it lies in the cavity.
    pub fn about(
        wall_ml: f64,
        cavity_ml: f64,
        dark_share: f64,
        thickness: Option<&WallThickness>,
    ) -> Self {
        let share = thickness.map_or(UNKNOWN_THICKNESS_SHARE, WallThickness::sd_share);
        let causes = |thickness: f64| ErrorCauses {
            cavity_ml,
            dark_share: dark_share.clamp(0.0, 1.0),
            thickness,
        };
        let of_cavity = causes(share * wall_ml / cavity_ml.max(1.0));
        Self {
            wall_ml: WALL_ERROR.interval(wall_ml, &causes(share)),
            cavity_ml: CAVITY_ERROR.interval(cavity_ml, &of_cavity),
            size_confidence: CAVITY_ERROR.share_within(Self::RIGHT_SHARE, &of_cavity),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::heart::deform::wall_thickness::WallLook;

    #[test]
    fn volumes_of_small_hearts_and_of_walls_that_nothing_is_known_of_are_less_certain() {
        let look = WallLook {
            apparent_mm: 20.0,
            cavity_ml: 50.0,
            usual_mm: 10.5,
            noise_length_mm: None,
            resolution_mm: Some(9.0),
        };
        let known = WallThickness::new(&look);
        let unknown = WallThickness::new(&WallLook {
            resolution_mm: None,
            ..look
        });
        let ratio = |[low, high]: [f64; 2]| high / low;
        let of = |cavity, thickness| VolumeIntervals::about(150.0, cavity, 0.0, thickness);
        let usual = of(90.0, Some(&known));
        for other in [of(90.0, Some(&unknown)), of(90.0, None)] {
            assert!(ratio(other.cavity_ml) > ratio(usual.cavity_ml));
            assert!(ratio(other.wall_ml) > ratio(usual.wall_ml));
            assert!(other.size_confidence < usual.size_confidence);
        }
        assert!(ratio(of(30.0, Some(&known)).cavity_ml) > ratio(usual.cavity_ml));
    }

    #[test]
    fn ends_are_possible_volumes_about_the_one_that_was_found() {
        for (wall, cavity, dark) in [(150.0, 90.0, 0.0), (60.0, 0.2, 1.0), (400.0, 600.0, -0.1)] {
            let intervals = VolumeIntervals::about(wall, cavity, dark, None);
            assert!((0.0..=1.0).contains(&intervals.size_confidence));
            for (found, [low, high]) in [(wall, intervals.wall_ml), (cavity, intervals.cavity_ml)] {
                assert!(0.0 < low && low < found && found < high && high.is_finite());
            }
        }
    }
}
