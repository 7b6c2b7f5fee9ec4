//! Jobs of kind `beat`: [`ventriform::runs::gated::from_files`] over a stored volume with gates and stored models.

use super::failures::{unwritten, work_error};
use super::files::volume_files;
use super::limits;
use super::models::{MESH_FILE, named_item, named_models, stored_models};
use super::page;
use super::parameters;
use crate::base::records::{Failure, Resource};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use ventriform::base::progress::{Monitor, Plan};
use ventriform::image::volume::ReadLimits;
use ventriform::parameters::{BeatChoice, GatedParameters};
use ventriform::results::export::Format;
use ventriform::results::report::{BeatSummary, object};
use ventriform::runs::advice::Explain;
use ventriform::runs::gated::{GatedOrder, from_files};

/// Fits one wall in motion to the gates of volumes.
#[derive(Debug, Clone, Copy)]
pub struct BeatWork {
    /// Limits on the volume; those on voxels hold for all gates together.
    pub limits: ReadLimits,
}

impl Work for BeatWork {
    fn makes(&self) -> Resource {
        Resource::Beat
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let (mut items, library) = named_models(parameters);
        items.extend(named_item(parameters, limits::NORMALS_FIELD));
        Needs {
            items,
            library,
            files: &[MESH_FILE, limits::NORMALS_FILE],
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check_with_fit::<BeatChoice>(given)
    }

    fn plan(&self) -> Plan {
        Plan::BEAT
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let parameters =
            GatedParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let normals = limits::of_input(input)?;
        let order = GatedOrder {
            gates: &volume_files(&input.files),
            normals: normals.as_ref(),
            auto: parameters.fit.is_auto(),
            models: stored_models(input, &parameters.fit)?,
            parameters: &parameters.fit,
            choice: parameters.choice,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(|error| work_error(&error))?;
        let files = made.files(&Format::ALL, monitor);
        let files = files.map_err(unwritten)?;
        Ok(WorkOutput {
            summary: object(&BeatSummary::from_report(made.report())),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }
    fn page_files(&self) -> &'static [&'static str] {
        page::BEAT_FILES
    }

    fn page(&self, beat: &StoredItem, scans: &[Map<String, Value>]) -> Result<String, Failure> {
        page::beat_page(&|name| beat.read_whole(name), scans).map_err(|error| error.explain())
    }
}
