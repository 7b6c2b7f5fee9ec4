//! A patient's segmentation from files to files.
//!
//! [`from_files`] reads the volume, the expert's mask where there is one, and the models; settles
//! hints and margin on the volume ([`FitParameters::on`]); fits every model and keeps the
//! best fit ([`crate::segmentation`]). [`Segmented::files`] is what comes of it, the same
//! files on the command line and over HTTP.
//!
//! Models that were named must be usable, every one of them. Of models that are merely at hand
//! (`auto`) those that cannot be used are left out, and the report says why.

use crate::deform::DeformError;
use crate::export::read_json::ReadMeshError;
use crate::locate::localisation::LocaliseError;
use crate::mesh::TriMesh;
use crate::model::{Organ, Template, TemplateError};
use crate::parameters::{FitParameters, ParameterError};
use crate::progress::{Cancelled, Monitor};
use crate::segmentation::built_in;
use crate::segmentation::{
    self, NamedTemplate, Refused, Segmentation, SegmentationError, SegmentationParameters,
};
use crate::volume::{self, ReadLimits, ReadOptions, Reading, VolumeError, VolumeFile};

/// What is to be segmented, and by what.
#[derive(Debug, Clone)]
pub struct Order<'a> {
    /// The volume's files.
    pub volume: &'a [VolumeFile],
    /// The files of an expert's mask to measure against.
    pub expert: Option<&'a [VolumeFile]>,
    /// The models to fit. None is the built-in one, where the organ is the left ventricle.
    pub models: Vec<NamedMesh>,
    /// Whether the models were named, or merely are at hand.
    pub named: bool,
    /// The parameters.
    pub parameters: &'a FitParameters,
}

/// A model with the name under which the report speaks of it.
#[derive(Debug, Clone)]
pub struct NamedMesh {
    /// The name.
    pub name: String,
    /// The model, LPS mm.
    pub mesh: TriMesh,
}

/// A segmented patient.
#[derive(Debug, Clone)]
pub struct Segmented {
    /// The volume and what its header says.
    pub reading: Reading,
    /// What came out.
    pub segmentation: Segmentation,
    /// The parameters used, margin settled.
    pub parameters: FitParameters,
}

/// Why there is no segmentation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SegmentError {
    /// The files hold no usable volume.
    #[error(transparent)]
    Volume(VolumeError),
    /// The expert's files hold no usable volume.
    #[error("the expert's mask: {0}")]
    ExpertVolume(VolumeError),
    /// A parameter does not suit the volume.
    #[error("`{}`: {}", .0.field, .0.message)]
    Parameter(#[from] ParameterError),
    /// A model's file cannot be read.
    #[error("model {name}: {error}")]
    Unreadable {
        /// The model.
        name: String,
        /// Why.
        error: ReadMeshError,
    },
    /// A model cannot be fitted.
    #[error("model {name}: {error}")]
    Model {
        /// The model.
        name: String,
        /// Why.
        error: TemplateError,
    },
    /// The model was made for another organ.
    #[error("model {name} shows a {shows}, and a {wanted} was asked for")]
    OtherOrgan {
        /// The model.
        name: String,
        /// Its organ.
        shows: String,
        /// The organ asked for.
        wanted: &'static str,
    },
    /// There is no model of the organ at hand, and none is built in.
    #[error("there is no model of a {organ} at hand")]
    NoModel {
        /// The organ.
        organ: &'static str,
    },
    /// The fit or the comparison failed.
    #[error(transparent)]
    Segmentation(SegmentationError),
    /// The caller asked for an end.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl SegmentError {
    /// Whether the work ended because it was asked to, in whichever stage.
    pub fn is_cancelled(&self) -> bool {
        use SegmentationError::Deform;
        matches!(
            self,
            SegmentError::Cancelled(_)
                | SegmentError::Volume(VolumeError::Cancelled(_))
                | SegmentError::ExpertVolume(VolumeError::Cancelled(_))
                | SegmentError::Segmentation(
                    SegmentationError::Cancelled(_)
                        | Deform(
                            DeformError::Cancelled(_)
                                | DeformError::Localise(LocaliseError::Cancelled(_))
                        )
                )
        )
    }

    /// The parameter, or the field of the file, that the error is about.
    pub fn field(&self) -> Option<&str> {
        match self {
            SegmentError::Volume(error) => error.field(),
            SegmentError::Parameter(error) => Some(&error.field),
            SegmentError::ExpertVolume(_)
            | SegmentError::Segmentation(SegmentationError::Expert(_)) => Some("expert"),
            SegmentError::Segmentation(SegmentationError::Deform(error)) => match error {
                DeformError::Parameter { field, .. } => Some(field),
                DeformError::TooManyNodes { .. } => Some("model"),
                DeformError::Localise(LocaliseError::NoHeart { .. }) => Some("center"),
                _ => None,
            },
            SegmentError::Unreadable { .. }
            | SegmentError::Model { .. }
            | SegmentError::OtherOrgan { .. }
            | SegmentError::NoModel { .. }
            | SegmentError::Segmentation(SegmentationError::NoTemplate) => Some("model"),
            SegmentError::Segmentation(SegmentationError::Cancelled(_))
            | SegmentError::Cancelled(_) => None,
        }
    }
}

