//! Errors of the domain as failures for callers.
//!
//! Errors of the domain state facts. This is the one place that decides, for each of them, where the fault lies, the
//! stable code, the parameter or file field concerned, and the advice. The command line, the service and the Python
//! package use it; the advice names parameters by their common names and fits all of them.
//!
//! 1. An error [`Explain`]s itself as a [`Failure`].
//! 2. [`advice`] is what the caller can do; [`Explain::with_advice`] is both as one line.

mod failure;

pub use failure::{Failure, Fault};

use crate::heart::beat::BeatError;
use crate::heart::comparison::WhichScan;
use crate::heart::deform::DeformError;
use crate::heart::model::TemplateError;
use crate::heart::normals::NormalsError;
use crate::heart::reader::ProfileError;
use crate::image::locate::LocateError;
use crate::image::volume::VolumeError;
use crate::image::volume::gates::GATE_COUNTS;
use crate::image::volume::given_mask::GivenMaskError;
use crate::mesh::files::MeshFileError;
use crate::parameters::ParameterError;
use crate::results::export::dicom::{DicomError, StatedIdentity};
use crate::results::export::read_json::ReadMeshError;
use crate::runs::evaluate::normals::BuildError;
use crate::runs::gated::GatedError;
use crate::runs::objects::ObjectError;
use crate::runs::pipeline::PipelineError;
use crate::runs::reading::ReadingError;
use crate::runs::rest_stress::ComparisonError;
use crate::runs::segmentation::SegmentationError;
use crate::runs::serial::SerialError;
use crate::surface::SurfaceError;
use crate::surface::retile::RetileError;
use std::error::Error;

/// Advice for work that was cancelled.
const START_AGAIN: &str = "Start again if the result is still needed.";

/// Code of a cancelled operation.
const CANCELLED_FAILURE: (Fault, &str) = (Fault::Request, "cancelled");

/// An error that can be explained to a client.
pub trait Explain: Error {
    /// The error with status class, code, field and advice.
    fn explain(&self) -> Failure;

    /// Whether this is no failure: the operation was cancelled.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// The error and the advice as one line, for the command line.
    fn with_advice(&self) -> String {
        match self.explain().fix {
            Some(fix) => format!("{self}. {fix}"),
            None => self.to_string(),
        }
    }
}

/// The advice of [`Explain::explain`]; empty if there is none.
pub fn advice(error: &impl Explain) -> String {
    error.explain().fix.unwrap_or_default()
}

impl Explain for ParameterError {
    fn explain(&self) -> Failure {
        Failure::new(
            Fault::Request,
            "invalid-parameter",
            format!("`{}`: {}.", self.field, self.message),
        )
        .at(&self.field)
        .fix(&self.fix)
    }
}

impl Explain for VolumeError {
    fn explain(&self) -> Failure {
        let kind = match self {
            VolumeError::TooLarge { .. } => (Fault::TooLarge, "volume-too-large"),
            VolumeError::Mesh { error, .. } => {
                let mut told = error.explain();
                told.detail = sentence(&self.without_header_text());
                return told.or_to_sender(sentence(self));
            }
            VolumeError::SingleSlice { .. } => (Fault::Content, "single-slice"),
            VolumeError::FrameNeeded { .. } => (Fault::Request, "frame-needed"),
            VolumeError::NotGated { .. } => (Fault::Content, "not-gated"),
            VolumeError::OtherGate { .. } => (Fault::Content, "gates-differ"),
            VolumeError::FrameOutOfRange { .. } => (Fault::Request, "frame-out-of-range"),
            VolumeError::Unsupported { .. } | VolumeError::NotVolume { .. } => {
                (Fault::Content, "unsupported-format")
            }
            VolumeError::Unrecognised { .. } => (Fault::Content, "unrecognised-format"),
            VolumeError::Truncated { .. } => (Fault::Content, "truncated-volume"),
            VolumeError::Corrupt { .. } => (Fault::Content, "corrupt-volume"),
            VolumeError::Field { .. } => (Fault::Content, "invalid-header"),
            VolumeError::Io { .. } | VolumeError::Memory { .. } => (Fault::Service, "unreadable"),
            VolumeError::Cancelled(_) => CANCELLED_FAILURE,
            _ => (Fault::Content, "unusable-volume"),
        };
        let told = self.without_header_text();
        failure(kind, &told, self.field(), volume_advice(self)).or_to_sender(sentence(self))
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, VolumeError::Cancelled(_))
    }
}

