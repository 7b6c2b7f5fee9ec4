//! `/dicom-web/workitems`: Unified Procedure Steps over HTTP (UPS-RS, DICOM PS3.18 section 11), as
//! the IHE profile AI Workflow for Imaging (AIW-I) uses them.
//!
//! Bodies are DICOM JSON: an array with one data set, or the data set alone. The Transaction UID of a
//! claimed item is taken from the query (`transaction-uid`, `transaction`), from the header
//! `Transaction-UID`, or from the body (0008,1195); clients differ. No answer shows it.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::quota::reserve_item;
use crate::openapi::{self, LookupProblems};
use crate::resources::erasures::{ReceiptBody, acknowledged};
use crate::wire::links::rfc3339;
use crate::wire::problem::{Answer, Problem, ProblemBody, body, shorten};
use crate::wire::public_base::public_path;
use crate::wire::query::{NoQuery, QueryReader};
use crate::wire::request::{PathSegments, bytes_of, parsed};
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{AppendHeaders, IntoResponse};
use serde::Deserialize;
use serde_json::{Map, Value};
use utoipa::IntoParams;
use ventriform::results::export::dicom::is_uid;
use ventriform_service::base::dicom_tags::{
    PROCEDURE_STEP_STATE, SOP_INSTANCE_UID, TRANSACTION_UID,
    UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE,
};
use ventriform_service::base::records::{Erased, Timestamp};
use ventriform_service::network::worklist::{
    Change, DataSetJson, Matching, Refusal, Workitem, WorkitemState, new_uid,
};
use ventriform_service::use_cases::workitems::{ChangedWorkitem, FoundWorkitems};

const MEDIA_TYPE: &str = "application/dicom+json";

/// Media types of DICOM JSON.
const JSON_TYPES: [&str; 2] = [MEDIA_TYPE, "application/json"];

/// Items of a page, unless the client asks for fewer, and at most.
const PAGE_ITEMS: (usize, usize) = (100, 1000);

/// The query of a new work item.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct WorkitemQuery {
    /// SOP Instance UID of the item
    workitem: Option<String>,
}

/// The UID that is the whole query: PS3.18 writes `?workitem=UID`, but many clients write `?UID`.
fn bare_uid(query: &QueryReader) -> Option<String> {
    query.bare().filter(|uid| is_uid(uid)).map(str::to_owned)
}

/// Create a work item
///
/// A scheduled Unified Procedure Step. Its UID is given in the query, in the body (0008,0018), or
/// made by the service. Absent attributes that a schedule needs get neutral values, which a
/// `Warning` says.
#[utoipa::path(post, path = "/dicom-web/workitems", tag = "workitems",
    operation_id = "create_workitem",
    params(WorkitemQuery),
    request_body(content = openapi::DicomJson, content_type = "application/dicom+json"),
    responses(
        (status = 201, description = "Created",
            headers(("Location" = String, description = "The item's path"))),
        (status = 409, description = "There is an item of this UID",
            body = ProblemBody, content_type = "application/problem+json"),
        openapi::WorkitemProblems))]
pub async fn create_workitem(
    State(app): State<App>,
    caller: Caller,
    query: QueryReader,
    request: Request,
) -> Answer {
    let named = match bare_uid(&query) {
        None => query.all::<WorkitemQuery>()?.workitem,
        uid => uid,
    };
    let counting = reserve_item(&app, &caller, request.headers()).await?;
    let attributes = data_set(&app, request).await?;
    let (field, named) = match named {
        None => (SOP_INSTANCE_UID, attributes.text(SOP_INSTANCE_UID)),
        Some(ref uid) => ("workitem", Some(uid.as_str())),
    };
    let uid = named.map_or_else(new_uid, str::to_owned);
    require_uid(field, &uid)?;
    let service = &app.service;
    let created = service.create_workitem(&caller.by, &uid, attributes, &counting);
    let completed = created.await?.map_err(refused)?;
    let location = [(header::LOCATION, path(&uid))];
    let warning = completed.then(|| {
        let text = "The Workitem was created with modifications.";
        (header::WARNING, warning(text))
    });
    Ok((StatusCode::CREATED, location, AppendHeaders(warning)).into_response())
}

