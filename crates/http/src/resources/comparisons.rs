//! `/v1/comparisons`: rest and stress of one patient, and the request that compares them.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, FileProblems, UploadProblems, WaitAnswers};
use crate::resources::files;
use crate::resources::jobs::PriorityQuery;
use crate::resources::jobs::filing::{self, JsonOrder, UploadJob};
use crate::resources::named_scan::{NamedScan, SCAN_ID_FIX, add, named_scan};
use crate::resources::products::{Offer, ProductCollection, body_of_product, object_paths};
use crate::resources::tags::TagQuery;
use crate::wire::job_fields::ComparisonFields;
use crate::wire::limits::BodyLimits;
use crate::wire::links::path_of;
use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::query::QueryReader;
use crate::wire::request::media_type;
use crate::wire::webhook_request::WebhookQuery;
use axum::extract::{Request, State};
use serde::Serialize;
use serde_json::{Map, Value};
use utoipa::ToSchema;
use ventriform::heart::comparison::WhichScan;
use ventriform::parameters::ComparisonChoice;
use ventriform::runs::rest_stress::{FILE_NAMES, mesh_of};
use ventriform_service::base::records::{Product, Resource, Tenant};

/// The collection of comparisons.
pub struct Comparisons;

const REPORT_FILE: &str = "comparison.json";
const STRESS_MESH: &str = mesh_of(WhichScan::Stress);

impl ProductCollection for Comparisons {
    const RESOURCE_KIND: Resource = Resource::Comparison;
    type Body = ComparisonBody;
    const MESH_NAMES: &'static [&'static str] = &[STRESS_MESH, mesh_of(WhichScan::Rest)];
    const MAIN_MESH: &'static str = STRESS_MESH;
    const FILE_NAMES: &'static [&'static str] = FILE_NAMES;
    const REPORT_FILE: &'static str = REPORT_FILE;
    const FILE_SCHEMA: &'static str = "ComparisonFileName";
    const FILE_HELP: &'static str = "The `.dcm` files are DICOM objects of the study of the scan at stress, made on \
        request; they need the scope `submit`, or `deidentify=true`.";
}

body_of_product!(
    /// A comparison: two scans of one patient, fitted by one model, with the main figures. Its volume is the scan at
    /// stress, its parameter `rest` the one at rest.
    ComparisonBody,
    Comparison,
    ComparisonLinks,
    ventriform::parameters::ComparisonParameters,
    ventriform::results::report::ComparisonSummary,
    "Ratio of the cavities, summed scores, what is reversible and what fixed, and flags; the report has all figures.",
    "cmp_2c26b46b68ffc68ff99b453c1d304134"
);

/// Paths of one comparison.
#[derive(Serialize, ToSchema)]
struct ComparisonLinks {
    /// This comparison.
    #[serde(rename = "self")]
    itself: String,
    /// The wall at stress, in the format that `Accept` asks for.
    mesh: String,
    /// The report.
    report: String,
    /// The report as an HTML page.
    page: String,
    /// Slices of stress above those of rest.
    slices: String,
    /// DICOM objects of the study of the scan at stress, for the archive.
    dicom: Vec<String>,
    /// The volume at stress.
    stress: String,
    /// The volume at rest.
    rest: String,
}

impl ComparisonLinks {
    fn from_product(comparison: &Product) -> Self {
        let itself = path_of(&comparison.id);
        let rest = comparison.parameters.get("rest").and_then(Value::as_str);
        Self {
            mesh: format!("{itself}/mesh"),
            report: format!("{itself}/report"),
            page: format!("{itself}/{}", files::REPORT_PAGE),
            slices: format!("{itself}/slices.png"),
            dicom: object_paths(comparison),
            stress: path_of(comparison.volume.as_deref().unwrap_or_default()),
            rest: path_of(rest.unwrap_or_default()),
            itself,
        }
    }
}

/// The answers that a client which waits for a comparison may ask for: the report, or the slices.
fn offers() -> Vec<Offer> {
    vec![
        Offer::new("application/json", REPORT_FILE),
        Offer::new("image/png", "slices.png"),
    ]
}

