//! `/v1/readings`: what readers state of results, and the request that signs a reading.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, UploadProblems, WaitAnswers};
use crate::resources::files;
use crate::resources::jobs::filing::JsonOrder;
use crate::resources::products::{Offer, ProductCollection, body_of_product, object_paths};
use crate::wire::job_fields::ReadingFields;
use crate::wire::links::path_of;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::QueryReader;
use axum::extract::{Request, State};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use ventriform::runs::reading::{FILE_NAMES, READING_FILE};
use ventriform_service::base::records::{Product, Resource};

/// The collection of readings.
pub struct Readings;

impl ProductCollection for Readings {
    const RESOURCE_KIND: Resource = Resource::Reading;
    type Body = ReadingBody;
    const MESH_NAMES: &'static [&'static str] = &[];
    const FILE_NAMES: &'static [&'static str] = FILE_NAMES;
    const REPORT_FILE: &'static str = READING_FILE;
    const FILE_SCHEMA: &'static str = "ReadingFileName";
    const FILE_HELP: &'static str = "`measurements.dcm` and `fhir.json` are made on request; they need the scope `submit`, \
        or `deidentify=true`.";
}

body_of_product!(
    /// A reading: what a reader states of a result. It keeps the report and the pictures that were read.
    ReadingBody,
    Reading,
    ReadingLinks,
    ventriform::parameters::ReadingParameters,
    ventriform::results::report::ReadingSummary,
    "Who read, when, and the summed scores; the reading has all.",
    "rdg_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one reading.
#[derive(Serialize, ToSchema)]
struct ReadingLinks {
    /// This reading.
    #[serde(rename = "self")]
    itself: String,
    /// What was stated.
    report: String,
    /// The reading as an HTML page.
    page: String,
    /// DICOM objects, for the archive.
    dicom: Vec<String>,
    /// The structured report as FHIR resources.
    fhir: String,
    /// The result that was read.
    result: String,
    /// The reading that this one replaces.
    #[serde(skip_serializing_if = "Option::is_none")]
    amends: Option<String>,
    /// The volume; of a comparison that at stress.
    volume: String,
}

impl ReadingLinks {
    fn from_product(reading: &Product) -> Self {
        let itself = path_of(&reading.id);
        let named = |name: &str| reading.parameters.get(name).and_then(Value::as_str);
        Self {
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            dicom: object_paths(reading),
            fhir: format!("{itself}/fhir.json"),
            result: path_of(named("result").unwrap_or_default()),
            amends: named("amends").map(path_of),
            volume: path_of(reading.volume.as_deref().unwrap_or_default()),
            itself,
        }
    }
}

/// The answer that a client which waits may ask for.
fn offers() -> Vec<Offer> {
    vec![Offer::new("application/json", READING_FILE)]
}

/// Sign a reading
///
/// Files what a reader states of a comparison, a segmentation or a beat: scores, quality, limits and impression. At least
/// scores or an impression are needed. The service adds the time. A result that was read is read again by naming its newest
/// reading in `amends`; the former one is kept. The scope `sign` is needed. `send` and `to` send the structured report to an
/// archive. Texts that name the patient are refused: whose scan it is stands in every output.
#[utoipa::path(post, path = "/v1/readings", tag = "readings",
    request_body(content((openapi::ReadingRequest = "application/json"))),
    params(openapi::IdempotencyHeader, openapi::PreferHeader, openapi::WebhookSecretHeader),
    responses(openapi::ReadingAnswer, WaitAnswers, UploadProblems))]
pub async fn create_reading(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    query.all::<()>()?;
    let read = JsonOrder::read(&app, &caller, Resource::Reading, offers(), request);
    let (order, body) = read.await?;
    let stated: ReadingFields = body.all()?;
    let order = order.checked()?;
    let parameters = order.work.parameters_from_json(&given(&stated)?)?;
    order.work.check_order(None, &parameters)?;
    let signing = app.service.signing(&caller.tenant, parameters).await?;
    order.file(signing.volume, signing.parameters, &[]).await
}

/// The fields that were given, which have to name a reader.
fn given(stated: &ReadingFields) -> Answer<Map<String, Value>> {
    if stated.reader.is_none() {
        let missing = Problem::invalid_field("reader", "`reader` is missing.");
        return Err(missing.fix("Give the name of who read the result."));
    }
    match serde_json::to_value(stated) {
        Ok(Value::Object(fields)) => Ok(fields),
        _ => Ok(Map::new()),
    }
}
