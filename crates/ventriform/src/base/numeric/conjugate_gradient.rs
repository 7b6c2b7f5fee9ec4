//! The preconditioned conjugate gradient method for systems over 3-vectors.
//!
//! In: a symmetric positive definite [`LinearSystem`] A x = b with a preconditioner M ≈ A⁻¹, a
//! starting point x and a tolerance. Out: an improved x (Hestenes and Stiefel 1952; the
//! preconditioned form of Golub and Van Loan, *Matrix Computations*, algorithm 11.5.1). Each
//! round takes one multiplication by A and one by M.
//!
//! All sums run in the order of the unknowns, so the same input gives the same bytes on any
//! number of threads. A direction without positive curvature, which rounding can cause near the
//! solution, ends the iteration.

use std::convert::Infallible;

use crate::base::geometry::Vec3;

/// A symmetric positive definite matrix over 3-vectors with a preconditioner.
pub trait LinearSystem {
    /// Sets `image` to A x.
    fn multiply(&self, x: &[Vec3], image: &mut [Vec3]);

    /// Sets `z` to M r: M is symmetric positive definite and close to the inverse of A.
    fn precondition(&self, r: &[Vec3], z: &mut [Vec3]);
}

/// The residual r = b - A x at which a system counts as solved.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Tolerance {
    /// rᵀ M r has fallen to the square of this fraction of its first value.
    OfFirst(f64),
    /// |r|² has fallen to this value.
    SquaredLength(f64),
}

/// Improves `x`, whose residual is `residual`, until `tolerance` is met or after `limit` rounds.
/// Returns the number of rounds. `before_round` is called before each round; an error from it
/// ends the iteration.
///
/// # Errors
/// Those of `before_round`.
pub fn solve_observed<E>(
    system: &impl LinearSystem,
    x: &mut [Vec3],
    mut residual: Vec<Vec3>,
    tolerance: Tolerance,
    limit: usize,
    mut before_round: impl FnMut() -> Result<(), E>,
) -> Result<usize, E> {
    let n = x.len();
    let mut image = vec![Vec3::zeros(); n];
    let mut z = vec![Vec3::zeros(); n];
    system.precondition(&residual, &mut z);
    let mut direction = z.clone();
    let mut rho = dot(&residual, &z);
    let goal = match tolerance {
        Tolerance::OfFirst(fraction) => fraction * fraction * rho,
        Tolerance::SquaredLength(square) => square,
    };
    for round in 0..limit {
        before_round()?;
        let error = match tolerance {
            Tolerance::OfFirst(_) => rho,
            Tolerance::SquaredLength(_) => dot(&residual, &residual),
        };
        if !(error > goal) {
            return Ok(round);
        }
        system.multiply(&direction, &mut image);
        let curvature = dot(&direction, &image);
        if !(curvature > 0.0) {
            return Ok(round);
        }
        let step = rho / curvature;
        for i in 0..n {
            x[i] += direction[i] * step;
            residual[i] -= image[i] * step;
        }
        system.precondition(&residual, &mut z);
        let next = dot(&residual, &z);
        let ratio = next / rho;
        rho = next;
        for i in 0..n {
            direction[i] = z[i] + direction[i] * ratio;
        }
    }
    Ok(limit)
}

/// [`solve_observed`] without anything to call before each round.
pub fn solve(
    system: &impl LinearSystem,
    x: &mut [Vec3],
    residual: Vec<Vec3>,
    tolerance: Tolerance,
    limit: usize,
) -> usize {
    let nothing = || Ok::<(), Infallible>(());
    match solve_observed(system, x, residual, tolerance, limit, nothing) {
        Ok(rounds) => rounds,
        Err(never) => match never {},
    }
}

/// The inner product, summed in order.
pub fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}
