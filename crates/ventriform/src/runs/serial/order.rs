//! The input of a serial comparison.

use crate::heart::normals::NormalLimits;
use crate::image::volume::VolumeFile;
use crate::parameters::SerialParameters;
use crate::runs::segmentation::NamedMesh;
use std::ops::RangeInclusive;

/// How many scans are compared.
pub const SCAN_COUNTS: RangeInclusive<usize> = 2..=20;

/// The files, models and parameters of a serial comparison.
#[derive(Debug, Clone)]
pub struct SerialOrder<'a> {
    /// The files of every scan: a volume, or gates. Dates decide on their order, where all headers state one.
    pub scans: &'a [Vec<VolumeFile>],
    /// Whether the built-in hearts are fitted.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// Normal limits to score all scans by.
    pub normals: Option<&'a NormalLimits>,
    /// The parameters.
    pub parameters: &'a SerialParameters,
}
