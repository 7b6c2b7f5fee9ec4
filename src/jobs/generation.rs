//! The work of kind `model`: [`crate::pipeline`] from files to every download.

use super::checked::{self, unusable};
use super::reader::{no_page, refusal, sentence, volume_files};
use super::{Failure, Fault, Input, Output, OutputFile, Resource, Stored, Work, WorkError};
use crate::export::{self, Format};
use crate::parameters::ModelParameters;
use crate::pipeline::{self, Model, PipelineError, pages};
use crate::progress::{Monitor, Plan, Stage};
use crate::surface::SurfaceError;
use crate::volume::ReadLimits;
use serde_json::{Map, Value, json};

/// Makes models.
#[derive(Debug, Clone, Copy)]
pub struct Generation {
    /// What a volume may cost.
    pub limits: ReadLimits,
}

impl Work for Generation {
    fn makes(&self) -> Resource {
        Resource::Model
    }

    fn plan(&self) -> Plan {
        Plan::GENERATION
    }

    fn parameters_from_text(
        &self,
        pairs: &[(String, String)],
    ) -> Result<Map<String, Value>, Failure> {
        checked::from_text::<ModelParameters>(pairs)
    }

    fn parameters_from_json(
        &self,
        object: &Map<String, Value>,
    ) -> Result<Map<String, Value>, Failure> {
        checked::from_json::<ModelParameters>(object)
    }

    fn run(&self, input: &Input, monitor: &Monitor<'_>) -> Result<Output, WorkError> {
        let parameters = ModelParameters::from_json(&input.parameters).map_err(unusable)?;
        let files = volume_files(&input.files);
        let model = pipeline::generate(&files, &parameters, &self.limits, monitor)
            .map_err(|error| explain(&error))?;
        Ok(Output {
            files: downloads(&model, input, monitor)?,
            summary: summary(&model),
        })
    }

    fn page(&self, stored: &Stored) -> Result<String, Failure> {
        pages::model_page(&|name| stored.read(name)).map_err(|error| no_page(&error))
    }
}

fn explain(error: &PipelineError) -> WorkError {
    if error.is_cancelled() {
        return WorkError::Cancelled;
    }
    let (fault, code) = match error {
        PipelineError::Volume(volume) => return refusal(volume).into(),
        PipelineError::Surface(SurfaceError::NoSurface { .. }) => (Fault::Content, "no-surface"),
        PipelineError::Surface(_) => (Fault::Content, "unusable-surface"),
        PipelineError::Retile(_) => (Fault::Request, "unsuitable-points"),
        PipelineError::Optimise(_) => (Fault::Content, "not-optimised"),
        PipelineError::Unsound { .. } => (Fault::Content, "unsound-model"),
        PipelineError::Cancelled(_) => return WorkError::Cancelled,
    };
    let failure = Failure::new(fault, code, sentence(error)).fix(error.fix());
    WorkError::Failed(match error.field() {
        Some(field) => failure.at(field),
        None => failure,
    })
}

fn summary(model: &Model) -> Map<String, Value> {
    let counts = [
        ("vertices", json!(model.mesh.vertices.len())),
        ("triangles", json!(model.mesh.triangles.len())),
    ];
    counts
        .into_iter()
        .map(|(name, count)| (name.to_owned(), count))
        .chain(model.report.quality_summary())
        .collect()
}

fn downloads(
    model: &Model,
    input: &Input,
    monitor: &Monitor<'_>,
) -> Result<Vec<OutputFile>, WorkError> {
    let mut metadata = model.metadata();
    metadata.volume_id = Some(input.volume.clone());
    let mut files = Vec::new();
    for (done, format) in Format::ALL.into_iter().enumerate() {
        monitor.report(Stage::Export, done as f64 / 8.0)?;
        let bytes = export::encode(format, &model.mesh, &metadata).map_err(|error| {
            Failure::new(Fault::Content, "not-exportable", sentence(&error)).at(format.extension())
        })?;
        files.push(OutputFile {
            name: format!("mesh.{}", format.extension()),
            media_type: format.media_type(),
            bytes,
        });
    }
    files.push(OutputFile {
        name: "report.json".into(),
        media_type: "application/json",
        bytes: model.report.to_json_text().into_bytes(),
    });
    let closeness = model.closeness(monitor)?;
    files.push(OutputFile {
        name: "distance.json".into(),
        media_type: "application/json",
        bytes: serde_json::to_vec(&closeness).expect("numbers always serialise"),
    });
    monitor.report(Stage::Export, 1.0)?;
    Ok(files)
}
