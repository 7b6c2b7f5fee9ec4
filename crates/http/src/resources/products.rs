//! The common routes of models, segmentations, beats, comparisons, limits and templates beside being [`Collection`]s: a
//! mesh in several formats, files that can be downloaded, and perhaps a report.
//!
//! [`routes`] serves them under `/v1/{plural}/{id}/mesh`, `.../report` and `.../{file}`.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{
    ConditionalHeaders, DicomProblems, Documented, DownloadAnswers, FileAnswer, LookupProblems,
    MeshAnswer, ReportAnswer, ReportDocumentAnswer,
};
use crate::resources::collection::{Collection, find};
use crate::resources::files;
use crate::resources::scans::{self, ScanUidsBody};
use crate::wire::links::path_of;
use crate::wire::negotiate;
use crate::wire::problem::not_found::{missing, no_such_file};
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::{NoQuery, Query, QueryReader};
use crate::wire::request::PathSegments;
use crate::wire::response_cache::Keep;
use crate::wire::words::{PartName, Word};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderValue, StatusCode, header};
use axum::routing::get;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::convert::Infallible;
use std::marker::PhantomData;
use std::ops::ControlFlow;
use std::sync::Arc;
use utoipa::openapi::RefOr;
use utoipa::openapi::path::HttpMethod;
use utoipa::openapi::schema::{ObjectBuilder, OneOfBuilder, Schema, Type};
use utoipa::{IntoParams, PartialSchema, ToSchema};
use utoipa_axum::router::UtoipaMethodRouter;
use ventriform::results::export::{Format, Part};
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{
    ItemFilter, ListPage, ListRequest, Owned, Product, Resource, StoreError, Tenant,
};
use ventriform_service::callers::Scope;
use ventriform_service::use_cases::service::Service;
use ventriform_service::work::dicom::{self, ResultObject};

/// One kind of product.
pub trait ProductCollection: 'static {
    /// The kind: its ids, its noun, its path.
    const RESOURCE_KIND: Resource;

    /// Whether it is made of a scan, by which it is searched.
    const SEARCHED_BY_SCAN: bool = true;

    /// The product as JSON.
    type Body: From<Presented> + Serialize + ToSchema + Send;

    /// The names, without extension, of the meshes it may have in every format.
    const MESH_NAMES: &'static [&'static str] = &["mesh"];

    /// The mesh that stands for the product where only one is asked for.
    const MAIN_MESH: &'static str = "mesh";

    /// The names of the files it may have beside its meshes.
    const FILE_NAMES: &'static [&'static str];

    /// The form, as a regular expression, of further names, of which each product has as many as its scan has parts.
    const NUMBERED_FILES: Option<&'static str> = None;

    /// Whether a further name without its extension is that of a mesh, of which parts can be had.
    fn is_numbered_mesh(_stem: &str) -> bool {
        false
    }

    /// The file that holds the report; it has one if it is among its files.
    const REPORT_FILE: &'static str = "report.json";

    /// The name of the schema that lists all names of files.
    const FILE_SCHEMA: &'static str;

    /// The description of a download in the document.
    const FILE_HELP: &'static str;
}

impl<P: ProductCollection> Collection for P {
    const RESOURCE_KIND: Resource = P::RESOURCE_KIND;
    const SEARCHED_BY_SCAN: bool = P::SEARCHED_BY_SCAN;
    type Row = Product;
    type Body = P::Body;

    async fn row(
        service: &Service,
        tenant: &Tenant,
        id: &str,
    ) -> Result<Option<Owned<Product>>, ServiceError> {
        service.product(tenant, id).await
    }

    fn body(app: &App, _: Scope, product: Owned<Product>) -> Result<P::Body, StoreError> {
        Ok(Presented::from_held(app, product).into())
    }

