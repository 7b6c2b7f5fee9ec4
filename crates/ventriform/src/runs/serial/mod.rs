//! Scans of one patient over the years, from files to what changed.
//!
//! 1. [`SerialOrder`]: the files of 2 to 20 scans, the models, normal limits, and the parameters.
//! 2. One scan given twice is refused, and so are scans of two patients, of rest beside stress, with other tracers, and
//!    with attenuation corrected in some.
//! 3. The scans are ordered by the dates of their headers. Each is fitted by itself, all by one model: that of the built-in
//!    hearts in which all together have the greatest confidence.
//! 4. The walls are registered to that of the first scan, and each scan is fitted again from their common heart
//!    ([`crate::heart::serial`]). If all scans are gated, a beat is fitted to each.
//! 5. Every scan is compared with the first one and with the one before it ([`SerialPair`]).
//! 6. [`SerialHearts::report`] is the report; [`SerialHearts::files`] are the files written.

mod checks;
mod error;
mod files;
mod fits;
mod from_files;
mod hearts;
mod names;
mod order;
mod report;
mod trend;

pub use error::SerialError;
pub use files::{maps_of, page_files};
pub use from_files::from_files;
pub use hearts::{SerialHearts, SerialPair, SerialScan};
pub use names::{FILE_NAMES, NUMBERED_FILE_PATTERN, is_scan_mesh};
pub use order::{SCAN_COUNTS, SerialOrder};