impl Explain for SurfaceError {
    fn explain(&self) -> Failure {
        let kind = match self {
            SurfaceError::NoSurface { .. } => (Fault::Content, "no-surface"),
            SurfaceError::Cancelled(_) => CANCELLED_FAILURE,
            _ => (Fault::Content, "unusable-surface"),
        };
        failure(kind, self, self.field(), surface_advice(self))
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, SurfaceError::Cancelled(_))
    }
}

impl Explain for RetileError {
    fn explain(&self) -> Failure {
        match self {
            RetileError::Cancelled(_) => failure(CANCELLED_FAILURE, self, None, START_AGAIN.into()),
            _ => failure(
                (Fault::Request, "unsuitable-points"),
                self,
                Some("points"),
                retile_advice(self),
            ),
        }
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, RetileError::Cancelled(_))
    }
}

impl Explain for PipelineError {
    fn explain(&self) -> Failure {
        let code = match self {
            PipelineError::Volume(error) => return error.explain(),
            PipelineError::Surface(error) => return error.explain(),
            PipelineError::Retile(error) => return error.explain(),
            PipelineError::Cancelled(_) => {
                return failure(CANCELLED_FAILURE, self, None, START_AGAIN.into());
            }
            PipelineError::Optimise(_) => "not-optimised",
            PipelineError::Unsound { .. } => "unsound-model",
        };
        let advice = "Try another `seed`, more `points`, or `topology=genus0`.";
        failure((Fault::Content, code), self, None, advice.into())
    }

    fn is_cancelled(&self) -> bool {
        PipelineError::is_cancelled(self)
    }
}

impl Explain for ProfileError {
    fn explain(&self) -> Failure {
        let field = match self {
            ProfileError::Syntax(_) => None,
            ProfileError::Version(_) => Some("version"),
            ProfileError::Field { field, .. } => Some(field.as_str()),
        };
        failure(
            (Fault::Content, "unusable-profile"),
            self,
            field,
            "Give the file that `ventriform calibrate` wrote.".into(),
        )
    }
}

impl Explain for SegmentationError {
    fn explain(&self) -> Failure {
        let (code, field, advice) = match self {
            SegmentationError::Volume(volume) => return volume.explain(),
            SegmentationError::Parameter(parameter) => return parameter.explain(),
            SegmentationError::NotFound(error) => return error.explain(),
            SegmentationError::Fit(error) => return error.explain(),
            SegmentationError::NoModel { .. } | SegmentationError::NoTemplate => (
                (Fault::Request, "no-model"),
                "model",
                "Name a model in `model`, or add one to the library.".into(),
            ),
            SegmentationError::UnreadableModel { .. } => {
                (UNSUITABLE_CHOICE, "model", GIVE_MESH_JSON.into())
            }
            SegmentationError::UnsuitableModel { error, .. } => {
                (UNSUITABLE_CHOICE, "model", template_advice(error))
            }
            SegmentationError::OtherOrgan { shows, .. } => (
                UNSUITABLE_CHOICE,
                "model",
                format!("Give a model of that organ, or set `organ` to {shows}."),
            ),
            SegmentationError::ReaderOfVentricles { .. } => (
                UNSUITABLE_CHOICE,
                "reader",
                "Leave `reader` out, or set `organ` to left_ventricle.".into(),
            ),
            SegmentationError::ReaderOfOtherWall { learnt, asked, .. } => (
                UNSUITABLE_CHOICE,
                "reader",
                format!(
                    "Set `edge` to {learnt}, or give a profile learnt with `ventriform calibrate \
                     --edge {asked}`."
                ),
            ),
            SegmentationError::ExpertMask(mask) => {
                let failure = mask.explain();
                let named = failure.field.is_some() && !matches!(mask, GivenMaskError::File(_));
                return if named { failure } else { failure.at("expert") };
            }
            SegmentationError::Normals(error) => return error.explain(),
            SegmentationError::Cancelled(_) => {
                return failure(CANCELLED_FAILURE, self, None, START_AGAIN.into());
            }
        };
        failure(code, self, Some(field), advice)
    }

    fn is_cancelled(&self) -> bool {
        SegmentationError::is_cancelled(self)
    }
}

impl Explain for BuildError {
    fn explain(&self) -> Failure {
        match self {
            Self::Normals { error, .. } => {
                let mut failure = error.explain();
                failure.detail = self.to_string();
                failure
            }
            Self::Cancelled(_) => failure(CANCELLED_FAILURE, self, None, START_AGAIN.into()),
            _ => Failure::new(Fault::Content, "unsuitable-cohort", self.to_string()),
        }
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, Self::Cancelled(_))
    }
}

