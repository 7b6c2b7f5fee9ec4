//! The wall's uptake at stress beside that at rest: what is lost only under stress.
//!
//! In: the polar maps of two scans of one heart, of one model ([`Sides`]). Out: their [`Change`].
//!
//! 1. The stress map is turned about the long axis if the maps then agree significantly better ([`Turn`]).
//! 2. Stress is scaled to rest by the places that did not change ([`matched`](crate::heart::normals::matched) with the rest
//!    map in place of the normal mean), never by each map's maximum.
//! 3. The difference, rest less stress, is smoothed over the wall. Wall that loses more at stress than
//!    [`REVERSIBLE_POINTS`] is reversible; wall below the threshold of the rest map in both is fixed.
//!
//! [`ComparisonFlag`] names what makes a comparison doubtful.
//!
//! Guaranteed: a scan multiplied by a factor gives the same figures.
//!
//! Not guaranteed: without normal limits it is not known what is normal: a defect at rest that fills under stress
//! shows as a negative difference and counts as nothing. No category is derived.

mod calibration;
mod difference;
mod flags;
mod scale;
mod turn;

pub use calibration::{DIFFERENCE_SD_POINTS, MOST_MUSCLE_QUOTIENT};
pub use difference::{Change, ComparedSegment, ComparedTerritory, PartFigures, REVERSIBLE_POINTS};
pub use flags::{ComparisonFlag, Reason, WhichScan};
pub use scale::Sides;
pub use turn::Turn;
