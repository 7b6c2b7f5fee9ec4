//! How well two segmentations agree, and how well a cohort is segmented.

pub mod masks;
