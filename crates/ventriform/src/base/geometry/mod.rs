//! Geometry that all stages share: vectors, coordinate frames, closest points, random numbers.
//!
//! Lengths are in millimetres and angles in radians unless a name says otherwise.

pub mod bvh;
pub mod frame;
pub mod random;
pub mod rotation;
pub mod triangle;

/// A position or a direction in patient space: LPS, millimetres.
pub type Vec3 = nalgebra::Vector3<f64>;

/// A position or a direction in a plane.
pub type Vec2 = nalgebra::Vector2<f64>;