impl Explain for NormalsError {
    fn explain(&self) -> Failure {
        let (field, advice) = match self {
            Self::Syntax(_) | Self::Field { .. } => (
                "normals",
                "Give a file that `ventriform normals build` wrote.",
            ),
            Self::SchemaVersion(_) => (
                "normals",
                "Build the limits anew with this program, or use the program that wrote them.",
            ),
            Self::Edited { .. } => (
                "normals",
                "Give the file as it was written, or build it anew.",
            ),
            Self::TooFewCases { .. } => (
                "normals",
                "Add healthy cases of this kind, or make men and women one group.",
            ),
            Self::OtherKind { .. } => (
                "normals",
                "Give limits of this sex, protocol, tracer and attenuation correction.",
            ),
            Self::Ambiguous { .. } => (
                "normals",
                "State `sex`, `protocol`, `tracer` and `attenuation_corrected` of the scan.",
            ),
            Self::OtherSex { .. } => ("sex", "Leave `sex` out, or correct it."),
            Self::Unoriented => (
                "superior",
                "State `superior`, the direction to the patient's head.",
            ),
            Self::TooLittleWall { .. } => (
                "normals",
                "Look at the fit: the base may be outside of the image, or the heart may not have been found.",
            ),
        };
        failure(UNSUITABLE_CHOICE, self, Some(field), advice.into())
    }
}

impl Explain for GatedError {
    fn explain(&self) -> Failure {
        match self {
            GatedError::Volume(VolumeError::FrameNeeded { frames, why }) => {
                let why = why.as_deref().unwrap_or("nothing says that they are");
                let detail = format!(
                    "The {frames} volumes are taken for no gates of one heart beat: {why}."
                );
                Failure::new(Fault::Content, "not-gated", detail).at("gated").fix(
                    "Set `gated` to true if they are gates; one volume of a dynamic study is for a segmentation.",
                )
            }
            GatedError::Volume(error) => error.explain(),
            GatedError::Segmentation(error) => error.explain(),
            GatedError::Beat(error) => {
                let (kind, advice) = beat_advice(error);
                failure(kind, self, None, advice.into())
            }
            GatedError::Files(_) => {
                failure((Fault::Service, "unwritable"), self, None, String::new())
            }
            GatedError::Parameter {
                name,
                least,
                greatest,
                ..
            } => {
                let advice = format!("Give a number from {least} to {greatest}, or leave it out.");
                failure(
                    (Fault::Request, "invalid-parameter"),
                    self,
                    Some(name),
                    advice,
                )
            }
            GatedError::Cancelled(_) => failure(CANCELLED_FAILURE, self, None, START_AGAIN.into()),
        }
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, GatedError::Cancelled(_))
    }
}

impl Explain for ComparisonError {
    fn explain(&self) -> Failure {
        let (kind, field, advice) = match self {
            ComparisonError::Volume { scan, error } => return of_scan(*scan, error.explain()),
            ComparisonError::Segmentation { scan, error } => {
                return of_scan(*scan, error.explain());
            }
            ComparisonError::Gated { scan, error } => return of_scan(*scan, error.explain()),
            ComparisonError::NoVentricle { scan } => (
                (Fault::Request, "no-ventricle"),
                Some(scan.as_str()),
                "Give a model of a left ventricle, or leave `model` out.",
            ),
            ComparisonError::SameScan(_) => (
                (Fault::Content, "same-scan"),
                Some("rest"),
                "Give the scan at rest and the scan at stress.",
            ),
            ComparisonError::OtherPatient(_) => (
                (Fault::Content, "other-patient"),
                Some("rest"),
                "Give two scans of one patient; if these are, and one was pseudonymised, set `same_patient` to true.",
            ),
            ComparisonError::NothingInCommon => (
                (Fault::Content, "nothing-in-common"),
                None,
                "Look at both polar maps with `segment`: one of the scans shows no left ventricle.",
            ),
            ComparisonError::Files(_) => ((Fault::Service, "unwritable"), None, ""),
            ComparisonError::Cancelled(_) => (CANCELLED_FAILURE, None, START_AGAIN),
        };
        failure(kind, self, field, advice.into())
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, ComparisonError::Cancelled(_))
    }
}

