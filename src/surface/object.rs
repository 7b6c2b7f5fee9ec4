//! Which voxels are the object: steps 2 and 3 of [`super`], for labels here, for intensities in
//! [`intensity`].

use std::borrow::Cow;

use super::error::describe_labels;
use super::{
    IsoLevel, Isolate, SurfaceError, SurfaceFacts, SurfaceParameters, VolumeKind, intensity, masks,
};
use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::grid::labels::Labels;
use crate::grid::survey::Survey;
use crate::progress::Monitor;
use crate::volume::Volume;

/// The voxels to surface, and the samples that place the vertices.
pub(super) struct Object<'a> {
    pub labels: Labels,
    pub values: Cow<'a, [f32]>,
    pub shape: [usize; 3],
    pub frame: VoxelToPatient,
    pub iso: f32,
    pub is_mask: bool,
}

/// Chooses voxels and iso-value as asked, and notes in `facts` what was seen.
///
/// # Errors
/// Where nothing is there to be chosen.
pub(super) fn select<'a>(
    volume: &'a Volume,
    parameters: &SurfaceParameters,
    survey: &Survey,
    facts: &mut SurfaceFacts,
    monitor: &Monitor,
) -> Result<Object<'a>, SurfaceError> {
    if survey.finite == 0 {
        let voxels = volume.voxels.len();
        return Err(SurfaceError::NoFiniteVoxel { voxels });
    }
    facts.range = [survey.minimum, survey.maximum].map(f64::from);
    facts.not_finite = survey.not_finite;
    if survey.not_finite > 0 {
        facts.warnings.push(format!(
            "{} of {} voxels are NaN or infinite; they count as outside",
            survey.not_finite,
            volume.voxels.len()
        ));
    }
    if survey.minimum == survey.maximum {
        let value = survey.minimum;
        return Err(SurfaceError::Constant { value });
    }
    match (parameters.isolate, &survey.labels) {
        (Isolate::Label(label), present) => {
            let count = present.as_ref().and_then(|p| p.get(&label)).copied();
            if count.is_none() {
                let present = present.iter().flatten().map(|(&l, &n)| (l, n)).collect();
                return Err(SurfaceError::NoSuchLabel { label, present });
            }
            select_label(volume, parameters, label, facts)
        }
        // Who names an iso-value wants the values as they are.
        (Isolate::Auto, Some(present)) if parameters.iso == IsoLevel::Auto => {
            let largest = present
                .iter()
                .max_by_key(|&(&label, &n)| (n, std::cmp::Reverse(label)));
            let label = largest.map_or(0, |(&label, _)| label);
            facts.kind = if present.len() == 1 {
                VolumeKind::Mask
            } else {
                let all: Vec<_> = present.iter().map(|(&l, &n)| (l, n)).collect();
                facts.warnings.push(format!(
                    "the volume is a label map with {}; the largest, {label}, was taken: name another one by isolate: label",
                    describe_labels(&all)
                ));
                VolumeKind::Labels
            };
            select_label(volume, parameters, label, facts)
        }
        _ => intensity::select(volume, parameters, survey, facts, monitor),
    }
}

fn select_label<'a>(
    volume: &Volume,
    parameters: &SurfaceParameters,
    label: i64,
    facts: &mut SurfaceFacts,
) -> Result<Object<'a>, SurfaceError> {
    if facts.kind == VolumeKind::Intensity {
        facts.kind = VolumeKind::Labels;
    }
    facts.label = Some(label);
    let mask = mask_of(volume, label);
    let smoothed = masks::smooth(&mask, parameters.mask_smoothing);
    if smoothed.sigma < parameters.mask_smoothing {
        facts.warnings.push(format!(
            "thin parts of the mask would be lost: smoothed with {} instead of {} voxels",
            smoothed.sigma, parameters.mask_smoothing
        ));
    }
    let level = match parameters.iso {
        IsoLevel::Auto => smoothed.level,
        IsoLevel::Fraction(f) | IsoLevel::Absolute(f) => f as f32,
    };
    facts.reference = 1.0;
    facts.iso_fraction = f64::from(level);
    let shape = smoothed.shape;
    let labels = Labels::threshold(&smoothed.values, shape, [0; 3], shape, level);
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
        is_mask: true,
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

/// The labelled voxels of the volume, whose values place the vertices.
pub(super) fn whole(volume: &Volume, labels: Labels, iso: f32) -> Object<'_> {
    Object {
        labels,
        values: volume.voxels.as_slice().into(),
        shape: volume.shape,
        frame: volume.frame.clone(),
        iso,
        is_mask: false,
    }
}
