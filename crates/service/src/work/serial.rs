//! Jobs of kind `serial`: [`ventriform::runs::serial::from_files`] over the stored volumes of one patient, that of the job
//! and those of its parameter `others`.

use super::failures::{unwritten, volume_missing, work_error};
use super::files::volume_files;
use super::limits;
use super::models::{MESH_FILE, named_item, named_models, stored_models};
use super::page;
use super::parameters;
use crate::base::records::{Failure, Fault, Resource};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use ventriform::base::progress::{Monitor, Plan};
use ventriform::image::volume::ReadLimits;
use ventriform::parameters::{SerialChoice, SerialParameters};
use ventriform::results::export::Format;
use ventriform::results::report::{SerialSummary, object};
use ventriform::runs::advice::Explain;
use ventriform::runs::serial::{SerialOrder, from_files};

/// The parameter that names the other scans.
const OTHERS_FIELD: &str = "others";

/// Compares scans of one patient over the years.
#[derive(Debug, Clone, Copy)]
pub struct SerialWork {
    /// Limits on each scan, and on the voxels of all together.
    pub limits: ReadLimits,
}

/// The fields under which the other volumes are looked up, with their ids.
fn others(parameters: &Map<String, Value>) -> Vec<(String, String)> {
    let named = parameters.get(OTHERS_FIELD).and_then(Value::as_str);
    named.map_or_else(Vec::new, SerialChoice::named_volumes)
}

impl Work for SerialWork {
    fn makes(&self) -> Resource {
        Resource::Serial
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let (mut items, library) = named_models(parameters);
        items.extend(others(parameters));
        items.extend(named_item(parameters, limits::NORMALS_FIELD));
        Needs {
            items,
            library,
            files: &[MESH_FILE, limits::NORMALS_FILE],
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check_with_fit::<SerialChoice>(given)
    }

    fn check_order(
        &self,
        volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        let wrong =
            |detail: &str| Failure::new(Fault::Request, "invalid-field", detail).at(OTHERS_FIELD);
        let others = others(parameters);
        if others.is_empty() {
            return Err(wrong("The other scans are missing.")
                .fix("Give in `others` the ids of 1 to 19 stored volumes, separated by commas."));
        }
        if others.iter().any(|(_, id)| Some(id.as_str()) == volume) {
            return Err(wrong("A scan is named twice.").fix("Give every scan once."));
        }
        Ok(())
    }

    fn plan(&self) -> Plan {
        Plan::SERIAL
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let parameters =
            SerialParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let mut scans = vec![volume_files(&input.files)];
        for (field, _) in others(&input.parameters) {
            let other = input.items.get(&field);
            let other = other.ok_or_else(|| volume_missing(OTHERS_FIELD))?;
            scans.push(volume_files(&other.files));
        }
        let normals = limits::of_input(input)?;
        let order = SerialOrder {
            scans: &scans,
            auto: parameters.fit.is_auto(),
            models: stored_models(input, &parameters.fit)?,
            normals: normals.as_ref(),
            parameters: &parameters,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(|error| work_error(&error))?;
        let files = made.files(&Format::ALL, monitor);
        let files = files.map_err(unwritten)?;
        Ok(WorkOutput {
            summary: object(&SerialSummary::from_report(made.report())),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }

    fn page_files(&self) -> &'static [&'static str] {
        page::serial_files()
    }

    fn page(&self, serial: &StoredItem, scans: &[Map<String, Value>]) -> Result<String, Failure> {
        page::serial_page(&|name| serial.read_whole(name), scans).map_err(|error| error.explain())
    }
}