    async fn rows(
        service: &Service,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> Result<ListPage<Owned<Product>>, ServiceError> {
        let products = service.products(tenant, P::RESOURCE_KIND, filter, page);
        products.await
    }
}

/// A product and when it will be erased.
pub struct Presented {
    /// The product.
    pub product: Product,
    /// When it will be erased (RFC 3339); `None` if it is kept.
    pub expires_at: Option<String>,
    /// The scan of its volume.
    pub scan: Option<ScanUidsBody>,
    /// Whether every `model=auto` fits it; templates only.
    pub library: bool,
}

impl Presented {
    /// A product as its tenant has it.
    pub fn from_held(app: &App, held: Owned<Product>) -> Self {
        Self {
            expires_at: app.expires_at(held.item.resource(), &held.ownership),
            scan: ScanUidsBody::from_scan(&held.ownership.scan),
            library: held.ownership.library,
            product: held.item,
        }
    }
}

/// `GET /v1/{plural}/{id}/mesh` and `GET /v1/{plural}/{id}/{file}`; and
/// `GET /v1/{plural}/{id}/report` if there are reports.
pub fn routes<P: ProductCollection>() -> Vec<UtoipaMethodRouter<App>> {
    let (noun, plural) = (P::RESOURCE_KIND.noun(), P::RESOURCE_KIND.plural());
    let label = P::RESOURCE_KIND.label();
    let download = |path: &str, id: &str, summary: String| {
        let path = format!("/v1/{plural}/{{id}}/{path}");
        Documented::new(HttpMethod::Get, path, plural, id.to_owned(), summary).id(label)
    };
    let mesh = download(
        "mesh",
        &format!("get_{noun}_mesh"),
        format!("Download a {label}'s mesh"),
    )
    .description(match P::MAIN_MESH {
        "mesh" => "In the format that `Accept` asks for; GLB if it allows any.".to_owned(),
        stem => format!("`{stem}.*` in the format that `Accept` asks for; GLB if it allows any."),
    })
    .parameters::<PartQuery>()
    .parameters::<ConditionalHeaders>()
    .answers::<MeshAnswer>();
    let mut file = download(
        "{file}",
        &format!("get_{noun}_file"),
        format!("Download one of a {label}'s files"),
    )
    .description(P::FILE_HELP);
    let names = file.refer::<FileNames<P>>();
    let mut file = file
        .segment(
            "file",
            "The file's name; `x-files` says of each what it is".into(),
            names,
        )
        .parameters::<ConditionalHeaders>()
        .answers::<FileAnswer>();
    if !P::MESH_NAMES.is_empty() {
        file = file.parameters::<PartQuery>();
    }
    if !dicom::objects(P::RESOURCE_KIND).is_empty() {
        file = file
            .parameters::<DeidentifyQuery>()
            .answers::<DicomProblems>();
    }
    let shared = |operation: Documented| {
        operation
            .answers::<DownloadAnswers>()
            .answers::<LookupProblems>()
    };
    let mut routes = vec![shared(file).served_by(get(get_file::<P>))];
    if !P::MESH_NAMES.is_empty() {
        routes.push(shared(mesh).served_by(get(get_mesh::<P>)));
    }
    if P::FILE_NAMES.contains(&P::REPORT_FILE) {
        let report = download(
            "report",
            &format!("get_{noun}_report"),
            format!("Read a {label}'s report"),
        )
        .parameters::<ConditionalHeaders>();
        let report = if P::FILE_NAMES.contains(&files::REPORT_PAGE) {
            report
                .description("JSON, or an HTML page if `Accept` prefers `text/html`.")
                .answers::<ReportAnswer>()
        } else {
            report
                .description("JSON.")
                .answers::<ReportDocumentAnswer>()
        };
        routes.push(shared(report).served_by(get(get_report::<P>)));
    }
    routes
}

/// The program that made a product.
#[derive(Serialize, ToSchema)]
#[schema(as = Software)]
pub struct SoftwareBody {
    /// The program.
    name: String,
    /// Its version.
    version: String,
}

/// A file that can be downloaded.
#[derive(Serialize, ToSchema)]
#[schema(as = Download)]
pub struct DownloadBody {
    /// The file's name.
    #[schema(example = "mesh.glb")]
    name: String,
    /// Its path.
    href: String,
    /// Its media type.
    media_type: String,
    /// Its length in bytes.
    bytes: u64,
    /// SHA-256 of its content, hexadecimal; also its `ETag`.
    sha256: String,
}

impl SoftwareBody {
    /// The program that made `product`.
    pub fn from_product(product: &Product) -> Self {
        Self {
            name: "ventriform".into(),
            version: product.software.clone(),
        }
    }
}

impl DownloadBody {
    /// All files of `product`.
    pub fn all(product: &Product) -> Vec<Self> {
        product
            .files
            .iter()
            .map(|file| Self {
                href: files::path(product, file),
                name: file.name.clone(),
                media_type: file.media_type.clone(),
                bytes: file.bytes,
                sha256: file.sha256.clone(),
            })
            .collect()
    }
}

/// Declares the JSON of a kind of product that is made of a volume: its doc comments, its name, the
/// name of its schema, the type of its links, the schemas of its parameters and of its summary,
/// what its summary holds, and an example of an id.
macro_rules! body_of_product {
    ($(#[doc = $doc:tt])+ $name:ident, $schema:ident, $links:ident, $parameters:path, $figures:path, $summary:tt, $example:tt) => {
        $(#[doc = $doc])+
        #[derive(serde::Serialize, utoipa::ToSchema)]
        #[schema(as = $schema)]
        pub struct $name {
            /// Derived from tenant, volume, parameters and mesh, so it is the same on every machine.
            #[schema(example = $example)]
            id: String,
            /// When it was made (RFC 3339).
            #[schema(format = DateTime)]
            created_at: String,
            /// When it will be erased unless it is computed again (RFC 3339); absent if it is kept.
            #[schema(format = DateTime)]
            expires_at: Option<String>,
            /// The volume it was made of.
            volume: String,
            /// The scan of that volume; absent if it is not known.
            dicom: Option<$crate::resources::scans::ScanUidsBody>,
            /// The parameters used, including every default.
            #[schema(value_type = $parameters)]
            parameters: serde_json::Map<String, serde_json::Value>,
            #[doc = $summary]
            #[schema(value_type = $figures)]
            summary: serde_json::Map<String, serde_json::Value>,
            /// The program that made it.
            software: $crate::resources::products::SoftwareBody,
            /// Its files.
            files: Vec<$crate::resources::products::DownloadBody>,
            /// Related paths.
            links: $links,
        }

        impl From<$crate::resources::products::Presented> for $name {
            fn from(presented: $crate::resources::products::Presented) -> Self {
                let product = presented.product;
                Self {
                    expires_at: presented.expires_at,
                    dicom: presented.scan,
                    created_at: $crate::wire::links::rfc3339(product.created_at),
                    volume: product.volume.clone().unwrap_or_default(),
                    software: $crate::resources::products::SoftwareBody::from_product(&product),
                    files: $crate::resources::products::DownloadBody::all(&product),
                    links: $links::from_product(&product),
                    id: product.id,
                    parameters: product.parameters,
                    summary: product.summary,
                }
            }
        }
    };
}
pub(crate) use body_of_product;

/// A media type that a client may ask for, and the file that has it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Offer {
    /// The media type.
    pub media_type: &'static str,
    /// The file's name.
    pub file: String,
}

impl Offer {
    /// `file` under `media_type`.
    pub fn new(media_type: &'static str, file: impl Into<String>) -> Self {
        Self {
            media_type,
            file: file.into(),
        }
    }

    /// The mesh of that name in every format, GLB first.
    pub fn meshes(stem: &str) -> Vec<Self> {
        Format::ALL
            .map(|format| {
                let name = format!("{stem}.{}", format.extension());
                Self::new(format.media_type(), name)
            })
            .to_vec()
    }

    /// The report of products of that kind, and the page if they have one.
    fn reports<P: ProductCollection>() -> Vec<Self> {
        let page = P::FILE_NAMES.contains(&files::REPORT_PAGE);
        let page = page.then(|| Self::new("text/html", files::REPORT_PAGE));
        std::iter::once(Self::new("application/json", P::REPORT_FILE))
            .chain(page)
            .collect()
    }
}

/// The offer that `Accept` rates highest, or the 406 that lists the offers.
pub fn choose<'a>(headers: &HeaderMap, offers: &'a [Offer]) -> Answer<&'a Offer> {
    let types: Vec<&str> = offers.iter().map(|offer| offer.media_type).collect();
    Ok(&offers[negotiate::require_offer(headers, &types)?])
}

