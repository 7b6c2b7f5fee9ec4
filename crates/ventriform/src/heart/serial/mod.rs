//! Scans of one heart over the years: what really changed.
//!
//! In: hearts fitted to scans of one patient, all at rest or all at stress, by one model. Out: where each heart lies
//! against the first one's ([`Registration`]), what all have in common ([`CommonHeart`]), from which each is fitted
//! again, and of every figure its change with an interval and a verdict ([`FigureChange`](crate::heart::comparison::FigureChange)).
//!
//! 1. Every later heart is registered to the first one as a rigid body: by the nodes of the model, and then by the
//!    images about the wall.
//! 2. The common heart is the mean of the registered walls: its shape, long axis, valve plane and muscle. Each scan is
//!    fitted again from it, with that valve plane and that muscle, so that what differs is the heart and not the fit.
//! 3. Uptake is compared place by place as that of rest and stress is ([`crate::heart::comparison`]): counts are matched
//!    by the wall that did not change, and the noise of the pair is its own.
//! 4. A figure has changed if its 95 % interval excludes that it did not, and has not if that interval excludes a change
//!    that matters ([`SERIAL_FIGURES`]). The errors are those of hearts that were scanned again and had not changed.
//!
//! Guaranteed: the same scans give the same figures, whatever the number of threads.
//!
//! Not guaranteed: the muscle is taken to weigh the same in all scans, but in `mass_g`, which is each scan's own. A valve
//! plane that moved against the apex while the wall stayed is not seen.

mod calibration;
mod common;
mod figures;
mod flags;
mod registration;

pub use common::CommonHeart;
pub use figures::{SERIAL_FIGURES, segment_error};
pub use flags::SerialFlag;
pub use registration::{PlacedHeart, Registration, RigidMotion, registered};
