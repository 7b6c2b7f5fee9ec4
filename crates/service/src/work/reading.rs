//! Jobs of kind `reading`: [`ventriform::runs::reading`] over a stored result, which the parameter `result` names.

use super::comparison::REST_FIELD;
use super::failures::broken_result;
use super::models::named_item;
use super::{page, parameters};
use crate::base::records::{Failure, Fault, Resource};
use crate::items::{OutputFile, StoredItem, WorkOutput};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use ventriform::base::progress::{Monitor, Plan, Stage};
use ventriform::parameters::{Parameters, ReadingParameters};
use ventriform::results::report::{ReadKind, ReadingSummary, object};
use ventriform::runs::advice::Explain;
use ventriform::runs::reading::{FILE_NAMES, PAGE_FILES, files, read, report_file, report_of};

/// The parameter that names the result.
pub(super) const RESULT_FIELD: &str = "result";

/// Writes what a reader states of a result.
#[derive(Debug, Clone, Copy)]
pub struct ReadingWork;

/// The kind of the result with that id; `None` if such results are not read.
pub(super) fn kind_of(result: &str) -> Option<ReadKind> {
    match Resource::from_id(result)? {
        Resource::Comparison => Some(ReadKind::Comparison),
        Resource::Segmentation => Some(ReadKind::Segmentation),
        Resource::Beat => Some(ReadKind::Beat),
        _ => None,
    }
}

fn invalid(field: &str, detail: &str, fix: &str) -> Failure {
    let failure = Failure::new(Fault::Request, "invalid-field", detail);
    failure.at(field).fix(fix)
}

impl Work for ReadingWork {
    fn makes(&self) -> Resource {
        Resource::Reading
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let named = [RESULT_FIELD, REST_FIELD];
        Needs {
            items: (named.iter())
                .filter_map(|field| named_item(parameters, field))
                .collect(),
            library: false,
            files: FILE_NAMES,
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        parameters::check::<ReadingParameters>(given)
    }

    fn check_order(
        &self,
        _volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        let result = parameters.get(RESULT_FIELD).and_then(Value::as_str);
        match result.and_then(kind_of) {
            Some(_) => Ok(()),
            None => Err(invalid(
                RESULT_FIELD,
                "The result that is read is missing.",
                "Give the id of a comparison, a segmentation or a beat.",
            )),
        }
    }

    fn plan(&self) -> Plan {
        Plan::READING
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        monitor.report(Stage::Report, 0.0)?;
        let stated =
            ReadingParameters::from_json(&input.parameters).map_err(|error| error.explain())?;
        let missing = || {
            let fix = "Give the id of a result that is stored.";
            invalid(RESULT_FIELD, "The result that is read was erased.", fix)
        };
        let result = input.items.get(RESULT_FIELD).ok_or_else(missing)?;
        let kind = kind_of(&result.id).ok_or_else(missing)?;
        // The reading goes with both scans of a comparison.
        let rest = result.parameters.get(REST_FIELD).and_then(Value::as_str);
        if kind == ReadKind::Comparison && stated.rest.as_deref() != rest {
            let fix = "Give the `rest` of the comparison's parameters.";
            return Err(invalid(REST_FIELD, "It is not the volume at rest.", fix).into());
        }
        let content = |name: &str| result.read_whole(name);
        let report = content(report_file(kind)).map_err(|error| broken_result(&error))?;
        let report = report.ok_or_else(missing)?;
        let report = report_of(&report).map_err(|error| error.explain())?;
        let reading = read(&stated, kind, &report).map_err(|error| error.explain())?;
        let files = files(&reading, content).map_err(|error| broken_result(&error))?;
        monitor.report(Stage::Report, 1.0)?;
        Ok(WorkOutput {
            summary: object(&ReadingSummary::from_reading(&reading)),
            files: files.into_iter().map(OutputFile::from).collect(),
        })
    }

    fn page_files(&self) -> &'static [&'static str] {
        PAGE_FILES
    }

    fn page(&self, reading: &StoredItem, scans: &[Map<String, Value>]) -> Result<String, Failure> {
        page::reading_page(&|name| reading.read_whole(name), scans).map_err(|error| error.explain())
    }
}