/// The tenant's product of that id, or the 404 or 410 that says why there is none.
pub async fn find_any(app: &App, tenant: &Tenant, id: &str) -> Answer<Product> {
    match app.service.product(tenant, id).await? {
        Some(product) => Ok(product.item),
        None => {
            let resource = Resource::from_id(id).unwrap_or(Resource::Model);
            Err(missing(app, tenant, resource, id).await)
        }
    }
}

impl Keep for Arc<Product> {
    fn bytes(&self) -> usize {
        /// Of a file's record, and of an item beside its maps.
        const RECORD_BYTES: usize = 400;
        /// By how much a JSON object in memory is larger than its text.
        const IN_MEMORY: usize = 4;
        let text = |map| serde_json::to_string(map).map_or(0, |text: String| text.len());
        IN_MEMORY * (text(&self.parameters) + text(&self.summary))
            + RECORD_BYTES * (self.files.len() + 1)
    }
}

/// The tenant's product of that id, without asking the database again while nothing is written.
async fn kept<P: ProductCollection>(app: &App, tenant: &Tenant, id: &str) -> Answer<Arc<Product>> {
    let read = async || {
        let product = find::<P>(app, tenant, id).await?.item;
        Ok(ControlFlow::Continue(Arc::new(product)))
    };
    // What is used of it tells nobody whose scan it is.
    let asker = (tenant, false);
    let kept = app
        .products
        .get(&app.service, asker, P::RESOURCE_KIND, id, read);
    let ControlFlow::<Infallible, _>::Continue(product) = kept.await?;
    Ok(product)
}

