//! `/v1/keys`: the keys of the caller's tenant, for callers with the scope `admin`. The operator
//! makes the first one, and keys of other tenants, by `ventriform keys create`.

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::guard::AlreadyRecorded;
use crate::openapi::{ListProblems, LookupProblems, UploadProblems};
use crate::wire::fields::{Count, FieldReader, given};
use crate::wire::links::rfc3339;
use crate::wire::pagination::{PageQuery, next_cursor};
use crate::wire::problem::{Answer, Problem, ProblemBody, shorten};
use crate::wire::public_base::public_path;
use crate::wire::query::{Moment, NoQuery, Query};
use crate::wire::request::PathSegments;
use crate::wire::words::{ScopeName, Word};
use axum::Extension;
use axum::Json;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use ventriform_service::base::records::Timestamp;
use ventriform_service::callers::{ApiKey, Maker, Quota};
use ventriform_service::use_cases::keys::KeyOrder;

/// A key. Its secret is shown once, when it is made.
#[derive(Serialize, ToSchema)]
#[schema(as = Key)]
pub struct KeyBody {
    /// Its id.
    #[schema(example = "0123456789abcdef")]
    id: String,
    /// Its name, which says what it is for.
    #[schema(example = "scanner 2")]
    name: String,
    /// Whose items and jobs it opens.
    #[schema(example = "default")]
    tenant: String,
    /// The acts that it allows.
    scope: ScopeName,
    /// Whether it opens the service.
    state: KeyStateName,
    /// The key that has made it, if a key has: its requests count as requests of that key too.
    #[schema(example = "fedcba9876543210")]
    #[serde(skip_serializing_if = "Option::is_none")]
    made_by: Option<String>,
    /// The subject of the OpenID Connect issuer whose key it is: that made it with a token, or with a key of its own.
    #[schema(example = "contractor-7")]
    #[serde(skip_serializing_if = "Option::is_none")]
    owner: Option<String>,
    /// When it was made (RFC 3339).
    #[schema(format = DateTime)]
    created_at: String,
    /// From when on it is refused (RFC 3339).
    #[schema(format = DateTime)]
    expires_at: Option<String>,
    /// When it was revoked (RFC 3339).
    #[schema(format = DateTime)]
    revoked_at: Option<String>,
    /// Requests per minute; `null` is the service's general limit.
    requests_per_minute: Option<u64>,
    /// Bytes that its tenant may store; `null` is the service's general limit.
    stored_bytes: Option<u64>,
    /// Jobs of its tenant that may wait; `null` is the service's general limit.
    queued_jobs: Option<u64>,
    /// The key itself, to be sent as `Authorization: Bearer KEY`. Only in the answer that makes it.
    #[serde(skip_serializing_if = "Option::is_none")]
    key: Option<String>,
}

/// Whether a key opens the service.
#[derive(Serialize, ToSchema)]
#[schema(as = KeyState)]
#[serde(rename_all = "snake_case")]
enum KeyStateName {
    /// It does.
    Active,
    /// Its time is over.
    Expired,
    /// It was revoked.
    Revoked,
}

/// A page of keys.
#[derive(Serialize, ToSchema)]
pub struct KeyList {
    /// The keys, newest first.
    keys: Vec<KeyBody>,
    /// `cursor` of the next page; absent on the last.
    #[serde(skip_serializing_if = "Option::is_none")]
    next_cursor: Option<String>,
}

/// A key to be made.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewKey {
    /// Its name, which says what it is for.
    #[serde(default, deserialize_with = "given")]
    #[schema(
        required = true,
        nullable = false,
        min_length = 1,
        max_length = 80,
        example = "scanner 2"
    )]
    name: Option<String>,
    /// The acts that it allows: `read`, `submit` or `admin`.
    #[serde(default, deserialize_with = "given")]
    #[schema(value_type = String, required = true, pattern = "^(read|submit|sign|admin)$", example = "submit")]
    scope: Option<ScopeName>,
    /// From when on it is refused (RFC 3339). If absent, when the key or the token ends that makes it; never if that
    /// never ends.
    #[schema(value_type = Option<String>, format = DateTime)]
    expires_at: Option<Moment>,
    /// Requests per minute; the service's general limit if absent.
    #[schema(value_type = Option<u64>)]
    requests_per_minute: Option<Count>,
    /// Bytes that the tenant may store; the service's general limit if absent.
    #[schema(value_type = Option<u64>)]
    stored_bytes: Option<Count>,
    /// Jobs of the tenant that may wait; the service's general limit if absent.
    #[schema(value_type = Option<u64>)]
    queued_jobs: Option<Count>,
}

impl NewKey {
    fn order(self) -> Answer<KeyOrder> {
        let missing = |field: &str| {
            Problem::invalid_field(field, format!("`{field}` is missing."))
                .fix("Give a name, and one of the scopes read, submit and admin.")
        };
        let count = |given: Option<Count>| given.map(|count| count.0);
        Ok(KeyOrder {
            name: self.name.ok_or_else(|| missing("name"))?,
            scope: self.scope.ok_or_else(|| missing("scope"))?.0,
            expires_at: self.expires_at.map(|moment| moment.0),
            quota: Quota {
                requests: count(self.requests_per_minute),
                bytes: count(self.stored_bytes),
                jobs: count(self.queued_jobs),
            },
        })
    }
}

/// Make a key
///
/// For the caller's tenant. The answer is the only place where the key itself is shown. Requests with it count as
/// requests of the caller's key too, so that all keys that a key makes have together what it has. A key does not outlive
/// the key that makes it. One that is made with a token ends with the token, unless `expires_at` asks for more and the
/// operator allows it (`oidc_key_life`).
#[utoipa::path(post, path = "/v1/keys", tag = "access", operation_id = "create_key",
    request_body(content = NewKey, content_type = "application/json"),
    responses(
        (status = 201, description = "Made", body = KeyBody,
            headers(("Location" = String, description = "The key's path"))),
        UploadProblems))]
