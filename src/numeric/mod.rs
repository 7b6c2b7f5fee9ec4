//! Numerical methods that several stages share.
//!
//! - [`conjugate_gradient`]: sparse symmetric positive definite systems.

pub mod conjugate_gradient;
