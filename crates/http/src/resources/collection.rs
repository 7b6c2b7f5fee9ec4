//! The common routes of volumes, models, segmentations and templates: they are listed in pages,
//! shown one by one, and erased.
//!
//! [`Collection`] says how one kind of thing is read and shown;
//! [`routes`] serves it under `/v1/{plural}` and `/v1/{plural}/{id}`.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{
    CachedHeaders, Documented, EraseProblems, ErasureHeader, ListProblems, LookupProblems,
    UnchangedAnswer,
};
use crate::resources::erasures::{self, CascadeQuery, ReceiptBody};
use crate::resources::scan_search::ScanListQuery;
use crate::resources::scans::{self, ScanQuery};
use crate::resources::tags::TagQuery;
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::not_found::missing;
use crate::wire::problem::{Answer, Problem};
use crate::wire::query::{NoQuery, QueryReader};
use crate::wire::request::PathSegments;
use crate::wire::validators::{ValidatedJson, json};
use axum::extract::State;
use axum::http::{HeaderMap, HeaderName, HeaderValue};
use axum::routing::{delete, get};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::borrow::Cow;
use std::convert::Infallible;
use std::ops::ControlFlow;
use utoipa::openapi::path::HttpMethod;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};
use utoipa_axum::router::UtoipaMethodRouter;
use ventriform_service::base::error::ServiceError;
use ventriform_service::base::records::{
    ItemFilter, ListPage, ListRequest, Owned, Resource, StoreError, Tenant,
};
use ventriform_service::callers::Scope;
use ventriform_service::use_cases::service::Service;

/// One kind of stored thing.
pub trait Collection: 'static {
    /// The kind: its ids, its noun, its path.
    const RESOURCE_KIND: Resource;

    /// Whether a caller may give it names of its own, and search by them.
    const CARRIES_TAGS: bool = false;

    /// Whether it is of a scan, by which it is searched.
    const SEARCHED_BY_SCAN: bool = true;

    /// What is stored of it.
    type Row: Send;

    /// The row as JSON.
    type Body: Serialize + ToSchema + Send;

    /// The JSON of a row for a caller of that scope.
    ///
    /// # Errors
    /// If the row holds something that cannot be read.
    fn body(app: &App, scope: Scope, row: Owned<Self::Row>) -> Result<Self::Body, StoreError>;

    /// The tenant's row of that id, for which the request is charged.
    fn row(
        service: &Service,
        tenant: &Tenant,
        id: &str,
    ) -> impl Future<Output = Result<Option<Owned<Self::Row>>, ServiceError>> + Send;

    /// A page of the tenant's rows, newest first unless the filter says otherwise, likewise.
    fn rows(
        service: &Service,
        tenant: &Tenant,
        filter: &ItemFilter,
        page: ListRequest,
    ) -> impl Future<Output = Result<ListPage<Owned<Self::Row>>, ServiceError>> + Send;
}

/// `GET /v1/{plural}`, `GET /v1/{plural}/{id}` and `DELETE /v1/{plural}/{id}`.
pub fn routes<C: Collection>() -> [UtoipaMethodRouter<App>; 3] {
    let (noun, plural) = (C::RESOURCE_KIND.noun(), C::RESOURCE_KIND.plural());
    let label = C::RESOURCE_KIND.label();
    let operation = |method, path: &str, id, summary| {
        Documented::new(method, format!("/v1/{plural}{path}"), plural, id, summary)
    };
    let mut listing = operation(
        HttpMethod::Get,
        "",
        format!("list_{plural}"),
        format!("List {plural}"),
    )
    .parameters::<PageQuery>()
    .parameters::<CachedHeaders>()
    .json::<ListBody<C>>("A page, newest first")
    .answers::<UnchangedAnswer>()
    .answers::<ListProblems>();
    if C::CARRIES_TAGS {
        listing = listing.parameters::<TagQuery>();
    }
    if C::SEARCHED_BY_SCAN {
        listing = listing.parameters::<ScanQuery>();
    }
    if C::RESOURCE_KIND == Resource::Volume {
        listing = listing.parameters::<ScanListQuery>().description(
            "All that are stored are searched, filtered and ordered. The page's validator in `ETag` \
             tells whether anything on it has changed.",
        );
    }
    let lookup = operation(
        HttpMethod::Get,
        "/{id}",
        format!("get_{noun}"),
        format!("Show a {label}"),
    )
    .id(label)
    .parameters::<CachedHeaders>()
    .json::<C::Body>(&format!("The {label}"))
    .answers::<UnchangedAnswer>()
    .answers::<LookupProblems>();
    let mut erasure = operation(
        HttpMethod::Delete,
        "/{id}",
        format!("delete_{noun}"),
        format!("Erase a {label}"),
    )
    .description(
        "Refused while an unfinished job needs it or a legal hold keeps it. Every erasure leaves a \
         receipt, at the path in `Location`; `Prefer: return=representation` asks for it in the \
         answer.",
    )
    .id(label)
    .parameters::<ErasureHeader>()
    .json::<ReceiptBody>("Erased; the receipt")
    .empty_answer("204", "Erased")
    .answers::<EraseProblems>()
    .answers::<LookupProblems>();
    if C::RESOURCE_KIND == Resource::Volume {
        erasure = erasure.parameters::<CascadeQuery>();
    }
    [
        listing.served_by(get(list::<C>)),
        lookup.served_by(get(show::<C>)),
        erasure.served_by(delete(erase::<C>)),
    ]
}

