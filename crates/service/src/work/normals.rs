//! Jobs of kind `normals`: [`ventriform::runs::evaluate::normals::of_scans`] over stored volumes. The parameter `cases` is
//! the cohort's table; each of its rows names a volume. The job's own volume is that of the first row.

use super::failures::volume_missing;
use super::limits;
use crate::base::records::{Failure, Fault, Resource};
use crate::items::{NotAdded, WorkOutput, check_name};
use crate::jobs::{GivenParameters, Needs, Work, WorkError, WorkInput};
use serde_json::{Map, Value};
use std::collections::BTreeSet;
use ventriform::base::progress::{Monitor, Plan};
use ventriform::base::text::is_printable;
use ventriform::image::volume::ReadLimits;
use ventriform::parameters::{CohortCase, NormalsParameters};
use ventriform::runs::advice::Explain;
use ventriform::runs::evaluate::normals::{
    BuildError, CohortRow, CohortScan, NormalsOptions, of_scans,
};

/// The parameter with the cohort's table.
const CASES_FIELD: &str = "cases";
/// The parameter with the name of the limits.
const NAME_FIELD: &str = "name";
/// Most rows of a table.
pub const MOST_CASES: usize = 1000;
/// Longest text of a row, bytes.
const MOST_TEXT_BYTES: usize = 200;

/// Builds normal limits.
#[derive(Debug, Clone, Copy)]
pub struct NormalsWork {
    /// Limits on each scan.
    pub limits: ReadLimits,
}

/// The parameters of a job.
struct Parameters {
    name: String,
    cases: Vec<CohortCase>,
    fits: NormalsParameters,
}

impl Parameters {
    fn from_object(object: &Map<String, Value>) -> Result<Self, Failure> {
        let mut object = object.clone();
        let name = match object.remove(NAME_FIELD) {
            None => "normals".to_owned(),
            Some(Value::String(name)) => name,
            Some(_) => return Err(wrong(NAME_FIELD, "`name` must be a text.")),
        };
        check_name(&name).map_err(|error| match error {
            NotAdded::Refused(failure) => failure,
            _ => wrong(NAME_FIELD, "The name cannot be used."),
        })?;
        let cases = match object.remove(CASES_FIELD) {
            None => return Err(wrong(CASES_FIELD, "`cases` is missing.")),
            Some(Value::Array(cases)) => cases,
            Some(_) => return Err(wrong(CASES_FIELD, "`cases` must be a list.")),
        };
        let fits = NormalsParameters::from_json(&object).map_err(|error| error.explain())?;
        Ok(Self {
            name,
            cases: table(cases)?,
            fits,
        })
    }

    fn to_json(&self) -> Map<String, Value> {
        let mut all = self.fits.to_json();
        all.insert(NAME_FIELD.into(), self.name.clone().into());
        let cases = serde_json::to_value(&self.cases);
        all.insert(CASES_FIELD.into(), cases.expect("rows are plain data"));
        all
    }
}

/// The rows of a table, checked.
fn table(rows: Vec<Value>) -> Result<Vec<CohortCase>, Failure> {
    if rows.is_empty() || rows.len() > MOST_CASES {
        let detail = format!(
            "The table has {} rows; it may have 1 to {MOST_CASES}.",
            rows.len()
        );
        return Err(wrong(CASES_FIELD, detail));
    }
    let mut names = BTreeSet::new();
    let mut cases = Vec::with_capacity(rows.len());
    for (number, row) in rows.into_iter().enumerate() {
        let place = |field: &str| format!("{CASES_FIELD}[{number}]{field}");
        let case: CohortCase = serde_json::from_value(row)
            .map_err(|error| wrong(&place(""), format!("The row cannot be read: {error}.")))?;
        for (field, text) in [
            (".case", &case.case),
            (".protocol", &case.protocol),
            (".tracer", &case.tracer),
        ] {
            if text.is_empty() || text.len() > MOST_TEXT_BYTES || !text.chars().all(is_printable) {
                let detail = format!("It must have 1 to {MOST_TEXT_BYTES} bytes, all printable.");
                return Err(wrong(&place(field), detail));
            }
        }
        if Resource::from_id(&case.volume) != Some(Resource::Volume) {
            return Err(wrong(&place(".volume"), "It is not the id of a volume."));
        }
        if !names.insert(case.case.clone()) {
            return Err(wrong(&place(".case"), "Another row has the same name."));
        }
        cases.push(case);
    }
    for (number, case) in cases.iter().enumerate() {
        if let Some(rest) = &case.rest_case
            && (!names.contains(rest) || *rest == case.case)
        {
            let detail = "No other row has this name.";
            return Err(wrong(&format!("{CASES_FIELD}[{number}].rest_case"), detail));
        }
    }
    Ok(cases)
}