/// Show a work item
///
/// Without its Transaction UID.
#[utoipa::path(get, path = "/dicom-web/workitems/{uid}", tag = "workitems",
    operation_id = "get_workitem",
    params(("uid" = String, Path, description = "SOP Instance UID of the item")),
    responses(
        (status = 200, description = "The item", body = openapi::DicomJson,
            content_type = "application/dicom+json"),
        openapi::ScopeProblems, LookupProblems))]
pub async fn get_workitem(
    State(app): State<App>,
    caller: Caller,
    PathSegments(uid): PathSegments<String>,
    _: NoQuery,
) -> Answer {
    let item = find(&app, &caller, &uid).await?;
    Ok(shown(StatusCode::OK, &[item.shown()]))
}

/// Erase a work item
///
/// With all that it says of the patient, in whatever state it is; whoever has claimed it finds it gone. Refused while this
/// service performs it. The receipt is at the path in `Location`; `Prefer: return=representation` asks for it in the answer.
#[utoipa::path(delete, path = "/dicom-web/workitems/{uid}", tag = "workitems",
    operation_id = "delete_workitem",
    params(("uid" = String, Path, description = "SOP Instance UID of the item"),
        openapi::ErasureHeader),
    responses(
        (status = 200, description = "Erased; the receipt", body = ReceiptBody),
        (status = 204, description = "Erased"),
        (status = 409, description = "This service performs it",
            body = ProblemBody, content_type = "application/problem+json"),
        openapi::ScopeProblems, LookupProblems))]
pub async fn delete_workitem(
    State(app): State<App>,
    caller: Caller,
    PathSegments(uid): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let erased = app.service.erase_workitem(&caller.by, &uid).await?;
    match erased {
        Erased::Done(receipt) => Ok(acknowledged(*receipt, &headers)),
        Erased::InUse | Erased::OnHold { .. } => Err(Problem::new(
            StatusCode::CONFLICT,
            "in-use",
            "This service performs the work item.",
        )
        .fix("Wait for its job to end, or DELETE the job; GET /v1/jobs lists the jobs.")),
        Erased::Unknown => Err(missing(&app, &caller, &uid).await),
    }
}

/// A search for work items, besides the attributes that are matched.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct SearchQuery {
    /// Greatest number of items
    limit: Option<usize>,
    /// Number of matching items to skip
    offset: Option<usize>,
    /// Only items in this state; any other attribute can be given likewise
    #[serde(rename = "ProcedureStepState")]
    state: Option<String>,
}

/// Search work items
///
/// Attributes are named by keyword or tag, with points between a sequence and what is in it:
/// `ProcedureStepState=SCHEDULED`, `InputInformationSequence.StudyInstanceUID=1.2.3`. `*` and `?` are
/// wildcards, `FIRST-LAST` is a range of dates. Items come with all their attributes, oldest first; a `Warning`
/// says that there are more than one answer holds, to be asked for by `offset`.
#[utoipa::path(get, path = "/dicom-web/workitems", tag = "workitems",
    operation_id = "search_workitems",
    params(SearchQuery),
    responses(
        (status = 200, description = "The items", body = openapi::DicomJson,
            content_type = "application/dicom+json"),
        (status = 204, description = "No item matches"),
        (status = 413, description = "The search takes too long",
            body = ProblemBody, content_type = "application/problem+json"),
        openapi::ScopeProblems, openapi::ListProblems))]
