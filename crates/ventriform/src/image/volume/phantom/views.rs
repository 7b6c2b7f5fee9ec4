//! The projections of a phantom, as a gamma camera would count them.
//!
//! The uptake is blurred by the resolution of camera and collimator, which is the same at every distance, and summed
//! along the rays of [`VIEW_COUNT`] views over half a turn, from the right in front to the left behind. A second head
//! stands at a right angle, and each turns a quarter. Views after the motion show the patient displaced along the body.
//! The counts of all views together are as stated, and random.
//!
//! Not modelled: attenuation, scatter, resolution by distance.

use super::anatomy::{self, Anatomy};
use super::parameters::{PhantomError, PhantomParameters};
use super::{kernels, motion, poisson};
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::geometry::random::{Purpose, stream};
use crate::base::progress::Monitor;
use crate::image::grid::blur::blur;
use crate::image::reconstruct::{Projections, View, project};

/// Views over half a turn.
pub const VIEW_COUNT: usize = 60;
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
    parameters.check()?;
    let p = parameters;
    let [columns, deep, rows] = p.shape;
    let pixel_mm = p.spacing_mm[0];
    if deep != columns || p.spacing_mm != [pixel_mm; 3] {
        return Err(PhantomError::NoCubes);
    }
    let frame = VoxelToPatient::centred(p.shape, p.spacing_mm, anatomy::FIELD_CENTRE)
        .expect("the spacing was checked to be positive");
    let anatomy = Anatomy::new(p);
    anatomy.check_fits(p)?;
    let (mut uptake, _) = anatomy.render(p.shape, &frame, monitor)?;
    let system_mm = (p.fwhm_mm.powi(2) - p.post_filter_mm.powi(2)).sqrt();
    blur(
        &mut uptake,
        p.shape,
        &kernels(system_mm, p.spacing_mm),
        monitor,
    )?;
    let views = views(usize::from(p.heads));
    let mut projections = project(&uptake, [columns, rows], pixel_mm, views.clone());
    if p.motion_mm != 0.0 {
        let moved = motion::displaced(&uptake, p.shape, p.motion_mm / pixel_mm);
        let after = project(&moved, [columns, rows], pixel_mm, views.clone()).counts;
        let first = ((1.0 - p.motion_share) * (VIEW_COUNT / usize::from(p.heads)) as f64).round();
        let pixels = columns * rows;
        for (number, _) in views
            .iter()
            .enumerate()
            .filter(|(_, view)| view.time as f64 >= first)
        {
            let own = number * pixels..(number + 1) * pixels;
            projections.counts[own.clone()].copy_from_slice(&after[own]);
        }
    }
    monitor.check()?;
    let sum: f64 = projections.counts.iter().map(|v| f64::from(*v)).sum();
    let per_value = 1e6 * counts_m / sum.max(f64::MIN_POSITIVE);
    let mut random = stream(p.seed, Purpose::PhantomNoise);
    for count in &mut projections.counts {
        *count = poisson::draw(per_value * f64::from(*count), &mut random) as f32;
    }
    Ok(projections)
}

/// The views of one or two heads, in the order of their angles.
fn views(heads: usize) -> Vec<View> {
    let each = VIEW_COUNT / heads;
    let view = |number: usize| View {
        angle_deg: FIRST_VIEW_DEG - 180.0 * number as f64 / VIEW_COUNT as f64,
        time: number % each,
    };
    (0..VIEW_COUNT).map(view).collect()
}
