//! A simulated heart in gates, and its files.

use crate::dicom::NM_GREATEST;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::Volume;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};

/// A small simulated heart in eight gates: it shrinks and thickens, and is smallest in the fourth.
pub fn beating() -> &'static [Volume] {
    static GATE_VOLUMES: std::sync::OnceLock<Vec<Volume>> = std::sync::OnceLock::new();
    GATE_VOLUMES.get_or_init(|| {
        let contractions = [0.0, 0.4, 0.85, 1.0, 0.75, 0.45, 0.2, 0.05];
        let gate = |contraction: f64| {
            let parameters = PhantomParameters {
                shape: [40; 3],
                spacing_mm: [6.4; 3],
                width_mm: 72.0 - 7.0 * contraction,
                wall_mm: 9.0 + 4.0 * contraction,
                pose_spread_deg: 0.0,
                pose_spread_mm: 0.0,
                noise: 0.0,
                liver: 0.1,
                gut: 0.1,
                ..PhantomParameters::default()
            };
            phantom(&parameters, &Monitor::silent()).unwrap().volume
        };
        let mut gates = contractions.map(gate);
        // Voxels are as a Nuclear Medicine Image holds them.
        let voxels = gates.iter().flat_map(|gate| &gate.voxels);
        let greatest = voxels.copied().fold(0.0, f32::max);
        for voxel in gates.iter_mut().flat_map(|gate| &mut gate.voxels) {
            *voxel = (*voxel / greatest * NM_GREATEST).round();
        }
        gates.into()
    })
}

/// Bytes of the header of a NIfTI-1 file, with the four that say that no extension follows.
const NIFTI_HEADER_BYTES: usize = 352;

/// Volumes on one grid as a 4-D NIfTI file; `step_s` is the time between them, if the header is to state it.
pub fn nifti_of(volumes: &[Volume], step_s: Option<f32>) -> Vec<u8> {
    let file = |volume: &Volume| nifti::write(volume, StoredType::Float32, false).unwrap();
    let mut bytes = file(&volumes[0]);
    for volume in &volumes[1..] {
        bytes.extend_from_slice(&file(volume)[NIFTI_HEADER_BYTES..]);
    }
    let count = i16::try_from(volumes.len()).unwrap();
    bytes[40..42].copy_from_slice(&4i16.to_le_bytes());
    bytes[48..50].copy_from_slice(&count.to_le_bytes());
    if let Some(step) = step_s {
        // pixdim[4], and xyzt_units: millimetres and seconds.
        bytes[92..96].copy_from_slice(&step.to_le_bytes());
        bytes[123] = 2 | 8;
    }
    bytes
}
