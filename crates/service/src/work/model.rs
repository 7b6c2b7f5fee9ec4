//! Jobs of kind `model`: [`ventriform::runs::pipeline::generate`], from a volume's files to every download.

use super::failures::{not_exportable, work_error};
use super::files::{json_file, mesh_file, volume_files};
use super::page;
use super::parameters;
use crate::base::records::{Failure, Resource};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use ventriform::base::progress::{Monitor, Plan, Stage};
use ventriform::image::volume::ReadLimits;
use ventriform::parameters::ModelParameters;
use ventriform::results::export::Format;
use ventriform::results::report::object;
use ventriform::runs::advice::Explain;
use ventriform::runs::pipeline::{self, Model};

/// Makes models.
#[derive(Debug, Clone, Copy)]
pub struct ModelWork {
    /// Limits on the volume.
    pub limits: ReadLimits,
}

impl Work for ModelWork {
    fn makes(&self) -> Resource {
        Resource::Model
    }

    fn plan(&self) -> Plan {
        Plan::GENERATION
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check::<ModelParameters>(given)
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let parameters =
            ModelParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let files = volume_files(&input.files);
        let model = pipeline::generate(&files, &parameters, &self.limits, monitor)
            .map_err(|error| work_error(&error))?;
        Ok(WorkOutput {
            files: downloads(&model, &input.volume, monitor)?,
            summary: object(&model.report.summary()),
        })
    }

    fn page_files(&self) -> &'static [&'static str] {
        page::MODEL_FILES
    }

    fn page(&self, model: &StoredItem, scans: &[Map<String, Value>]) -> Result<String, Failure> {
        page::model_page(&|name| model.read_whole(name), scans).map_err(|error| error.explain())
    }
}

fn downloads(
    model: &Model,
    volume: &str,
    monitor: &Monitor<'_>,
) -> Result<Vec<OutputFile>, WorkError> {
    let surface = model.measured_surface();
    let mut metadata = model.metadata_with_distance(&surface, monitor)?;
    metadata.volume_id = Some(volume.to_owned());
    let mut files = Vec::new();
    for (done, format) in Format::ALL.into_iter().enumerate() {
        monitor.report(Stage::Export, done as f64 / 8.0)?;
        let file = mesh_file(format, &model.mesh, &metadata);
        files.push(file.map_err(|error| not_exportable(&error).at(format.extension()))?);
    }
    let report = model.report.to_json_text().into_bytes();
    files.push(json_file("report.json", report));
    let closeness = surface.closeness(&model.mesh, monitor)?;
    let distance = serde_json::to_vec(&closeness).expect("numbers always serialise");
    files.push(json_file("distance.json", distance));
    monitor.report(Stage::Export, 1.0)?;
    Ok(files)
}
