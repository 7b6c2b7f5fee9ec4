//! Rest and stress of one patient from beginning to end: two scans in, the comparison's report and files out.
//!
//! 1. [`ComparisonOrder`]: the files of both scans, the models, normal limits, and the parameters.
//! 2. One scan given twice, by its instance or its voxels, and scans of two patients are refused.
//! 3. [`from_files`](mod@from_files) fits both hearts by one model: that of the built-in hearts in which both
//!    together have the greatest confidence, so both polar maps have the same places. Both are beats if both scans
//!    are gated.
//! 4. What makes figures doubtful is a [`ComparisonFlag`](crate::heart::comparison::ComparisonFlag) with its numbers.
//! 5. The maps are compared ([`crate::heart::comparison`]). With normal limits, each scan is scored by the group of its own
//!    protocol, and the summed difference score adds up what segments score more at stress. The ratio of the cavities
//!    (transient ischaemic dilation, TID) is that of the anatomical walls in the images of all gates.
//! 6. [`ComparedHearts::report`] is the report; [`ComparedHearts::files`] are the files written.

mod checks;
mod error;
mod files;
mod from_files;
mod hearts;
mod names;
mod order;
mod report;
mod slices;

pub(crate) use checks::{FEW_MATCHED_PERCENT, RESOLUTION_MM};
pub use error::ComparisonError;
pub use from_files::from_files;
pub use hearts::{ComparedHeart, ComparedHearts};
pub use names::{FILE_NAMES, mesh as mesh_of};
pub use order::{ComparisonOrder, ScanOrder};
