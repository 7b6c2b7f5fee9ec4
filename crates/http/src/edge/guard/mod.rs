//! The layer before every handler: a request passes only with credentials that allow it.
//!
//! 1. [`hosts`]: the `Host` header must name this service (against DNS rebinding), and a page of
//!    another site cannot change anything on a service that asks nobody who they are.
//!    Headers that a request has at most once are refused if it has two ([`SINGLE_HEADERS`]): one part of the way
//!    may have looked at the first, another at the last.
//! 2. The `Authorization` header tells the caller, see [`ventriform_service::callers::Gate`]; without a valid one the
//!    answer is
//!    401. [`is_open_path`] names the paths that everybody may read.
//! 3. The caller's requests are counted, also as those of the keys that have made its key: 429 beyond the quota. Every
//!    answer carries `RateLimit` and `RateLimit-Policy` (draft-ietf-httpapi-ratelimit-headers-10).
//! 4. The scope must include what method and path need: 403 if not.
//! 5. From here on, its memory is charged to its tenant and client ([`crate::wire::memory`]). Handlers that add something
//!    reserve it under the tenant's quotas ([`crate::edge::quota`]).
//! 6. What changes something is recorded where that is done, by the caller's agent ([`Caller::by`]); after the handler,
//!    [`trail`] records the rest: what was read and refused. An act that changed something is answered when its event
//!    is on disk.
//!
//! 7. An answer that lasts ends when the credentials of its request do ([`CredentialWatch`]), and so does a wait for a
//!    job.
//!
//! `Authorization` decides alone; a caller's address or a forwarded header never does.

pub mod hosts;
pub mod pages;
pub mod state;

mod erased;
mod trail;

pub use trail::AlreadyRecorded;