impl Explain for SerialError {
    fn explain(&self) -> Failure {
        let numbered = |scan: &usize, mut told: Failure| {
            told.detail = format!("scan {scan}: {}", told.detail);
            told.to_sender = told
                .to_sender
                .map(|text| format!("scan {scan}: {text}").into());
            told
        };
        let (kind, field, advice) = match self {
            SerialError::Volume { scan, error } => return numbered(scan, error.explain()),
            SerialError::Segmentation { scan, error } => return numbered(scan, error.explain()),
            SerialError::Gated { scan, error } => return numbered(scan, error.explain()),
            SerialError::ScanCount { .. } => (
                (Fault::Request, "scan-count"),
                Some("others"),
                "Give 2 to 20 scans of one patient, each once.",
            ),
            SerialError::TooManyVoxels { .. } => (
                (Fault::Content, "too-many-voxels"),
                None,
                "Compare fewer scans at once, or raise the limit on voxels.",
            ),
            SerialError::NoVentricle { .. } => (
                (Fault::Request, "no-ventricle"),
                Some("model"),
                "Give a model of a left ventricle, or leave `model` out.",
            ),
            SerialError::SameScan { .. } => (
                (Fault::Content, "same-scan"),
                Some("others"),
                "Give every scan once.",
            ),
            SerialError::OtherPatient { .. } => (
                (Fault::Content, "other-patient"),
                Some("others"),
                "Give scans of one patient; if these are, and some were pseudonymised, set `same_patient` to true.",
            ),
            SerialError::MixedKinds { .. } => (
                (Fault::Content, "mixed-kinds"),
                Some("others"),
                "Compare rest with rest and stress with stress, of one tracer, all corrected for attenuation or none; \
                 rest with stress of one day is what `compare` is for.",
            ),
            SerialError::NothingInCommon { .. } => (
                (Fault::Content, "nothing-in-common"),
                None,
                "Look at the polar maps with `segment`: one of the scans shows no left ventricle.",
            ),
            SerialError::Files(_) => ((Fault::Service, "unwritable"), None, ""),
            SerialError::Cancelled(_) => (CANCELLED_FAILURE, None, START_AGAIN),
        };
        // Whoever may read a job may not see what headers say.
        let told = failure(kind, &self.without_header_text(), field, advice.into());
        told.or_to_sender(sentence(self))
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, SerialError::Cancelled(_))
    }
}

/// A failure of one of two scans: its text begins with the scan's name.
fn of_scan(scan: WhichScan, mut told: Failure) -> Failure {
    told.detail = format!("{scan}: {}", told.detail);
    told.to_sender = told.to_sender.map(|text| format!("{scan}: {text}").into());
    told
}

fn beat_advice(error: &BeatError) -> ((Fault, &'static str), &'static str) {
    match error {
        BeatError::GateCount { .. } => (
            (Fault::Content, "gate-count"),
            "Send the gated series as it was reconstructed, usually with 8 or 16 gates; one volume of the whole beat \
             is for a segmentation.",
        ),
        BeatError::OtherGrid { .. } => (
            (Fault::Content, "gates-differ"),
            "Reconstruct all gates on one grid.",
        ),
        BeatError::EmptyGate { .. } => (
            (Fault::Content, "empty-gate"),
            "Leave the gate out if the study has others, or reconstruct it again.",
        ),
        BeatError::NoVentricle => (
            (Fault::Request, "no-ventricle"),
            "Give a model of a left ventricle, or leave `model` out.",
        ),
        BeatError::Cancelled => (CANCELLED_FAILURE, START_AGAIN),
    }
}

impl Explain for GivenMaskError {
    fn explain(&self) -> Failure {
        let (kind, field, advice) = match self {
            GivenMaskError::File(error) => return error.explain(),
            GivenMaskError::Volumes { .. } => (
                (Fault::Content, "unusable-volume"),
                None,
                "Give a mask of one volume.".into(),
            ),
            GivenMaskError::Empty => (
                (Fault::Content, "empty-mask"),
                None,
                "Give a mask with voxels inside the organ.".into(),
            ),
            GivenMaskError::NotMask { .. } => (
                (Fault::Content, "not-a-mask"),
                None,
                "Give a mask of 0 and 1, a label map, a DICOM Segmentation, or probabilities from 0 to 1."
                    .into(),
            ),
            GivenMaskError::SeveralStructures { .. } => (
                (Fault::Request, "label-needed"),
                Some("label"),
                "Set `label` to the number or the name of the one that is meant.".into(),
            ),
            GivenMaskError::OnlyCavity { .. } => (
                (Fault::Request, "label-needed"),
                Some("label"),
                "Give a mask of the wall, or set `label` to this structure if it is meant.".into(),
            ),
            GivenMaskError::NoSuchStructure { .. } => (
                (Fault::Request, "no-such-label"),
                Some("label"),
                "Set `label` to a structure of the mask, or leave it out.".into(),
            ),
            GivenMaskError::OtherGrid { .. } => (
                (Fault::Content, "other-grid"),
                Some("resample"),
                "Give a mask on the same grid, or resample it by `resample`.".into(),
            ),
            GivenMaskError::Elsewhere { .. } | GivenMaskError::TooFarApart { .. } => (
                (Fault::Content, "mask-elsewhere"),
                None,
                "Give a mask of the same scan whose header places it correctly in the patient; of a mesh, state its \
                 frame by `mesh_frame` (lps or ras)."
                    .into(),
            ),
            GivenMaskError::Cancelled(_) => (CANCELLED_FAILURE, None, START_AGAIN.into()),
        };
        failure(kind, &self.without_header_text(), field, advice)
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, GivenMaskError::Cancelled(_))
    }
}

