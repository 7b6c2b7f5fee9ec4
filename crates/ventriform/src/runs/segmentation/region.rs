//! The scan about a fitted organ, small enough to be part of a page.

use crate::base::geometry::Vec3;
use crate::base::geometry::bvh::Aabb;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::field::Field;
use crate::image::volume::Volume;
use crate::mesh::TriMesh;
use nalgebra::Matrix3;

/// Margin of the part beyond the organ on every side, mm: a heart stays in slices of 140 mm.
const REGION_MARGIN_MM: f64 = 25.0;
/// Smaller voxels are merged into blocks of about this size, mm: finer than the detail of emission scans.
const BLOCK_SIZE_MM: f64 = 2.5;

/// The part of `volume` about `organ`. Voxels keep their places, unless they are so small that blocks of
/// them are merged. Values that are not finite count as 0.
///
/// # Errors
/// [`Cancelled`].
pub(super) fn region(
    volume: &Volume,
    organ: &TriMesh,
    monitor: &Monitor,
) -> Result<Volume, Cancelled> {
    let organ = Aabb::around(&organ.vertices);
    let margin = Vec3::repeat(REGION_MARGIN_MM);
    let about = Aabb {
        min: organ.min - margin,
        max: organ.max + margin,
    };
    let field = Field::coarse(volume, Some(&about), BLOCK_SIZE_MM, monitor)?;
    let origin = field.to_patient(&Vec3::zeros());
    let steps = [Vec3::x(), Vec3::y(), Vec3::z()].map(|axis| field.to_patient(&axis) - origin);
    let frame = VoxelToPatient::new(Matrix3::from_columns(&steps), origin);
    Ok(Volume {
        shape: field.shape(),
        voxels: field.values().to_vec(),
        frame: frame.expect("blocks of a volume's voxels span the space as these do"),
        integral: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    /// A volume whose values are the places along x.
    fn ramp(size: usize, spacing: f64) -> Volume {
        let frame = VoxelToPatient::centred([size; 3], [spacing; 3], Vec3::zeros()).unwrap();
        Volume::sampled([size; 3], frame, |p| p.x)
    }

    #[test]
    fn the_part_reaches_about_the_organ_and_every_value_keeps_its_place() {
        let organ = shapes::tetrahedron(20.0);
        let bounds = Aabb::around(&organ.vertices);
        // Voxels as they are, blocks of two, and an organ larger than the scan.
        for (size, spacing, block) in [(60, 4.0, 4.0), (140, 1.4, 2.8), (8, 4.0, 4.0)] {
            let volume = ramp(size, spacing);
            let part = region(&volume, &organ, &Monitor::silent()).unwrap();
            assert!(
                part.frame
                    .spacing()
                    .iter()
                    .all(|s| (s - block).abs() < 1e-9)
            );
            let [nx, ny, nz] = part.shape;
            let first = part.frame.to_patient(&Vec3::zeros());
            let last = part.frame.to_patient(&Vec3::new(
                nx as f64 - 1.0,
                ny as f64 - 1.0,
                nz as f64 - 1.0,
            ));
            let half = (size as f64 - 1.0) * spacing / 2.0;
            for axis in 0..3 {
                let reach = [
                    bounds.min[axis] - REGION_MARGIN_MM,
                    bounds.max[axis] + REGION_MARGIN_MM,
                ];
                assert!(first[axis] <= reach[0].max(-half) + block);
                assert!(last[axis] >= reach[1].min(half) - block);
                assert!(last[axis] - first[axis] <= reach[1] - reach[0] + 3.0 * block);
            }
            for i in 0..nx {
                let place = part.frame.to_patient(&Vec3::new(i as f64, 0.0, 0.0));
                assert!((f64::from(part.at(i, 0, 0)) - place.x).abs() < 1e-4);
            }
        }
    }
}