/// Compare rest and stress
///
/// `stress` and `rest` name volumes, or segmentations or beats of them. One model is fitted anew to both; scans that are both
/// gated become beats. Corrections of a named segmentation or beat (`center`, `axis`, `base`, `segments_from`) are kept unless
/// `parameters` state others (`stress_center`, `rest_axis`, ...). `normals` names the normal limits that score both. A form
/// has the files `stress` and `rest`, and everything else in the query. The answer is 202 with the job, or with
/// `Prefer: wait=60`, once it has ended, 200 with the report (`application/json`) or the slices of stress above those of rest.
#[utoipa::path(post, path = "/v1/comparisons", tag = "comparisons",
    request_body(content(
        (openapi::ComparisonRequest = "application/json"),
        (openapi::ComparisonForm = "multipart/form-data"))),
    params(openapi::ComparisonQuery, TagQuery, PriorityQuery,
        openapi::IdempotencyHeader,
        openapi::PreferHeader, WebhookQuery, openapi::WebhookSecretHeader),
    responses(openapi::ComparisonAnswer, WaitAnswers, FileProblems, UploadProblems))]
pub async fn create_comparison(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    mut request: Request,
) -> Answer {
    if media_type(request.headers()).as_deref() == Some("multipart/form-data") {
        let job = UploadJob {
            makes: Resource::Comparison,
            apart: &["rest"],
            offers: offers(),
        };
        return filing::file_upload(&app, &caller, job, query, request).await;
    }
    refuse_query(&app, query)?;
    let settings = app.service.settings();
    let limits = BodyLimits::of_json(settings, settings.json_limit);
    request.extensions_mut().insert(limits);
    let read = JsonOrder::read(&app, &caller, Resource::Comparison, offers(), request);
    let (order, body) = read.await?;
    let scans: ComparisonFields = body.all()?;
    let order = order.checked()?;
    let tenant = &caller.tenant;
    let (stress, of_stress) = scan_of(&app, tenant, scans.stress, WhichScan::Stress).await?;
    let mut parameters = scans.parameters;
    let (rest, of_rest) = scan_of(&app, tenant, scans.rest, WhichScan::Rest).await?;
    add(&mut parameters, "rest", rest)?;
    for (name, correction) in of_stress.into_iter().chain(of_rest) {
        parameters.entry(name).or_insert(correction);
    }
    if let Some(normals) = scans.normals {
        add(&mut parameters, "normals", normals)?;
    }
    let parameters = order.work.parameters_from_json(&parameters)?;
    let named = [("volume".into(), WhichScan::Stress.as_str().into())];
    order.file(stress, parameters, &named).await
}

/// Refuses a query beside a JSON body, in which everything is: what is wrong in it first.
fn refuse_query(app: &App, query: QueryReader) -> Answer<()> {
    let mut known = query.clone();
    known.take::<TagQuery>()?.tags(app)?;
    known.take::<PriorityQuery>()?.priority()?;
    known.take::<WebhookQuery>()?;
    let work = app.service.work_of(Resource::Comparison.noun())?;
    work.parameters_from_text(&known.rest())?;
    match query.rest().first() {
        None => Ok(()),
        Some((name, _)) => {
            let twice = format!("`{}` is in the query, and the body is JSON.", shorten(name));
            Err(Problem::bad_request("invalid-parameter", twice)
                .at(name)
                .fix("Give it in the body, parameters under `parameters`; or send both scans as a form."))
        }
    }
}

/// The scan that a field names, and what was corrected of the fit that names it, as parameters of the comparison.
async fn scan_of(
    app: &App,
    tenant: &Tenant,
    given: Option<String>,
    scan: WhichScan,
) -> Answer<(String, Map<String, Value>)> {
    let field = scan.as_str();
    let Some(id) = given else {
        let missing = format!("`{field}` is missing.");
        return Err(Problem::invalid_field(field, missing).fix(SCAN_ID_FIX));
    };
    let NamedScan { volume, fit } = named_scan(app, tenant, field, &id).await?;
    Ok((volume, ComparisonChoice::corrections_of(&fit, scan)))
}
