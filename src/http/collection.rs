//! What volumes, models, segmentations and templates have in common: they are listed in pages,
//! shown one by one, and erased.
//!
//! [`Collection`] says how one kind of thing is read from the catalogue and shown;
//! [`routes`] serves it under `/v1/{plural}` and `/v1/{plural}/{id}`.

use super::app::App;
use super::openapi::{Documented, EraseProblems, ListProblems, LookupProblems, PageParameters};
use super::pagination::{list_query, next_cursor};
use super::problem::not_found::missing;
use super::problem::{Answer, Problem};
use super::request::{PathSegments, query_pairs, refuse_unknown};
use crate::jobs::{Catalogue, Deleted, ListPage, ListRequest, Resource, StoreError};
use axum::Json;
use axum::extract::{RawQuery, State};
use axum::http::StatusCode;
use axum::routing::{delete, get};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use std::borrow::Cow;
use utoipa::openapi::path::HttpMethod;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr};
use utoipa::{PartialSchema, ToSchema};
use utoipa_axum::router::UtoipaMethodRouter;

/// One kind of stored thing.
pub trait Collection: 'static {
    /// The kind: its ids, its noun, its path.
    const RESOURCE: Resource;

    /// A row of the catalogue.
    type Row: Send;

    /// The row as JSON.
    type Body: Serialize + ToSchema + Send;

    /// The JSON of a row.
    ///
    /// # Errors
    /// If the row holds something that cannot be read.
    fn body(row: Self::Row) -> Result<Self::Body, StoreError>;

    /// The row of that id.
    fn row(
        catalogue: &dyn Catalogue,
        id: &str,
    ) -> impl Future<Output = Result<Option<Self::Row>, StoreError>> + Send;

    /// A page of rows, newest first.
    fn rows(
        catalogue: &dyn Catalogue,
        page: ListRequest,
    ) -> impl Future<Output = Result<ListPage<Self::Row>, StoreError>> + Send;
}

/// `GET /v1/{plural}`, `GET /v1/{plural}/{id}` and `DELETE /v1/{plural}/{id}`.
pub fn routes<C: Collection>() -> [UtoipaMethodRouter<App>; 3] {
    let (noun, plural) = (C::RESOURCE.noun(), C::RESOURCE.plural());
    let operation = |method, path: &str, id, summary| {
        Documented::new(method, format!("/v1/{plural}{path}"), plural, id, summary)
    };
    let listing = operation(
        HttpMethod::Get,
        "",
        format!("list_{plural}"),
        format!("List {plural}"),
    )
    .parameters::<PageParameters>()
    .json::<ListBody<C>>("A page, newest first")
    .answers::<ListProblems>();
    let lookup = operation(
        HttpMethod::Get,
        "/{id}",
        format!("get_{noun}"),
        format!("Show a {noun}"),
    )
    .id(noun)
    .json::<C::Body>(&format!("The {noun}"))
    .answers::<LookupProblems>();
    let erasure = operation(
        HttpMethod::Delete,
        "/{id}",
        format!("delete_{noun}"),
        format!("Erase a {noun}"),
    )
    .description("Refused while an unfinished job needs it.")
    .id(noun)
    .empty_answer("204", "Erased")
    .answers::<EraseProblems>()
    .answers::<LookupProblems>();
    [
        listing.served_by(get(list::<C>)),
        lookup.served_by(get(show::<C>)),
        erasure.served_by(delete(erase::<C>)),
    ]
}

/// The row of that id, or the 404 or 410 that says why there is none.
pub async fn find<C: Collection>(app: &App, id: &str) -> Answer<C::Row> {
    let catalogue = &*app.queue.catalogue;
    let found = match Resource::of(id) == Some(C::RESOURCE) {
        true => C::row(catalogue, id).await?,
        false => None,
    };
    match found {
        Some(row) => Ok(row),
        None => Err(missing(catalogue, C::RESOURCE, id).await),
    }
}

async fn list<C: Collection>(
    State(app): State<App>,
    RawQuery(query): RawQuery,
) -> Answer<Json<ListBody<C>>> {
    let (page, []) = list_query(query.as_deref(), [])?;
    let page = C::rows(&*app.queue.catalogue, page).await?;
    let next_cursor = next_cursor(&page);
    let items = page
        .items
        .into_iter()
        .map(C::body)
        .collect::<Result<_, _>>()?;
    Ok(Json(ListBody { items, next_cursor }))
}

async fn show<C: Collection>(
    State(app): State<App>,
    PathSegments(id): PathSegments<String>,
    RawQuery(query): RawQuery,
) -> Answer<Json<C::Body>> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    Ok(Json(C::body(find::<C>(&app, &id).await?)?))
}

async fn erase<C: Collection>(
    State(app): State<App>,
    PathSegments(id): PathSegments<String>,
    RawQuery(query): RawQuery,
) -> Answer<StatusCode> {
    refuse_unknown(&query_pairs(query.as_deref()), &[])?;
    let deleted = match Resource::of(&id) == Some(C::RESOURCE) {
        true => app.queue.erase(&id).await?,
        false => Deleted::Unknown,
    };
    match deleted {
        Deleted::Done => Ok(StatusCode::NO_CONTENT),
        Deleted::Unknown => Err(missing(&*app.queue.catalogue, C::RESOURCE, &id).await),
        Deleted::InUse => Err(Problem::new(
            StatusCode::CONFLICT,
            "in-use",
            format!("An unfinished job needs this {}.", C::RESOURCE.noun()),
        )
        .fix("Wait for the job to end, or DELETE it; GET /v1/jobs lists the jobs.")),
    }
}

/// A page of things: `{"models": [...], "next_cursor": "..."}`.
struct ListBody<C: Collection> {
    items: Vec<C::Body>,
    next_cursor: Option<String>,
}

impl<C: Collection> Serialize for ListBody<C> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry(C::RESOURCE.plural(), &self.items)?;
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
        let plural = C::RESOURCE.plural();
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
