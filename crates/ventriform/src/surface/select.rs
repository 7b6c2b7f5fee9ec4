//! Which voxels are the object: by [`label`] in label maps, by
//! [`intensity`] in all other volumes.

use super::error::describe_labels;
use super::object::Object;
use super::{
    IsoLevel, Isolate, SurfaceError, SurfaceFacts, SurfaceParameters, VolumeKind, intensity, label,
};
use crate::base::progress::Monitor;
use crate::image::grid::Volume;
use crate::image::grid::survey::{self, Survey};
use std::cmp::Reverse;

/// Labels from which none is taken for the object because it is the largest.
const MOST_TO_CHOOSE_FROM: usize = 256;

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
    if survey.minimum == survey.maximum && (survey.not_finite == 0 || survey.labels.is_none()) {
        let value = survey.minimum;
        return Err(SurfaceError::Constant { value });
    }
    match (parameters.isolate, &survey.labels) {
        (Isolate::Label(label), _) => {
            if (label as f32) as i64 != label {
                return Err(SurfaceError::InexactLabel { label });
            }
            if !volume.voxels.contains(&(label as f32)) {
                let present = survey::whole_values(volume, monitor)?;
                let present = present.into_iter().flatten().collect();
                return Err(SurfaceError::NoSuchLabel { label, present });
            }
            label::select(volume, parameters, label, facts, monitor)
        }
        // An explicit iso-value applies to the values themselves, not to a smoothed mask.
        (Isolate::Auto, Some(present)) if parameters.iso == IsoLevel::Auto => {
            let (objects, background) = survey::objects(volume, present, monitor)?;
            if background != 0 {
                facts.warnings.push(format!(
                    "the value {background}, which surrounds the rest, was taken for the background"
                ));
            }
            let all: Vec<_> = objects.iter().map(|(&l, &n)| (l, n)).collect();
            if all.len() > MOST_TO_CHOOSE_FROM {
                return Err(SurfaceError::LabelNeeded { present: all });
            }
            let largest = all.iter().max_by_key(|&&(label, n)| (n, Reverse(label)));
            let label = largest.map_or(0, |&(label, _)| label);
            facts.kind = if all.len() == 1 {
                VolumeKind::Mask
            } else {
                facts.warnings.push(format!(
                    "the volume is a label map with {}; the largest, {label}, was taken: name another one by isolate: \
                     label",
                    describe_labels(&all)
                ));
                VolumeKind::Labels
            };
            label::select(volume, parameters, label, facts, monitor)
        }
        _ => intensity::select(volume, parameters, survey, facts, monitor),
    }
}
