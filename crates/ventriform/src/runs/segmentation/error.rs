//! Why there is no segmentation.

use crate::base::progress::Cancelled;
use crate::heart::deform::DeformError;
use crate::heart::model::TemplateError;
use crate::heart::normals::NormalsError;
use crate::image::locate::LocateError;
use crate::image::volume::VolumeError;
use crate::image::volume::given_mask::GivenMaskError;
use crate::parameters::ParameterError;
use crate::results::export::read_json::ReadMeshError;

/// Why there is no segmentation: one variant for each step that can fail, with that step's error.
/// Cancellation is [`SegmentationError::Cancelled`], whichever step met it.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentationError {
    /// The files hold no usable volume.
    #[error(transparent)]
    Volume(VolumeError),
    /// A parameter does not suit the volume.
    #[error("`{}`: {}", .0.field, .0.message)]
    Parameter(#[from] ParameterError),
    /// There is no model of the organ, and none is built in.
    #[error("there is no model of a {organ}")]
    NoModel {
        /// The organ.
        organ: &'static str,
    },
    /// No template was given to fit.
    #[error("no model was given to fit")]
    NoTemplate,
    /// A model's file cannot be parsed.
    #[error("model {name}: {error}")]
    UnreadableModel {
        /// The model.
        name: String,
        /// Why.
        error: ReadMeshError,
    },
    /// The model shows another organ.
    #[error("model {name} shows a {shows}; a model of a {wanted} is needed")]
    OtherOrgan {
        /// The model.
        name: String,
        /// Its organ.
        shows: String,
        /// The organ to segment.
        wanted: &'static str,
    },
    /// A model's mesh cannot be fitted.
    #[error("model {name}: {error}")]
    UnsuitableModel {
        /// The model.
        name: String,
        /// Why.
        error: TemplateError,
    },
    /// A reader's profile says nothing of this organ.
    #[error("reader {name}: the profile is of left ventricles, not of a {organ}")]
    ReaderOfVentricles {
        /// The profile.
        name: String,
        /// The organ to segment.
        organ: &'static str,
    },
    /// A reader's profile starts from the other wall.
    #[error("reader {name}: the profile starts from the {learnt} wall, and `edge` is {asked}")]
    ReaderOfOtherWall {
        /// The profile.
        name: String,
        /// The wall that it starts from.
        learnt: &'static str,
        /// The wall that was asked for.
        asked: &'static str,
    },
    /// The expert's mask cannot be used.
    #[error("the expert's mask: {0}")]
    ExpertMask(GivenMaskError),
    /// The organ is not found in the volume.
    #[error(transparent)]
    NotFound(LocateError),
    /// No model could be fitted: the first one's error, if it is not that the organ is not found.
    #[error(transparent)]
    Fit(DeformError),
    /// The wall's uptake cannot be compared with the normal limits.
    #[error(transparent)]
    Normals(#[from] NormalsError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SegmentationError {
    /// Whether the work ended because the caller asked for it.
    pub fn is_cancelled(&self) -> bool {
        matches!(self, SegmentationError::Cancelled(_))
    }
}

impl From<VolumeError> for SegmentationError {
    fn from(error: VolumeError) -> Self {
        match error {
            VolumeError::Cancelled(cancelled) => cancelled.into(),
            error => SegmentationError::Volume(error),
        }
    }
}

impl From<GivenMaskError> for SegmentationError {
    fn from(error: GivenMaskError) -> Self {
        match error {
            GivenMaskError::Cancelled(cancelled) => cancelled.into(),
            error => SegmentationError::ExpertMask(error),
        }
    }
}

impl From<DeformError> for SegmentationError {
    fn from(error: DeformError) -> Self {
        match error {
            DeformError::Cancelled(cancelled)
            | DeformError::Localise(LocateError::Cancelled(cancelled)) => cancelled.into(),
            DeformError::Localise(error) => SegmentationError::NotFound(error),
            error => SegmentationError::Fit(error),
        }
    }
}