/// Answers with the offered file, under the media type by which it was offered.
pub async fn send(
    app: &App,
    asker: Asker<'_>,
    product: &Product,
    offer: &Offer,
    headers: &HeaderMap,
) -> Answer {
    let mut response = send_named(app, asker, product, &offer.file, headers).await?;
    if let Some(own) = response.headers_mut().get_mut(header::CONTENT_TYPE)
        && !own.as_bytes().starts_with(offer.media_type.as_bytes())
    {
        *own = HeaderValue::from_static(offer.media_type);
    }
    Ok(response)
}

async fn get_mesh<P: ProductCollection>(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    Query(query): Query<PartQuery>,
    headers: HeaderMap,
) -> Answer {
    let Some(Word(part)) = query.part else {
        return get_offered::<P>(&app, &caller, &id, &headers, &Offer::meshes(P::MAIN_MESH)).await;
    };
    let product = kept::<P>(&app, &caller.tenant, &id).await?;
    let offers = Offer::meshes(P::MAIN_MESH);
    let offer = choose(&headers, &offers)?;
    let mut response = send_part(&app, &product, &offer.file, part, &headers).await?;
    response
        .headers_mut()
        .insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

/// The part of a mesh that is asked for.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct PartQuery {
    /// Of meshes of a left ventricle: only this part of the wall, as an open surface
    #[param(inline)]
    part: Option<PartName>,
}

/// Whether a file names the patient.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
struct DeidentifyQuery {
    // Without a default, which clients would send with every file, also with those that do not take it.
    /// Of DICOM objects: whether to remove the patient's identity (PS3.15, basic profile); of report.html: whether it names nobody. Default: false
    deidentify: Option<bool>,
}

