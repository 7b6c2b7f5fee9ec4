//! Volumes of known truth: a left ventricle in a torso, as SPECT would show it.
//!
//! In go [`PhantomParameters`] and a seed; out come the volume, the mask of the wall as it
//! really is, and the pose. The steps:
//!
//! 1. `anatomy`: the uptake at every voxel. The LV wall is a truncated prolate ellipsoid
//!    shell with a slanted base, perhaps with perfusion defects by AHA segment (Cerqueira et
//!    al., Circulation 2002); round it blood, right ventricle, liver, gut, lungs and torso.
//! 2. `blur`: the camera's and the collimator's resolution, a Gaussian.
//! 3. `poisson`: counting noise.
//! 4. `blur` again: the filter of the reconstruction, which correlates the noise.
//!
//! Steps 2 to 4 stand for projection and reconstruction: right in resolution and in the look of
//! the noise, without attenuation, scatter or motion.
//!
//! The same parameters give the same voxels on any number of threads.

mod anatomy;
mod blur;
mod poisson;

use self::anatomy::Anatomy;
use super::Volume;
use crate::geometry::Vec3;
use crate::geometry::frame::VoxelToPatient;
use crate::geometry::random::{Purpose, stream};
use crate::progress::{Cancelled, Monitor, Stage};
use rand::Rng;
use rayon::prelude::*;
use serde::Serialize;

/// What the phantom is like. Lengths in millimetres, uptakes relative to healthy wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhantomParameters {
    /// Voxels along i, j, k, each 16..=1024, at most 2^28 together. Default 128 each.
    pub shape: [usize; 3],
    /// Voxel size, each 0.5..=20. Default 3.2, so that 128 voxels span a torso.
    pub spacing_mm: [f64; 3],
    /// Length of the LV from apex to base outside, 30..=150. Default 85.
    pub length_mm: f64,
    /// Its greatest width outside, 20..=150. Default 65.
    pub width_mm: f64,
    /// Thickness of the wall, 2..=25 and less than half the width. Default 11.
    pub wall_mm: f64,
    /// How far the wall reaches beyond the ellipsoid's equator, 0..=half the length. Default 15.
    pub base_mm: f64,
    /// Slant of the basal plane in degrees, 0..=40. Default 15.
    pub base_tilt_deg: f64,
    /// Direction from base to apex (LPS). Default (0.64, -0.60, -0.48): left, front, down.
    pub apex_direction: [f64; 3],
    /// The seed turns the axis by up to this many degrees, 0..=90. Default 10.
    pub pose_spread_deg: f64,
    /// The seed shifts the heart by up to this much along x, y, z, 0..=30. Default 8.
    pub pose_spread_mm: f64,
    /// Perfusion defects. Default none.
    pub defects: Vec<Defect>,
    /// Uptake of the right ventricle's wall, 0..=3; 0 leaves it out. Default 0.3.
    pub right_ventricle: f64,
    /// Uptake of the blood in the cavities, 0..=3. Default 0.12.
    pub blood: f64,
    /// Uptake of the torso, 0..=3. Default 0.1.
    pub background: f64,
    /// Uptake of the liver, 0..=5; above 1 it is hotter than the heart. Default 0.5.
    pub liver: f64,
    /// Uptake of the gut below the heart, 0..=5. Default 0.6.
    pub gut: f64,
    /// Resolution of the final volume (full width at half maximum), 0..=40. Default 11.
    pub fwhm_mm: f64,
    /// The part of it that filters the noise, at most `fwhm_mm`. Default 6.
    pub post_filter_mm: f64,
    /// Standard deviation over mean in a uniform region of uptake 1, 0 (no noise) or
    /// 0.001..=1. Default 0.05.
    pub noise: f64,
    /// Value of healthy wall before blurring, above 0. Default 1000.
    pub wall_value: f64,
    /// For pose and noise. Default 1.
    pub seed: u64,
}

/// A region of the wall with less uptake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Defect {
    /// AHA segment, 1..=17.
    pub segment: u8,
    /// 0 (healthy) ..= 1 (no uptake at all).
    pub severity: f64,
}

impl Default for PhantomParameters {
    fn default() -> Self {
        Self {
            shape: [128; 3],
            spacing_mm: [3.2; 3],
            length_mm: 85.0,
            width_mm: 65.0,
            wall_mm: 11.0,
            base_mm: 15.0,
            base_tilt_deg: 15.0,
            apex_direction: [0.64, -0.60, -0.48],
            pose_spread_deg: 10.0,
            pose_spread_mm: 8.0,
            defects: Vec::new(),
            right_ventricle: 0.3,
            blood: 0.12,
            background: 0.1,
            liver: 0.5,
            gut: 0.6,
            fwhm_mm: 11.0,
            post_filter_mm: 6.0,
            noise: 0.05,
            wall_value: 1000.0,
            seed: 1,
        }
    }
}

/// A phantom and its truth.
#[derive(Debug, Clone)]
pub struct Phantom {
    /// What the scanner shows.
    pub volume: Volume,
    /// 1 where at least half of a voxel is LV wall (defects included), else 0.
    pub truth: Volume,
    /// Where the LV is.
    pub pose: Pose,
    /// What it was made from.
    pub parameters: PhantomParameters,
}

