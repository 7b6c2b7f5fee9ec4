//! How well a cohort is segmented, and what a set of fits has in common.
//!
//! - [`cohort`], [`models`], [`fits`], [`record`]: who is in the folder, the models of the
//!   templates, their fits to the patients, and how these are kept.
//!
//! - [`rows`]: many fits; means, and what they say about the paper's findings ([`findings`]).
//! - [`table`], [`page`]: the same as CSV and JSON, and as one page with [`plot`]s and
//!   [`slices`](crate::segmentation::slices).
//! - [`statistics`]: mean shape and principal modes.

pub mod cohort;
pub mod findings;
pub mod fits;
pub mod models;
pub mod page;
pub mod plot;
pub mod record;
pub mod rows;
pub mod statistics;
pub mod table;
