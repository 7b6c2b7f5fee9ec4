//! `/v1/templates`: models that jobs name, and those that `model=auto` fits beside the built-in hearts.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::reserve_item;
use crate::openapi::{self, LookupProblems, UploadProblems};
use crate::resources::collection::find;
use crate::resources::products::{DownloadBody, Presented, ProductCollection, SoftwareBody};
use crate::wire::fields::{FieldReader, given};
use crate::wire::links::{added, path_of, rfc3339};
use crate::wire::problem::{Answer, Problem, ProblemBody};
use crate::wire::query::{NoQuery, Query};
use crate::wire::request::{PathSegments, bytes_of};
use crate::wire::upload::media_types::MESH_TYPES;
use crate::wire::words::{MeshFrameName, MeshUnitName, OrganName};
use axum::Json;
use axum::body::Bytes;
use axum::extract::{Request, State};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::{IntoParams, ToSchema};
use ventriform::heart::model::Organ;
use ventriform::mesh::files::MeshStatement;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{Resource, Tenant};
use ventriform_service::config::Size;
use ventriform_service::items::{TemplateSource, check_name};
use ventriform_service::use_cases::library::GivenMesh;
use ventriform_service::work::TEMPLATE_BYTES;

/// Largest mesh.
pub const MESH_SIZE: Size = Size(TEMPLATE_BYTES);

/// The collection of templates.
pub struct Templates;

impl ProductCollection for Templates {
    const RESOURCE_KIND: Resource = Resource::Template;
    const SEARCHED_BY_SCAN: bool = false;
    type Body = TemplateBody;
    const FILE_NAMES: &'static [&'static str] = &[];
    const FILE_SCHEMA: &'static str = "TemplateFileName";
    const FILE_HELP: &'static str = "The mesh in each format.";
}

/// A template: a model that jobs name, or that every `model=auto` fits.
#[derive(Serialize, ToSchema)]
#[schema(as = Template)]
pub struct TemplateBody {
    /// Derived from tenant, organ and mesh, so it is the same on every machine.
    #[schema(example = "tpl_2c26b46b68ffc68ff99b453c1d304134")]
    id: String,
    /// When it was added (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// Its name.
    name: String,
    /// The organ it shows.
    #[schema(example = "left_ventricle")]
    organ: String,
    /// Whether every `model=auto` fits it. Otherwise only jobs that name it do.
    library: bool,
    /// Counts and main figures.
    #[schema(value_type = ventriform::results::report::TemplateSummary)]
    summary: Map<String, Value>,
    /// The program that added it.
    software: SoftwareBody,
    /// Its files.
    files: Vec<DownloadBody>,
    /// Related paths.
    links: TemplateLinks,
}

/// Paths of one template.
#[derive(Serialize, ToSchema)]
struct TemplateLinks {
    /// This template.
    #[serde(rename = "self")]
    itself: String,
    /// Its mesh, in the format that `Accept` asks for.
    mesh: String,
}

impl From<Presented> for TemplateBody {
    fn from(presented: Presented) -> Self {
        let product = presented.product;
        let itself = path_of(&product.id);
        let text = |key: &str| {
            let value = product.parameters.get(key).and_then(Value::as_str);
            value.unwrap_or_default().to_owned()
        };
        Self {
            created_at: rfc3339(product.created_at),
            name: text("name"),
            organ: text("organ"),
            library: presented.library,
            files: DownloadBody::all(&product),
            software: SoftwareBody::from_product(&product),
            links: TemplateLinks {
                mesh: format!("{itself}/mesh"),
                itself,
            },
            id: product.id,
            summary: product.summary,
        }
    }
}

/// The query of a new template.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct TemplateQuery {
    /// The organ that the model shows
    #[param(value_type = Option<openapi::OrganField>, inline)]
    organ: Option<OrganName>,
    /// The name that reports show
    #[param(min_length = 1, max_length = 80)]
    name: Option<String>,
    /// Unit of the mesh, if its file does not state it. Default: mm (of glTF m), if the size is that of an organ
    #[param(inline)]
    mesh_unit: Option<MeshUnitName>,
    /// Frame of the mesh, if its file does not state it. Default: lps
    #[param(inline)]
    mesh_frame: Option<MeshFrameName>,
    /// The stored model or segmentation whose mesh is copied
    #[param(pattern = "^(mdl_|seg_)[0-9a-f]{1,64}$")]
    model: Option<String>,
    /// Whether every `model=auto` fits the template, beside the built-in hearts
    library: Option<bool>,
}

