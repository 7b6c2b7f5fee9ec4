//! Random numbers that are determined by a seed and a purpose.
//!
//! The generator is PCG-XSL-RR-128/64 (O'Neill 2014). Every purpose has an independent stream, so
//! drawing more numbers in one stage does not affect any other stage.

use rand::Rng;
use rand_pcg::Pcg64;

/// The use of a stream of random numbers. The numbers of the variants are part of every
/// result and must never change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Initial positions of the model's points.
    Placement = 1,
    /// New positions of sites that are moved.
    Relocation = 2,
    /// Samples for measurements.
    Measure = 3,
    /// Counting noise of phantoms.
    PhantomNoise = 4,
    /// Shapes of phantoms.
    PhantomShape = 5,
    /// Starting poses of the deformable model.
    Pose = 6,
    /// The differences between healthy phantoms.
    PhantomPerson = 7,
    /// Noise of the difference of two scans.
    ComparisonNoise = 8,
}

/// The generator of the stream for `purpose` with this seed.
pub fn stream(seed: u64, purpose: Purpose) -> Pcg64 {
    Pcg64::new(u128::from(seed), purpose as u128)
}

/// A number of the standard normal distribution, as twelve uniform ones less six: never beyond 6.
pub fn normal(random: &mut impl Rng) -> f64 {
    (0..12).map(|_| uniform(random)).sum::<f64>() - 6.0
}

/// A number in [0, 1) with 53 random bits.
pub fn uniform(random: &mut impl Rng) -> f64 {
    (random.next_u64() >> 11) as f64 * (-53_f64).exp2()
}