fn wrong(field: &str, detail: impl Into<String>) -> Failure {
    Failure::new(Fault::Request, "invalid-field", detail)
        .at(field)
        .fix(
            "Give a list of rows such as {\"case\": \"n01\", \"volume\": \"vol_...\", \"sex\": \"F\", \"protocol\": \
             \"rest\", \"tracer\": \"Tc-99m tetrofosmin\", \"attenuation_corrected\": false, \"healthy\": true}.",
        )
}

/// The volume of the first row of `parameters`, which is the job's own.
pub fn first_volume(parameters: &Map<String, Value>) -> Option<String> {
    let first = parameters.get(CASES_FIELD)?.get(0)?;
    Some(first.get("volume")?.as_str()?.to_owned())
}

fn place_of(number: usize) -> String {
    format!("{CASES_FIELD}[{number}].volume")
}

impl Work for NormalsWork {
    fn makes(&self) -> Resource {
        Resource::Normals
    }

    fn needs(&self, parameters: &Map<String, Value>) -> Needs {
        let cases = parameters.get(CASES_FIELD).and_then(Value::as_array);
        let volumes = cases.into_iter().flatten().enumerate();
        let items = volumes.filter_map(|(number, case)| {
            let volume = case.get("volume")?.as_str()?;
            Some((place_of(number), volume.to_owned()))
        });
        Needs {
            items: items.collect(),
            library: false,
            files: &[],
        }
    }

    fn check_parameters(&self, given: GivenParameters<'_>) -> Result<Map<String, Value>, Failure> {
        match given {
            GivenParameters::Json(object) => Ok(Parameters::from_object(object)?.to_json()),
            GivenParameters::Text(_) => {
                Err(wrong(CASES_FIELD, "The table is part of a JSON body."))
            }
        }
    }

    fn check_order(
        &self,
        volume: Option<&str>,
        parameters: &Map<String, Value>,
    ) -> Result<(), Failure> {
        if volume == first_volume(parameters).as_deref() {
            return Ok(());
        }
        let detail = "The job's volume is not that of the first row of `cases`.";
        let failure = Failure::new(Fault::Request, "invalid-field", detail).at("volume");
        Err(failure.fix("POST the table to /v1/normals, or give the first row's volume."))
    }

    fn plan(&self) -> Plan {
        Plan::NORMALS
    }

    fn run(&self, input: &WorkInput, monitor: &Monitor<'_>) -> Result<WorkOutput, WorkError> {
        let Parameters { cases, fits, .. } = Parameters::from_object(&input.parameters)?;
        let scan = |(number, case): (usize, CohortCase)| {
            let place = place_of(number);
            let volume = input.items.get(&place);
            let volume = volume.ok_or_else(|| volume_missing(&place))?;
            Ok(CohortScan {
                paths: volume.files.iter().map(|file| file.to_path_buf()).collect(),
                row: CohortRow {
                    file: case.volume,
                    case: case.case,
                    sex: case.sex,
                    protocol: case.protocol,
                    tracer: case.tracer,
                    attenuation_corrected: case.attenuation_corrected,
                    healthy: case.healthy,
                    rest_case: case.rest_case,
                },
            })
        };
        let scans = cases.into_iter().enumerate().map(scan);
        let scans: Vec<CohortScan> = scans.collect::<Result<_, Failure>>()?;
        let options = NormalsOptions {
            parameters: fits,
            program_version: env!("CARGO_PKG_VERSION").to_owned(),
            limits: self.limits,
        };
        let limits =
            of_scans(&scans, &options, &|_, _| (), monitor).map_err(|error| match error {
                BuildError::Cancelled(cancelled) => cancelled.into(),
                error => WorkError::Failed(error.explain().at(CASES_FIELD)),
            })?;
        Ok(limits::output(&limits))
    }
}
