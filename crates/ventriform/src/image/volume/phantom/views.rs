//! The projections of a phantom, as a gamma camera would count them.
//!
//! The uptake is blurred by the resolution of camera and collimator, which is the same at every distance, and summed
//! along the rays of [`VIEW_COUNT`] views over half a turn, from the right in front to the left behind. A second head
//! stands at a right angle, and each turns a quarter. Views after the motion show the patient displaced along the body.
//! The counts of all views together are as stated, and random.
//!
//! Not modelled: attenuation, scatter, resolution by distance.

use super::motion::{self, VIEW_COUNT};
use super::parameters::{PhantomError, PhantomParameters};
use super::{placed, poisson, system_kernels};
use crate::base::geometry::random::{Purpose, stream};
use crate::base::progress::Monitor;
use crate::image::grid::blur::blur;
use crate::image::reconstruct::{Projections, View, project};

/// The detector's angle at the first view, degrees: the right in front.
const FIRST_VIEW_DEG: f64 = 225.0;

/// The projections of the phantom of `parameters`, with so many million counts in all.
///
/// # Errors
/// [`PhantomError`], also for a grid whose voxels are no cubes, or with another number of them along i than along j.
pub fn phantom_projections(
    parameters: &PhantomParameters,
    counts_m: f64,
    monitor: &Monitor,
) -> Result<Projections, PhantomError> {
    let p = parameters;
    let (anatomy, frame) = placed(p)?;
    let [columns, deep, rows] = p.shape;
    let pixel_mm = p.spacing_mm[0];
    if deep != columns || p.spacing_mm != [pixel_mm; 3] {
        return Err(PhantomError::NoCubes);
    }
    let (mut uptake, _) = anatomy.render(p.shape, &frame, monitor)?;
    blur(&mut uptake, p.shape, &system_kernels(p), monitor)?;
    let (of_a_head, first_after) = motion::views_of_a_head(p);
    let seen = |image: &[f32]| project(image, [columns, rows], pixel_mm, views(of_a_head));
    let mut projections = seen(&uptake);
    if p.motion_mm != 0.0 {
        let moved = seen(&motion::displaced(&uptake, p.shape, p.motion_mm / pixel_mm)).counts;
        let pixels = columns * rows;
        let after =
            (projections.views.iter().enumerate()).filter(|(_, view)| view.time >= first_after);
        for (number, _) in after {
            let own = number * pixels..(number + 1) * pixels;
            projections.counts[own.clone()].copy_from_slice(&moved[own]);
        }
    }
    monitor.check()?;
    let sum: f64 = projections.counts.iter().map(|v| f64::from(*v)).sum();
    let per_value = 1e6 * counts_m / sum.max(f64::MIN_POSITIVE);
    let mut random = stream(p.noise_seed(), Purpose::PhantomNoise);
    for count in &mut projections.counts {
        *count = poisson::draw(per_value * f64::from(*count), &mut random) as f32;
    }
    Ok(projections)
}

/// The views of heads with so many each, in the order of their angles.
fn views(of_a_head: usize) -> Vec<View> {
    let view = |number: usize| View {
        angle_deg: FIRST_VIEW_DEG - 180.0 * number as f64 / VIEW_COUNT as f64,
        time: number % of_a_head,
    };
    (0..VIEW_COUNT).map(view).collect()
}
