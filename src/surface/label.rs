//! The voxels that carry one label of a label map.

use super::object::{MaskObject, Object};
use super::{
    IsoLevel, SurfaceError, SurfaceFacts, SurfaceParameters, TopologyMode, VolumeKind, masks,
};
use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::grid::labels::Labels;
use crate::progress::Monitor;
use crate::volume::Volume;

/// Selects the voxels of `label`, smoothed so that their surface has no staircase.
///
/// # Errors
/// [`SurfaceError::NoSurface`] if none of them reaches the iso-value, [`SurfaceError::Cancelled`].
pub(super) fn select<'a>(
    volume: &Volume,
    parameters: &SurfaceParameters,
    label: i64,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Object<'a>, SurfaceError> {
    if facts.kind == VolumeKind::Intensity {
        facts.kind = VolumeKind::Labels;
    }
    facts.label = Some(label);
    let mut mask = mask_of(volume, label);
    let asked = parameters.mask_smoothing;
    let voxel_ml = volume.frame.voxel_volume() / 1000.0;
    facts.mask_ml = Some(mask.count() as f64 * voxel_ml);
    let ball = parameters.topology == TopologyMode::Genus0;
    let mut count = mask.count();
    let mut joined = 0;
    if ball {
        (mask, joined) = masks::joined(&mask);
    }
    let mut smoothed = masks::smooth(&mask, count, asked, &volume.frame, monitor)?;
    let mut dropped = [0; 2];
    if ball && let Some((kept, parts, voxels)) = masks::largest_part(&mask, &smoothed) {
        // The level has to suit the volume of what remains.
        count = count.saturating_sub(voxels).max(1);
        smoothed = masks::smooth(&kept, count, asked, &volume.frame, monitor)?;
        (mask, dropped) = (kept, [parts, voxels]);
    }
    if smoothed.sigma < parameters.mask_smoothing {
        facts.warnings.push(format!(
            "thin parts of the mask would be lost: smoothed with {:.2} instead of {} voxels",
            smoothed.sigma, parameters.mask_smoothing
        ));
    }
    let torn = || {
        let labels = masks::at_level(&smoothed, smoothed.level);
        labels.euler_characteristic() != 1
    };
    let level = match parameters.iso {
        IsoLevel::Auto if ball && torn() => {
            masks::level_as_ball(&smoothed, count, &volume.frame, monitor)?
        }
        IsoLevel::Auto => smoothed.level,
        IsoLevel::Fraction(f) | IsoLevel::Absolute(f) | IsoLevel::Below(f) => f as f32,
    };
    facts.reference = 1.0;
    facts.iso_fraction = f64::from(level);
    let shape = smoothed.shape;
    let labels = masks::at_level(&smoothed, level);
    if labels.count() == 0 || !(level > 0.0) {
        return Err(SurfaceError::NoSurface {
            iso: f64::from(level),
            minimum: 0.0,
            maximum: smoothed.values.iter().copied().fold(0.0, f32::max),
        });
    }
    let corner = Vec3::from(smoothed.origin.map(|o| o as f64));
    let frame = VoxelToPatient::new(*volume.frame.linear(), volume.frame.to_patient(&corner))
        .expect("a moved frame is as invertible as the volume's own");
    let bounds = mask.bounds();
    facts.touches_border = bounds.is_some_and(|(low, extent)| {
        (0..3).any(|r| {
            let first = low[r] + mask.origin[r];
            first == 0 || first + extent[r] == volume.shape[r]
        })
    });
    Ok(Object {
        labels,
        values: smoothed.values.into(),
        shape,
        frame,
        iso: level,
        mask: Some(MaskObject {
            passes: smoothed.passes,
            dropped,
            joined,
        }),
    })
}

/// The voxels that carry `label`, in the smallest box that holds them.
fn mask_of(volume: &Volume, label: i64) -> Labels {
    let [nx, ny, _] = volume.shape;
    let carries = |v: f32| v == label as f32;
    let mut low = [usize::MAX; 3];
    let mut high = [0; 3];
    for (row, values) in volume.voxels.chunks(nx).enumerate() {
        let Some(first) = values.iter().position(|&v| carries(v)) else {
            continue;
        };
        let last = values.iter().rposition(|&v| carries(v)).unwrap_or(first);
        let ends = [(first, last), (row % ny, row % ny), (row / ny, row / ny)];
        for (r, (a, b)) in ends.into_iter().enumerate() {
            low[r] = low[r].min(a);
            high[r] = high[r].max(b);
        }
    }
    if low[0] == usize::MAX {
        return Labels::empty([0; 3], [1; 3]);
    }
    let extent = [0, 1, 2].map(|r| high[r] - low[r] + 1);
    let mut mask = Labels::empty(low, extent);
    for k in 0..extent[2] {
        for j in 0..extent[1] {
            let start = low[0] + nx * (low[1] + j + ny * (low[2] + k));
            for (i, &v) in volume.voxels[start..start + extent[0]].iter().enumerate() {
                if carries(v) {
                    mask.set([i, j, k], true);
                }
            }
        }
    }
    mask
}
