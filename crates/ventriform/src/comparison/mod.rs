//! Rest and stress of one patient: where the wall lacks blood only under stress.
//!
//! In: a [`ComparedHeart`] at stress and one at rest, each a segmentation or a beat. Out: a [`Comparison`], written by
//! [`ComparedHearts::files`].
//!
//! 1. Both hearts are fitted by the same model ([`from_files`](mod@from_files)): that of the built-in hearts in which both together have the
//!    greatest confidence. So both polar maps have the same places.
//! 2. The scans are checked ([`checks`]): one patient, one at stress and one at rest, made alike. One scan given twice and scans of
//!    different patients are refused; what makes figures doubtful is a [`ComparisonFlag`] with its numbers.
//! 3. The stress map is turned about the long axis if the maps then agree significantly better ([`turn`]).
//! 4. Stress is scaled to rest by the places that did not change ([`matched`](crate::normals::matched) with the rest map in place of the normal mean),
//!    never by each map's maximum.
//! 5. The difference, rest less stress, is smoothed over the wall ([`difference`]). Wall that loses more at stress than
//!    [`REVERSIBLE_POINTS`] is reversible; wall below the threshold of both maps is fixed.
//! 6. With normal limits, each scan is scored by the group of its own protocol; the summed difference score adds up what segments score more at stress.
//! 7. The ratio of the cavities (transient ischaemic dilation, TID) is that of the anatomical walls, in the images of all gates.
//!
//! Guaranteed: a scan multiplied by a factor gives the same figures.
//!
//! Not guaranteed: without normal limits it is not known what is normal: a defect at rest that fills under stress shows as a negative
//! difference and counts as nothing. No category is derived.

mod calibration;
mod checks;
mod difference;
mod error;
mod files;
mod flags;
mod from_files;
mod hearts;
mod order;
mod turn;

pub use calibration::DIFFERENCE_SD_POINTS;
pub use difference::{
    Change, ComparedSegment, ComparedTerritory, PartFigures, REVERSIBLE_POINTS, Sides,
};
pub use error::ComparisonError;
pub use flags::{ComparisonFlag, Reason, WhichScan};
pub use from_files::from_files;
pub use hearts::{ComparedHeart, ComparedHearts};
pub use order::{ComparisonNormals, ComparisonOrder, ScanOrder};
pub use turn::Turn;
