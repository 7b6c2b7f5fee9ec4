//! A gated study as one model in motion: how much the ventricle ejects, and which wall does not move.
//!
//! In: the gates of a study, and the anatomical wall that was fitted to their sum. Out: a [`Beat`]: the wall at every
//! moment, volumes, ejection fraction, and each segment's motion, thickening and phase. The steps:
//!
//! 1. [`study`] checks the gates and scales each to equal counts.
//! 2. [`mod@fit`] fits one wall to all gates at once: the muscle of every column is kept, uptake is shared, motion is
//!    periodic, and the wall's image is blurred by the resolution before it is compared ([`objective`]). Gates that are
//!    fitted one by one let the muscle swing by a fifth.
//! 3. [`figures`] takes end diastole and end systole from the curve, after the gates' width was taken off.
//! 4. [`counts`] gives a second opinion on thickening, from the gates' brightness.
//! 5. [`intervals`] says how far the figures may be off, and [`flags`] where they mean little.
//!
//! Guaranteed: the volume of the muscle changes by less than 3 per cent over the beat; gates that begin elsewhere in
//! the cycle give the same figures, moved; without a beat there is no ejection fraction.
//!
//! Not guaranteed: the thickness of the wall, which the image does not tell. Its mean is assumed, or comes from a known
//! volume of muscle; a millimetre moves the ejection fraction by about 1.5 points. Where the wall is dark, its motion
//! is assumed to be small.

mod beside;
mod calibration;
mod carried;
pub mod counts;
mod curvature;
mod error;
mod fields;
pub mod figures;
pub mod fit;
pub mod flags;
mod image;
pub mod intervals;
pub mod moment;
mod noise;
mod objective;
mod order;
pub mod phase;
mod spectrum;
mod start;
pub mod study;

pub use beside::ActivityBeside;
pub use counts::WallCounts;
pub use error::BeatError;
pub use figures::{Beat, Extreme, Rates, SegmentMotion};
pub use fit::{BeatFit, BeatParameters, Volumes, fit};
pub use flags::BeatFlag;
pub use intervals::{Intervals, WallCauses};
pub use moment::{Contraction, WallMoment};
pub use objective::Priors;
pub use phase::Phases;
pub use study::GatedStudy;
