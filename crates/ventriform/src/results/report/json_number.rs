//! Numbers of reports: how they are rounded, and those that JSON cannot express.

use crate::base::geometry::Vec3;
pub(super) use crate::base::numeric::decimals::round;
use serde::{Deserialize, Deserializer};

/// A point or a direction, rounded to 4 decimals.
pub(super) fn point(p: &Vec3) -> [f64; 3] {
    [p.x, p.y, p.z].map(round)
}

/// Reads `null`, as which JSON has a number that is not finite, as NaN.
pub(super) fn or_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
}