impl Explain for LocateError {
    fn explain(&self) -> Failure {
        let (kind, field, advice) = match self {
            LocateError::NoHeart { .. } => (
                (Fault::Content, "no-heart"),
                Some("center"),
                "Check that the file is a reconstructed heart scan; if it is, give the heart's \
                 centre as `center` (x,y,z in LPS millimetres).",
            ),
            LocateError::NoCandidate => (
                (Fault::Content, "no-heart"),
                Some("center"),
                "Check that the file is a reconstructed heart scan, in counts from 0 on.",
            ),
            LocateError::HotVoxels(_) => (
                (Fault::Content, "hot-voxels"),
                None,
                "Replace these voxels by the mean of their neighbours, or send the scan as it was reconstructed.",
            ),
            LocateError::HintOutside => (
                (Fault::Request, "hint-outside"),
                None,
                "Give `center` or `box` inside the volume, or leave them out.",
            ),
            LocateError::Blank => (
                (Fault::Content, "blank-volume"),
                None,
                "Check that this is the right file and, for a 4-D one, the right `frame`.",
            ),
            LocateError::Cancelled(_) => (CANCELLED_FAILURE, None, START_AGAIN),
        };
        failure(kind, self, field, advice.into())
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, LocateError::Cancelled(_))
    }
}

impl Explain for DeformError {
    fn explain(&self) -> Failure {
        let (field, advice) = match self {
            DeformError::Localise(error) => return error.explain(),
            DeformError::Cancelled(_) => {
                return failure(CANCELLED_FAILURE, self, None, START_AGAIN.into());
            }
            DeformError::TooManyNodes { limit, .. } => (
                Some("model"),
                format!("Give a model of at most {limit} points, or use no support springs."),
            ),
            DeformError::Parameter { field, .. } => (Some(*field), FINITE_NUMBERS.into()),
            DeformError::PointTooFar { outer, most_mm, .. } => (
                Some(if *outer {
                    "outer_through"
                } else {
                    "inner_through"
                }),
                format!(
                    "Give points within {most_mm} mm of the wall, x,y,z in LPS millimetres, or none."
                ),
            ),
            DeformError::HintNotFinite | DeformError::OtherOrgan => (None, FINITE_NUMBERS.into()),
        };
        failure((Fault::Request, "invalid-parameter"), self, field, advice)
    }

    fn is_cancelled(&self) -> bool {
        match self {
            DeformError::Localise(error) => error.is_cancelled(),
            error => matches!(error, DeformError::Cancelled(_)),
        }
    }
}

const FINITE_NUMBERS: &str = "Give finite numbers within their ranges.";

impl Explain for ReadMeshError {
    fn explain(&self) -> Failure {
        failure(UNSUITABLE_MODEL, self, None, GIVE_MESH_JSON.into())
    }
}

impl Explain for MeshFileError {
    fn explain(&self) -> Failure {
        let (kind, field) = match self {
            MeshFileError::Cancelled(_) => (CANCELLED_FAILURE, None),
            MeshFileError::TooLong { .. } => ((Fault::TooLarge, "mesh-too-large"), None),
            MeshFileError::Size(_) => (UNSUITABLE_MODEL, Some("mesh_unit")),
            MeshFileError::Contradiction { field: "unit", .. } => {
                ((Fault::Request, "contradiction"), Some("mesh_unit"))
            }
            MeshFileError::Contradiction { .. } => {
                ((Fault::Request, "contradiction"), Some("mesh_frame"))
            }
            _ => (UNSUITABLE_MODEL, None),
        };
        failure(kind, self, field, mesh_file_advice(self))
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, MeshFileError::Cancelled(_))
    }
}