/// Add a template
///
/// The body is a closed mesh: JSON (`mesh.json` of a model, or a file written by `ventriform templates
/// build`), STL, PLY, OBJ, VTK or VTP PolyData, GLB or glTF, told by its content; `mesh_unit` and `mesh_frame`
/// state what the file does not. Or `model` names a stored model or segmentation whose mesh is copied. The same mesh
/// for the same organ is added only once. `model=auto` fits it beside the built-in hearts where a job
/// names it (`model=auto,tpl_...`), and in every job with `library=true`. Retention never erases
/// templates.
#[utoipa::path(post, path = "/v1/templates", tag = "templates",
    request_body(content = openapi::MeshDocument, content_type = "application/json"),
    params(TemplateQuery),
    responses(
        (status = 201, description = "Added", body = TemplateBody,
            headers(("Location" = String, description = "The template's path"))),
        (status = 200, description = "Already in the library", body = TemplateBody,
            headers(("Location" = String, description = "The template's path"))),
        (status = 409, description = "The library is full",
            body = ProblemBody, content_type = "application/problem+json"),
        UploadProblems,
    ))]
pub async fn create_template(
    State(app): State<App>,
    caller: Caller,
    Query(query): Query<TemplateQuery>,
    request: Request,
) -> Answer {
    let counting = reserve_item(&app, &caller, request.headers()).await?;
    let organ = query.organ.map_or(Organ::LeftVentricle, |word| word.0);
    let model = query.model.as_deref();
    let name = query.name.as_deref().or(model).unwrap_or("template");
    check_name(name).map_err(ServiceError::from)?;
    let stated = MeshStatement {
        unit: query.mesh_unit.map(|word| word.0),
        frame: query.mesh_frame.map(|word| word.0),
    };
    let tenant = &caller.tenant;
    let service = &app.service;
    service
        .require_product_room(tenant, Resource::Template)
        .await?;
    let body = bytes_of(request, &MESH_TYPES).await?;
    let (bytes, volume) = given_mesh(&app, tenant, model, body).await?;
    let mesh = GivenMesh {
        organ: organ.as_str().to_owned(),
        bytes,
        stated,
    };
    let source = TemplateSource {
        tenant,
        name,
        volume: volume.as_deref(),
        library: query.library,
    };
    let added_template = service.add_template(&caller.by, source, mesh, caller.quota, &counting);
    let (template, new) = added_template.await?;
    let body = TemplateBody::from(Presented::from_held(&app, template));
    Ok(added(new, &body.id, &body))
}

/// A JSON merge patch of a template's setting.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TemplatePatch {
    /// Whether every `model=auto` fits the template
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = Option<bool>)]
    library: Option<Option<bool>>,
}

/// Change a template's setting
///
/// A JSON merge patch (RFC 7396) of `library`: whether every `model=auto` fits it, beside the built-in
/// hearts; `null` stands for false.
#[utoipa::path(patch, path = "/v1/templates/{id}", tag = "templates",
    operation_id = "update_template",
    params(("id" = String, Path, description = "The template's id")),
    request_body(content(
        (TemplatePatch = "application/merge-patch+json"),
        (TemplatePatch = "application/json"))),
    responses((status = 200, description = "The template", body = TemplateBody),
        openapi::PatchProblems, LookupProblems))]
pub async fn update_template(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer<Json<TemplateBody>> {
    let tenant = &caller.tenant;
    find::<Templates>(&app, tenant, &id).await?;
    let patch: TemplatePatch = FieldReader::read_patch(&app, request).await?.all()?;
    if let Some(library) = patch.library {
        let library = library.unwrap_or(false);
        let set = app.service.set_library(&caller.by, &id, library);
        set.await?;
    }
    let template = find::<Templates>(&app, tenant, &id).await?;
    Ok(Json(Presented::from_held(&app, template).into()))
}

/// The mesh to be added: the body, or that of the stored `model`, with the id of its volume.
async fn given_mesh(
    app: &App,
    tenant: &Tenant,
    model: Option<&str>,
    body: Bytes,
) -> Answer<(Bytes, Option<String>)> {
    match model {
        None => Ok((body, None)),
        Some(id) if body.is_empty() => Ok(app.service.stored_mesh(tenant, id).await?),
        Some(_) => Err(Problem::bad_request(
            "contradiction",
            "The request has both a body and `model`.",
        )
        .at("model")
        .fix("Send a mesh or name a model, not both.")),
    }
}
