//! `/v1/normals`: normal limits, added as a file or built of a cohort of stored volumes.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::{reserve_item, reserve_job};
use crate::openapi::{self, FileProblems, UploadProblems};
use crate::resources::jobs::filing;
use crate::resources::products::{DownloadBody, Presented, ProductCollection, SoftwareBody};
use crate::wire::fields::FieldReader;
use crate::wire::idempotency;
use crate::wire::job_fields::{CohortFields, OrderFields};
use crate::wire::links::{added, path_of, rfc3339};
use crate::wire::problem::{Answer, ProblemBody};
use crate::wire::query::Query;
use crate::wire::request::{json_bytes, object_of, parsed};
use crate::wire::webhook_request::job_webhook;
use axum::extract::{Request, State};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};
use ventriform::heart::normals::MOST_NORMALS_BYTES;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::Resource;
use ventriform_service::config::Size;
use ventriform_service::items::check_name;
use ventriform_service::work::first_volume;

/// Largest file of normal limits.
pub const NORMALS_SIZE: Size = Size(MOST_NORMALS_BYTES as u64);

/// The file of normal limits.
const NORMALS_FILE: &str = "normals.json";

/// The collection of normal limits.
pub struct Normals;

impl ProductCollection for Normals {
    const RESOURCE_KIND: Resource = Resource::Normals;
    const SEARCHED_BY_SCAN: bool = false;
    type Body = NormalsBody;
    const MESH_NAMES: &'static [&'static str] = &[];
    const FILE_NAMES: &'static [&'static str] = &[NORMALS_FILE];
    const FILE_SCHEMA: &'static str = "NormalsFileName";
    const FILE_HELP: &'static str = "The limits, as `ventriform segment --normals` takes them and `ventriform normals build` writes them.";
}

/// Normal limits: the uptake of healthy people, by sex, protocol, tracer and attenuation correction.
#[derive(Serialize, ToSchema)]
#[schema(as = Normals)]
pub struct NormalsBody {
    /// Derived from tenant and content, so it is the same on every machine.
    #[schema(example = "nrm_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When they were added or built (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Their name.
    name: String,
    /// Their content.
    #[schema(value_type = ventriform::results::report::NormalsSummary)]
    summary: Map<String, Value>,
    /// The program that added or built them.
    software: SoftwareBody,
    /// Their files.
    files: Vec<DownloadBody>,
    /// Related paths.
    links: NormalsLinks,
}

/// Paths of normal limits.
#[derive(Serialize, ToSchema)]
struct NormalsLinks {
    /// These limits.
    #[serde(rename = "self")]
    itself: String,
    /// Their file.
    limits: String,
}

impl From<Presented> for NormalsBody {
    fn from(presented: Presented) -> Self {
        let product = presented.product;
        let itself = path_of(&product.id);
        let name = product.parameters.get("name").and_then(Value::as_str);
        Self {
            created_at: rfc3339(product.created_at),
            name: name.unwrap_or_default().to_owned(),
            files: DownloadBody::all(&product),
            software: SoftwareBody::from_product(&product),
            links: NormalsLinks {
                limits: format!("{itself}/{NORMALS_FILE}"),
                itself,
            },
            id: product.id,
            summary: product.summary,
        }
    }
}

/// The query of new normal limits.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct NormalsQuery {
    /// The name of a file of limits that is added; a cohort has its name in the body
    #[param(min_length = 1, max_length = 80)]
    name: Option<String>,
}

/// Add or build normal limits
///
/// The body is a file of limits, as `ventriform normals build` writes it: it is added, the same file only once. Or the body is
/// a cohort: `cases`, a table of healthy people's stored volumes. A job then fits every scan, leaves out with the reason what
/// cannot be used, and builds the limits of each group; a group needs 12 cases, 30 or more give steady limits. Jobs name
/// limits in their parameter `normals`. Retention never erases limits, and they do not go with the volumes of which they were
/// built: they are statistics, and name cases as the table does.
#[utoipa::path(post, path = "/v1/normals", tag = "normals",
    request_body(content((openapi::NormalsRequest = "application/json"))),
    params(NormalsQuery, openapi::IdempotencyHeader),
    responses(
        (status = 201, description = "Added", body = NormalsBody,
            headers(("Location" = String, description = "The limits' path"))),
        (status = 200, description = "Already there", body = NormalsBody,
            headers(("Location" = String, description = "The limits' path"))),
        (status = 202, description = "A job to build them is accepted", body = crate::resources::jobs::JobBody, headers(
            ("Location" = String, description = "The job's path"),
            ("Retry-After" = u64, description = "Seconds to wait before asking for its state"))),
        (status = 409, description = "There are as many as the operator allows",
            body = ProblemBody, content_type = "application/problem+json"),
        FileProblems, UploadProblems,
    ))]
pub async fn create_normals(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<NormalsQuery>,
    request: Request,
) -> Answer {
    let service = &app.service;
    let tenant = &caller.tenant;
    let headers = request.headers().clone();
    let trace_parent = crate::edge::observe::trace_parent(&request);
    let counting = reserve_item(&app, &caller, &headers).await?;
    let name = query.name.as_deref().unwrap_or("normals");
    check_name(name).map_err(ServiceError::from)?;
    // A repeated request gets its job, whatever has become of the library.
    let key = idempotency::key(&headers)?;
    if !service.is_filed(tenant, key.as_deref()).await? {
        service
            .require_product_room(tenant, Resource::Normals)
            .await?;
    }
    let bytes = json_bytes(request).await?;
    // A table is short; whatever is longer is read as limits, under the budget of decoding.
    let table_limit = app.service.settings().json_limit.as_usize();
    let object = if bytes.len() <= table_limit {
        Some(parsed(&app, bytes.clone(), object_of).await?)
    } else {
        None
    };
    let Some(object) = object.filter(|object| !object.contains_key("format")) else {
        let added_normals =
            service.add_normals(&caller.by, tenant, name, bytes, caller.quota, &counting);
        let (stored, new) = added_normals.await?;
        let body = NormalsBody::from(Presented::from_held(&app, stored));
        return Ok(added(new, &body.id, &body));
    };
    drop(counting);
    let counting = reserve_job(&app, &caller, &headers).await?;
    let mut body = FieldReader::from_object(object);
    let order: OrderFields = body.take()?;
    let cohort: CohortFields = body.all()?;
    let work = service.work_of(Resource::Normals.noun())?;
    let (mut order, webhook) = order.order(&app, &caller, &headers, trace_parent)?;
    let mut parameters = cohort.parameters;
    for (field, value) in [("name", cohort.name), ("cases", cohort.cases)] {
        parameters.extend(value.map(|value| (field.to_owned(), value)));
    }
    let parameters = work.parameters_from_json(&parameters)?;
    let volume = first_volume(&parameters);
    if let Some(webhook) = webhook {
        order.webhook = Some(job_webhook(&app, webhook).await?);
    }
    let filed = service.file_job(work, volume, parameters, order, &counting);
    let filed = filed.await;
    let filed = filed.map_err(|error| error.naming("volume", "cases[0].volume"))?;
    filing::accepted(&app, filed).await
}