fn mesh_file_advice(error: &MeshFileError) -> String {
    match error {
        MeshFileError::Cancelled(_) => START_AGAIN.into(),
        MeshFileError::TooLong { .. } => {
            "Give a mesh of fewer triangles, or ask the operator to raise the limit.".into()
        }
        MeshFileError::Unknown { .. } | MeshFileError::Unsupported { .. } => {
            "Give a closed triangle mesh as STL, PLY, OBJ, VTK or VTP PolyData, GLB, or JSON as `generate` \
             writes it."
                .into()
        }
        MeshFileError::Damaged { .. }
        | MeshFileError::NotFinite { .. }
        | MeshFileError::NoSuchVertex { .. } => {
            "Transfer the file again; if that does not help, export it again from its source.".into()
        }
        MeshFileError::Empty | MeshFileError::Flat => {
            "Give a closed surface that encloses the organ.".into()
        }
        MeshFileError::Open { .. } => {
            "Close the surface (fill its holes, merge vertices that lie apart) and export it again."
                .into()
        }
        MeshFileError::Orientation { .. } => {
            "Orient the triangles alike (most programs call it `recompute normals`) and export it again."
                .into()
        }
        MeshFileError::Contradiction { .. } => {
            "Leave the statement out, or correct the one in the file.".into()
        }
        MeshFileError::UnknownWord { known, .. } => format!("Write the file with {known}."),
        MeshFileError::Size(size) => match (size.likely, size.factor()) {
            (Some(unit), Some(factor)) => format!(
                "Multiply the coordinates by {factor} to have millimetres, or set `mesh_unit` to {}, if that is \
                 its unit; set it to {} if the mesh is as small or large as that.",
                unit.as_str(),
                size.unit.as_str()
            ),
            _ => format!(
                "Scale the coordinates to millimetres, or set `mesh_unit` to mm, cm or m; to {} if the mesh is as \
                 small or large as that.",
                size.unit.as_str()
            ),
        },
    }
}

impl Explain for TemplateError {
    fn explain(&self) -> Failure {
        failure(UNSUITABLE_MODEL, self, None, template_advice(self))
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, TemplateError::Cancelled(_))
    }
}

impl Explain for ObjectError {
    fn explain(&self) -> Failure {
        match self {
            Self::Volume(error) => error.explain(),
            Self::Identity(error) => error.explain(),
        }
    }

    fn is_cancelled(&self) -> bool {
        matches!(self, Self::Volume(error) if error.is_cancelled())
    }
}

impl Explain for ReadingError {
    fn explain(&self) -> Failure {
        match self {
            Self::Missing { field } => failure(
                (Fault::Request, "invalid-field"),
                self,
                Some(field),
                format!("Give `{field}`."),
            ),
            Self::NoPlace { field, .. } => failure(
                (Fault::Request, "invalid-field"),
                self,
                Some(field),
                "Give `scores` of a single scan, `stress_scores` and `rest_scores` of a comparison.".into(),
            ),
            Self::Report(_) => failure(
                (Fault::Service, "unreadable"),
                self,
                None,
                "Make the result again.".into(),
            ),
        }
    }
}

impl Explain for DicomError {
    fn explain(&self) -> Failure {
        let (kind, field, advice) = match self {
            DicomError::NoIdentity { field } => (
                (Fault::Request, "identity-needed"),
                Some(*field),
                "DICOM objects belong to a patient and a study: give `patient_id` and \
                 `study_uid`, or the scan as the DICOM file that it came from."
                    .into(),
            ),
            DicomError::Undecoded { field } => (
                (Fault::Request, "identity-needed"),
                Some(*field),
                undecoded_advice(field),
            ),
            DicomError::Contradiction { field } => (
                (Fault::Request, "identity-differs"),
                Some(*field),
                format!("Check that this is the right scan; leave `{field}` out if it is."),
            ),
            DicomError::Identity { field, expected } => (
                (Fault::Request, "invalid-parameter"),
                Some(*field),
                format!("Give {expected} as `{field}`."),
            ),
            DicomError::Oblique => (
                (Fault::Content, "not-exportable"),
                None,
                "Resample the volume to a grid with right angles.".into(),
            ),
            DicomError::LongContour { .. } | DicomError::Mesh(_) => (
                (Fault::Content, "not-exportable"),
                Some("model"),
                "Use a model with fewer points.".into(),
            ),
            DicomError::TooLarge
            | DicomError::Picture { .. }
            | DicomError::Encoding(_)
            | DicomError::Report(_) => (
                (Fault::Content, "not-exportable"),
                None,
                "Use the other files of the result, which hold the same.".into(),
            ),
        };
        failure(kind, self, field, advice)
    }
}

/// A mesh that was given as a template and cannot be fitted.
pub const UNSUITABLE_MODEL: (Fault, &str) = (Fault::Content, "unsuitable-model");

