//! `/v1/serials`: scans of one patient over the years, and the request that compares them.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, UploadProblems, WaitAnswers};
use crate::resources::files;
use crate::resources::jobs::filing::JsonOrder;
use crate::resources::named_scan::{add, named_scan};
use crate::resources::products::{Offer, ProductCollection, body_of_product, object_paths};
use crate::wire::job_fields::SerialFields;
use crate::wire::links::path_of;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::QueryReader;
use axum::extract::{Request, State};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;
use ventriform::runs::serial::{FILE_NAMES, NUMBERED_FILE_PATTERN, SCAN_COUNTS, is_scan_mesh};
use ventriform_service::base::records::{Product, Resource, Tenant};

/// The collection of serial comparisons.
pub struct Serials;

const REPORT_FILE: &str = "serial.json";
/// The mesh that stands for a serial comparison where one is asked for: the wall in the first scan.
const FIRST_MESH: &str = "mesh_scan01";

impl ProductCollection for Serials {
    const RESOURCE_KIND: Resource = Resource::Serial;
    type Body = SerialBody;
    const MESH_NAMES: &'static [&'static str] = &[FIRST_MESH];
    const MAIN_MESH: &'static str = FIRST_MESH;
    const FILE_NAMES: &'static [&'static str] = FILE_NAMES;
    const NUMBERED_FILES: Option<&'static str> = Some(NUMBERED_FILE_PATTERN);

    fn is_numbered_mesh(stem: &str) -> bool {
        is_scan_mesh(stem)
    }

    const REPORT_FILE: &'static str = REPORT_FILE;
    const FILE_SCHEMA: &'static str = "SerialFileName";
    const FILE_HELP: &'static str = "All meshes have the same nodes and triangles. The numbers of scans count from 01 in \
        the order of the report. `measurements.dcm` and `fhir.json` are made on request; they need the scope `submit`, or \
        `deidentify=true`.";
}

body_of_product!(
    /// A serial comparison: scans of one patient, fitted from one common heart, with the main figures. Its volume is the
    /// first scan of the request, its parameter `others` the others.
    SerialBody,
    Serial,
    SerialLinks,
    ventriform::parameters::SerialParameters,
    ventriform::results::report::SerialSummary,
    "What changed from the first to the last scan, and flags; the report has all figures.",
    "ser_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one serial comparison.
#[derive(Serialize, ToSchema)]
struct SerialLinks {
    /// This serial comparison.
    #[serde(rename = "self")]
    itself: String,
    /// The wall in the first scan, in the format that `Accept` asks for.
    mesh: String,
    /// The report.
    report: String,
    /// The report as an HTML page.
    page: String,
    /// The figures of all scans, drawn.
    trend: String,
    /// DICOM objects of the study of the last scan, for the archive.
    dicom: Vec<String>,
    /// The volumes, in the order of the request.
    volumes: Vec<String>,
}

impl SerialLinks {
    fn from_product(serial: &Product) -> Self {
        let itself = path_of(&serial.id);
        let others = serial.parameters.get("others").and_then(Value::as_str);
        let others = others.into_iter().flat_map(|ids| ids.split(','));
        let volumes = serial.volume.as_deref().into_iter().chain(others);
        Self {
            mesh: format!("{itself}/mesh"),
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            trend: format!("{itself}/trend.svg"),
            dicom: object_paths(serial),
            volumes: volumes.map(path_of).collect(),
            itself,
        }
    }
}

/// The answers that a client which waits may ask for: the report, or the trend.
fn offers() -> Vec<Offer> {
    vec![
        Offer::new("application/json", REPORT_FILE),
        Offer::new("image/svg+xml", "trend.svg"),
    ]
}

/// Compare scans of one patient over the years
///
/// `scans` names 2 to 20 volumes, or segmentations or beats of them, in any order: dates of their headers order them. All are
/// at rest or all at stress, of one tracer. All are fitted anew from one common heart; if all are gated, they become beats.
/// `normals` names the normal limits that score all. The answer is 202 with the job, or with `Prefer: wait=60`, once it has
/// ended, 200 with the report (`application/json`) or the trend (`image/svg+xml`).
#[utoipa::path(post, path = "/v1/serials", tag = "serials",
    request_body(content((openapi::SerialRequest = "application/json"))),
    params(openapi::IdempotencyHeader, openapi::PreferHeader, openapi::WebhookSecretHeader),
    responses(openapi::SerialAnswer, WaitAnswers, UploadProblems))]
pub async fn create_serial(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    query.all::<()>()?;
    let read = JsonOrder::read(&app, &caller, Resource::Serial, offers(), request);
    let (order, body) = read.await?;
    let given: SerialFields = body.all()?;
    let order = order.checked()?;
    let mut volumes = volumes_of(&app, &caller.tenant, given.scans).await?;
    let first = volumes.remove(0);
    let named = (0..volumes.len()).map(|n| (format!("others[{n}]"), format!("scans[{}]", n + 1)));
    let named: Vec<_> = named
        .chain([("volume".into(), "scans[0]".into())])
        .collect();
    let mut parameters = given.parameters;
    add(&mut parameters, "others", volumes.join(","))?;
    if let Some(normals) = given.normals {
        add(&mut parameters, "normals", normals)?;
    }
    let parameters = order.work.parameters_from_json(&parameters)?;
    order.file(first, parameters, &named).await
}

/// The volumes that `scans` names, each once.
async fn volumes_of(app: &App, tenant: &Tenant, scans: Option<Vec<String>>) -> Answer<Vec<String>> {
    const FIX: &str = "Give the ids of 2 to 20 stored volumes, segmentations or beats of one patient, each scan once.";
    let scans = scans.unwrap_or_default();
    if !SCAN_COUNTS.contains(&scans.len()) {
        let detail = format!("`scans` has {} entries.", scans.len());
        return Err(Problem::invalid_field("scans", detail).fix(FIX));
    }
    let mut volumes: Vec<String> = Vec::with_capacity(scans.len());
    for (place, id) in scans.iter().enumerate() {
        let field = format!("scans[{place}]");
        let volume = named_scan(app, tenant, &field, id).await?.volume;
        if volumes.contains(&volume) {
            let twice = format!("`{field}` names a scan that stands before it.");
            return Err(Problem::invalid_field(&field, twice).fix(FIX));
        }
        volumes.push(volume);
    }
    Ok(volumes)
}