/// Answers with one part of the mesh `name` of `product`, cut out of it now.
async fn send_part(
    app: &App,
    product: &Product,
    name: &str,
    part: Part,
    headers: &HeaderMap,
) -> Answer {
    let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
    let made = match Format::from_extension(extension) {
        Some(format) => app.service.mesh_part(product, stem, part, format).await?,
        None => None,
    };
    match made {
        None => Err(lacks_file(product, name)),
        Some(Some(file)) => files::send_derived(product, file, headers).await,
        Some(None) => Err(Problem::new(
            StatusCode::NOT_FOUND,
            "not-found",
            format!(
                "The triangles of this mesh do not say which are {}.",
                part.as_str()
            ),
        )
        .at("part")
        .fix("Leave out `part`. Meshes of left ventricles have parts.")),
    }
}

async fn get_report<P: ProductCollection>(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    get_offered::<P>(&app, &caller, &id, &headers, &Offer::reports::<P>()).await
}

/// The file among `offers` that `Accept` rates highest.
async fn get_offered<P: ProductCollection>(
    app: &App,
    caller: &Caller,
    id: &str,
    headers: &HeaderMap,
    offers: &[Offer],
) -> Answer {
    let product = kept::<P>(app, &caller.tenant, id).await?;
    let asker = Asker::new(caller);
    let mut response = send(app, asker, &product, choose(headers, offers)?, headers).await?;
    response
        .headers_mut()
        .insert(header::VARY, HeaderValue::from_static("accept"));
    Ok(response)
}

async fn get_file<P: ProductCollection>(
    State(app): State<App>,
    caller: Caller,
    PathSegments((id, name)): PathSegments<(String, String)>,
    query: QueryReader,
    headers: HeaderMap,
) -> Answer {
    let objects = dicom::made_on_request(P::RESOURCE_KIND);
    let object = objects
        .into_iter()
        .find(|object| object.file_name() == name);
    let (mut part, mut deidentify) = (None, false);
    if object.is_some() || name == files::REPORT_PAGE {
        deidentify = query.all::<DeidentifyQuery>()?.deidentify.unwrap_or(false);
    } else if is_mesh::<P>(&name) {
        part = query.all::<PartQuery>()?.part;
    } else {
        query.all::<()>()?;
    }
    let names = file_names::<P>();
    if P::NUMBERED_FILES.is_none() && !names.contains(&name) {
        return Err(no_such_file(P::RESOURCE_KIND, &name, &names));
    }
    let product = kept::<P>(&app, &caller.tenant, &id).await?;
    if let Some(Word(part)) = part {
        return send_part(&app, &product, &name, part, &headers).await;
    }
    let Some(object) = object else {
        let asker = Asker {
            deidentify,
            ..Asker::new(&caller)
        };
        return send_named(&app, asker, &product, &name, &headers).await;
    };
    if !deidentify {
        caller.require(Scope::Submit)?;
    }
    send_object(&app, &caller.tenant, &product, object, deidentify, &headers).await
}

/// Answers with a DICOM object, or with FHIR resources, which are made of the product's files and the scan of its volume.
async fn send_object(
    app: &App,
    tenant: &Tenant,
    product: &Product,
    object: ResultObject,
    deidentify: bool,
    headers: &HeaderMap,
) -> Answer {
    let service = &app.service;
    let made = service.dicom_object(tenant, product, object, deidentify);
    match made.await? {
        Some(file) => files::send_object(product, file, headers).await,
        None => Err(lacks_file(product, object.file_name())),
    }
}

/// 404: the product has no file of that name.
fn lacks_file(product: &Product, name: &str) -> Problem {
    let names: Vec<_> = product.files.iter().map(|file| file.name.clone()).collect();
    no_such_file(product.resource(), name, &names)
}

/// The paths of the DICOM objects that can be made of a product.
pub fn object_paths(product: &Product) -> Vec<String> {
    let itself = path_of(&product.id);
    let objects = dicom::objects(product.resource()).iter();
    objects
        .filter(|object| object.is_of(product))
        .map(|object| format!("{itself}/{}", object.file_name()))
        .collect()
}

