//! The voxels that carry one label of a label map.

use super::object::{MaskObject, Object};
use super::{
    IsoLevel, SurfaceError, SurfaceFacts, SurfaceParameters, TopologyMode, VolumeKind, masks,
};
use crate::base::geometry::Vec3;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::progress::{Cancelled, Monitor};
use crate::image::grid::Volume;
use crate::image::grid::components::Components;
use crate::image::grid::labels::Labels;

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
    let given = mask_of(volume, label);
    let asked = parameters.mask_smoothing;
    let voxel_ml = volume.frame.voxel_volume() / 1000.0;
    facts.mask_ml = Some(given.count() as f64 * voxel_ml);
    let ball = parameters.topology == TopologyMode::Genus0;
    let mut count = given.count();
    let (mut mask, mut joined) = if ball {
        masks::joined(&given, monitor)?
    } else {
        (given.clone(), 0)
    };
    let mut smoothed = masks::smooth(&mask, count, asked, &volume.frame, monitor)?;
    let mut dropped = [0; 2];
    if ball && let Some((kept, parts)) = masks::largest_part(&mask, &smoothed, monitor)? {
        // The level has to suit the volume of what remains of the label, without what joined its parts.
        let remaining = given.voxels().filter(|&p| kept.get(p)).count();
        dropped = [parts, count - remaining];
        joined = kept.count() - remaining;
        count = remaining.max(1);
        smoothed = masks::smooth(&kept, count, asked, &volume.frame, monitor)?;
        mask = kept;
    }
    if smoothed.sigma < parameters.mask_smoothing {
        facts.warnings.push(format!(
            "thin parts of the mask would be lost: smoothed with {:.2} instead of {} voxels",
            smoothed.sigma, parameters.mask_smoothing
        ));
    }
    let level = match parameters.iso {
        IsoLevel::Auto
            if ball && !is_ball(&masks::at_level(&smoothed, smoothed.level), monitor)? =>
        {
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

/// `true` for one component without cavities and handles. The Euler characteristic alone does not tell: it
/// is 1 for a handle and a cavity, too.
fn is_ball(labels: &Labels, monitor: &Monitor) -> Result<bool, Cancelled> {
    Ok(labels.euler_characteristic() == 1
        && Components::of_inside(labels, monitor)?.sizes.len() == 1
        && Components::of_outside(labels, monitor)?.sizes.len() == 1)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::extract;

    /// The volume of 30 x 24 x 24 voxels of 2 mm whose label 1 is where `inside` holds.
    fn label_map(inside: impl Fn([usize; 3]) -> bool) -> Volume {
        let shape = [30, 24, 24];
        let frame = VoxelToPatient::centred(shape, [2.0; 3], Vec3::zeros()).unwrap();
        let voxels = (0..shape.iter().product()).map(|n| {
            let p = [n % 30, n / 30 % 24, n / (30 * 24)];
            f32::from(u8::from(inside(p)))
        });
        Volume {
            shape,
            voxels: voxels.collect(),
            frame,
            integral: true,
        }
    }

    /// The enclosed volume as a share of that of `voxels`, and what was found.
    fn volume_share(volume: &Volume, voxels: usize) -> (f64, SurfaceFacts) {
        let parameters = SurfaceParameters::default();
        let surface = extract(volume, &parameters, &Monitor::silent()).unwrap();
        let wanted = voxels as f64 * volume.frame.voxel_volume();
        (surface.mesh.volume() / wanted, surface.facts)
    }

    /// Two crumbs that touch along an edge are joined and left out: the voxels that join them are none of the
    /// label's.
    #[test]
    fn what_joins_parts_that_are_left_out_is_not_taken_off() {
        let cube = |p: [usize; 3]| p.iter().all(|x| (4..14).contains(x));
        let crumbs = |p: [usize; 3]| {
            let [i, j, k] = p;
            let crumb = |x, y| (x..x + 4).contains(&i) && (y..y + 4).contains(&j);
            (4..8).contains(&k) && (crumb(18, 4) || crumb(22, 8))
        };
        let alone = volume_share(&label_map(cube), 1000).0;
        let (share, facts) = volume_share(&label_map(|p| cube(p) || crumbs(p)), 1000);
        assert_eq!(facts.voxels_dropped, 2 * 64);
        assert_eq!(facts.voxels_filled, 0);
        assert!((share - alone).abs() < 1e-3, "{share} {alone}");
    }

    /// The Euler characteristic of a ball with a cavity and a handle is that of a ball.
    #[test]
    fn a_handle_and_a_cavity_do_not_hide_each_other() {
        let solid = |p: [usize; 3]| {
            let [i, j, k] = p.map(|x| x as f64);
            let near = (i - 9.0).hypot(j - 11.0).hypot(k - 11.0) < 8.0;
            let bar = (10..26).contains(&p[0]) && (9..13).contains(&p[2]);
            let ends = (6..9).contains(&p[1]) || (14..17).contains(&p[1]);
            near || bar && ends || (23..26).contains(&p[0]) && bar && (6..17).contains(&p[1])
        };
        let hollow = |p: [usize; 3]| {
            let [i, j, k] = p.map(|x| x as f64);
            (i - 9.0).hypot(j - 11.0).hypot(k - 11.0) < 4.0
        };
        let holed = label_map(|p| solid(p) && !hollow(p));
        let labels = mask_of(&holed, 1);
        assert_eq!(labels.euler_characteristic(), 1);
        assert!(!is_ball(&labels, &Monitor::silent()).unwrap());
        let (share, facts) = volume_share(&holed, labels.count());
        assert_eq!((facts.handles_before, facts.cavities_before), (1, 1));
        assert!((share - 1.0).abs() < 0.02, "{share}");
    }
}
