//! Erasing, and `/v1/erasures`: the receipts that stay.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::guard::AlreadyRecorded;
use crate::openapi::{ListProblems, LookupProblems};
use crate::wire::links::{path_of, rfc3339};
use crate::wire::negotiate;
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::not_found::{missing, no_receipt};
use crate::wire::problem::{Answer, Problem};
use crate::wire::public_base::public_path;
use crate::wire::query::{NoQuery, Query};
use crate::wire::request::PathSegments;
use crate::wire::validators;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Json};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::records::{Erased, ErasureReason, Receipt, Resource};

/// The receipt of an erasure. It stays when what it names is gone, and holds no name that was given
/// to an item.
#[derive(Serialize, ToSchema)]
#[schema(as = Receipt)]
pub struct ReceiptBody {
    /// The receipt's id.
    #[schema(example = "ers_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f")]
    id: String,
    /// The item that was to be erased: its id, that of what was received, or the UID of a work item; `volumes` if volumes were
    /// selected by a filter.
    #[schema(example = "vol_9f86d081884c7d659a2feaa0c55ad015")]
    item: String,
    /// By what volumes were selected, such as `study`; never a value.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    #[schema(required = false)]
    selected_by: Vec<String>,
    /// When it was erased (RFC 3339).
    #[schema(format = DateTime)]
    erased_at: String,
    /// The name of the key that asked for it; `retention` if it had reached its age.
    erased_by: String,
    /// Why it was erased.
    reason: ReasonName,
    /// The AuditEvent that records it.
    audit_event: AuditEventName,
    /// The item, and what went with it.
    items: Vec<ErasedItemBody>,
    /// The jobs whose records went with it.
    jobs: Vec<String>,
    /// Related paths.
    links: ReceiptLinks,
}

/// Which AuditEvent records an act.
#[derive(Serialize, ToSchema)]
struct AuditEventName {
    /// Its id, as `GET /v1/audit` shows it.
    #[schema(example = "1234")]
    id: String,
    /// Its hash, which the hashes of all later events cover.
    hash: String,
}

/// Why something was erased.
#[derive(Serialize, ToSchema)]
#[schema(as = ErasureReason)]
#[serde(rename_all = "snake_case")]
enum ReasonName {
    /// Somebody asked for it.
    Request,
    /// It had reached the age that the operator has set.
    Retention,
}

/// An erased item.
#[derive(Serialize, ToSchema)]
#[schema(as = ErasedItem)]
struct ErasedItemBody {
    /// Its id.
    id: String,
    /// Whether its files were erased; not if another tenant stored the same content.
    files_erased: bool,
    /// Its files.
    files: Vec<ErasedFileBody>,
}

/// A file of an erased item.
#[derive(Serialize, ToSchema)]
#[schema(as = ErasedFile)]
struct ErasedFileBody {
    /// Its name in the store.
    name: String,
    /// Its length in bytes.
    bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    sha256: String,
}

/// Paths of one receipt.
#[derive(Serialize, ToSchema)]
struct ReceiptLinks {
    /// This receipt.
    #[serde(rename = "self")]
    itself: String,
}

/// A page of receipts.
#[derive(Serialize, ToSchema)]
pub struct ReceiptList {
    /// The receipts, newest first.
    erasures: Vec<ReceiptBody>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<Receipt> for ReceiptBody {
    fn from(receipt: Receipt) -> Self {
        let items = receipt.items.into_iter().map(|item| ErasedItemBody {
            id: item.id,
            files_erased: item.files_erased,
            files: item
                .files
                .into_iter()
                .map(|file| ErasedFileBody {
                    name: file.name,
                    bytes: file.bytes,
                    sha256: file.sha256,
                })
                .collect(),
        });
        Self {
            links: ReceiptLinks {
                itself: path(&receipt.id),
            },
            id: receipt.id,
            item: receipt.item,
            selected_by: receipt.selected_by,
            erased_at: rfc3339(receipt.erased_at),
            erased_by: receipt.erased_by,
            reason: match receipt.reason {
                ErasureReason::Request => ReasonName::Request,
                ErasureReason::Retention => ReasonName::Retention,
            },
            audit_event: AuditEventName {
                id: receipt.audit.sequence.to_string(),
                hash: receipt.audit.hash,
            },
            items: items.collect(),
            jobs: receipt.jobs,
        }
    }
}

fn path(id: &str) -> String {
    public_path(&format!("/v1/erasures/{id}"))
}

/// Whether more than a volume is erased.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct CascadeQuery {
    /// Whether to erase also the models, segmentations, beats, comparisons and templates that were made of the volume, and the records of its jobs. Unless this is true they stay: one volume may be sent again. The erasure by patient or study (DELETE /v1/volumes) takes them by default
    #[param(default = false)]
    pub cascade: Option<bool>,
}

