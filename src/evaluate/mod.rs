//! How well two segmentations agree, how well a cohort is segmented, and what a set of fits
//! has in common.
//!
//! - [`masks`]: two masks; the paper's E_J and E_CD.
//! - [`rows`]: many fits; means, and what they say about the paper's findings ([`findings`]).
//! - [`table`], [`page`]: the same as CSV and JSON, and as one page with [`plot`]s and
//!   [`slices`].
//! - [`statistics`]: mean shape and principal modes.

pub mod findings;
pub mod masks;
pub mod page;
pub mod plot;
pub mod rows;
pub mod slices;
pub mod statistics;
pub mod table;
