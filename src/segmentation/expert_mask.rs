//! An expert's mask on the grid of the volume that it belongs to.

use crate::geometry::Vec3;
use crate::grid::voxelise::Mask;
use crate::progress::{Cancelled, Monitor};
use crate::volume::{FileFormat, Reading, Volume};

/// Why a mask cannot be compared with a volume.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ExpertMaskError {
    /// No voxel is above 0.5.
    #[error("the expert's mask is empty")]
    Empty,
    /// More than a hundredth of it lies outside the volume.
    #[error(
        "only {inside} of the mask's {all} voxels lie inside the volume: the headers place mask \
         and volume differently in the patient"
    )]
    Elsewhere {
        /// Mask voxels inside the volume.
        inside: usize,
        /// All mask voxels.
        all: usize,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The mask in a file that was read: voxels above 0.5, of a DICOM Segmentation its first segment. The
/// others, such as the cavity in `mask.dcm`, are not the structure.
pub(super) fn of_file(reading: Reading) -> Volume {
    let mut volume = reading.volume;
    if reading.facts.format == FileFormat::DicomSeg {
        for voxel in &mut volume.voxels {
            *voxel = f32::from(u8::from(*voxel == 1.0));
        }
    }
    volume
}

/// Voxels between two checks of the cancel token.
const PORTION: usize = 1 << 14;

/// The mask `expert` (voxels above 0.5) on the grid of `volume`: unchanged where the grids agree
/// within a hundredth of a voxel, otherwise by the nearest voxel in the patient.
///
/// # Errors
/// [`ExpertMaskError`].
pub fn on_grid(
    expert: &Volume,
    volume: &Volume,
    monitor: &Monitor,
) -> Result<Mask, ExpertMaskError> {
    let all = expert.voxels.iter().filter(|v| **v > 0.5).count();
    if all == 0 {
        return Err(ExpertMaskError::Empty);
    }
    if same_grid(expert, volume) {
        return Ok(Mask {
            shape: expert.shape,
            voxels: expert.voxels.iter().map(|v| *v > 0.5).collect(),
        });
    }
    let mut inside = 0;
    for (v, value) in expert.voxels.iter().enumerate() {
        if v % PORTION == 0 {
            monitor.check()?;
        }
        inside += usize::from(*value > 0.5 && contains(volume, &place(expert, v)));
    }
    if inside * 100 < all * 99 {
        return Err(ExpertMaskError::Elsewhere { inside, all });
    }
    let mut mask = Mask::empty(volume.shape);
    for (v, voxel) in mask.voxels.iter_mut().enumerate() {
        if v % PORTION == 0 {
            monitor.check()?;
        }
        *voxel = value_at(expert, &place(volume, v)) > 0.5;
    }
    Ok(mask)
}

/// The patient's point at a voxel's centre.
fn place(volume: &Volume, v: usize) -> Vec3 {
    let [nx, ny, _] = volume.shape;
    let index = [v % nx, v / nx % ny, v / (nx * ny)];
    volume
        .frame
        .to_patient(&Vec3::from(index.map(|x| x as f64)))
}

fn contains(volume: &Volume, p: &Vec3) -> bool {
    let index = volume.frame.to_voxel(p);
    (0..3).all(|a| index[a] > -0.5 && index[a] < volume.shape[a] as f64 - 0.5)
}

/// Value of the voxel that holds `p`, 0 outside.
fn value_at(volume: &Volume, p: &Vec3) -> f32 {
    if !contains(volume, p) {
        return 0.0;
    }
    let index = volume.frame.to_voxel(p);
    let [i, j, k] = [0, 1, 2].map(|a| index[a].round().max(0.0) as usize);
    volume.at(i, j, k)
}

fn same_grid(a: &Volume, b: &Volume) -> bool {
    let corner = Vec3::from(a.shape.map(|n| n as f64));
    let near = |index: &Vec3| (b.frame.to_voxel(&a.frame.to_patient(index)) - index).norm() < 0.01;
    a.shape == b.shape && near(&Vec3::zeros()) && near(&corner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::frame::VoxelToPatient;

    fn volume(shape: [usize; 3], spacing: f64, centre: Vec3, radius: f64) -> Volume {
        let frame = VoxelToPatient::centred(shape, [spacing; 3], centre).unwrap();
        let mut volume = Volume {
            shape,
            voxels: vec![0.0; shape.iter().product()],
            frame,
            integral: true,
        };
        for v in 0..volume.voxels.len() {
            volume.voxels[v] = f32::from(u8::from(place(&volume, v).norm() < radius));
        }
        volume
    }

    #[test]
    fn a_mask_on_another_grid_is_resampled_by_its_place() {
        let image = volume([30; 3], 2.0, Vec3::zeros(), 10.0);
        let fine = volume([50; 3], 1.0, Vec3::new(1.0, 0.5, 0.0), 10.0);
        let taken = on_grid(&fine, &image, &Monitor::silent()).unwrap();
        let own = on_grid(&image, &image, &Monitor::silent()).unwrap();
        let differing = taken.voxels.iter().zip(&own.voxels).filter(|(a, b)| a != b);
        // Half a fine voxel of displacement on a ball of five coarse ones.
        assert!(differing.count() * 8 < own.count());
    }

    #[test]
    fn empty_and_distant_masks_are_refused() {
        let image = volume([30; 3], 2.0, Vec3::zeros(), 10.0);
        let none = volume([30; 3], 2.0, Vec3::zeros(), 0.0);
        assert_eq!(
            on_grid(&none, &image, &Monitor::silent()),
            Err(ExpertMaskError::Empty)
        );
        let mut far = image.clone();
        far.frame = VoxelToPatient::centred([30; 3], [2.0; 3], Vec3::new(400.0, 0.0, 0.0)).unwrap();
        assert!(matches!(
            on_grid(&far, &image, &Monitor::silent()),
            Err(ExpertMaskError::Elsewhere { inside: 0, .. })
        ));
    }
}
