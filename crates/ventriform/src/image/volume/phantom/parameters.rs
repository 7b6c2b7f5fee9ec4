//! The parameters of a phantom and their ranges.

use crate::base::geometry::Vec3;
use crate::base::progress::Cancelled;
use serde::Serialize;
use std::f64::consts::TAU;

/// Parameters of a phantom. Lengths are in millimetres, uptakes relative to the healthy wall.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PhantomParameters {
    /// Voxels along i, j, k, each 16..=1024, at most 2^28 together. Default 128 each.
    pub shape: [usize; 3],
    /// Voxel size, each 0.5..=20. Default 3.2, so that 128 voxels span a torso.
    pub spacing_mm: [f64; 3],
    /// Outer length of the LV from apex to base, 30..=150. Default 85.
    pub length_mm: f64,
    /// Largest outer width of the LV, 20..=150. Default 65.
    pub width_mm: f64,
    /// Thickness of the wall, 2..=25 and less than half the width. Default 11.
    pub wall_mm: f64,
    /// Extent of the wall beyond the equator of the ellipsoid, 0..=half the length. Default 15.
    pub base_mm: f64,
    /// Slant of the basal plane in degrees, 0..=40. Default 15.
    pub base_tilt_deg: f64,
    /// Direction from base to apex, LPS. Default (0.64, -0.60, -0.48): left, anterior, inferior.
    pub apex_direction: [f64; 3],
    /// Largest random rotation of the axis in degrees, 0..=90. Default 10.
    pub pose_spread_deg: f64,
    /// Largest random shift of the heart along each of x, y, z, 0..=30. Default 8.
    pub pose_spread_mm: f64,
    /// How the uptake of a wall without defects differs from place to place. Default: not at all.
    pub variation: UptakeVariation,
    /// Perfusion defects of the wall. Default none.
    pub defects: Vec<PerfusionDefect>,
    /// Uptake of the right ventricle's wall, 0..=3; 0 leaves it out. Default 0.3.
    pub right_ventricle: f64,
    /// Uptake of the blood in the cavities, 0..=3. Default 0.12.
    pub blood: f64,
    /// Uptake of the torso, 0..=3. Default 0.1.
    pub background: f64,
    /// Uptake of the liver, 0..=5; above 1 it is brighter than the heart. Default 0.5.
    pub liver: f64,
    /// Uptake of the gut below the heart, 0..=5. Default 0.6.
    pub gut: f64,
    /// Distance that the patient moves towards the head during the scan, -60..=60. The true mask keeps the
    /// first place. Default 0.
    pub motion_mm: f64,
    /// Share of the scan after the motion, 0..=1. Default 0.5.
    pub motion_share: f64,
    /// Heads of the camera, 1 or 2 (at a right angle); matters with motion only. Default 1.
    pub heads: u8,
    /// Resolution of the final volume (full width at half maximum), 0..=40. Default 11.
    pub fwhm_mm: f64,
    /// Full width at half maximum of the reconstruction filter, which is part of `fwhm_mm` and at most
    /// as large. Default 6.
    pub post_filter_mm: f64,
    /// Standard deviation divided by the mean in a uniform region of uptake 1: 0 (no noise) or
    /// 0.001..=1. Default 0.05.
    pub noise: f64,
    /// Value of the healthy wall before blurring, above 0. Default 1000.
    pub wall_value: f64,
    /// Seed of the random numbers for pose and noise. Default 1.
    pub seed: u64,
    /// Which scan of the patient it is: each has its own noise. Default 0.
    pub scan: u32,
}

/// How the uptake of a wall differs from place to place, as that of healthy people does: attenuation lowers it
/// towards the base and on one side, and no heart takes up evenly.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct UptakeVariation {
    /// Share that the base has less than the apex, 0..=0.5.
    pub basal_fall: f64,
    /// Share that one side has less at the base, 0..=0.4.
    pub side_fall: f64,
    /// Where that side is, turns from anterior towards septal.
    pub side_turns: f64,
    /// Amplitude of an uneven uptake, 0..=0.1.
    pub unevenness: f64,
    /// Its place about the axis, turns.
    pub uneven_turns: f64,
    /// Share that the apex has less, 0..=0.5.
    pub apical_fall: f64,
}