/// A model that was chosen for a segmentation and cannot be fitted.
const UNSUITABLE_CHOICE: (Fault, &str) = (Fault::Request, "unsuitable-model");

const GIVE_MESH_JSON: &str = "Give a JSON mesh as `generate` writes it (mesh.json).";

/// Advice about a field of a scan that cannot be decoded.
fn undecoded_advice(field: &str) -> String {
    let correct = "correct Specific Character Set (0008,0005) or the value in the file (its warnings \
                   say what is wrong)";
    if StatedIdentity::FIELD_NAMES.contains(&field) {
        format!(
            "State `{field}` (PUT .../identity, or --{}), or {correct}, or ask for de-identified \
         objects.",
            field.replace('_', "-")
        )
    } else {
        format!("Ask for de-identified objects, or {correct}.")
    }
}

fn volume_advice(error: &VolumeError) -> String {
    match error {
        VolumeError::NoFile | VolumeError::Empty { .. } => {
            "Give a file that contains the volume.".into()
        }
        VolumeError::Unsupported { fix, .. }
        | VolumeError::NotVolume { fix, .. }
        | VolumeError::NotSlices { fix, .. } => (*fix).into(),
        VolumeError::Mesh { error, .. } => mesh_file_advice(error),
        VolumeError::SingleSlice { .. } => {
            "Send all slices: every file of the series, or a volume with at least two voxels along each axis.".into()
        }
        VolumeError::NotOneSeries { .. } => {
            "Send all files of one scan, each once, as several files or as one zip; where they are of one scan and \
             their headers contradict each other, export it again from the system that made it."
                .into()
        }
        VolumeError::Unrecognised { .. } => {
            "Give NIfTI (.nii, .nii.gz, or a .hdr/.img pair) or DICOM (a multi-frame NM, PET, CT or \
             MR file, all files of one series, or a zip of them)."
                .into()
        }
        // Changing a patient's file by hand is dangerous, so the advice is to export it again.
        VolumeError::Field { field, .. } if field.ends_with(')') => format!(
            "Export the series again from the system that made it, so that it states a valid \
             {field}."
        ),
        VolumeError::Field { field, .. } => format!("Write the file again with a valid {field}."),
        VolumeError::Truncated { .. } | VolumeError::Corrupt { .. } => {
            "Transfer the file again; if that does not help, export it again from its source."
                .into()
        }
        VolumeError::TooLarge { what, limit, .. } => too_large_advice(what, *limit),
        VolumeError::FrameNeeded { frames, .. } | VolumeError::FrameOutOfRange { frames, .. } => {
            let last = frames.saturating_sub(1);
            let choose = format!("Set `frame` to a number from 0 (the first) to {last} (the last).");
            match error {
                VolumeError::FrameNeeded { .. } if GATE_COUNTS.contains(frames) => format!(
                    "{choose} If they are the gates of one heart beat, say so: in the names of files of one gate each \
                     (gate1.nii, gate2.nii, ...), or by the time of a gate in the header (pixdim[4] and xyzt_units of \
                     NIfTI); or give their sum. A beat takes them with `gated`."
                ),
                _ => choose,
            }
        }
        VolumeError::OtherGate { .. } => {
            "Give the gates as they were reconstructed together: of one study, as many voxels, at the same \
             place.".into()
        }
        VolumeError::NotGated { .. } => {
            "Give the gated series (6 to 32 volumes of one heart beat in one file, or one file for each gate).".into()
        }
        VolumeError::ImageMissing { .. } => {
            "Give the .hdr and the .img together, or a single .nii.".into()
        }
        VolumeError::NotOneVolume { .. } => {
            "Give one file, a .hdr with its .img, the DICOM files of one series (a slice or a gate each), or 6 to 32 \
             NIfTI files of one gate each."
                .into()
        }
        VolumeError::Overflow { .. } => "Scale the values to below 3.4e38.".into(),
        VolumeError::NoFiniteVoxel { .. } => EMPTY_FILE.into(),
        VolumeError::VoxelSize { .. } => {
            "Make sure that the header or the affine states millimetres, and give the size that the scanner had.".into()
        }
        VolumeError::Memory { .. } => "Try again later, or use a smaller volume.".into(),
        VolumeError::Io { .. } => "Check that the file exists and can be read.".into(),
        VolumeError::Cancelled(_) => START_AGAIN.into(),
    }
}

