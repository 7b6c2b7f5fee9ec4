//! The input of a segmentation.

use crate::heart::normals::NormalLimits;
use crate::heart::reader::ReaderProfile;
use crate::image::volume::VolumeFile;
use crate::mesh::TriMesh;
use crate::parameters::FitParameters;

/// The files, models and parameters of a segmentation.
#[derive(Debug, Clone)]
pub struct SegmentationOrder<'a> {
    /// The volume's files.
    pub volume: &'a [VolumeFile],
    /// The files of an expert's mask to compare with.
    pub expert: Option<&'a [VolumeFile]>,
    /// Whether the built-in hearts are fitted, if the organ is the left ventricle.
    pub auto: bool,
    /// Further models to fit.
    pub models: Vec<NamedMesh>,
    /// The reader as whom to draw the wall.
    pub reader: Option<NamedReader>,
    /// The normal limits to compare the wall's uptake with.
    pub normals: Option<&'a NormalLimits>,
    /// The parameters.
    pub parameters: &'a FitParameters,
}

impl<'a> SegmentationOrder<'a> {
    /// The built-in hearts alone are fitted to the volume in these files: no mask, no reader, no normal limits.
    pub fn of_built_in_hearts(volume: &'a [VolumeFile], parameters: &'a FitParameters) -> Self {
        Self {
            volume,
            expert: None,
            auto: true,
            models: Vec::new(),
            reader: None,
            normals: None,
            parameters,
        }
    }
}

/// A reader's profile with its name in the report.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedReader {
    /// The name.
    pub name: String,
    /// The profile.
    pub profile: ReaderProfile,
}

/// A model with its name in the report.
#[derive(Debug, Clone)]
pub struct NamedMesh {
    /// The name.
    pub name: String,
    /// The model, LPS mm.
    pub mesh: TriMesh,
    /// Whether it must be usable, as one that the caller named. Otherwise it is left out if it cannot
    /// be used, and the report says why.
    pub required: bool,
}
