//! Which names the service answers to, and which pages may use it.
//!
//! **DNS rebinding**: a page on `evil.example` can let that name point to 127.0.0.1 and then read a
//! service on the visitor's machine as if it were its own. The browser still sends
//! `Host: evil.example`. So where callers may be anonymous, `Host` must be an IP address,
//! `localhost`, a name without a dot (no public name has that form), or a name of the setting
//! `hosts`; on loopback an IP address must be a loopback address too. Other names get 421.
//!
//! **Pages of other sites** can send forms and uploads, although they cannot read the answers. A
//! request of an anonymous caller that would change something is refused if `Sec-Fetch-Site` or
//! `Origin` says that another site sent it, unless the setting `cors_origins` allows that site.

use crate::wire::problem::{Answer, Problem};
use crate::wire::public_base::PublicBase;
use axum::extract::{Request, State};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderName, StatusCode, Version, header, uri::Authority};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use std::net::IpAddr;
use std::sync::Arc;
use ventriform_service::config::Words;

const SEC_FETCH_SITE: HeaderName = HeaderName::from_static("sec-fetch-site");

/// Stands for every name in `hosts`, and for every site in `cors_origins`.
pub const ANY_HOST: &str = "*";

/// Which `Host` headers are answered.
#[derive(Debug, Clone)]
pub struct HostPolicy {
    /// Names that are answered in any case.
    pub names: Words,
    /// Sites whose pages may use the service.
    pub origins: Words,
    /// Whether the service listens on a loopback address.
    pub loopback: bool,
    /// Whether callers may be anonymous.
    pub open: bool,
}

impl HostPolicy {
    /// Whether a request to this host is answered.
    fn answers(&self, host: &str) -> bool {
        let Ok(authority) = host.parse::<Authority>() else {
            return false;
        };
        let name = authority.host().trim_end_matches('.').to_ascii_lowercase();
        if self
            .names
            .iter()
            .any(|n| n == ANY_HOST || n.eq_ignore_ascii_case(&name))
        {
            return true;
        }
        let address = name.trim_matches(['[', ']']).parse::<IpAddr>();
        if self.loopback {
            return match address {
                Ok(address) => address.to_canonical().is_loopback(),
                Err(_) => is_local(&name),
            };
        }
        if self.names.is_empty() {
            return !self.open || address.is_ok() || is_local(&name);
        }
        address.is_ok_and(|address| address.to_canonical().is_loopback()) || name == "localhost"
    }

    /// Refuses a request that would change something and comes from a page of another site.
    ///
    /// # Errors
    /// 403.
    pub fn check_site(&self, request: &Parts) -> Answer<()> {
        let base = request.extensions.get::<Arc<PublicBase>>();
        let reached = base.and_then(|base| base.host.as_deref());
        if request.method.is_safe() || !is_foreign(&request.headers, reached) {
            return Ok(());
        }
        let origin = request.headers.get(header::ORIGIN);
        let origin = origin.and_then(|value| value.to_str().ok()).unwrap_or("?");
        if self.origins.iter().any(|o| o == ANY_HOST || o == origin) {
            return Ok(());
        }
        Err(Problem::new(
            StatusCode::FORBIDDEN,
            "cross-site",
            "A page of another site sent this request, and this service does not allow that.",
        )
        .at("Origin")
        .fix("Ask the operator to add the site to `cors_origins`."))
    }
}

/// Names that no stranger can own: those of this machine and of its local network.
fn is_local(name: &str) -> bool {
    !name.is_empty() && (!name.contains('.') || name.ends_with(".localhost"))
}

/// Whether a browser says that a page of another site sent the request. `reached` is the host under which
/// a trusted proxy, or else the request itself, says that it was sent.
fn is_foreign(headers: &HeaderMap, reached: Option<&str>) -> bool {
    if let Some(site) = headers.get(SEC_FETCH_SITE) {
        return site == "cross-site" || site == "same-site";
    }
    let Some(origin) = headers.get(header::ORIGIN) else {
        return false;
    };
    let host = headers
        .get(header::HOST)
        .and_then(|host| host.to_str().ok());
    let own = origin
        .to_str()
        .ok()
        .and_then(|o| Some(o.split_once("://")?.1));
    own.is_none() || (own != host && own != reached)
}