use crate::app::App;
use crate::edge::caller::Caller;
use crate::edge::watch::CredentialWatch;
use crate::wire::client::ClientAddress;
use crate::wire::memory::{Ledger, answered};
use crate::wire::problem::{Answer, Problem};
use axum::extract::{MatchedPath, Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::sync::Arc;
use std::time::Instant;
use ventriform_service::callers::{Allowance, Identity, Refusal, Scope};
use ventriform_service::config::Settings;

const RATE_LIMIT: HeaderName = HeaderName::from_static("ratelimit");
const RATE_LIMIT_POLICY: HeaderName = HeaderName::from_static("ratelimit-policy");

/// The headers that a request has at most once.
const SINGLE_HEADERS: [HeaderName; 9] = [
    header::AUTHORIZATION,
    header::CONTENT_TYPE,
    header::CONTENT_ENCODING,
    header::IF_RANGE,
    header::RANGE,
    HeaderName::from_static("idempotency-key"),
    HeaderName::from_static("last-event-id"),
    HeaderName::from_static("transaction-uid"),
    HeaderName::from_static("webhook-secret"),
];

/// Refuses a request that has one of [`SINGLE_HEADERS`] twice.
fn check_single(headers: &HeaderMap) -> Answer<()> {
    if headers.len() == headers.keys_len() {
        return Ok(());
    }
    let repeated = |name: &&HeaderName| headers.get_all(*name).iter().nth(1).is_some();
    match SINGLE_HEADERS.iter().find(repeated) {
        None => Ok(()),
        Some(name) => Err(Problem::bad_request(
            "repeated-header",
            format!("The request has the header `{name}` more than once."),
        )
        .at(name.as_str())
        .fix("Send it once; look whether a proxy adds one of its own.")),
    }
}

/// The paths under which everything needs the scope `admin`.
const ADMIN_PATHS: [&str; 5] = [
    "/v1/keys",
    "/v1/audit",
    "/v1/webhooks",
    "/v1/intake",
    "/v1/volumes/{id}/hold",
];

/// The changes by which much goes at once: they need the scope `admin`, although others on the same path do not.
const ADMIN_CHANGES: [(Method, &str); 1] = [(Method::DELETE, "/v1/volumes")];

/// The changes of what a reader signs: they need the scope `sign`.
const SIGNED_CHANGES: [(Method, &str); 2] = [
    (Method::POST, "/v1/readings"),
    (Method::DELETE, "/v1/readings/{id}"),
];

/// The paths under which everything needs at least the scope `submit`: they tell whose scans are
/// stored.
const PATIENT_PATHS: [&str; 2] = ["/v1/volumes/{id}/identity", "/dicom-web/workitems"];

/// Whether everybody may read this path: health, the page for people and the documentation. They
/// show nothing that is stored.
fn is_open_path(path: &str, settings: &Settings) -> bool {
    matches!(
        path,
        "/" | "/healthz" | "/readyz" | "/openapi.json" | "/docs" | "/docs/" | "/favicon.ico"
    ) || path.starts_with("/assets/")
        || path.starts_with("/examples/")
        || (settings.open_metrics && path == "/metrics")
}

/// The scope needed for this method on this path. `route` is the pattern of the path.
fn needed(method: &Method, route: Option<&str>) -> Scope {
    let below = |path: &&str| {
        let rest = route.and_then(|route| route.strip_prefix(*path));
        rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
    };
    let at = |(changing, path): &(Method, &str)| changing == method && route == Some(*path);
    if ADMIN_PATHS.iter().any(below) || ADMIN_CHANGES.iter().any(at) {
        return Scope::Admin;
    }
    if SIGNED_CHANGES.iter().any(at) {
        return Scope::Sign;
    }
    if method.is_safe() && !PATIENT_PATHS.iter().any(below) {
        Scope::Read
    } else {
        Scope::Submit
    }
}

/// The layer; see the module.
pub async fn guard(State(app): State<App>, request: Request, next: Next) -> Response {
    if let Err(problem) = check_single(request.headers()) {
        return problem.into_response();
    }
    if is_open_path(request.uri().path(), app.service.settings()) && request.method().is_safe() {
        return next.run(request).await;
    }
    // A body cannot be shared between threads, so only the head is lent to what waits.
    let (mut request, body) = request.into_parts();
    let address = ClientAddress::current().to_string();
    let identity = match identify(&app, &request, &address).await {
        Ok(identity) => Arc::new(identity),
        Err(problem) => return problem.into_response(),
    };
    let allowance = count(&app, &identity, &address);
    let answer = match allowance.filter(|allowance| !allowance.allowed) {
        Some(refused) => Err(too_many_requests(&refused)),
        None => admit(&app, &identity, &address, &mut request).await,
    };
    let mut response = match answer {
        Ok(act) => {
            // Anonymous callers have only their address.
            let tenant = identity.account.as_ref().map(|_| &identity.tenant);
            let ledger = Ledger::new(app.service.memory(), tenant);
            let answer = next.run(Request::from_parts(request, body));
            let response = ledger.clone().scope(answer).await;
            match answered(&ledger, response).await {
                Ok(response) => {
                    let item = act.object();
                    let response = erased::settled(&app, &identity.tenant, item, response).await;
                    act.record(&app, response).await
                }
                Err(problem) => problem.into_response(),
            }
        }
        Err(problem) => problem.into_response(),
    };
    if let Some(allowance) = allowance {
        add_limits(&mut response, &allowance);
    }
    CredentialWatch::new(&app, identity).over(response)
}

/// Who sends the request.
async fn identify(app: &App, request: &Parts, address: &str) -> Answer<Identity> {
    let guard = &app.guard;
    let authorization = request.headers.get(header::AUTHORIZATION);
    let refusal = match guard
        .gate
        .identify(authorization.map(HeaderValue::as_bytes))
        .await
    {
        Ok(identity) => return Ok(identity),
        Err(Refusal::Store(error)) => return Err(error.into()),
        Err(Refusal::Issuer(reason)) => return Err(issuer_unavailable(&reason)),
        Err(refusal) => refusal,
    };
    if !matches!(refusal, Refusal::Missing) {
        trail::sign_in_refused(app, request, address, &refusal).await;
        let allowance = guard
            .failures
            .count(address, guard.failure_limit, Instant::now());
        if !allowance.allowed {
            return Err(too_many_failures(&allowance));
        }
    }
    Err(unauthorized(&refusal))
}

/// Refuses what the caller may not do, and tells the handlers who it is.
async fn admit(
    app: &App,
    identity: &Arc<Identity>,
    address: &str,
    request: &mut Parts,
) -> Answer<trail::Act> {
    let quota = identity.limits(app.service.quotas().general);
    let act = trail::Act::new(app, request, identity, address.to_owned());
    let watch = CredentialWatch::new(app, identity.clone());
    let caller = Caller::new(identity.clone(), quota, act.agent(), watch);
    if identity.account.is_none() {
        app.guard.hosts.check_site(request)?;
    }
    let route = request.extensions.get::<MatchedPath>();
    let needed = needed(&request.method, route.map(MatchedPath::as_str));
    if let Err(problem) = caller.require(needed) {
        trail::access_refused(app, request, identity, address).await;
        return Err(problem);
    }
    request.extensions.insert(caller);
    Ok(act)
}

/// Counts a request for its caller and for the keys that have made the caller's key. Returns what is left where the
/// least is left.
fn count(app: &App, identity: &Identity, address: &str) -> Option<Allowance> {
    let (guard, general) = (&app.guard, app.service.quotas().general);
    let own = match &identity.account {
        Some(account) => Some(account.clone()),
        None => guard.count_anonymous.then(|| format!("address {address}")),
    };
    let own = own.zip(identity.limits(general).requests);
    let shared = identity.shared_accounts();
    let shared = shared.map(|(account, quota)| (account.to_owned(), quota));
    let accounts: Vec<(String, u64)> = own.into_iter().chain(shared).collect();
    let now = Instant::now();
    if let [(account, quota)] = &accounts[..] {
        // Nobody else is to be asked before it counts.
        return Some(guard.requests.count(account, *quota, now));
    }
    let look = |(account, quota): &(String, u64)| guard.requests.look(account, *quota, now);
    let count = |(account, quota): &(String, u64)| guard.requests.count(account, *quota, now);
    // A refused request counts for nobody.
    let refused = accounts.iter().map(look).find(|one| !one.allowed);
    refused.or_else(|| {
        let counted = accounts.iter().map(count);
        counted.min_by_key(|one| (one.allowed, one.remaining))
    })
}

/// Adds `RateLimit` and `RateLimit-Policy`.
fn add_limits(response: &mut Response, allowance: &Allowance) {
    let Allowance {
        quota, remaining, ..
    } = allowance;
    let window = ventriform_service::callers::QUOTA_WINDOW.as_secs();
    let resets_in = seconds(allowance);
    let values = [
        (
            RATE_LIMIT_POLICY,
            format!("\"requests\";q={quota};w={window}"),
        ),
        (
            RATE_LIMIT,
            format!("\"requests\";r={remaining};t={resets_in}"),
        ),
    ];
    for (name, value) in values {
        if let Ok(value) = HeaderValue::try_from(value) {
            response.headers_mut().insert(name, value);
        }
    }
}

/// Whole seconds until the window ends, at least 1.
fn seconds(allowance: &Allowance) -> u64 {
    allowance.resets_in.as_millis().div_ceil(1000).max(1) as u64
}

fn too_many_requests(allowance: &Allowance) -> Problem {
    Problem::new(
        StatusCode::TOO_MANY_REQUESTS,
        "too-many-requests",
        format!(
            "This caller, or the key that has made its key with all keys that it has made, has sent \
             more than the {} requests that it may send per minute.",
            allowance.quota
        ),
    )
    .fix("Try again after the number of seconds in Retry-After, or ask the operator for more.")
    .header(header::RETRY_AFTER, seconds(allowance).to_string())
}

fn too_many_failures(allowance: &Allowance) -> Problem {
    Problem::new(
        StatusCode::TOO_MANY_REQUESTS,
        "too-many-failures",
        "Too many requests with wrong credentials have come from this address.",
    )
    .fix("Correct the credentials; valid ones are accepted at once.")
    .header(header::RETRY_AFTER, seconds(allowance).to_string())
}

fn unauthorized(refusal: &Refusal) -> Problem {
    let challenge = |error: &str| format!("Bearer realm=\"ventriform\"{error}");
    let (detail, fix, error) = match refusal {
        Refusal::Missing => (
            "This service needs credentials.".to_owned(),
            "Send `Authorization: Bearer KEY`; the operator makes keys by `ventriform keys create`.",
            "",
        ),
        Refusal::NotBearer => (
            "The Authorization header holds no bearer credential.".to_owned(),
            "Send `Authorization: Bearer KEY`.",
            ", error=\"invalid_request\"",
        ),
        Refusal::EndedKey { state, .. } => (
            format!("The key of this request is {}.", state.as_str()),
            "Ask the operator for another key.",
            ", error=\"invalid_token\"",
        ),
        Refusal::Token(reason) => (
            format!("The token of this request is refused: {reason}."),
            "Get a new token from the issuer that this service accepts.",
            ", error=\"invalid_token\"",
        ),
        _ => (
            "The key of this request is unknown.".to_owned(),
            "Check that the whole key was sent; the operator makes keys by `ventriform keys create`.",
            ", error=\"invalid_token\"",
        ),
    };
    Problem::new(StatusCode::UNAUTHORIZED, "unauthorized", detail)
        .at("Authorization")
        .fix(fix)
        .header(header::WWW_AUTHENTICATE, challenge(error))
}

fn issuer_unavailable(reason: &str) -> Problem {
    Problem::new(
        StatusCode::SERVICE_UNAVAILABLE,
        "issuer-unavailable",
        format!("Tokens cannot be checked: {reason}."),
    )
    .fix("Try again later, or use an API key.")
    .header(header::RETRY_AFTER, "30")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_method_needs_the_narrowest_scope_that_fits() {
        let needs = |method: Method, route| needed(&method, Some(route));
        assert_eq!(needs(Method::GET, "/v1/volumes/{id}"), Scope::Read);
        assert_eq!(needs(Method::HEAD, "/v1/volumes/{id}"), Scope::Read);
        assert_eq!(needs(Method::POST, "/v1/volumes"), Scope::Submit);
        assert_eq!(needs(Method::DELETE, "/v1/jobs/{id}"), Scope::Submit);
        assert_eq!(needs(Method::GET, "/v1/keys"), Scope::Admin);
        assert_eq!(needs(Method::DELETE, "/v1/keys/{id}"), Scope::Admin);
        assert_eq!(needs(Method::POST, "/v1/readings"), Scope::Sign);
        assert_eq!(needs(Method::DELETE, "/v1/readings/{id}"), Scope::Sign);
        assert_eq!(needs(Method::GET, "/v1/readings/{id}"), Scope::Read);
        assert_eq!(needs(Method::GET, "/v1/audit"), Scope::Admin);
        assert_eq!(needs(Method::POST, "/v1/webhooks/secret"), Scope::Admin);
        let again = "/v1/jobs/{id}/deliveries/{delivery}/redeliver";
        assert_eq!(needs(Method::POST, again), Scope::Submit);
        assert_eq!(needs(Method::PUT, "/v1/volumes/{id}/hold"), Scope::Admin);
        assert_eq!(needs(Method::DELETE, "/v1/volumes/{id}"), Scope::Submit);
        assert_eq!(needs(Method::DELETE, "/v1/volumes"), Scope::Admin);
        let identity = "/v1/volumes/{id}/identity";
        assert_eq!(needs(Method::GET, identity), Scope::Submit);
        let items = "/dicom-web/workitems";
        assert_eq!(needs(Method::GET, items), Scope::Submit);
        assert_eq!(needs(Method::GET, "/v1/auditors"), Scope::Read);
        assert_eq!(
            needed(&Method::from_bytes(b"PURGE").unwrap(), None),
            Scope::Submit
        );
    }

    #[test]
    fn only_pages_and_health_are_open() {
        let settings = Settings::default();
        for open in [
            "/",
            "/healthz",
            "/readyz",
            "/openapi.json",
            "/docs",
            "/assets/page.js",
            "/examples/scan.dcm",
        ] {
            assert!(is_open_path(open, &settings), "{open}");
        }
        for closed in [
            "/metrics",
            "/v1/volumes",
            "/docsx",
            "//healthz",
            "/healthz/",
        ] {
            assert!(!is_open_path(closed, &settings), "{closed}");
        }
    }
}
