//! The patient: both ventricles through the beat, and the trunk around them.

pub mod breathing;
pub mod heart;
pub mod material;
pub mod torso;
pub mod ventricle;

use super::parameters::Orientation;
use nalgebra::Vector3;

/// A point or direction, RAS millimetres.
pub type Vec3 = Vector3<f64>;

/// Points on a regular grid in space, RAS millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Place {
    /// The first point.
    pub origin: Vec3,
    /// From point to point.
    pub step_mm: f64,
    /// Points along x, y, z.
    pub shape: [usize; 3],
}

impl Place {
    /// A cube of `count` points along each axis about the origin.
    pub fn cube(count: usize, step_mm: f64) -> Self {
        let origin = Vec3::repeat(-0.5 * (count - 1) as f64 * step_mm);
        Self {
            origin,
            step_mm,
            shape: [count; 3],
        }
    }

    /// The point at indices.
    pub fn at(&self, [x, y, z]: [usize; 3]) -> Vec3 {
        self.origin + self.step_mm * Vec3::new(x as f64, y as f64, z as f64)
    }

    /// The indices of a point, which may lie between points.
    pub fn indices(&self, point: &Vec3) -> [f64; 3] {
        let at = (point - self.origin) / self.step_mm;
        [at.x, at.y, at.z]
    }

    /// The first point of the part that covers a cube about `centre`, and how many points it has.
    pub fn part_about(&self, centre: &Vec3, half_mm: f64) -> ([usize; 3], [usize; 3]) {
        let at = self.indices(centre);
        let reach = half_mm / self.step_mm;
        let low = [0, 1, 2].map(|i| (at[i] - reach).floor().max(0.0) as usize);
        let high = [0, 1, 2].map(|i| ((at[i] + reach).ceil() as usize).min(self.shape[i]));
        (low, [0, 1, 2].map(|i| high[i] - low[i]))
    }

    /// The same part as a place.
    pub fn part(&self, corner: [usize; 3], shape: [usize; 3]) -> Self {
        Self {
            origin: self.at(corner),
            step_mm: self.step_mm,
            shape,
        }
    }

    /// The place of `factor` points for each, so that their means lie where the points were.
    pub fn finer(&self, factor: usize) -> Self {
        let step_mm = self.step_mm / factor as f64;
        let first = 0.5 * (factor - 1) as f64 * step_mm;
        Self {
            origin: self.origin - Vec3::repeat(first),
            step_mm,
            shape: self.shape.map(|n| n * factor),
        }
    }
}

/// Directions of a heart: lateral, anterior, and to the apex.
#[derive(Debug, Clone, Copy)]
pub struct Directions {
    /// To the lateral wall.
    pub lateral: Vec3,
    /// To the anterior wall.
    pub anterior: Vec3,
    /// From base to apex.
    pub apex: Vec3,
}

impl Directions {
    /// The directions of an orientation.
    pub fn new(orientation: &Orientation) -> Self {
        let (sin_az, cos_az) = orientation.azimuth_deg.to_radians().sin_cos();
        let (sin_tilt, cos_tilt) = orientation.inferior_tilt_deg.to_radians().sin_cos();
        let (sin_roll, cos_roll) = orientation.roll_deg.to_radians().sin_cos();
        let apex = Vec3::new(-cos_tilt * sin_az, cos_tilt * cos_az, -sin_tilt);
        let up = (Vec3::z() - apex.z * apex).normalize();
        let anterior = cos_roll * up + sin_roll * up.cross(&apex);
        Self {
            lateral: anterior.cross(&apex),
            anterior,
            apex,
        }
    }

    /// A vector's parts along lateral, anterior and apex.
    pub fn parts(&self, v: &Vec3) -> [f64; 3] {
        [self.lateral.dot(v), self.anterior.dot(v), self.apex.dot(v)]
    }
}
