//! Slices across the long axis, cut out of an image by linear interpolation.

use super::anatomy::{Directions, Place, Vec3};
use super::files::ImageFrame;
use super::grid::Grid;
use super::reader::Masks;

/// Edge of a slice, mm.
const EDGE_MM: f64 = 230.0;
/// Length along the axis, mm.
const LENGTH_MM: f64 = 190.0;

/// Slices of an image.
pub struct Slices {
    /// Where the slices' voxels lie.
    pub frame: ImageFrame,
    shape: [usize; 3],
    source: Place,
}

impl Slices {
    /// Slices about `middle`, as large as the voxels of `source`: x from the septum to the lateral wall, y from
    /// inferior to anterior, z from the apex to the base.
    pub fn across(directions: &Directions, middle: &Vec3, source: &Place) -> Self {
        let step = source.step_mm;
        let count = |mm: f64| (mm / step).round() as usize;
        let shape = [count(EDGE_MM), count(EDGE_MM), count(LENGTH_MM)];
        let steps = [directions.lateral, directions.anterior, -directions.apex].map(|v| v * step);
        let half = [0, 1, 2].map(|i| 0.5 * (shape[i] - 1) as f64);
        let origin = middle - half[0] * steps[0] - half[1] * steps[1] - half[2] * steps[2];
        Self {
            frame: ImageFrame { steps, origin },
            shape,
            source: *source,
        }
    }

    /// The image in slices; beyond it the values at its border.
    pub fn of_image(&self, image: &Grid) -> Grid {
        let [a, b, c] = self.frame.steps;
        Grid::from_fn(self.shape, |[x, y, z]| {
            let point = self.frame.origin + x as f64 * a + y as f64 * b + z as f64 * c;
            image.between(self.source.indices(&point))
        })
    }

    /// The masks in slices: 1 where at least half is.
    pub fn of_masks(&self, masks: &Masks) -> Masks {
        let half = |mask: &Grid| {
            let mut cut = self.of_image(mask);
            cut.values
                .iter_mut()
                .for_each(|v| *v = f32::from(u8::from(*v >= 0.5)));
            cut
        };
        Masks {
            truth: half(&masks.truth),
            cavity: half(&masks.cavity),
            apparent: half(&masks.apparent),
            expert: half(&masks.expert),
            expert_on_image: half(&masks.expert_on_image),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulator::parameters::Orientation;

    #[test]
    fn a_linear_image_is_the_same_in_slices() {
        let orientation = Orientation {
            azimuth_deg: 47.0,
            inferior_tilt_deg: 27.0,
            roll_deg: 5.0,
        };
        let source = Place::cube(64, 6.4);
        let image = Grid::from_fn([64; 3], |at| {
            let p = source.at(at);
            (1000.0 + p.x - 0.5 * p.y + 0.3 * p.z) as f32
        });
        let slices = Slices::across(
            &Directions::new(&orientation),
            &Vec3::new(-40.0, 10.0, 5.0),
            &source,
        );
        let cut = slices.of_image(&image);
        let [a, b, c] = slices.frame.steps;
        for at in [[3, 4, 5], [20, 18, 15], [30, 2, 29]] {
            let [x, y, z] = at.map(|i| i as f64);
            let p = slices.frame.origin + x * a + y * b + z * c;
            let known = (1000.0 + p.x - 0.5 * p.y + 0.3 * p.z) as f32;
            assert!((cut.at(at) - known).abs() < 0.01);
        }
    }
}
