//! The work of kind `segmentation`: [`crate::segmentation::from_files`] over stored models.

use super::checked::{self, unusable};
use super::reader::{no_page, refusal, sentence, volume_files};
use super::{Failure, Fault, Input, Needs, Output, OutputFile, Resource, Stored, Work, WorkError};
use crate::deform::DeformError;
use crate::export::{Format, read_json};
use crate::locate::localisation::LocaliseError;
use crate::parameters::{FitParameters, Parameters};
use crate::pipeline::pages;
use crate::progress::{Monitor, Plan};
use crate::segmentation::{ExpertError, SegmentationError};
use crate::segmentation::{NamedFile, OutcomeError};
use crate::segmentation::{NamedMesh, Order, SegmentError, from_files};
use crate::volume::ReadLimits;
use serde_json::{Map, Value};

/// Fits models.
#[derive(Debug, Clone, Copy)]
pub struct Fitting {
    /// What a volume may cost.
    pub limits: ReadLimits,
}

impl Work for Fitting {
    fn makes(&self) -> Resource {
        Resource::Segmentation
    }

    fn plan(&self) -> Plan {
        Plan::SEGMENTATION
    }

    fn parameters_from_text(
        &self,
        pairs: &[(String, String)],
    ) -> Result<Map<String, Value>, Failure> {
        checked::from_text::<FitParameters>(pairs)
    }

    fn parameters_from_json(
        &self,
        object: &Map<String, Value>,
    ) -> Result<Map<String, Value>, Failure> {
        checked::from_json::<FitParameters>(object)
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let id = |field: &str| {
            Some((
                field.to_owned(),
                parameters.get(field)?.as_str()?.to_owned(),
            ))
        };
        let model = id("model").filter(|(_, id)| id != FitParameters::AUTO);
        Needs {
            library: model.is_none(),
            things: model.into_iter().chain(id("expert")).collect(),
        }
    }

    fn run(&self, input: &Input, monitor: &Monitor<'_>) -> Result<Output, WorkError> {
        let parameters = FitParameters::from_json(&input.parameters).map_err(unusable)?;
        let expert = input
            .things
            .get("expert")
            .map(|expert| volume_files(&expert.files));
        let (models, named) = models(input, &parameters)?;
        let order = Order {
            volume: &volume_files(&input.files),
            expert: expert.as_deref(),
            models,
            named,
            parameters: &parameters,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(explain)?;
        let files = made
            .files(&Format::ALL, Some(input.volume.clone()), monitor)
            .map_err(|error| match error {
                OutcomeError::Cancelled(cancelled) => cancelled.into(),
                error => WorkError::Failed(Failure::new(
                    Fault::Content,
                    "not-exportable",
                    sentence(&error),
                )),
            })?;
        Ok(Output {
            summary: made.summary(),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }

    fn page(&self, stored: &Stored) -> Result<String, Failure> {
        pages::segmentation_page(&|name| stored.read(name)).map_err(|error| no_page(&error))
    }
}

impl From<NamedFile> for OutputFile {
    fn from(file: NamedFile) -> Self {
        Self {
            name: file.name,
            media_type: file.media_type,
            bytes: file.bytes,
        }
    }
}

/// The models to fit, and whether they were named.
fn models(input: &Input, parameters: &FitParameters) -> Result<(Vec<NamedMesh>, bool), WorkError> {
    let organ = parameters.organ.as_str();
    let shows = |stored: &Stored| {
        let organ = stored.parameters.get("organ");
        organ.and_then(Value::as_str).map(str::to_owned)
    };
    if let Some(stored) = input.things.get("model") {
        if let Some(other) = shows(stored).filter(|shown| shown != organ) {
            return Err(explain(SegmentError::OtherOrgan {
                name: stored.id.clone(),
                shows: other,
                wanted: organ,
            }));
        }
        let model = mesh(stored)?.ok_or_else(|| gone(&stored.id))?;
        return Ok((vec![model], true));
    }
    let mut models = Vec::new();
    for stored in &input.library {
        if shows(stored).is_some_and(|shown| shown == organ) {
            // One that was erased a moment ago is not at hand any more.
            models.extend(mesh(stored)?);
        }
    }
    Ok((models, false))
}

/// A stored mesh by its name; `None` where its file is gone.
fn mesh(stored: &Stored) -> Result<Option<NamedMesh>, WorkError> {
    let name = stored.parameters.get("name").and_then(Value::as_str);
    let name = match name {
        Some(name) => format!("{name} ({})", stored.id),
        None => stored.id.clone(),
    };
    let Some(bytes) = stored.read("mesh.json").map_err(|e| unreadable(&e))? else {
        return Ok(None);
    };
    match read_json::decode(&bytes) {
        Ok(mesh) => Ok(Some(NamedMesh { name, mesh })),
        Err(error) => Err(explain(SegmentError::Unreadable { name, error })),
    }
}

fn gone(id: &str) -> WorkError {
    WorkError::Failed(
        Failure::new(
            Fault::Request,
            "invalid-field",
            format!("The model `{id}` has no mesh any more."),
        )
        .at("model")
        .fix("GET /v1/models and /v1/templates list what there is."),
    )
}

fn unreadable(error: &std::io::Error) -> Failure {
    Failure::new(
        Fault::Service,
        "unreadable",
        format!("A stored model cannot be read: {error}."),
    )
}

/// Why there is no segmentation, for whoever asked for it.
pub(super) fn explain(error: SegmentError) -> WorkError {
    use SegmentationError::{Cancelled, Deform, Expert, NoTemplate};
    if error.is_cancelled() {
        return WorkError::Cancelled;
    }
    let (fault, code) = match &error {
        SegmentError::Volume(volume) => return refusal(volume).into(),
        SegmentError::ExpertVolume(volume) => return refusal(volume).at("expert").into(),
        SegmentError::Parameter(_) => (Fault::Request, "invalid-parameter"),
        SegmentError::Unreadable { .. }
        | SegmentError::Model { .. }
        | SegmentError::OtherOrgan { .. } => (Fault::Request, "unsuitable-model"),
        SegmentError::NoModel { .. } | SegmentError::Segmentation(NoTemplate) => {
            (Fault::Request, "no-model")
        }
        SegmentError::Segmentation(Expert(ExpertError::Empty)) => (Fault::Content, "empty-mask"),
        SegmentError::Segmentation(Expert(ExpertError::Elsewhere { .. })) => {
            (Fault::Content, "mask-elsewhere")
        }
        SegmentError::Segmentation(Deform(DeformError::Localise(localise))) => match localise {
            LocaliseError::HintOutside => (Fault::Request, "hint-outside"),
            LocaliseError::Blank => (Fault::Content, "blank-volume"),
            _ => (Fault::Content, "no-heart"),
        },
        SegmentError::Segmentation(Deform(_)) => (Fault::Request, "invalid-parameter"),
        SegmentError::Segmentation(Cancelled(_) | Expert(ExpertError::Cancelled(_)))
        | SegmentError::Cancelled(_) => return WorkError::Cancelled,
    };
    let failure = Failure::new(fault, code, sentence(&error)).fix(error.fix());
    WorkError::Failed(match error.field() {
        Some(field) => failure.at(field),
        None => failure,
    })
}
