//! The input of a comparison.

use crate::parameters::ComparisonParameters;
use crate::segmentation::NamedMesh;
use crate::volume::VolumeFile;

/// The files, models and parameters of a comparison.
#[derive(Debug, Clone)]
pub struct ComparisonOrder<'a> {
    /// The scan at stress.
    pub stress: ScanOrder<'a>,
    /// The scan at rest.
    pub rest: ScanOrder<'a>,
    /// Whether the built-in hearts are fitted.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// The parameters.
    pub parameters: &'a ComparisonParameters,
}

/// The files of one scan: a volume, or gates.
pub type ScanOrder<'a> = &'a [VolumeFile];