/// The tenant's row of that id, for which the request is charged, or the 404 or 410 that says why there is none.
pub async fn find<C: Collection>(app: &App, tenant: &Tenant, id: &str) -> Answer<Owned<C::Row>> {
    let found = match Resource::from_id(id) == Some(C::RESOURCE_KIND) {
        true => C::row(&app.service, tenant, id).await?,
        false => None,
    };
    match found {
        Some(row) => Ok(row),
        None => Err(missing(app, tenant, C::RESOURCE_KIND, id).await),
    }
}

/// The header with the limits of one upload (draft-ietf-httpbis-resumable-upload), so that clients need not send what will be
/// refused.
const UPLOAD_LIMIT: HeaderName = HeaderName::from_static("upload-limit");

async fn list<C: Collection>(
    State(app): State<App>,
    caller: Caller,
    headers: HeaderMap,
    mut query: QueryReader,
) -> Answer {
    let mut filter = ItemFilter::default();
    if C::CARRIES_TAGS {
        filter.tags = query.take::<TagQuery>()?.filter(&app)?;
    }
    if C::SEARCHED_BY_SCAN {
        filter.scan = query.take::<ScanQuery>()?.into();
    }
    if C::RESOURCE_KIND == Resource::Volume {
        filter.search = query.take::<ScanListQuery>()?.search(&caller)?;
    }
    let page = query.all::<PageQuery>()?.charged().await?;
    let page = C::rows(&app.service, &caller.tenant, &filter, page).await;
    let page = page.map_err(|refused| Problem::from(refused).of_search())?;
    let next_cursor = next_cursor(&page);
    let items = page
        .items
        .into_iter()
        .map(|row| C::body(&app, caller.scope, row))
        .collect::<Result<_, _>>()?;
    let body: ListBody<C> = ListBody { items, next_cursor };
    let mut answer = json(&headers, &body)?;
    if C::RESOURCE_KIND == Resource::Volume {
        let limit = HeaderValue::from(app.service.settings().body_limit.0);
        let limit = [b"max-size=", limit.as_bytes()].concat();
        let limit = HeaderValue::from_bytes(&limit).map(|limit| (UPLOAD_LIMIT, limit));
        answer.headers_mut().extend(limit);
    }
    Ok(answer)
}

async fn show<C: Collection>(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let read = async || {
        let row = find::<C>(&app, &caller.tenant, &id).await?;
        Ok(ControlFlow::Continue(ValidatedJson::from_body(&C::body(
            &app,
            caller.scope,
            row,
        )?)?))
    };
    let asker = (&caller.tenant, scans::sees_patients(caller.scope));
    let kept = app
        .answers
        .get(&app.service, asker, C::RESOURCE_KIND, &id, read);
    let ControlFlow::<Infallible, _>::Continue(answer) = kept.await?;
    Ok(answer.answer(&headers))
}

async fn erase<C: Collection>(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    query: QueryReader,
    headers: HeaderMap,
) -> Answer {
    let cascade = match C::RESOURCE_KIND {
        Resource::Volume => query.all::<CascadeQuery>()?.cascade.unwrap_or(false),
        _ => query.all().map(|()| false)?,
    };
    erasures::erase(&app, &caller, C::RESOURCE_KIND, id, cascade, &headers).await
}

/// A page of things: `{"models": [...], "next_cursor": "..."}`.
struct ListBody<C: Collection> {
    items: Vec<C::Body>,
    next_cursor: Option<String>,
}

impl<C: Collection> Serialize for ListBody<C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(C::RESOURCE_KIND.plural(), &self.items)?;
        if let Some(cursor) = &self.next_cursor {
            map.serialize_entry("next_cursor", cursor)?;
        }
        map.end()
    }
}

impl<C: Collection> ToSchema for ListBody<C> {
    fn name() -> Cow<'static, str> {
        format!("{}List", C::Body::name()).into()
    }

    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((C::Body::name().into(), C::Body::schema()));
        C::Body::schemas(schemas);
    }
}

impl<C: Collection> PartialSchema for ListBody<C> {
    fn schema() -> RefOr<Schema> {
        let plural = C::RESOURCE_KIND.plural();
        let items = ArrayBuilder::new()
            .items(Ref::from_schema_name(C::Body::name()))
            .description(Some(format!("The {plural}, newest first.")));
        let cursor = ObjectBuilder::new()
            .schema_type(SchemaType::from_iter([Type::String, Type::Null]))
            .description(Some("`cursor` of the next page; absent on the last."));
        let page = ObjectBuilder::new()
            .description(Some(format!("A page of {plural}.")))
            .property(plural, Schema::Array(items.build()))
            .required(plural)
            .property("next_cursor", Schema::from(cursor));
        Schema::from(page).into()
    }
}
