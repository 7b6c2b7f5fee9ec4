//! The input of a beat.

use crate::heart::normals::NormalLimits;
use crate::image::volume::VolumeFile;
use crate::parameters::{BeatChoice, FitParameters};
use crate::runs::segmentation::NamedMesh;

/// The files, models and parameters of a beat.
#[derive(Debug, Clone)]
pub struct GatedOrder<'a> {
    /// The files of the gates: one file with all, or one for each in their order.
    pub gates: &'a [VolumeFile],
    /// Whether the built-in hearts are fitted to the gates' sum.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// The normal limits to compare the beat with.
    pub normals: Option<&'a NormalLimits>,
    /// The parameters of the fit to the gates' sum.
    pub parameters: &'a FitParameters,
    /// The parameters of the beat.
    pub choice: BeatChoice,
}
