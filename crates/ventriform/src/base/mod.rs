//! What every stage shares: characters of names, points and frames, linear solvers, progress and cancelling.

pub mod text;

pub mod geometry;

pub mod progress;

pub mod numeric;