/// Segments the volume of `order`.
///
/// # Errors
/// See [`SegmentError`].
pub fn from_files(
    order: &Order<'_>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Segmented, SegmentError> {
    let frame = order.parameters.frame;
    let parts = 1 + usize::from(order.expert.is_some());
    let reading = read(order.volume, frame, limits, &monitor.piece(0, parts))
        .map_err(SegmentError::Volume)?;
    let expert = order
        .expert
        .map(|files| read(files, None, limits, &monitor.piece(1, parts)))
        .transpose()
        .map_err(SegmentError::ExpertVolume)?;
    let parameters = FitParameters {
        margin: Some((order.parameters.margin).unwrap_or(usual_margin(reading.facts.format))),
        ..order.parameters.clone()
    };
    let fit = SegmentationParameters {
        deform: parameters.on(&reading.volume, 0.0)?,
        polar: parameters.polar,
    };
    let (templates, refused) = templates(order, monitor)?;
    let expert = expert.as_ref().map(|expert| &expert.volume);
    let mut segmentation =
        segmentation::segment(&reading.volume, &templates, &fit, expert, monitor)
            .map_err(SegmentError::Segmentation)?;
    segmentation.refused.splice(0..0, refused);
    Ok(Segmented {
        reading,
        segmentation,
        parameters,
    })
}

fn read(
    files: &[VolumeFile],
    frame: Option<usize>,
    limits: &ReadLimits,
    monitor: &Monitor<'_>,
) -> Result<Reading, VolumeError> {
    volume::read(files, &ReadOptions { frame }, limits, monitor)
}

/// Margin of readers of clinical DICOM scans, mm: one expert's mask lies 3 mm outside the
/// steepest slope; 2.5 mm gave the best agreement there.
const DICOM_MARGIN: f64 = 2.5;

/// How far outside the steepest slope the readers of such files draw, mm.
fn usual_margin(format: volume::Format) -> f64 {
    match format {
        volume::Format::DicomNm => DICOM_MARGIN,
        _ => 0.0,
    }
}

/// The models made ready, and those that could not be.
fn templates(
    order: &Order<'_>,
    monitor: &Monitor<'_>,
) -> Result<(Vec<NamedTemplate>, Vec<Refused>), SegmentError> {
    let organ = order.parameters.organ;
    if order.models.is_empty() {
        return Ok((vec![built_in(organ, monitor)?], Vec::new()));
    }
    let (mut templates, mut refused) = (Vec::new(), Vec::new());
    let mut first = None;
    for NamedMesh { name, mesh } in &order.models {
        match Template::new(mesh.clone(), organ, monitor) {
            Ok(template) => templates.push(NamedTemplate {
                name: name.clone(),
                template,
            }),
            Err(TemplateError::Cancelled(cancelled)) => return Err(cancelled.into()),
            Err(error) => {
                refused.push(Refused {
                    name: name.clone(),
                    reason: error.to_string(),
                });
                let name = name.clone();
                first.get_or_insert(SegmentError::Model { name, error });
            }
        }
    }
    match first {
        Some(error) if order.named || templates.is_empty() => Err(error),
        _ => Ok((templates, refused)),
    }
}

fn built_in(organ: Organ, monitor: &Monitor<'_>) -> Result<NamedTemplate, SegmentError> {
    if organ != Organ::LeftVentricle {
        return Err(SegmentError::NoModel {
            organ: organ.as_str(),
        });
    }
    Ok(NamedTemplate {
        name: built_in::NAME.into(),
        template: built_in::template(monitor)?,
    })
}
