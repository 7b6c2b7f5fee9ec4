//! Which voxels are the object: by [`label`] in label maps, by
//! [`intensity`] in all other volumes.

use super::error::describe_labels;
use super::object::Object;
use super::{
    IsoLevel, Isolate, SurfaceError, SurfaceFacts, SurfaceParameters, VolumeKind, intensity, label,
};
use crate::grid::survey::Survey;
use crate::progress::Monitor;
use crate::volume::Volume;

/// Chooses voxels and iso-value by `parameters`, and notes in `facts` what `volume` holds.
///
/// # Errors
/// [`SurfaceError`] if the volume is blank, or lacks the label or the iso-value.
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
            label::select(volume, parameters, label, facts)
        }
        // An explicit iso-value applies to the values themselves, not to a smoothed mask.
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
            label::select(volume, parameters, label, facts)
        }
        _ => intensity::select(volume, parameters, survey, facts, monitor),
    }
}
