//! Random numbers that depend on the seed and the purpose alone.
//!
//! PCG-XSL-RR-128/64 (O'Neill 2014), one independent stream for each purpose, so that drawing
//! one number more in one stage changes no other stage.

use rand::Rng;
use rand_pcg::Pcg64;

/// What a stream of random numbers is for. The discriminant is part of every result's
/// reproducibility: never renumber.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// First positions of the model's points.
    Placement = 1,
    /// Quality of re-tiling where sites must jump.
    Relocation = 2,
    /// Samples for measuring.
    Measure = 3,
    /// Counting noise of a phantom.
    PhantomNoise = 4,
    /// Shape of a phantom.
    PhantomShape = 5,
    /// Starting poses of the deformable model.
    Pose = 6,
}

/// The generator for `purpose` under `seed`.
pub fn stream(seed: u64, purpose: Purpose) -> Pcg64 {
    Pcg64::new(u128::from(seed), purpose as u128)
}

/// A number in [0, 1) with 53 random bits.
pub fn uniform(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 * (-53_f64).exp2()
}
