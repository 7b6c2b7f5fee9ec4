//! From the projections of a gamma camera to a volume.
//!
//! In: [`Projections`], the counts of every view of one gate, and how the camera turned; a [`Reconstruction`], which
//! says how. Out: the values of a volume whose voxels are as large as the pixels, in the patient's directions. Steps:
//!
//! 1. `camera`: where each view's rays go through the slices, as the image turned to the detector: linear between the
//!    four voxels about each point of a ray, one point to a voxel's length.
//! 2. `osem`: ordered subsets expectation maximisation (Hudson and Larkin, IEEE TMI 1994), from an even disc; or `fbp`:
//!    filtered back projection (Kak and Slaney 1988, chapter 3).
//! 3. `filter`: the Butterworth or Gaussian filter, by the image's spectrum.
//!
//! [`motion`]: where the heart was in each view, measured in the projections themselves.
//!
//! Values are counts: the sum of a volume is about the counts of one view. Nothing is below 0.
//!
//! Guaranteed: the same bytes for the same input whatever the number of threads: slices are worked on in packs, each
//! for itself. A bound on the work ([`Projections::check`]) is checked before it begins; cancelling ends it within a
//! pass over one pack.
//!
//! Not in the model: attenuation, scatter, decay between the views, and the resolution of the collimator. An image made
//! here is that of a scan without these corrections. Existing libraries were looked for: those of emission tomography
//! (STIR, PyTomography, NiftyRec, castor) are C++ or Python, and no Rust crate reconstructs SPECT.

mod camera;
mod fbp;
mod filter;
pub mod motion;
mod osem;
mod parameters;
mod projections;
#[cfg(test)]
mod tests;

pub use parameters::{
    AXIS_OFFSET_MM, CUT_OFF_PER_CM, FILTER_ORDER, FWHM_MM, Filter, ITERATIONS, Method,
    Reconstruction, SUBSETS,
};
pub use projections::{ODD_VIEW_PERCENT, OddView, Projections, ProjectionsError, View, by_angle};

use self::camera::Camera;
use crate::base::progress::{Cancelled, Monitor};

/// What a camera with `views` sees of an image of cubes of `pixel_mm`, x the fastest, with as many columns along y as
/// along x and so many rows along z: the sums along its rays.
pub fn project(
    image: &[f32],
    [columns, rows]: [usize; 2],
    pixel_mm: f64,
    views: Vec<View>,
) -> Projections {
    let mut projections = Projections {
        counts: Vec::new(),
        columns,
        rows,
        pixel_mm,
        views,
    };
    let camera = Camera::new(&projections, 0.0);
    projections.counts = camera::projected(&camera, image, rows);
    projections
}

/// The voxels of the volume of `projections`, x the fastest, on [`Projections::shape`]. Reports
/// [`Stage::Read`](crate::base::progress::Stage::Read).
///
/// # Errors
/// [`Cancelled`].
pub fn reconstruct(
    projections: &Projections,
    how: &Reconstruction,
    monitor: &Monitor,
) -> Result<Vec<f32>, Cancelled> {
    let camera = Camera::new(projections, how.axis_offset_mm);
    let mut image = match how.method {
        Method::Osem => osem::image(&camera, projections, how, monitor)?,
        Method::Fbp => fbp::image(&camera, projections, how, monitor)?,
    };
    monitor.check()?;
    if how.method == Method::Osem {
        let shape = projections.shape();
        image = filter::smoothed(image, shape, projections.pixel_mm, how);
    }
    monitor.check()?;
    for value in &mut image {
        *value = value.max(0.0);
    }
    Ok(image)
}
