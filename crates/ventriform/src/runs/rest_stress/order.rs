//! The input of a comparison.

use crate::heart::comparison::WhichScan;
use crate::heart::normals::NormalLimits;
use crate::image::volume::VolumeFile;
use crate::parameters::ComparisonParameters;
use crate::runs::segmentation::NamedMesh;

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
    /// Normal limits to score both scans by.
    pub normals: Option<&'a NormalLimits>,
    /// The parameters.
    pub parameters: &'a ComparisonParameters,
}

/// The files of one scan: a volume, or gates.
pub type ScanOrder<'a> = &'a [VolumeFile];

impl ComparisonOrder<'_> {
    /// The protocol of a scan: as the parameters state it, or else that of the limits which is for such scans
    /// ([`NormalLimits::protocol_of`]).
    pub(super) fn protocol(&self, scan: WhichScan) -> Option<String> {
        let choice = &self.parameters.choice;
        let stated = match scan {
            WhichScan::Stress => &choice.stress_protocol,
            WhichScan::Rest => &choice.rest_protocol,
        };
        stated
            .clone()
            .or_else(|| self.normals?.protocol_of(scan.as_str()))
    }
}
