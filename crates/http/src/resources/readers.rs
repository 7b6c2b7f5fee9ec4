//! `/v1/readers`: readers' profiles, by which segmentations are drawn.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::reserve_item;
use crate::openapi::UploadProblems;
use crate::resources::products::{DownloadBody, Presented, ProductCollection, SoftwareBody};
use crate::wire::links::{added, path_of, rfc3339};
use crate::wire::problem::{Answer, ProblemBody};
use crate::wire::query::Query;
use crate::wire::request::json_bytes;
use axum::extract::{Request, State};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::Resource;
use ventriform_service::config::Size;
use ventriform_service::items::check_name;

/// Largest profile: 5000 masks with two hashes each.
pub const PROFILE_SIZE: Size = Size(1 << 20);

/// The file of a profile.
const PROFILE_FILE: &str = "profile.json";

/// The collection of readers.
pub struct Readers;

impl ProductCollection for Readers {
    const RESOURCE_KIND: Resource = Resource::Reader;
    const SEARCHED_BY_SCAN: bool = false;
    type Body = ReaderBody;
    const MESH_NAMES: &'static [&'static str] = &[];
    const FILE_NAMES: &'static [&'static str] = &[PROFILE_FILE];
    const FILE_SCHEMA: &'static str = "ReaderFileName";
    const FILE_HELP: &'static str = "The profile, as `ventriform segment --reader` takes it.";
}

/// A reader: a profile by which segmentations are drawn.
#[derive(Serialize, ToSchema)]
#[schema(as = Reader)]
pub struct ReaderBody {
    /// Derived from tenant and profile, so it is the same on every machine.
    #[schema(example = "rdr_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When it was added (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Its name.
    name: String,
    /// The content of the profile.
    #[schema(value_type = ventriform::results::report::ReaderSummary)]
    summary: Map<String, Value>,
    /// The program that added it.
    software: SoftwareBody,
    /// Its files.
    files: Vec<DownloadBody>,
    /// Related paths.
    links: ReaderLinks,
}

/// Paths of one reader.
#[derive(Serialize, ToSchema)]
struct ReaderLinks {
    /// This reader.
    #[serde(rename = "self")]
    itself: String,
    /// Its profile.
    profile: String,
}

impl From<Presented> for ReaderBody {
    fn from(presented: Presented) -> Self {
        let product = presented.product;
        let itself = path_of(&product.id);
        let name = product.parameters.get("name").and_then(Value::as_str);
        Self {
            created_at: rfc3339(product.created_at),
            name: name.unwrap_or_default().to_owned(),
            files: DownloadBody::all(&product),
            software: SoftwareBody::from_product(&product),
            links: ReaderLinks {
                profile: format!("{itself}/{PROFILE_FILE}"),
                itself,
            },
            id: product.id,
            summary: product.summary,
        }
    }
}

/// The query of a new reader.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReaderQuery {
    /// The name that reports show; not a person's name, if results leave the house
    #[param(min_length = 1, max_length = 80)]
    name: Option<String>,
}

/// Add a reader
///
/// The body is a reader's profile, as `ventriform calibrate` writes it. `reader=ID` of a segmentation then
/// draws the wall as that reader would. The same profile is added only once. Retention never erases
/// readers.
#[utoipa::path(post, path = "/v1/readers", tag = "readers",
    request_body(content = ventriform::heart::reader::ProfileDocument, content_type = "application/json"),
    params(ReaderQuery),
    responses(
        (status = 201, description = "Added", body = ReaderBody,
            headers(("Location" = String, description = "The reader's path"))),
        (status = 200, description = "Already there", body = ReaderBody,
            headers(("Location" = String, description = "The reader's path"))),
        (status = 409, description = "There are as many readers as the operator allows",
            body = ProblemBody, content_type = "application/problem+json"),
        UploadProblems,
    ))]
pub async fn create_reader(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<ReaderQuery>,
    request: Request,
) -> Answer {
    let counting = reserve_item(&app, &caller, request.headers()).await?;
    let name = query.name.as_deref().unwrap_or("reader");
    check_name(name).map_err(ServiceError::from)?;
    let tenant = &caller.tenant;
    let service = &app.service;
    service
        .require_product_room(tenant, Resource::Reader)
        .await?;
    let profile = json_bytes(request).await?;
    let added_reader =
        service.add_reader(&caller.by, tenant, name, profile, caller.quota, &counting);
    let (stored, new) = added_reader.await?;
    let body = ReaderBody::from(Presented::from_held(&app, stored));
    Ok(added(new, &body.id, &body))
}
