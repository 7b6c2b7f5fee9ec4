//! What a segmentation starts from.

use crate::mesh::TriMesh;
use crate::parameters::FitParameters;
use crate::reader::ReaderProfile;
use crate::volume::VolumeFile;

/// The files, models and parameters of a segmentation.
#[derive(Debug, Clone)]
pub struct SegmentationOrder<'a> {
    /// The volume's files.
    pub volume: &'a [VolumeFile],
    /// The files of an expert's mask to compare with.
    pub expert: Option<&'a [VolumeFile]>,
    /// The models to fit. Empty: the built-in one, if the organ is the left ventricle.
    pub models: Vec<NamedMesh>,
    /// Whether every model must be usable. Otherwise models that cannot be used are left out,
    /// and the report says why.
    pub named: bool,
    /// The reader as whom to draw the wall.
    pub reader: Option<NamedReader>,
    /// The parameters.
    pub parameters: &'a FitParameters,
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
}
