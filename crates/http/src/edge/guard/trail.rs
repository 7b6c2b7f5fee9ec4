//! From requests to rows of the audit trail.
//!
//! Changes are recorded where they are made ([`Agent::change`]), so that a request which is dropped or refused
//! afterwards leaves its rows; what a handler changes otherwise is recorded here, after its answer is known. Recorded
//! are: acts that changed something, reads of contents and of lists under `/v1`, refused credentials, and requests
//! beyond a caller's scope. Not recorded are reads of jobs, which clients repeat while they wait, and requests that
//! were refused for another reason or found nothing.
//!
//! A row names an item by its id and never a path, a query or a name from a file.

use crate::app::App;
use crate::wire::problem::Problem;
use crate::wire::public_base::PublicBase;
use axum::extract::MatchedPath;
use axum::http::request::Parts;
use axum::http::{Method, StatusCode, header};
use axum::response::{IntoResponse, Response};
use tower_http::request_id::RequestId;
use ventriform::results::export::dicom::is_uid;
use ventriform_service::base::records::Tenant;
use ventriform_service::callers::{Activity, Agent, AuditEvent, Identity, Outcome, Refusal};

/// Longest id that is recorded; others are no ids of this service.
const LONGEST_ID: usize = 80;

/// Handlers that record their own event, in the same transaction as the act, put this into their
/// answer.
#[derive(Debug, Clone, Copy)]
pub struct AlreadyRecorded;

/// A request that may have to be recorded.
pub struct Act {
    method: Method,
    route: String,
    object: Option<String>,
    agent: Agent,
}

impl Act {
    /// The act of this request.
    pub fn new(app: &App, request: &Parts, identity: &Identity, address: String) -> Self {
        let route = request.extensions.get::<MatchedPath>();
        let event = event(request, identity, address, Activity::Read);
        Self {
            agent: app.service.agent_of(event),
            method: request.method.clone(),
            route: route.map_or_else(String::new, |route| route.as_str().to_owned()),
            object: item_of(request.uri.path()),
        }
    }

    /// The id that the path names.
    pub fn object(&self) -> Option<&str> {
        self.object.as_deref()
    }

    /// Who sends the request.
    pub fn agent(&self) -> Agent {
        self.agent.clone()
    }

    /// Records what was done and is not recorded yet, and returns the answer; instead of it 503 if an act that changed
    /// something could not be recorded.
    pub async fn record(self, app: &App, response: Response) -> Response {
        let status = response.status();
        if status == StatusCode::FORBIDDEN {
            // A handler found that the caller's scope does not suffice.
            let mut event = self.agent.event(Activity::AccessRefused, app.service.now());
            event.object = self.object;
            note_refusal(app, event).await;
            return response;
        }
        let done = status.is_success() || status == StatusCode::NOT_MODIFIED;
        if self.agent.has_acted() {
            return response;
        }
        if !done || response.extensions().get::<AlreadyRecorded>().is_some() {
            return response;
        }
        let Some(activity) = self.activity(status) else {
            return response;
        };
        let mut event = self.agent.event(activity, app.service.now());
        event.object = match activity {
            Activity::Create | Activity::Execute => location(&response).or(self.object),
            _ => self.object,
        }
        .or_else(|| place_of(&self.route));
        if self.method.is_safe() {
            app.service.recorder().note(event).await;
            return response;
        }
        match app.service.recorder().record(event).await {
            Ok(()) => response,
            Err(_) => not_recorded().into_response(),
        }
    }

    fn activity(&self, status: StatusCode) -> Option<Activity> {
        let below = ["/v1/", "/dicom-web/"];
        let mut paths = below.iter().filter_map(|top| self.route.strip_prefix(top));
        let mut segments = paths.next()?.split('/');
        let kind = segments.next()?;
        let is_list = segments.next().is_none();
        if self.method.is_safe() {
            return match (kind, is_list) {
                ("jobs", _) => None,
                ("audit", _) => Some(Activity::AuditRead),
                (_, true) => Some(Activity::Search),
                _ => Some(Activity::Read),
            };
        }
        Some(match (&self.method, kind) {
            (&Method::DELETE, _) => Activity::Delete,
            (&Method::POST, "jobs" | "models" | "segmentations" | "beats" | "comparisons")
                if is_list =>
            {
                Activity::Execute
            }
            (&Method::POST, _) if is_list && status == StatusCode::OK => Activity::Update,
            (&Method::POST, _) if is_list => Activity::Create,
            _ => Activity::Update,
        })
    }
}