/// The layer that answers only to known names.
pub async fn check_host(
    State(policy): State<HostPolicy>,
    request: Request,
    next: Next,
) -> Response {
    let mut hosts = request.headers().get_all(header::HOST).iter();
    let (given, target) = (hosts.next(), request.uri().host());
    let missing = given.is_none() && target.is_none() && request.version() == Version::HTTP_11;
    if missing || hosts.next().is_some() {
        return Problem::bad_request(
            "invalid-host",
            "A request has exactly one Host header (RFC 9112, section 3.2).",
        )
        .at("Host")
        .fix("Send one Host header with the service's address.")
        .into_response();
    }
    let answers = |host: &str| policy.answers(host);
    // HTTP/1.0 clients need not send one; browsers always do.
    let answered =
        given.is_none_or(|host| host.to_str().is_ok_and(answers)) && target.is_none_or(answers);
    if answered {
        return next.run(request).await;
    }
    Problem::new(
        StatusCode::MISDIRECTED_REQUEST,
        "unknown-host",
        "This service does not answer to the name in the Host header.",
    )
    .at("Host")
    .fix("Use the service's address, or ask the operator to add the name to the setting `hosts`.")
    .into_response()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy(names: &str, loopback: bool, open: bool) -> HostPolicy {
        HostPolicy {
            names: names.parse().unwrap(),
            origins: Words::default(),
            loopback,
            open,
        }
    }

    #[test]
    fn on_loopback_only_names_of_this_machine_are_answered() {
        let policy = policy("Heart.example", true, true);
        for good in [
            "127.0.0.1:8080",
            "127.0.0.2",
            "localhost",
            "LOCALHOST:1",
            "localhost.:80",
            "app.localhost",
            "[::1]:8080",
            "heart.example:443",
            "ventriform:8080",
        ] {
            assert!(policy.answers(good), "{good}");
        }
        for bad in [
            "evil.example",
            "127.0.0.1.evil.example",
            "localhost.evil.example",
            "192.0.2.1",
            "evil.example:8080",
            "127.0.0.1@evil.example",
            "",
            ":80",
            "a b",
        ] {
            assert!(!policy.answers(bad), "{bad}");
        }
    }

    #[test]
    fn elsewhere_names_are_free_only_if_callers_need_credentials() {
        assert!(policy("", false, false).answers("any.example"));
        let open = policy("", false, true);
        assert!(open.answers("192.0.2.1:80") && open.answers("ventriform"));
        assert!(!open.answers("evil.example"));
        let named = policy("heart.example", false, false);
        assert!(named.answers("heart.example") && named.answers("127.0.0.1"));
        assert!(!named.answers("other.example") && !named.answers("192.0.2.1"));
        assert!(policy("*", true, true).answers("any.example"));
    }

    #[test]
    fn only_browsers_on_other_sites_are_foreign() {
        let foreign = |pairs: &[(&'static str, &'static str)]| {
            let mut headers = HeaderMap::new();
            for (name, value) in pairs {
                headers.insert(*name, value.parse().unwrap());
            }
            is_foreign(&headers, Some("heart.example"))
        };
        assert!(!foreign(&[("host", "localhost:1")]));
        assert!(!foreign(&[("host", "a:1"), ("origin", "http://a:1")]));
        assert!(foreign(&[("host", "a:1"), ("origin", "http://a:2")]));
        assert!(foreign(&[("host", "a:1"), ("origin", "null")]));
        let proxied = [("host", "backend"), ("origin", "https://heart.example")];
        assert!(!foreign(&proxied));
        assert!(foreign(&[("sec-fetch-site", "cross-site")]));
        assert!(!foreign(&[("sec-fetch-site", "same-origin")]));
        assert!(!foreign(&[("sec-fetch-site", "none")]));
    }
}
