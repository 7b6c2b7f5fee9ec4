//! `/v1/intake`: what other systems have sent, and what became of it, for callers with the scope
//! `admin`; and `/v1/receiving`: how much is being received, for everybody.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::openapi::{self, ListProblems, LookupProblems};
use crate::resources::erasures::{ReceiptBody, acknowledged};
use crate::wire::links::{path_of, rfc3339};
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::{Answer, Problem, ProblemBody, shorten};
use crate::wire::public_base::public_path;
use crate::wire::query::{NoQuery, Query};
use crate::wire::request::PathSegments;
use crate::wire::words::{ReceivedState, Word};
use axum::Json;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use ventriform_service::network::intake::IntakeGroup;

/// Objects that make up one volume.
#[derive(Serialize, ToSchema)]
#[schema(as = Received)]
pub struct ReceivedBody {
    /// Its id.
    #[schema(example = "rcv_019a8f4e7c2b7c3e9d5f6a7b8c9d0e1f")]
    id: String,
    /// How far it has come.
    state: ReceivedState,
    /// Study Instance UID.
    study: String,
    /// Series Instance UID.
    series: String,
    /// SOP Instance UID of an object that is a volume of its own; absent for a series of slices.
    #[serde(skip_serializing_if = "Option::is_none")]
    instance: Option<String>,
    /// Modality.
    modality: Option<String>,
    /// The values of Image Type.
    image_type: Vec<String>,
    /// How its last object came: `c-store` or `stow-rs`.
    #[schema(example = "c-store")]
    protocol: String,
    /// The AE title, or the name of the key, that sent its last object.
    sender: String,
    /// Number of its objects.
    objects: u64,
    /// Size of those that are not part of a volume, bytes.
    waiting_bytes: u64,
    /// The volume made of it.
    volume: Option<String>,
    /// The job that a rule started.
    job: Option<String>,
    /// Why it is no volume, or why its job was not started.
    error: Option<ProblemBody>,
    /// When its first object came (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// When it last changed (RFC 3339).
    #[schema(format = DateTime)]
    changed_at: String,
    /// Related paths.
    links: ReceivedLinks,
}

/// Paths of received objects.
#[derive(Serialize, ToSchema)]
struct ReceivedLinks {
    /// This entry; DELETE forgets it.
    #[serde(rename = "self")]
    itself: String,
    /// The volume.
    #[serde(skip_serializing_if = "Option::is_none")]
    volume: Option<String>,
    /// The job.
    #[serde(skip_serializing_if = "Option::is_none")]
    job: Option<String>,
}

/// A page of what was received.
#[derive(Serialize, ToSchema)]
pub struct ReceivedList {
    /// The entries, newest first.
    intake: Vec<ReceivedBody>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

impl From<IntakeGroup> for ReceivedBody {
    fn from(group: IntakeGroup) -> Self {
        Self {
            state: Word(group.state),
            study: group.study,
            series: group.series,
            instance: group.instance,
            modality: group.modality,
            image_type: group.image_type,
            protocol: group.origin.protocol.as_str().to_owned(),
            sender: group.origin.sender,
            objects: group.objects,
            waiting_bytes: group.waiting_bytes,
            error: group.failure.map(|f| Problem::from(f).into_body()),
            created_at: rfc3339(group.created_at),
            changed_at: rfc3339(group.changed_at),
            links: ReceivedLinks {
                itself: public_path(&format!("/v1/intake/{}", group.id)),
                volume: group.volume.as_deref().map(path_of),
                job: group
                    .job
                    .as_ref()
                    .map(|job| public_path(&format!("/v1/jobs/{job}"))),
            },
            volume: group.volume,
            job: group.job,
            id: group.id,
        }
    }
}

/// A search for what was received.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct ReceivedQuery {
    /// Only what is in this state
    state: Option<ReceivedState>,
}

/// List what other systems have sent
///
/// The series and objects that came by C-STORE or STOW-RS, what became of them, and why those that failed
/// are no volume.
#[utoipa::path(get, path = "/v1/intake", tag = "dicomweb", operation_id = "list_received",
    params(PageQuery, ReceivedQuery),
    responses((status = 200, description = "A page, newest first", body = ReceivedList), ListProblems))]
pub async fn list_received(
    State(app): State<App>,
    caller: Caller,
    Query((page, search)): Query<(PageQuery, ReceivedQuery)>,
) -> Answer<Json<ReceivedList>> {
    let (page, state) = (page.charged().await?, search.state.map(|word| word.0));
    let page = app.service.received(&caller.tenant, state, page).await?;
    let next_cursor = next_cursor(&page);
    Ok(Json(ReceivedList {
        intake: page.items.into_iter().map(ReceivedBody::from).collect(),
        next_cursor,
    }))
}

/// What is being received from other systems.
#[derive(Serialize, ToSchema)]
#[schema(as = Receiving)]
pub struct ReceivingBody {
    /// Number of series, and of objects that are volumes of their own, of which objects still arrive or are being read.
    series: u64,
    /// Number of their objects that have arrived.
    objects: u64,
    /// Size of these, bytes.
    bytes: u64,
}

/// Show what is being received
///
/// How much other systems are sending by C-STORE or STOW-RS that is no volume yet. It names neither patients nor
/// senders.
#[utoipa::path(get, path = "/v1/receiving", tag = "dicomweb", operation_id = "show_receiving",
    responses((status = 200, description = "How much it is", body = ReceivingBody), ListProblems))]
pub async fn show_receiving(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
) -> Answer<Json<ReceivingBody>> {
    let receiving = app.service.receiving(&caller.tenant).await?;
    Ok(Json(ReceivingBody {
        series: receiving.groups,
        objects: receiving.objects,
        bytes: receiving.bytes,
    }))
}

/// Forget what was sent
///
/// Erases the objects that are not part of a volume, and what is known of those that are: sent again, they
/// are stored again. The volume stays. The receipt is at the path in `Location`.
#[utoipa::path(delete, path = "/v1/intake/{id}", tag = "dicomweb", operation_id = "forget_received",
    params(("id" = String, Path, description = "The entry's id"), openapi::ErasureHeader),
    responses((status = 200, description = "Erased; the receipt", body = ReceiptBody),
        (status = 204, description = "Erased"), LookupProblems))]
pub async fn forget_received(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
    headers: HeaderMap,
) -> Answer {
    let erased = app.service.forget_received(&caller.by, &id).await?;
    let receipt = erased.ok_or_else(|| {
        Problem::new(
            StatusCode::NOT_FOUND,
            "not-found",
            format!("Nothing that was received has the id `{}`.", shorten(&id)),
        )
        .fix("List what was received by GET /v1/intake.")
    })?;
    Ok(acknowledged(receipt, &headers))
}
