//! How well two segmentations agree, how well a cohort is segmented, and what a set of fits
//! has in common.

pub mod masks;
pub mod statistics;
pub mod table;
