//! Words that every stage shares: points, frames, closest points, exact predicates, seeds.
//!
//! Lengths are millimetres and angles radians wherever a name does not say otherwise.

pub mod bvh;
pub mod frame;
pub mod random;
pub mod rotation;
pub mod triangle;

/// A position or a direction in patient space: LPS, millimetres.
pub type Vec3 = nalgebra::Vector3<f64>;

/// A direction or a position in a plane.
pub type Vec2 = nalgebra::Vector2<f64>;
