//! Why there is no fit.

use crate::base::geometry::Vec3;
use crate::base::progress::Cancelled;
use crate::image::locate::LocateError;

/// Why there is no fit.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum DeformError {
    /// A parameter is out of range or not a number.
    #[error("{field} is {value}; it must lie within {least}..={most}")]
    Parameter {
        /// The parameter's name.
        field: &'static str,
        /// The value given.
        value: f64,
        /// Least value allowed.
        least: f64,
        /// Greatest value allowed.
        most: f64,
    },
    /// Support springs were asked for, and the model has too many nodes for them.
    #[error("support springs are for models of at most {limit} nodes; this one has {nodes}")]
    TooManyNodes {
        /// Nodes of the model.
        nodes: usize,
        /// Most nodes that a model with support springs may have.
        limit: usize,
    },
    /// A point that the wall should pass through lies far from every place where the wall may be.
    #[error(
        "the point ({:.1}, {:.1}, {:.1}) lies {distance_mm:.0} mm from the wall; the wall is pulled by at most {most_mm:.0} mm",
        place.x, place.y, place.z
    )]
    PointTooFar {
        /// Whether the outer surface should pass through it, or the inner one.
        outer: bool,
        /// The point, LPS mm.
        place: Vec3,
        /// Its distance from the wall.
        distance_mm: f64,
        /// The greatest one.
        most_mm: f64,
    },
    /// A ventricle was searched for a template of another organ, or the other way round.
    #[error("the template shows another organ than the one that was searched")]
    OtherOrgan,
    /// A hinted centre, axis or region is not finite, or the axis has no length.
    #[error("the hinted centre, axis or region must be finite, and the axis not zero")]
    HintNotFinite,
    /// The organ was not found.
    #[error(transparent)]
    Localise(#[from] LocateError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}