impl UptakeVariation {
    /// Uptake at a share of the way from apex (0) to base (1) and at an angle, turns from anterior towards septal,
    /// relative to an even wall.
    pub(super) fn at(&self, along: f64, turns: f64) -> f64 {
        let wave = |turns: f64| (TAU * turns).cos();
        let side = 0.5 + 0.5 * wave(turns - self.side_turns);
        let uneven = wave(2.0 * (turns - self.uneven_turns)) * (2.0 * TAU * along).sin();
        let apical = self.apical_fall * (1.0 - along / APICAL_SHARE).max(0.0);
        1.0 - self.basal_fall * along - self.side_fall * along * side + self.unevenness * uneven
            - apical
    }
}

/// Share of the length that the apex's own uptake reaches over.
const APICAL_SHARE: f64 = 0.2;

/// A segment of the wall with reduced uptake.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PerfusionDefect {
    /// AHA segment, 1..=17.
    pub segment: u8,
    /// From 0 (healthy) to 1 (no uptake).
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
            variation: UptakeVariation::default(),
            defects: Vec::new(),
            right_ventricle: 0.3,
            blood: 0.12,
            background: 0.1,
            liver: 0.5,
            gut: 0.6,
            motion_mm: 0.0,
            motion_share: 0.5,
            heads: 1,
            fwhm_mm: 11.0,
            post_filter_mm: 6.0,
            noise: 0.05,
            wall_value: 1000.0,
            seed: 1,
            scan: 0,
        }
    }
}

/// Why there is no phantom.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum PhantomError {
    /// A parameter outside its range.
    #[error("{field} is {value}, must be {low} to {high}")]
    OutOfRange {
        /// Name of the parameter.
        field: &'static str,
        /// The value given.
        value: f64,
        /// Smallest valid value.
        low: f64,
        /// Largest valid value.
        high: f64,
    },
    /// The heart does not fit into the volume.
    #[error("the volume spans {span_mm} mm along axis {axis}; the heart needs {needed_mm} mm")]
    TooSmall {
        /// 0, 1 or 2 for i, j, k.
        axis: usize,
        /// Size of the volume along that axis, mm.
        span_mm: f64,
        /// Size that the heart needs, mm.
        needed_mm: f64,
    },
    /// A camera that turns needs cubes, and as many of them along i as along j.
    #[error("projections need voxels that are cubes, and as many of them along i as along j")]
    NoCubes,
    /// The caller cancelled the work.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl PhantomParameters {
    /// The seed of the noise of this scan.
    pub(super) fn noise_seed(&self) -> u64 {
        // An odd number, so that no two scans of a patient have the same one.
        const NEXT_SCAN: u64 = 0x9E37_79B9_7F4A_7C15;
        let skipped = NEXT_SCAN.wrapping_mul(u64::from(self.scan));
        self.seed.wrapping_add(skipped)
    }

    /// Checks every parameter's range.
    pub(super) fn check(&self) -> Result<(), PhantomError> {
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
        let v = &self.variation;
        within("variation.basal_fall", v.basal_fall, 0.0, 0.5)?;
        within("variation.side_fall", v.side_fall, 0.0, 0.4)?;
        within("variation.side_turns", v.side_turns, -1.0, 1.0)?;
        within("variation.unevenness", v.unevenness, 0.0, 0.1)?;
        within("variation.uneven_turns", v.uneven_turns, -1.0, 1.0)?;
        within("variation.apical_fall", v.apical_fall, 0.0, 0.5)?;
        for defect in &self.defects {
            within("defects.segment", f64::from(defect.segment), 1.0, 17.0)?;
            within("defects.severity", defect.severity, 0.0, 1.0)?;
        }
        within("right_ventricle", self.right_ventricle, 0.0, 3.0)?;
        within("blood", self.blood, 0.0, 3.0)?;
        within("background", self.background, 0.0, 3.0)?;
        within("liver", self.liver, 0.0, 5.0)?;
        within("gut", self.gut, 0.0, 5.0)?;
        within("motion_mm", self.motion_mm, -60.0, 60.0)?;
        within("motion_share", self.motion_share, 0.0, 1.0)?;
        within("heads", f64::from(self.heads), 1.0, 2.0)?;
        within("fwhm_mm", self.fwhm_mm, 0.0, 40.0)?;
        within("post_filter_mm", self.post_filter_mm, 0.0, self.fwhm_mm)?;
        if self.noise != 0.0 {
            within("noise", self.noise, 0.001, 1.0)?;
        }
        within("wall_value", self.wall_value, 1e-6, 1e9)
    }
}

/// Checks that the value of a field lies in its range.
pub(super) fn within(
    field: &'static str,
    value: f64,
    low: f64,
    high: f64,
) -> Result<(), PhantomError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(PhantomError::OutOfRange {
            field,
            value,
            low,
            high,
        })
    }
}