/// What to do about more of something than one volume may have.
fn too_large_advice(what: &str, limit: u64) -> String {
    match what {
        "levels" => {
            "Give the folder of the scan itself, not one far above it; `--folder-limit` allows more levels.".into()
        }
        _ if what.starts_with("files") || what.contains("directory") => format!(
            "Give the files of one scan alone: at most {limit} {what}; `--file-limit`, or the operator's setting \
             `file_limit`, allows more."
        ),
        _ if what.contains("bytes") => format!(
            "Give one scan without other files, or a smaller one: at most {limit} {what}. The operator's setting \
             `decompressed_limit` allows more."
        ),
        _ => format!(
            "Crop or resample the volume to at most {limit} {what}, or ask the operator to raise \
             the limit."
        ),
    }
}

const EMPTY_FILE: &str = "Check the file in a viewer: it shows nothing.";

fn surface_advice(error: &SurfaceError) -> String {
    match error {
        SurfaceError::Cancelled(_) => START_AGAIN.into(),
        SurfaceError::NoFiniteVoxel { .. } | SurfaceError::Constant { .. } => EMPTY_FILE.into(),
        SurfaceError::NoSurface {
            minimum, maximum, ..
        } => format!("Set `iso` to auto or to an absolute value between {minimum} and {maximum}."),
        SurfaceError::BadIso { expected, .. } => format!("Set `iso` to {expected}."),
        SurfaceError::BadSmoothing { .. } => "Set `mask_smoothing` to a number from 0 to 3.".into(),
        SurfaceError::NoSuchLabel { .. } | SurfaceError::LabelNeeded { .. } => {
            "Set `label` to a label of the volume.".into()
        }
        SurfaceError::InexactLabel { .. } => {
            "Give the map as a file of whole numbers, or number its labels below 2^24.".into()
        }
        SurfaceError::OutsideVolume { shape, .. } => {
            format!("Give voxel indices below {shape:?}, counted from 0.")
        }
        SurfaceError::HintOutside => "Give a hint inside the volume, or none.".into(),
        SurfaceError::EmptyBox { .. } => "Give the lower corner of the box first.".into(),
        SurfaceError::SeedOutside { value, .. } => {
            format!("Choose a voxel inside the wall, or an `iso` below {value}.")
        }
        SurfaceError::BadShape { .. }
        | SurfaceError::TooManyVertices(_)
        | SurfaceError::NotClosed(_)
        | SurfaceError::BadVertex { .. } => "Give a smaller or a valid object.".into(),
    }
}

fn retile_advice(error: &RetileError) -> String {
    match error {
        RetileError::Cancelled(_) => START_AGAIN.into(),
        RetileError::TooFewPoints { needed, .. } => {
            format!("Set `points` to {needed} or more, or `topology` to genus0.")
        }
        RetileError::NotCarried { .. } => "More points do not help. Set `topology` to genus0, or \
             `isolate` to one component; if the object is only two or three voxels thick, choose \
             another `iso` or smooth the volume."
            .into(),
        RetileError::TooManyPoints { limit, .. } => format!("Set `points` to {limit} or fewer."),
        RetileError::OpenSurface(_) | RetileError::NoArea => {
            "Give a closed surface of finite size.".into()
        }
        RetileError::SelfIntersecting { .. } => {
            "Choose another `iso`, or smooth the volume.".into()
        }
        RetileError::BadParameter { name, range, .. } => {
            format!("Set `{name}` to a value in {range}.")
        }
    }
}

fn template_advice(error: &TemplateError) -> String {
    match error {
        TemplateError::NoCup { .. } => {
            "Give a model of a left ventricle, or set `organ` to what this one shows.".into()
        }
        TemplateError::TooLarge { limit, .. } => format!("Give a model of at most {limit} points."),
        _ => "Give a closed surface that faces outward, in LPS millimetres.".into(),
    }
}

/// The failure that `error` is, with its text as a sentence.
pub fn failure(
    (fault, code): (Fault, &str),
    error: &dyn Error,
    field: Option<&str>,
    advice: String,
) -> Failure {
    let failure = Failure::new(fault, code, sentence(error)).fix(advice);
    match field {
        Some(field) => failure.at(field),
        None => failure,
    }
}

/// An error's message as a sentence. A file's name, with which many begin, stays as it is.
pub fn sentence(error: &dyn Error) -> String {
    let text = error.to_string();
    let is_name = text.split_whitespace().next().is_some_and(|word| {
        word.trim_end_matches([':', ',', '.'])
            .contains(['.', '/', '_'])
    });
    let mut letters = text.chars();
    let mut sentence: String = match letters.next() {
        Some(first) if !is_name => first.to_uppercase().chain(letters).collect(),
        _ => text,
    };
    if !sentence.ends_with('.') {
        sentence.push('.');
    }
    sentence
}