/// A search for receipts.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReceiptQuery {
    /// Only receipts of erasing this item, also of one among volumes that were selected by a filter
    item: Option<String>,
}

/// Erases an item. 204, or 200 with the receipt if the client prefers it; `Location` is the
/// receipt's path.
///
/// # Errors
/// 404 or 410 if the caller's tenant has no such item, 409 if it must stay.
pub async fn erase(
    app: &App,
    caller: &Caller,
    kind: Resource,
    id: String,
    cascade: bool,
    headers: &HeaderMap,
) -> Answer {
    let erased = app.service.erase_item(&caller.by, kind, &id, cascade);
    match erased.await? {
        Erased::Done(receipt) => Ok(acknowledged(*receipt, headers)),
        Erased::Unknown => Err(missing(app, &caller.tenant, kind, &id).await),
        Erased::InUse => Err(Problem::new(
            StatusCode::CONFLICT,
            "in-use",
            format!("An unfinished job needs this {}.", kind.label()),
        )
        .fix("Wait for the job to end, or DELETE it; GET /v1/jobs lists the jobs.")),
        Erased::OnHold { id } => Err(on_hold(&id, kind.label())),
    }
}

/// 204, or 200 with the receipt if the client prefers it; `Location` is the receipt's path. The row of the audit trail was
/// written with the receipt.
pub fn acknowledged(receipt: Receipt, headers: &HeaderMap) -> Response {
    let location = [(header::LOCATION, path(&receipt.id))];
    if !negotiate::prefers_representation(headers) {
        let answer = (StatusCode::NO_CONTENT, location, Extension(AlreadyRecorded));
        return answer.into_response();
    }
    let applied = [("preference-applied", "return=representation")];
    let body = Json(ReceiptBody::from(receipt));
    (location, applied, Extension(AlreadyRecorded), body).into_response()
}

/// 409: a legal hold on the item `id` keeps what was to be erased.
pub fn on_hold(id: &str, what: &str) -> Problem {
    Problem::new(
        StatusCode::CONFLICT,
        "legal-hold",
        format!("A legal hold on `{id}` forbids to erase this {what}."),
    )
    .fix(format!(
        "DELETE {}/hold with a key of scope `admin` when the hold has ended.",
        path_of(id)
    ))
}

/// List receipts of erasures
#[utoipa::path(get, path = "/v1/erasures", tag = "erasures", operation_id = "list_erasures",
    params(PageQuery, ReceiptQuery),
    responses((status = 200, description = "A page, newest first", body = ReceiptList),
        ListProblems))]
pub async fn list_erasures(
    State(app): State<App>,
    caller: Caller,
    Query((page, search)): Query<(PageQuery, ReceiptQuery)>,
) -> Answer<Json<ReceiptList>> {
    let page = page.charged().await?;
    let item = search.item.as_deref();
    let page = app.service.receipts(&caller.tenant, item, page).await?;
    let next_cursor = next_cursor(&page);
    Ok(Json(ReceiptList {
        erasures: page.items.into_iter().map(ReceiptBody::from).collect(),
        next_cursor,
    }))
}

/// Show the receipt of an erasure
#[utoipa::path(get, path = "/v1/erasures/{id}", tag = "erasures", operation_id = "get_erasure",
    params(("id" = String, Path, description = "The receipt's id")),
    responses((status = 200, description = "The receipt", body = ReceiptBody), LookupProblems))]
pub async fn get_erasure(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    match app.service.receipt(&caller.tenant, &id).await? {
        Some(receipt) => validators::json(&headers, &ReceiptBody::from(receipt)),
        None => Err(no_receipt(&id)),
    }
}
