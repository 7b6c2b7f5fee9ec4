//! Jobs of kind `comparison`: [`ventriform::runs::rest_stress::from_files`] over two stored volumes, that of the job at
//! stress and that of its parameter `rest` at rest.

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
use ventriform::parameters::{ComparisonChoice, ComparisonParameters};
use ventriform::results::export::Format;
use ventriform::results::report::{ComparisonSummary, object};
use ventriform::runs::advice::Explain;
use ventriform::runs::rest_stress::{ComparisonOrder, from_files};

/// The parameter that names the scan at rest.
pub(super) const REST_FIELD: &str = "rest";

/// Compares rest and stress of one patient.
#[derive(Debug, Clone, Copy)]
pub struct ComparisonWork {
    /// Limits on each of both scans.
    pub limits: ReadLimits,
}

impl Work for ComparisonWork {
    fn makes(&self) -> Resource {
        Resource::Comparison
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let (mut items, library) = named_models(parameters);
        let named = [REST_FIELD, limits::NORMALS_FIELD];
        items.extend((named.iter()).filter_map(|field| named_item(parameters, field)));
        Needs {
            items,
            library,
            files: &[MESH_FILE, limits::NORMALS_FILE],
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check_with_fit::<ComparisonChoice>(given)
    }

    fn check_order(
        &self,
        volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        let wrong =
            |detail: &str| Failure::new(Fault::Request, "invalid-field", detail).at(REST_FIELD);
        match parameters.get(REST_FIELD).and_then(Value::as_str) {
            None => Err(wrong("The scan at rest is missing.")
                .fix("Give in `rest` the id of a stored volume, or in a form the file `rest`.")),
            Some(rest) if Some(rest) == volume => Err(wrong("Stress and rest are one volume.")
                .fix("Give the scan at stress and the scan at rest.")),
            Some(_) => Ok(()),
        }
    }

    fn plan(&self) -> Plan {
        Plan::COMPARISON
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let parameters =
            ComparisonParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let rest = input
            .items
            .get(REST_FIELD)
            .ok_or_else(|| volume_missing(REST_FIELD))?;
        let normals = limits::of_input(input)?;
        let order = ComparisonOrder {
            stress: &volume_files(&input.files),
            rest: &volume_files(&rest.files),
            auto: parameters.fit.is_auto(),
            models: stored_models(input, &parameters.fit)?,
            normals: normals.as_ref(),
            parameters: &parameters,
        };
        let made = from_files(&order, &self.limits, monitor).map_err(|error| work_error(&error))?;
        let files = made.files(&Format::ALL, monitor);
        let files = files.map_err(unwritten)?;
        Ok(WorkOutput {
            summary: object(&ComparisonSummary::from_report(made.report())),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }

    fn page_files(&self) -> &'static [&'static str] {
        page::COMPARISON_FILES
    }

    fn page(
        &self,
        comparison: &StoredItem,
        scans: &[Map<String, Value>],
    ) -> Result<String, Failure> {
        page::comparison_page(&|name| comparison.read_whole(name), scans)
            .map_err(|error| error.explain())
    }
}