/// Notes that credentials were refused.
pub async fn sign_in_refused(app: &App, request: &Parts, address: &str, refusal: &Refusal) {
    let (tenant, key) = match refusal {
        Refusal::EndedKey { tenant, key, .. } => (tenant.clone(), Some(key.clone())),
        // Nobody's: the operator's tenant sees it.
        _ => (Tenant::default(), None),
    };
    let identity = Identity {
        tenant,
        name: "unknown".into(),
        key,
        scope: ventriform_service::callers::Scope::Read,
        quota: ventriform_service::callers::Quota::default(),
        makers: ventriform_service::callers::Makers::default(),
        expires_at: None,
        owner: None,
        account: None,
    };
    let refused = event(
        request,
        &identity,
        address.to_owned(),
        Activity::SignInRefused,
    );
    note_refusal(app, refused).await;
}

/// Notes that a caller asked for more than its scope allows.
pub async fn access_refused(app: &App, request: &Parts, identity: &Identity, address: &str) {
    let mut refused = event(
        request,
        identity,
        address.to_owned(),
        Activity::AccessRefused,
    );
    refused.object = item_of(request.uri.path());
    note_refusal(app, refused).await;
}

async fn note_refusal(app: &App, mut event: AuditEvent) {
    event.outcome = Outcome::Refused;
    event.recorded = app.service.now();
    app.service.recorder().note(event).await;
}

fn event(request: &Parts, identity: &Identity, address: String, activity: Activity) -> AuditEvent {
    let id = request.extensions.get::<RequestId>();
    // A client may send any text as the id of its request; only ids that say nothing are recorded.
    let id = id.and_then(|id| id.header_value().to_str().ok());
    let id = id.filter(|id| uuid::Uuid::try_parse(id).is_ok());
    AuditEvent {
        key: identity.key.clone(),
        address: Some(address),
        request: id.map(str::to_owned),
        ..AuditEvent::new(0, activity, identity.tenant.clone(), identity.name.clone())
    }
}

/// The id in a path `/v1/KIND/ID/...` or `/dicom-web/workitems/UID/...`, if it has the form of one.
fn item_of(path: &str) -> Option<String> {
    if let Some(rest) = path.strip_prefix("/dicom-web/workitems/") {
        let uid = rest.split('/').next()?;
        return is_uid(uid).then(|| uid.to_owned());
    }
    let id = path.strip_prefix("/v1/")?.split('/').nth(1)?;
    // A prefix of three letters, or none.
    let number = match id.split_once('_') {
        Some((prefix, number))
            if prefix.len() == 3 && prefix.bytes().all(|b| b.is_ascii_lowercase()) =>
        {
            number
        }
        Some(_) => return None,
        None => id,
    };
    let formed = !number.is_empty() && id.len() <= LONGEST_ID;
    (formed && number.bytes().all(|b| b.is_ascii_hexdigit())).then(|| id.to_owned())
}

/// The object of a route without an id: `webhooks/secret`.
fn place_of(route: &str) -> Option<String> {
    let rest = route.split('/').skip(2).collect::<Vec<_>>().join("/");
    (!rest.is_empty() && !rest.contains('{')).then_some(rest)
}

/// The id of what the answer's `Location` names.
fn location(response: &Response) -> Option<String> {
    let path = response.headers().get(header::LOCATION)?.to_str().ok()?;
    let base = PublicBase::current();
    let prefix = base.as_ref().map_or("", |base| base.prefix());
    item_of(path.strip_prefix(prefix)?)
}

fn not_recorded() -> Problem {
    Problem::new(
        StatusCode::SERVICE_UNAVAILABLE,
        "audit-unavailable",
        "The request was carried out, but the audit trail could not be written.",
    )
    .fix("Ask the operator to look at the log and at the disk, then send the request again.")
    .header(header::RETRY_AFTER, "10")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_ids_are_taken_from_paths() {
        let item = |path| item_of(path);
        assert_eq!(
            item("/v1/volumes/vol_12ab/preview.png").as_deref(),
            Some("vol_12ab")
        );
        assert_eq!(
            item("/v1/keys/0123456789abcdef").as_deref(),
            Some("0123456789abcdef")
        );
        assert_eq!(
            item("/v1/webhooks/whk_0123456789abcdef").as_deref(),
            Some("whk_0123456789abcdef")
        );
        for uid in ["1.2.3.99", "2.25.340282366920938463463374607431768211455"] {
            for rest in ["", "/state", "/cancelrequest"] {
                let path = format!("/dicom-web/workitems/{uid}{rest}");
                assert_eq!(item_of(&path).as_deref(), Some(uid), "{path}");
            }
        }
        assert_eq!(
            place_of("/v1/webhooks/secret").as_deref(),
            Some("webhooks/secret")
        );
        assert_eq!(place_of("/v1/audit").as_deref(), Some("audit"));
        assert_eq!(place_of("/v1/volumes/{id}"), None);
        for path in [
            "/dicom-web/workitems/Doe^John",
            "/dicom-web/workitems",
            "/v1/volumes/doe_john",
            "/v1/volumes",
            "/v1/volumes/Doe%20John",
            "/healthz",
            "/v1/volumes/John",
        ] {
            assert_eq!(item(path), None, "{path}");
        }
    }
}