/// Who asks for a file of a product.
#[derive(Clone, Copy)]
pub struct Asker<'a> {
    tenant: &'a Tenant,
    scope: Scope,
    /// Whether a page names nobody.
    deidentify: bool,
}

impl<'a> Asker<'a> {
    /// `caller`, who sees of a scan what its scope allows.
    pub fn new(caller: &'a Caller) -> Self {
        Self {
            tenant: &caller.tenant,
            scope: caller.scope,
            deidentify: false,
        }
    }

    /// Somebody who files a job of `tenant`, for which the scope `submit` is needed.
    pub fn filer(tenant: &'a Tenant) -> Self {
        Self {
            tenant,
            scope: Scope::Submit,
            deidentify: false,
        }
    }

    /// The fields of the scans that the page of `product` names: that of its volume, then those of its other scans.
    async fn sees(self, app: &App, product: &Product) -> Answer<Vec<Map<String, Value>>> {
        let mut scans = Vec::new();
        for volume in product
            .volume
            .as_deref()
            .into_iter()
            .chain(product.other_scans())
        {
            let scan = match self.deidentify {
                true => None,
                false => app.service.scan(self.tenant, volume).await?,
            };
            let shown = scan.and_then(|scan| scans::shown(&scan, self.scope));
            scans.push(shown.unwrap_or_default());
        }
        Ok(scans)
    }
}

async fn send_named(
    app: &App,
    asker: Asker<'_>,
    product: &Product,
    name: &str,
    headers: &HeaderMap,
) -> Answer {
    if let Some(file) = product.file(name) {
        return files::send(app, product, file, headers).await;
    }
    if name == files::REPORT_PAGE {
        let scans = asker.sees(app, product).await?;
        if let Some(page) = app.service.report_page(product, scans).await? {
            return files::send_page(product, page, headers).await;
        }
    }
    Err(lacks_file(product, name))
}

/// Whether a product of that kind may have a mesh of this name.
fn is_mesh<P: ProductCollection>(name: &str) -> bool {
    let (stem, extension) = name.rsplit_once('.').unwrap_or((name, ""));
    let numbered = P::is_numbered_mesh(stem) && Format::from_extension(extension).is_some();
    numbered || mesh_names::<P>().any(|mesh| mesh == name)
}

/// The names of the meshes that a product of that kind may have, in every format.
fn mesh_names<P: ProductCollection>() -> impl Iterator<Item = String> {
    P::MESH_NAMES.iter().flat_map(|name| {
        let named = |format: Format| format!("{name}.{}", format.extension());
        Format::ALL.map(named)
    })
}

/// All names of files that a product of that kind may have.
fn file_names<P: ProductCollection>() -> Vec<String> {
    let meshes = mesh_names::<P>();
    let others = P::FILE_NAMES.iter().map(|name| (*name).to_owned());
    let objects = dicom::made_on_request(P::RESOURCE_KIND).into_iter();
    let objects = objects.map(|object| object.file_name().to_owned());
    meshes.chain(others).chain(objects).collect()
}

/// The schema of [`file_names`], and of names of the form [`ProductCollection::NUMBERED_FILES`].
struct FileNames<P>(PhantomData<P>);

impl<P: ProductCollection> ToSchema for FileNames<P> {
    fn name() -> Cow<'static, str> {
        P::FILE_SCHEMA.into()
    }
}

impl<P: ProductCollection> PartialSchema for FileNames<P> {
    fn schema() -> RefOr<Schema> {
        let text = || ObjectBuilder::new().schema_type(Type::String);
        let listed = text().enum_values(Some(file_names::<P>()));
        match P::NUMBERED_FILES {
            None => Schema::from(listed).into(),
            Some(form) => OneOfBuilder::new()
                .item(listed)
                .item(text().pattern(Some(form)))
                .into(),
        }
    }
}
