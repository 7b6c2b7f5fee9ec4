//! Healthy hearts as different as people are, for tests of normal limits: simulated, not patients.
//!
//! Size, thickness, place, attenuation and evenness of the uptake are drawn from the seed. Men have larger hearts,
//! and lose uptake on the inferior side; women lose it on the anterior side. The figures are those of no study: they
//! make limits that a program can be tested with.

use super::parameters::{PhantomParameters, UptakeVariation};
use crate::base::geometry::random::{Purpose, normal, stream};

/// A healthy heart's parameters and whose it is.
#[derive(Debug, Clone, PartialEq)]
pub struct HealthyPerson {
    /// `true` if the heart is that of a woman.
    pub female: bool,
    /// The scan's parameters.
    pub parameters: PhantomParameters,
}

/// The healthy heart of this seed, on the grid and with the noise of `base`. Even seeds are women's.
pub fn healthy_person(seed: u64, base: &PhantomParameters) -> HealthyPerson {
    let mut random = stream(seed, Purpose::PhantomPerson);
    let female = seed.is_multiple_of(2);
    let mut about = |mean: f64, spread: f64| mean + spread * normal(&mut random);
    let (length, width) = if female { (78.0, 59.0) } else { (86.0, 66.0) };
    // Turns from anterior towards septal: 0 is anterior, a half inferior.
    let side = if female { 0.0 } else { 0.5 };
    let parameters = PhantomParameters {
        length_mm: about(length, 4.0).clamp(65.0, 100.0),
        width_mm: about(width, 3.0).clamp(50.0, 78.0),
        wall_mm: about(10.5, 0.7).clamp(8.5, 13.0),
        base_tilt_deg: about(12.0, 4.0).clamp(2.0, 22.0),
        right_ventricle: about(0.35, 0.08).clamp(0.15, 0.6),
        liver: about(0.5, 0.15).clamp(0.1, 0.9),
        variation: UptakeVariation {
            basal_fall: about(0.15, 0.05).clamp(0.0, 0.35),
            side_fall: about(0.12, 0.05).clamp(0.0, 0.3),
            side_turns: about(side, 0.06).clamp(-1.0, 1.0),
            unevenness: about(0.0, 0.025).abs().min(0.07),
            uneven_turns: about(0.0, 0.2).clamp(-1.0, 1.0),
            apical_fall: about(0.08, 0.04).clamp(0.0, 0.25),
        },
        defects: Vec::new(),
        seed,
        ..base.clone()
    };
    HealthyPerson { female, parameters }
}
