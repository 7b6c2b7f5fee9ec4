//! Volumes, jobs and results: a file for each resource.

pub(crate) mod beats;
pub(crate) mod collection;
pub(crate) mod comparisons;
pub(crate) mod erasures;
pub(crate) mod files;
pub(crate) mod identities;
pub(crate) mod jobs;
pub(crate) mod legal_hold;
pub(crate) mod models;
mod named_scan;
pub(crate) mod normals;
pub(crate) mod products;
pub(crate) mod readers;
pub(crate) mod readings;
pub(crate) mod scan_erasures;
pub(crate) mod scan_search;
pub(crate) mod scans;
pub(crate) mod segmentations;
pub(crate) mod serials;
pub(crate) mod tags;
pub(crate) mod templates;
pub(crate) mod volume_download;
pub(crate) mod volumes;
pub(crate) mod voxels;