pub async fn search_workitems(
    State(app): State<App>,
    caller: Caller,
    mut query: QueryReader,
) -> Answer {
    let search: SearchQuery = query.take()?;
    let limit = search.limit.unwrap_or(PAGE_ITEMS.0).min(PAGE_ITEMS.1);
    let skip = search.offset.unwrap_or(0);
    let mut matching = Matching::default();
    let state = search.state.map(|it| ("ProcedureStepState".to_owned(), it));
    // All attributes are answered, and names are compared without regard to case.
    let needless = ["includefield", "fuzzymatching"];
    let mut wanted = query.rest();
    wanted.retain(|(name, _)| !needless.contains(&name.as_str()));
    for (name, value) in wanted.into_iter().chain(state) {
        matching.add(&name, &value).map_err(|error| {
            Problem::bad_request("unknown-parameter", format!("{error}."))
                .at(&error.name)
                .fix("Name attributes by keyword or tag, such as ProcedureStepState.")
        })?;
    }
    let service = &app.service;
    let found = service.search_workitems(&caller.tenant, &matching, skip, limit);
    let FoundWorkitems { text, more } = found.await?;
    if text.is_empty() {
        return Ok(StatusCode::NO_CONTENT.into_response());
    }
    let headers = [
        (header::CONTENT_TYPE, MEDIA_TYPE),
        (header::CACHE_CONTROL, "no-store"),
    ];
    // PS3.18, 8.3.4.4.
    let warning = more.then(|| {
        let text = "The number of results exceeded the maximum supported by the server. \
                    Additional results can be requested.";
        (header::WARNING, warning(text))
    });
    Ok((StatusCode::OK, headers, AppendHeaders(warning), text).into_response())
}

/// Change a work item
///
/// The attributes of the body replace those of the item. A claimed item needs the Transaction UID
/// of its claim.
#[utoipa::path(post, path = "/dicom-web/workitems/{uid}", tag = "workitems",
    operation_id = "update_workitem",
    params(("uid" = String, Path, description = "SOP Instance UID of the item"),
        TransactionQuery, openapi::TransactionHeader),
    request_body(content = openapi::DicomJson, content_type = "application/dicom+json"),
    responses((status = 200, description = "Changed"),
        openapi::WorkitemProblems, openapi::WorkitemConflict, LookupProblems))]
pub async fn update_workitem(
    State(app): State<App>,
    caller: Caller,
    PathSegments(uid): PathSegments<String>,
    query: QueryReader,
    headers: HeaderMap,
    request: Request,
) -> Answer {
    let counting = reserve_item(&app, &caller, request.headers()).await?;
    let (changes, stated) = claimed_data_set(&app, query, &headers, request).await?;
    let (service, stated) = (&app.service, stated.as_deref());
    let updated = service.update_workitem(&caller.by, &uid, stated, &changes, &counting);
    changed(&app, &caller, &uid, updated.await?).await?;
    Ok(StatusCode::OK.into_response())
}

/// Change the state of a work item
///
/// The body names the new state (0074,1000) and the Transaction UID (0008,1195). `IN PROGRESS` claims
/// the item for the performer that made up this UID; `COMPLETED` and `CANCELED` end it.
#[utoipa::path(put, path = "/dicom-web/workitems/{uid}/state", tag = "workitems",
    operation_id = "change_workitem_state",
    params(("uid" = String, Path, description = "SOP Instance UID of the item"),
        TransactionQuery, openapi::TransactionHeader),
    request_body(content = openapi::DicomJson, content_type = "application/dicom+json"),
    responses((status = 200, description = "The item is in this state"),
        openapi::WorkitemProblems, openapi::WorkitemConflict, LookupProblems))]
pub async fn change_workitem_state(
    State(app): State<App>,
    caller: Caller,
    PathSegments(uid): PathSegments<String>,
    query: QueryReader,
    headers: HeaderMap,
    request: Request,
) -> Answer {
    let (wanted, stated) = claimed_data_set(&app, query, &headers, request).await?;
    if let Some(uid) = &stated {
        require_uid(TRANSACTION_UID, uid)?;
    }
    let state = wanted
        .text(PROCEDURE_STEP_STATE)
        .and_then(WorkitemState::parse);
    let state = state.ok_or_else(|| {
        Problem::bad_request(
            "invalid-field",
            "Procedure Step State (0074,1000) is missing or unknown.",
        )
        .at(PROCEDURE_STEP_STATE)
        .fix("Give IN PROGRESS, COMPLETED or CANCELED.")
    })?;
    let done = change(&app, &caller, &uid, |item, now| {
        item.change_state(stated.as_deref(), state, now)
    });
    let already = done.await? == Change::Already;
    let warning = already.then(|| {
        let state = state.as_str();
        let text = format!("The UPS is already in the requested state of {state}.");
        (header::WARNING, warning(&text))
    });
    Ok((StatusCode::OK, AppendHeaders(warning)).into_response())
}