pub async fn create_key(
    State(app): State<App>,
    caller: Caller,
    _: NoQuery,
    request: Request,
) -> Answer {
    let order = FieldReader::read(&app, request)
        .await?
        .all::<NewKey>()?
        .order()?;
    let service = &app.service;
    let made = service.create_key(&caller.by, &caller.identity, order);
    let (key, text) = made.await?;
    app.guard.gate.refresh();
    let location = public_path(&format!("/v1/keys/{}", key.id));
    let body = KeyBody {
        key: Some(text),
        ..KeyBody::from_key(key, service.now())
    };
    let headers = [
        (header::LOCATION, location),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((
        StatusCode::CREATED,
        headers,
        Extension(AlreadyRecorded),
        Json(body),
    )
        .into_response())
}

/// List keys
///
/// Those of the caller's tenant, revoked ones included.
#[utoipa::path(get, path = "/v1/keys", tag = "access", operation_id = "list_keys",
    params(PageQuery),
    responses((status = 200, description = "A page, newest first", body = KeyList), ListProblems))]
pub async fn list_keys(
    State(app): State<App>,
    caller: Caller,
    Query(page): Query<PageQuery>,
) -> Answer<Json<KeyList>> {
    let page = page.charged().await?;
    let now = app.service.now();
    let page = app.service.keys(&caller.tenant, page).await?;
    let next_cursor = next_cursor(&page);
    let keys = page
        .items
        .into_iter()
        .map(|key| KeyBody::from_key(key, now));
    Ok(Json(KeyList {
        keys: keys.collect(),
        next_cursor,
    }))
}

/// Revoke a key
///
/// From now on it is refused. It stays in the list.
#[utoipa::path(delete, path = "/v1/keys/{id}", tag = "access", operation_id = "revoke_key",
    params(("id" = String, Path, description = "The key's id")),
    responses((status = 204, description = "Revoked, now or earlier"), LookupProblems))]
pub async fn revoke_key(
    State(app): State<App>,
    caller: Caller,
    PathSegments(id): PathSegments<String>,
    _: NoQuery,
) -> Answer {
    let revoked = app.service.revoke_key(&caller.by, &id);
    if !revoked.await? {
        return Err(Problem::new(
            StatusCode::NOT_FOUND,
            "not-found",
            format!("There is no key `{}`.", shorten(&id)),
        )
        .fix("Take an id from the list at GET /v1/keys."));
    }
    app.guard.gate.refresh();
    Ok((StatusCode::NO_CONTENT, Extension(AlreadyRecorded)).into_response())
}

/// Keys to revoke.
#[derive(Deserialize, IntoParams)]
#[into_params(parameter_in = Query)]
pub struct OwnerQuery {
    /// The subject whose keys they are: `owner` in the list of keys
    // An option, so that a query without it is refused by the handler.
    #[param(required = true, min_length = 1, example = "contractor-7")]
    owner: Option<String>,
}

/// The keys that were revoked.
#[derive(Serialize, ToSchema)]
pub struct RevokedKeys {
    /// Their ids; those that had been revoked before are none of them.
    #[schema(example = json!(["0123456789abcdef"]))]
    revoked: Vec<String>,
}

/// Revoke the keys of a subject
///
/// All keys of the caller's tenant that a subject of the OpenID Connect issuer has made with its tokens, and those that
/// were made with these. From now on they are refused. They stay in the list.
#[utoipa::path(delete, path = "/v1/keys", tag = "access", operation_id = "revoke_keys_of_owner",
    params(OwnerQuery),
    responses(
        (status = 200, description = "Revoked", body = RevokedKeys),
        (status = 422, description = "It is not said whose keys to revoke",
            body = ProblemBody, content_type = "application/problem+json"),
        ListProblems))]
pub async fn revoke_keys_of_owner(
    State(app): State<App>,
    caller: Caller,
    Query(OwnerQuery { owner }): Query<OwnerQuery>,
) -> Answer {
    let owner = owner.filter(|owner| !owner.is_empty()).ok_or_else(|| {
        Problem::invalid_field("owner", "`owner` is missing. Nothing was revoked.")
            .fix("Give the `owner` that GET /v1/keys shows; or DELETE /v1/keys/ID for one key.")
    })?;
    let revoked = app.service.revoke_keys_of(&caller.by, &owner).await?;
    app.guard.gate.refresh();
    Ok((Extension(AlreadyRecorded), Json(RevokedKeys { revoked })).into_response())
}

impl KeyBody {
    fn from_key(key: ApiKey, now: Timestamp) -> Self {
        use ventriform_service::callers::KeyState;
        Self {
            state: match key.state(now) {
                KeyState::Active => KeyStateName::Active,
                KeyState::Expired => KeyStateName::Expired,
                KeyState::Revoked => KeyStateName::Revoked,
            },
            scope: Word(key.scope),
            id: key.id,
            name: key.name,
            tenant: key.tenant.to_string(),
            made_by: match key.maker {
                Maker::Operator => None,
                Maker::Caller(key) => key,
            },
            owner: key.owner,
            created_at: rfc3339(key.created_at),
            expires_at: key.expires_at.map(rfc3339),
            revoked_at: key.revoked_at.map(rfc3339),
            requests_per_minute: key.quota.requests,
            stored_bytes: key.quota.bytes,
            queued_jobs: key.quota.jobs,
            key: None,
        }
    }
}
