//! Numerical methods that several stages share.
//!
//! - [`conjugate_gradient`]: the solver of sparse symmetric positive definite systems;
//! - [`block_matrix`]: such systems of 3×3 blocks;
//! - [`decimals`]: rounding of figures that are written;
//! - [`disjoint_sets`]: union-find on a list of parents;
//! - [`error_terms`]: the error of a volume, and the interval that holds the true one;
//! - [`lbfgs`]: the minimum of a smooth function within bounds;
//! - [`normal`]: the normal distribution;
//! - [`order`]: order statistics;
//! - [`round_step`]: round numbers for scales.

pub mod block_matrix;
pub mod conjugate_gradient;
pub mod decimals;
pub mod disjoint_sets;
pub mod error_terms;
pub mod lbfgs;
pub mod normal;
pub mod order;
pub mod round_step;