/// Ask to cancel a work item
///
/// A scheduled item is canceled at once. Of a claimed one, the request is noted in the Procedure Step
/// Progress Information, where its performer sees it. The body may say why.
#[utoipa::path(post, path = "/dicom-web/workitems/{uid}/cancelrequest", tag = "workitems",
    operation_id = "cancel_workitem",
    params(("uid" = String, Path, description = "SOP Instance UID of the item")),
    request_body(content = Option<openapi::DicomJson>, content_type = "application/dicom+json"),
    responses((status = 202, description = "Accepted"),
        openapi::WorkitemProblems, openapi::WorkitemConflict, LookupProblems))]
pub async fn cancel_workitem(
    State(app): State<App>,
    caller: Caller,
    PathSegments(uid): PathSegments<String>,
    _: NoQuery,
    request: Request,
) -> Answer {
    let bytes = bytes_of(request, &JSON_TYPES).await?;
    let details = if bytes.is_empty() {
        DataSetJson::default()
    } else {
        parsed(&app, bytes, parse).await?
    };
    let done = change(&app, &caller, &uid, |item, now| {
        item.request_cancel(&details, now)
    });
    let already = done.await? == Change::Already;
    let warning = already.then(|| {
        let text = "The UPS is already in the requested state of CANCELED.";
        (header::WARNING, warning(text))
    });
    Ok((StatusCode::ACCEPTED, AppendHeaders(warning)).into_response())
}

/// Changes an item, again if another change came before.
async fn change(
    app: &App,
    caller: &Caller,
    uid: &str,
    how: impl Fn(&mut Workitem, (Timestamp, &str)) -> Result<Change, Refusal>,
) -> Answer<Change> {
    let outcome = app.service.change_workitem(&caller.by, uid, how);
    changed(app, caller, uid, outcome.await?).await
}

/// The change that was made, or the problem why none was.
async fn changed(
    app: &App,
    caller: &Caller,
    uid: &str,
    outcome: ChangedWorkitem,
) -> Answer<Change> {
    match outcome {
        ChangedWorkitem::Done(change) => Ok(change),
        ChangedWorkitem::Unknown => Err(missing(app, caller, uid).await),
        ChangedWorkitem::Refused(refusal) => Err(refused(refusal)),
        ChangedWorkitem::TooLarge(limit) => Err(body::too_large(limit)),
    }
}

async fn find(app: &App, caller: &Caller, uid: &str) -> Answer<Workitem> {
    match app.service.workitem(&caller.tenant, uid).await? {
        Some(item) => Ok(item),
        None => Err(missing(app, caller, uid).await),
    }
}

/// 410 if the item was erased, else 404.
async fn missing(app: &App, caller: &Caller, uid: &str) -> Problem {
    match app.service.erased_at(&caller.tenant, uid).await {
        Ok(Some(at)) if is_uid(uid) => Problem::new(
            StatusCode::GONE,
            "gone",
            format!("The work item `{uid}` was erased at {}.", rfc3339(at)),
        )
        .fix("Create the work item again if it is still needed."),
        Ok(_) => Problem::new(
            StatusCode::NOT_FOUND,
            "not-found",
            format!("There is no work item `{}`.", shorten(uid)),
        )
        .fix("Take a UID from the list at GET /dicom-web/workitems."),
        Err(error) => error.into(),
    }
}

fn path(uid: &str) -> String {
    public_path(&format!("/dicom-web/workitems/{uid}"))
}

fn require_uid(field: &str, uid: &str) -> Answer<()> {
    if is_uid(uid) {
        Ok(())
    } else {
        Err(
            Problem::bad_request("invalid-parameter", format!("`{field}` is not a UID."))
                .at(field)
                .fix("Give numbers separated by dots, at most 64 characters."),
        )
    }
}

