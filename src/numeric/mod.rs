//! Numerical methods that several stages share.
//!
//! - [`round_step`]: round numbers for scales.
//! - [`conjugate_gradient`]: sparse symmetric positive definite systems.

pub mod conjugate_gradient;
pub mod round_step;
