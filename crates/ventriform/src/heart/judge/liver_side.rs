//! The side of the body on which bright activity lies below the heart: the liver's.
//!
//! In: the volume, the fitted cup and the wall's uptake, in a frame whose x runs to the patient's left and z up. Out:
//! how much more of that activity lies to the right of the body's middle than to the left. Gut and spleen on the left
//! are smaller.

use crate::base::geometry::Vec3;
use crate::image::grid::Volume;
use crate::image::locate::cup::Cup;

/// Share of the wall's uptake from which on activity is bright.
const BRIGHT_SHARE: f64 = 0.35;
/// Share of the wall's uptake from which on a voxel is part of the body.
const BODY_SHARE: f64 = 0.04;
/// Levels below the heart's centre between which activity counts, mm.
const LEVELS_BELOW_MM: [f64; 2] = [20.0, 120.0];
/// Distance from the heart's outer end up to which activity may be that of the heart, mm.
const HEART_MARGIN_MM: f64 = 20.0;
/// Least volume of bright activity that tells a side, ml.
const LEAST_BRIGHT_ML: f64 = 100.0;
/// Part of the body's voxels that lies beyond each of its sides, as scattered ones do.
const BEYOND_SIDE_SHARE: f64 = 0.02;
/// Step from voxel to voxel, along each axis.
const STRIDE: usize = 2;

/// The share of the bright activity below the heart that lies to the patient's right of the body's middle, less that on
/// the left: -1..=1; `None` where there is too little of it.
pub(super) fn liver_side(volume: &Volume, cup: &Cup, uptake: f64) -> Option<f64> {
    let [nx, ny, nz] = volume.shape;
    let reach = 0.5 * cup.length + HEART_MARGIN_MM;
    let [least, most] = LEVELS_BELOW_MM;
    // Places along x, mm to the left.
    let (mut body, mut bright) = (Vec::new(), Vec::new());
    for k in (0..nz).step_by(STRIDE) {
        for j in (0..ny).step_by(STRIDE) {
            for i in (0..nx).step_by(STRIDE) {
                let value = f64::from(volume.voxels[i + nx * (j + ny * k)]);
                // False for missing values too.
                let in_body = value > BODY_SHARE * uptake;
                if !in_body {
                    continue;
                }
                let index = Vec3::new(i as f64, j as f64, k as f64);
                let place = volume.frame.to_patient(&index);
                body.push(place.x);
                let from = place - cup.centre;
                let below = (least..most).contains(&-from.z);
                if value > BRIGHT_SHARE * uptake && below && from.norm() > reach {
                    bright.push(place.x);
                }
            }
        }
    }
    let voxel_ml = volume.frame.linear().determinant().abs() / 1000.0;
    let bright_ml = bright.len() as f64 * STRIDE.pow(3) as f64 * voxel_ml;
    if bright.is_empty() || bright_ml < LEAST_BRIGHT_ML {
        return None;
    }
    body.sort_by(f64::total_cmp);
    let beyond = (BEYOND_SIDE_SHARE * body.len() as f64) as usize;
    let middle = f64::midpoint(body[beyond], body[body.len() - 1 - beyond]);
    let right = bright.iter().filter(|x| **x < middle).count();
    Some(2.0 * right as f64 / bright.len() as f64 - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::geometry::frame::VoxelToPatient;

    /// The side of a bright ball at `x` mm to the left, `down` mm below the heart's centre, in a body that is not
    /// bright.
    fn side(x: f64, down: f64, radius: f64) -> Option<f64> {
        let frame = VoxelToPatient::centred([64; 3], [5.0; 3], Vec3::zeros()).unwrap();
        let centre = Vec3::new(40.0, -20.0, 30.0);
        let cup = Cup {
            centre,
            axis: Vec3::new(0.1, -0.9, -0.4).normalize(),
            length: 80.0,
            breadth: 1.0,
        };
        let liver = Vec3::new(x, 0.0, centre.z - down);
        let value = |p: &Vec3| {
            if (p - liver).norm() < radius || (p - centre).norm() < 40.0 {
                100.0
            } else if (p.x / 140.0).hypot(p.y / 100.0) < 1.0 {
                10.0
            } else {
                0.0
            }
        };
        liver_side(&Volume::sampled([64; 3], frame, value), &cup, 100.0)
    }

    #[test]
    fn the_side_of_bright_activity_below_the_heart_is_told() {
        assert_eq!(side(-70.0, 80.0, 45.0), Some(1.0));
        assert_eq!(side(70.0, 80.0, 45.0), Some(-1.0));
        assert!(side(0.0, 80.0, 45.0).unwrap().abs() < 0.2);
        // Too little, too high, and none but the heart itself.
        assert_eq!(side(-70.0, 80.0, 20.0), None);
        assert_eq!(side(-90.0, -50.0, 45.0), None);
        assert_eq!(side(40.0, 0.0, 30.0), None);
    }

    #[test]
    fn missing_values_are_no_activity() {
        let frame = VoxelToPatient::centred([8; 3], [30.0; 3], Vec3::zeros()).unwrap();
        let cup = Cup {
            centre: Vec3::new(0.0, 0.0, 60.0),
            axis: -Vec3::z(),
            length: 60.0,
            breadth: 1.0,
        };
        let volume = Volume::sampled([8; 3], frame, |_| f64::NAN);
        assert_eq!(liver_side(&volume, &cup, 1.0), None);
    }
}