/// The LV's place, LPS millimetres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Outermost point of the apex.
    pub apex: Vec3,
    /// Where the long axis leaves the base.
    pub base: Vec3,
    /// Unit vector from base to apex.
    pub axis: Vec3,
    /// Unit vector across the axis to the middle of the anterior wall.
    pub anterior: Vec3,
    /// Unit vector across both, to the middle of the septum.
    pub septal: Vec3,
}

/// Parameters that make no phantom.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PhantomError {
    /// A parameter outside its range.
    #[error("{field} is {value}, allowed is {low} to {high}")]
    OutOfRange {
        /// The parameter's name.
        field: &'static str,
        /// Its value.
        value: f64,
        /// Least allowed.
        low: f64,
        /// Greatest allowed.
        high: f64,
    },
    /// The heart would reach out of the volume.
    #[error("the volume spans {span_mm} mm along axis {axis}; the heart needs {needed_mm} mm")]
    TooSmall {
        /// 0, 1 or 2 for i, j, k.
        axis: usize,
        /// What there is.
        span_mm: f64,
        /// What is needed.
        needed_mm: f64,
    },
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Makes the phantom of `parameters`.
///
/// # Errors
/// [`PhantomError`] where a parameter is out of its range, the heart does not fit in, or the
/// work was cancelled.
pub fn phantom(parameters: &PhantomParameters, monitor: &Monitor) -> Result<Phantom, PhantomError> {
    parameters.check()?;
    let p = parameters;
    let anatomy = Anatomy::new(p);
    let frame = VoxelToPatient::centred(p.shape, p.spacing_mm, anatomy::FIELD_CENTRE)
        .expect("the spacing was checked to be positive");
    anatomy.check_fits(p)?;
    let step = |fraction| monitor.report(Stage::Read, fraction);
    step(0.0)?;
    let (mut voxels, wall) = anatomy.render(p.shape, &frame, monitor)?;
    step(0.3)?;
    let filter = blur::Gaussian::new(p.post_filter_mm, p.spacing_mm);
    let system = (p.fwhm_mm.powi(2) - p.post_filter_mm.powi(2)).sqrt();
    blur::Gaussian::new(system, p.spacing_mm).apply(&mut voxels, p.shape, monitor)?;
    step(0.6)?;
    if p.noise > 0.0 {
        let counts = filter.noise_gain() / p.noise.powi(2);
        count(&mut voxels, p.shape, counts, p.seed, monitor)?;
    }
    step(0.8)?;
    filter.apply(&mut voxels, p.shape, monitor)?;
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

/// Replaces each uptake by what `counts` expected decays per unit of it come to. Each slice
/// has its own stream, so that slices can be counted in parallel.
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
            let n = poisson::draw(f64::from(*v) * counts, &mut random);
            *v = (n / counts) as f32;
        }
        Ok(())
    })
}

impl PhantomParameters {
    /// Checks every range.
    fn check(&self) -> Result<(), PhantomError> {
        for n in self.shape {
            within("shape", n as f64, 16.0, 1024.0)?;
        }
        let voxels: usize = self.shape.iter().product();
        within(
            "shape (voxels in all)",
            voxels as f64,
            4096.0,
            (1 << 28) as f64,
        )?;
        for s in self.spacing_mm {
            within("spacing_mm", s, 0.5, 20.0)?;
        }
        within("length_mm", self.length_mm, 30.0, 150.0)?;
        within("width_mm", self.width_mm, 20.0, 150.0)?;
        within(
            "wall_mm",
            self.wall_mm,
            2.0,
            25.0_f64.min(0.5 * self.width_mm - 1.0),
        )?;
        within("base_mm", self.base_mm, 0.0, 0.5 * self.length_mm)?;
        within("base_tilt_deg", self.base_tilt_deg, 0.0, 40.0)?;
        let length = Vec3::from(self.apex_direction).norm();
        within("apex_direction (length)", length, 1e-3, 1e3)?;
        within("pose_spread_deg", self.pose_spread_deg, 0.0, 90.0)?;
        within("pose_spread_mm", self.pose_spread_mm, 0.0, 30.0)?;
        for defect in &self.defects {
            within("defects.segment", f64::from(defect.segment), 1.0, 17.0)?;
            within("defects.severity", defect.severity, 0.0, 1.0)?;
        }
        within("right_ventricle", self.right_ventricle, 0.0, 3.0)?;
        within("blood", self.blood, 0.0, 3.0)?;
        within("background", self.background, 0.0, 3.0)?;
        within("liver", self.liver, 0.0, 5.0)?;
        within("gut", self.gut, 0.0, 5.0)?;
        within("fwhm_mm", self.fwhm_mm, 0.0, 40.0)?;
        within("post_filter_mm", self.post_filter_mm, 0.0, self.fwhm_mm)?;
        if self.noise != 0.0 {
            within("noise", self.noise, 0.001, 1.0)?;
        }
        within("wall_value", self.wall_value, 1e-6, 1e9)
    }
}

fn within(field: &'static str, value: f64, low: f64, high: f64) -> Result<(), PhantomError> {
    match (low..=high).contains(&value) {
        true => Ok(()),
        false => Err(PhantomError::OutOfRange {
            field,
            value,
            low,
            high,
        }),
    }
}

#[cfg(test)]
mod tests;