/// The Transaction UID under which an item is claimed, under the names that clients give it.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
#[serde(rename_all = "kebab-case")]
pub struct TransactionQuery {
    /// The Transaction UID under which the item is claimed; it may also be in the body
    transaction_uid: Option<String>,
    /// The Transaction UID under which the item is claimed; it may also be in the body
    transaction: Option<String>,
}

/// The Transaction UID of the query or of the header.
fn transaction(query: QueryReader, headers: &HeaderMap) -> Answer<Option<String>> {
    let bare = bare_uid(&query);
    if bare.is_some() {
        return Ok(bare);
    }
    let query: TransactionQuery = query.all()?;
    let header = headers
        .get("transaction-uid")
        .and_then(|value| value.to_str().ok());
    let header = header.map(str::to_owned);
    Ok(query.transaction_uid.or(query.transaction).or(header))
}

/// The data set of the body, and the Transaction UID wherever the client states it.
async fn claimed_data_set(
    app: &App,
    query: QueryReader,
    headers: &HeaderMap,
    request: Request,
) -> Answer<(DataSetJson, Option<String>)> {
    let stated = transaction(query, headers)?;
    let body = data_set(app, request).await?;
    let stated = stated.or_else(|| body.text(TRANSACTION_UID).map(str::to_owned));
    Ok((body, stated))
}

async fn data_set(app: &App, request: Request) -> Answer<DataSetJson> {
    let bytes = bytes_of(request, &JSON_TYPES).await?;
    parsed(app, bytes, parse).await
}

/// The data set in an array with one, or alone.
fn parse(bytes: &[u8]) -> Answer<DataSetJson> {
    let malformed = |reason: &str| body::malformed_json(reason);
    let value = serde_json::from_slice(bytes).map_err(|error| malformed(&error.to_string()))?;
    let object = match value {
        Value::Object(object) => Some(object),
        Value::Array(mut sets) if sets.len() == 1 => match sets.pop() {
            Some(Value::Object(object)) => Some(object),
            _ => None,
        },
        _ => None,
    };
    let object: Map<String, Value> =
        object.ok_or_else(|| malformed("DICOM JSON is an array with one data set"))?;
    DataSetJson::from_object(object).map_err(|error| {
        Problem::bad_request("malformed-dicom-json", format!("{error}."))
            .at(&error.tag)
            .fix("Send DICOM JSON (PS3.18 annex F), such as [{\"00741000\": {\"vr\": \"CS\", \"Value\": \
                [\"SCHEDULED\"]}}].")
    })
}

fn shown(status: StatusCode, sets: &[&Map<String, Value>]) -> axum::response::Response {
    let headers = [
        (header::CONTENT_TYPE, MEDIA_TYPE),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (status, headers, Json(sets)).into_response()
}

fn warning(text: &str) -> String {
    format!("299 ventriform: {text}")
}

fn refused(refusal: Refusal) -> Problem {
    let text = refusal.to_string();
    let (problem, fix) = match &refusal {
        Refusal::Attribute { tag, .. } => (
            Problem::bad_request("invalid-field", format!("{text}.")).at(*tag),
            "Correct the attribute.".to_owned(),
        ),
        Refusal::NoTransaction | Refusal::OtherTransaction => (
            Problem::new(StatusCode::CONFLICT, "transaction-uid", &text).at(TRANSACTION_UID),
            "Send the Transaction UID under which the item was claimed; whoever lost it cannot \
             change the item."
                .into(),
        ),
        Refusal::State { state } => (
            Problem::new(StatusCode::CONFLICT, "workitem-state", &text).at(PROCEDURE_STEP_STATE),
            format!("The item is {}.", state.as_str()),
        ),
        Refusal::Unfinished(_) => (
            Problem::new(StatusCode::CONFLICT, "workitem-unfinished", &text)
                .at(UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE),
            "Add what was performed by POST to the item, then complete it.".into(),
        ),
    };
    problem.fix(fix).header(header::WARNING, warning(&text))
}
