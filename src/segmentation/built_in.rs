//! The built-in model: a healthy left ventricle, generated when it is first needed.
//!
//! It is generated like any other model, from a phantom without noise and without neighbouring
//! organs, and has the apparent edge of a blurred wall like the models of real scans. It is
//! kept for the life of the process, and is the same in every process.

use crate::model::{Organ, Template};
use crate::parameters::ModelParameters;
use crate::progress::{Cancelled, Monitor};
use crate::volume::phantom::{PhantomParameters, phantom};
use crate::volume::{ReadLimits, VolumeFile, nifti};
use std::sync::OnceLock;

/// Its name in reports.
pub const NAME: &str = "built-in";

static TEMPLATE: OnceLock<Template> = OnceLock::new();

/// The built-in model, ready to be fitted.
///
/// # Errors
/// [`Cancelled`].
pub fn template(monitor: &Monitor<'_>) -> Result<Template, Cancelled> {
    if let Some(template) = TEMPLATE.get() {
        return Ok(template.clone());
    }
    let made = make(&monitor.without_observer())?;
    Ok(TEMPLATE.get_or_init(|| made).clone())
}

/// Points of the model: within the paper's best range.
const POINTS: &str = "150";

fn make(monitor: &Monitor<'_>) -> Result<Template, Cancelled> {
    let parameters = PhantomParameters {
        shape: [64; 3],
        right_ventricle: 0.0,
        liver: 0.0,
        gut: 0.0,
        noise: 0.0,
        pose_spread_deg: 0.0,
        pose_spread_mm: 0.0,
        ..PhantomParameters::default()
    };
    let scan = sound(phantom(&parameters, monitor), monitor)?.volume;
    let bytes = nifti::write(&scan, nifti::StoredType::Float32, false);
    let file = VolumeFile::in_memory("built-in.nii", sound(bytes, monitor)?);
    let parameters = sound(ModelParameters::from_pairs([("points", POINTS)]), monitor)?;
    let limits = ReadLimits::default();
    let model = crate::pipeline::generate(&[file], &parameters, &limits, monitor);
    let mesh = sound(model, monitor)?.mesh;
    sound(Template::new(mesh, Organ::LeftVentricle, monitor), monitor)
}

/// Only the cancel token depends on the caller, so any other failure is a defect, which the test
/// below would find.
fn sound<T, E: std::fmt::Debug>(
    result: Result<T, E>,
    monitor: &Monitor<'_>,
) -> Result<T, Cancelled> {
    match result {
        Ok(value) => Ok(value),
        Err(error) => {
            monitor.check()?;
            unreachable!("the built-in model is the same on every machine: {error:?}")
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::progress::{CancelToken, Silent};
    use crate::segmentation::built_in::*;

    #[test]
    fn making_it_can_be_cancelled() {
        let cancel = CancelToken::new();
        cancel.cancel();
        let monitor = Monitor::new(&Silent, cancel);
        assert!(make(&monitor.without_observer()).is_err());
    }

    #[test]
    fn the_built_in_model_is_a_plausible_ventricle() {
        let template = template(&Monitor::silent()).unwrap();
        assert_eq!(template.mesh.vertices.len().to_string(), POINTS);
        let cup = template.cup.unwrap();
        assert!((60.0..100.0).contains(&cup.length), "{cup:?}");
        let wall_ml = template.mesh.volume() / 1000.0;
        assert!((100.0..260.0).contains(&wall_ml), "{wall_ml}");
    }
}
