//! Settings of the sensors: the kind of edge, their reach, and where a reader draws the edge.

use crate::base::geometry::Vec3;

/// Which point of an edge a sensor reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SensorKind {
    /// The half-way point of the steepest fall outward, between the ridge inside it and the trough
    /// outside it: the full width at half maximum, which readers take for the wall. Over
    /// simulated scans its standard deviation about the wall's apparent edge is 0.8 mm, that of
    /// the steepest slope 1.0 mm.
    HalfMaximum,
    /// The steepest fall outward.
    Gradient,
    /// The steepest slope, rising or falling.
    Unsigned,
    /// The point where the image falls through [`SensorSettings::level`] outward.
    Level,
}

/// Sampling of the image by the sensors, and the edge that they look for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorSettings {
    /// Which point of the edge is reported.
    pub kind: SensorKind,
    /// Half-length of the profile, mm.
    pub reach: f64,
    /// The value that [`SensorKind::Level`] looks for.
    pub level: f64,
    /// Greater values of the image are clipped to this one before slopes are computed.
    pub ceiling: f64,
    /// Shift that is added to the distances found.
    pub shift: EdgeShift,
    /// Where sensors see nothing.
    pub blind: Option<BlindSector>,
}

/// A sector about the long axis where sensors see nothing, for a wall that may be another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlindSector {
    /// A point of the long axis, LPS mm.
    pub centre: Vec3,
    /// Its direction, a unit vector.
    pub axis: Vec3,
    /// The middle of the sector, a unit vector across the axis.
    pub middle: Vec3,
    /// Half of its angle, degrees.
    pub half_angle: f64,
}

impl BlindSector {
    /// Whether `place` lies in the sector.
    pub fn holds(&self, place: &Vec3) -> bool {
        let from = place - self.centre;
        let across = from - self.axis * from.dot(&self.axis);
        across.dot(&self.middle) > across.norm() * self.half_angle.to_radians().cos()
    }
}

impl SensorSettings {
    /// exp(-t²/2(reach/2)²) for a point t mm from the sensor.
    pub(super) fn nearness(&self, t: f64) -> f64 {
        (-t * t / (2.0 * (self.reach / 2.0).powi(2))).exp()
    }
}

/// Distance of the edge that a reader draws from the edge that the sensors find, mm outward.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EdgeShift {
    /// Where the surface faces the long axis.
    pub inner: f64,
    /// Where it faces away from it.
    pub outer: f64,
    /// Where it faces out of the base.
    pub rim: f64,
    /// Two ends of the axis that the inner surface faces, LPS mm.
    pub axis: [Vec3; 2],
}

/// The side of the wall that a sensor is on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::heart::deform) enum WallSide {
    /// It faces the long axis.
    Inner,
    /// It faces away from the long axis.
    Outer,
    /// It faces out of the base.
    Rim,
}

impl EdgeShift {
    /// The side of the wall at `place` with this `normal`, and the shift of an edge there, mm.
    pub(in crate::heart::deform) fn at(&self, place: &Vec3, normal: &Vec3) -> (WallSide, f64) {
        let along = self.axis[1] - self.axis[0];
        let (length, position) = (along.norm(), (place - self.axis[0]).dot(&along));
        let basal = position < 0.5 * length * length;
        if length > 0.0 && basal && normal.dot(&along) < -0.6 * length {
            return (WallSide::Rim, self.rim);
        }
        let share = if length > 0.0 {
            (position / length.powi(2)).clamp(0.0, 1.0)
        } else {
            0.0
        };
        let towards = self.axis[0] + along * share - place;
        let facing = normal.dot(&towards) / towards.norm().max(f64::MIN_POSITIVE);
        if facing > 0.0 {
            (WallSide::Inner, self.inner * facing)
        } else {
            (WallSide::Outer, -self.outer * facing)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const EDGE_SHIFT: EdgeShift = EdgeShift {
        inner: 1.0,
        outer: 2.0,
        rim: 3.0,
        axis: [Vec3::new(5.0, 0.0, 0.0), Vec3::new(5.0, 0.0, 40.0)],
    };

    /// About an axis along z from the base at 0 to the apex at 40, at x = 5.
    #[test]
    fn a_sensor_is_on_the_side_that_it_faces() {
        let at = |place: [f64; 3], normal: [f64; 3]| {
            EDGE_SHIFT.at(&Vec3::from(place), &Vec3::from(normal))
        };
        let slanted = [0.6f64, 0.0, 0.8];
        for z in [2.0, 20.0, 39.0] {
            assert_eq!(at([25.0, 0.0, z], [-1.0, 0.0, 0.0]), (WallSide::Inner, 1.0));
            assert_eq!(at([25.0, 0.0, z], [1.0, 0.0, 0.0]), (WallSide::Outer, 2.0));
            assert_eq!(at([5.0, -9.0, z], [0.0, 1.0, 0.0]), (WallSide::Inner, 1.0));
            // A surface that faces the axis aslant is moved less.
            let (side, shift) = at([25.0, 0.0, z], slanted.map(|x| -x.abs() * 0.999));
            if z > 20.0 {
                assert!(side == WallSide::Inner && (shift - 0.6 * 0.999).abs() < 1e-9);
            }
            let (side, shift) = at([25.0, 0.0, z], slanted);
            assert!(side == WallSide::Outer && (shift - 2.0 * 0.6).abs() < 1e-9);
        }
        // Beyond the ends the nearest end is what counts.
        assert_eq!(
            at([5.0, 0.0, 60.0], [0.0, 0.0, 1.0]),
            (WallSide::Outer, 2.0)
        );
        assert_eq!(
            at([5.0, 0.0, 60.0], [0.0, 0.0, -1.0]),
            (WallSide::Inner, 1.0)
        );
        // The rim faces out of the base, in the basal half only.
        assert_eq!(
            at([25.0, 0.0, -3.0], [0.0, 0.0, -1.0]),
            (WallSide::Rim, 3.0)
        );
        assert_eq!(
            at([25.0, 0.0, 19.0], [0.7, 0.0, -0.71]),
            (WallSide::Rim, 3.0)
        );
        assert_eq!(at([25.0, 0.0, 19.0], [0.9, 0.0, -0.43]).0, WallSide::Outer);
        assert_ne!(at([25.0, 0.0, 21.0], [0.0, 0.0, -1.0]).0, WallSide::Rim);
        let point = EdgeShift {
            axis: [Vec3::zeros(); 2],
            ..EDGE_SHIFT
        };
        assert_eq!(point.at(&Vec3::z(), &-Vec3::z()), (WallSide::Inner, 1.0));
        assert_eq!(point.at(&-Vec3::z(), &-Vec3::z()), (WallSide::Outer, 2.0));
    }

    #[test]
    fn a_blind_sector_holds_what_lies_within_its_angle() {
        let sector = BlindSector {
            centre: Vec3::new(1.0, 2.0, 3.0),
            axis: Vec3::z(),
            middle: Vec3::x(),
            half_angle: 50.0,
        };
        for (degrees, inside) in [
            (0.0, true),
            (49.0, true),
            (-49.0, true),
            (51.0, false),
            (180.0, false),
        ] {
            let (sin, cos) = f64::to_radians(degrees).sin_cos();
            for (radius, along) in [(20.0, 0.0), (3.0, -70.0), (60.0, 33.0)] {
                let place = sector.centre + Vec3::new(radius * cos, radius * sin, along);
                assert_eq!(sector.holds(&place), inside, "{degrees}");
            }
        }
    }
}
