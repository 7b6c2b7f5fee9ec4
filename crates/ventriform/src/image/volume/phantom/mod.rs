//! Volumes with known ground truth: a left ventricle in a torso, as a SPECT scan would show it.
//!
//! In: [`PhantomParameters`] including a seed. Out: the volume, the true mask of the wall, and the
//! pose. The steps:
//!
//! 1. `anatomy`: the uptake at every voxel. The wall of the LV is a truncated prolate ellipsoid
//!    shell with a slanted base and optional perfusion defects by AHA segment (Cerqueira et al.,
//!    Circulation 2002), surrounded by blood, right ventricle, liver, gut, lungs and torso.
//! 2. `motion`: the views after a displacement along the body show the heart in another place.
//! 3. A Gaussian blur: the resolution of camera and collimator.
//! 4. `poisson`: counting noise.
//! 5. A second Gaussian blur: the reconstruction filter, which correlates the noise.
//!
//! Steps 2 to 5 replace projection and reconstruction. Resolution and texture of the noise are
//! realistic; attenuation and scatter are not modelled. [`phantom_projections`] makes the projections themselves,
//! [`phantom_gates`] the gates of a heart that beats.
//!
//! Guaranteed: the same parameters give the same voxels on any number of threads.

mod anatomy;
mod beat;
mod healthy;
mod motion;
mod parameters;
mod poisson;
mod views;

pub use anatomy::HeartPose;
pub use beat::{GatedPhantom, PhantomBeat, phantom_gates};
pub use healthy::{HealthyPerson, healthy_person};
pub use parameters::{PerfusionDefect, PhantomError, PhantomParameters, UptakeVariation};
pub use views::phantom_projections;

use self::anatomy::Anatomy;
use super::Volume;
use crate::base::geometry::frame::VoxelToPatient;
use crate::base::geometry::random::{Purpose, stream};
use crate::base::progress::{Cancelled, Monitor, Stage};
use crate::image::grid::blur::{Kernel, blur};
use rand::Rng;
use rayon::prelude::*;

/// A phantom and its ground truth.
#[derive(Debug, Clone)]
pub struct Phantom {
    /// The simulated scan.
    pub volume: Volume,
    /// 1 where at least half of a voxel is LV wall (including defects), otherwise 0.
    pub truth: Volume,
    /// Position and orientation of the LV.
    pub pose: HeartPose,
    /// The parameters it was made from.
    pub parameters: PhantomParameters,
}

/// Makes the phantom of `parameters`.
///
/// # Errors
/// [`PhantomError`] if a parameter is out of range, the heart does not fit into the volume, or the
/// work was cancelled.
pub fn phantom(parameters: &PhantomParameters, monitor: &Monitor) -> Result<Phantom, PhantomError> {
    parameters.check()?;
    imaged(parameters, &Anatomy::new(parameters), monitor)
}

/// The image of the patient `anatomy` of checked parameters.
fn imaged(
    p: &PhantomParameters,
    anatomy: &Anatomy<'_>,
    monitor: &Monitor,
) -> Result<Phantom, PhantomError> {
    let frame = frame_about(p, anatomy)?;
    let step = |fraction| monitor.report(Stage::Read, fraction);
    step(0.0)?;
    let (mut voxels, wall) = anatomy.render(p.shape, &frame, monitor)?;
    if p.motion_mm != 0.0 {
        voxels = motion::moved(&voxels, p);
    }
    step(0.3)?;
    let filter = kernels(p.post_filter_mm, p.spacing_mm);
    blur(&mut voxels, p.shape, &system_kernels(p), monitor)?;
    step(0.6)?;
    if p.noise > 0.0 {
        let gain: f64 = filter.iter().map(Kernel::noise_gain).product();
        let counts = gain / p.noise.powi(2);
        count(&mut voxels, p.shape, counts, p.noise_seed(), monitor)?;
    }
    step(0.8)?;
    blur(&mut voxels, p.shape, &filter, monitor)?;
    voxels
        .par_iter_mut()
        .for_each(|v| *v *= p.wall_value as f32);
    step(1.0)?;
    Ok(Phantom {
        volume: Volume {
            shape: p.shape,
            voxels,
            frame: frame.clone(),
            integral: false,
        },
        truth: Volume {
            shape: p.shape,
            voxels: wall,
            frame,
            integral: true,
        },
        pose: anatomy.pose(),
        parameters: p.clone(),
    })
}

/// The patient of checked parameters, and the grid about them.
fn placed(p: &PhantomParameters) -> Result<(Anatomy<'_>, VoxelToPatient), PhantomError> {
    p.check()?;
    let anatomy = Anatomy::new(p);
    let frame = frame_about(p, &anatomy)?;
    Ok((anatomy, frame))
}

/// The grid about the heart.
fn frame_about(
    p: &PhantomParameters,
    anatomy: &Anatomy<'_>,
) -> Result<VoxelToPatient, PhantomError> {
    let frame = VoxelToPatient::centred(p.shape, p.spacing_mm, anatomy::FIELD_CENTRE)
        .expect("the spacing was checked to be positive");
    anatomy.check_fits(p)?;
    Ok(frame)
}

/// The kernels of the resolution of camera and collimator.
fn system_kernels(p: &PhantomParameters) -> [Kernel; 3] {
    let system_mm = (p.fwhm_mm.powi(2) - p.post_filter_mm.powi(2)).sqrt();
    kernels(system_mm, p.spacing_mm)
}

/// The kernels along i, j, k of a Gaussian with the full width at half maximum `fwhm_mm`, cut off at
/// four sigma, beyond which lies 6e-5 of its mass.
fn kernels(fwhm_mm: f64, spacing_mm: [f64; 3]) -> [Kernel; 3] {
    let sigma_mm = fwhm_mm / (8.0 * 2_f64.ln()).sqrt();
    spacing_mm.map(|spacing| Kernel::gaussian(sigma_mm / spacing, 4.0))
}

/// Replaces each uptake by a Poisson-distributed one of `counts` expected decays per unit of uptake.
/// Each slice has its own stream of random numbers, so that slices can be drawn in parallel.
fn count(
    voxels: &mut [f32],
    shape: [usize; 3],
    counts: f64,
    seed: u64,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let mut seeds = stream(seed, Purpose::PhantomNoise);
    let seeds: Vec<u64> = (0..shape[2]).map(|_| seeds.next_u64()).collect();
    let slices = voxels.par_chunks_mut(shape[0] * shape[1]).zip(seeds);
    slices.try_for_each(|(slice, seed)| {
        monitor.check()?;
        let mut random = stream(seed, Purpose::PhantomNoise);
        for v in slice {
            let n = poisson::draw(f64::from(v.max(0.0)) * counts, &mut random);
            *v = (n / counts) as f32;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests;
