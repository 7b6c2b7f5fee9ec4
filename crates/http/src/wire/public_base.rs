//! Under which address clients reach the service: scheme, host, and the path before ours.
//!
//! It is that of the connection and of the `Host` header. If the other end is a trusted proxy (setting
//! `trusted_proxies`), its word is taken for what it has changed: `X-Forwarded-Proto`,
//! `X-Forwarded-Host`, `X-Forwarded-Port` and `X-Forwarded-Prefix`, or `proto` and `host` of `Forwarded`
//! (RFC 7239). Of a list, as many values count from its right as there are trusted proxies
//! ([`trusted_hops`]): the leftmost of them, which the outermost trusted proxy has written. What stands before it could
//! have been made up by the client. If `X-Forwarded-*` and `Forwarded` disagree, neither is used. The prefixes
//! that count are joined in their order. Values that cannot be part of an address are not used. Without a prefix from a
//! proxy, the setting `base_path` is the path.
//!
//! Requests may come with `base_path` or without, so a proxy may strip it or not.
//!
//! Every path in an answer is made by [`public_path`]: links, `Location`, the files of the page.
//! [`crate::edge::connections`] runs each request within [`PublicBase::scope`].

use crate::wire::client::trusted_hops;
use axum::http::{HeaderMap, HeaderName, header};
use std::net::IpAddr;
use std::sync::Arc;
use ventriform_service::config::{BasePath, Networks};

const X_FORWARDED_PROTO: HeaderName = HeaderName::from_static("x-forwarded-proto");
const X_FORWARDED_HOST: HeaderName = HeaderName::from_static("x-forwarded-host");
const X_FORWARDED_PORT: HeaderName = HeaderName::from_static("x-forwarded-port");
const X_FORWARDED_PREFIX: HeaderName = HeaderName::from_static("x-forwarded-prefix");

/// Longest name of a host that is used, with its port.
const LONGEST_HOST: usize = 260;

tokio::task_local! {
    static REQUEST_BASE: Arc<PublicBase>;
}

/// The parts that are known beforehand.
#[derive(Debug, Clone, Default)]
pub struct ProxyPolicy {
    /// The proxies whose word is taken.
    pub trusted: Networks,
    /// The path under which proxies show the service.
    pub base_path: BasePath,
    /// Whether the service itself speaks TLS.
    pub tls: bool,
}

/// The address under which a client reaches the service.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PublicBase {
    https: bool,
    /// Host and port as the client names them, if it does.
    pub host: Option<String>,
    prefix: BasePath,
}

impl PublicBase {
    /// The address to which a request was sent that arrived from `peer`.
    pub fn from_request(peer: IpAddr, headers: &HeaderMap, policy: &ProxyPolicy) -> Arc<Self> {
        let own = Self {
            https: policy.tls,
            host: first(headers, &header::HOST).filter(|host| is_host(host)),
            prefix: policy.base_path.clone(),
        };
        Arc::new(if policy.trusted.contain(peer.to_canonical()) {
            own.forwarded(headers, policy)
        } else {
            own
        })
    }

    /// The address as a proxy has seen it.
    fn forwarded(self, headers: &HeaderMap, policy: &ProxyPolicy) -> Self {
        let element = outermost(headers, &policy.trusted);
        let hops = trusted_hops(headers, &policy.trusted);
        let stated = |name: HeaderName, parameter: &str| match (
            from_right(headers, &name, hops),
            pair(&element, parameter),
        ) {
            (Some(one), Some(other)) if !one.eq_ignore_ascii_case(&other) => None,
            (one, other) => one.or(other),
        };
        let https = match stated(X_FORWARDED_PROTO, "proto") {
            Some(scheme) if scheme.eq_ignore_ascii_case("https") => true,
            Some(scheme) if scheme.eq_ignore_ascii_case("http") => false,
            _ => self.https,
        };
        let port = from_right(headers, &X_FORWARDED_PORT, hops);
        let port = port.and_then(|port| port.parse::<u16>().ok());
        let usual = if https { 443 } else { 80 };
        let host = stated(X_FORWARDED_HOST, "host").filter(|host| is_host(host));
        let host = host.map(|host| match port.filter(|port| *port != usual) {
            Some(port) if !has_port(&host) => format!("{host}:{port}"),
            _ => host,
        });
        let prefixes = headers.get_all(X_FORWARDED_PREFIX).iter();
        let prefixes = prefixes.flat_map(|value| value.to_str().unwrap_or("?").split(','));
        let prefixes: Vec<&str> = prefixes.collect();
        let made_up = prefixes.len().saturating_sub(hops);
        let joined: String = prefixes
            .into_iter()
            .skip(made_up)
            .map(|prefix| prefix.trim().trim_end_matches('/'))
            .collect();
        Self {
            https,
            host: host.or(self.host),
            prefix: match joined.parse() {
                Ok(prefix) if !joined.is_empty() => prefix,
                _ => self.prefix,
            },
        }
    }

    /// The path before ours, without a slash at its end; empty if there is none.
    pub fn prefix(&self) -> &str {
        self.prefix.as_str()
    }

    /// The address, without a slash at its end.
    pub fn url(&self) -> String {
        let scheme = if self.https { "https" } else { "http" };
        let host = self.host.as_deref().unwrap_or("127.0.0.1:8080");
        format!("{scheme}://{host}{}", self.prefix())
    }

    /// That of the request that the current task answers; `None` for work that belongs to none.
    pub fn current() -> Option<Arc<Self>> {
        REQUEST_BASE.try_with(Arc::clone).ok()
    }

    /// Runs the answering of a request that was sent to this address.
    pub async fn scope<T>(self: Arc<Self>, answer: impl Future<Output = T>) -> T {
        REQUEST_BASE.scope(self, answer).await
    }
}

/// A path of this service as the client of the current request has to write it.
pub fn public_path(path: &str) -> String {
    let prefixed = REQUEST_BASE.try_with(|base| format!("{}{path}", base.prefix()));
    prefixed.unwrap_or_else(|_| path.to_owned())
}

/// The first value of a header that may be a list.
fn first(headers: &HeaderMap, name: &HeaderName) -> Option<String> {
    let value = headers.get(name)?.to_str().ok()?;
    let value = value.split(',').next().unwrap_or_default().trim();
    (!value.is_empty()).then(|| value.to_owned())
}

/// The value at `place` from the right (1 is the last) of a header that may be a list, or the first of a
/// shorter one: some proxies pass on a value instead of appending theirs.
fn from_right(headers: &HeaderMap, name: &HeaderName, place: usize) -> Option<String> {
    let lines = headers.get_all(name).iter();
    let values: Vec<&str> = lines
        .flat_map(|line| line.to_str().unwrap_or_default().split(','))
        .collect();
    let value = values.get(values.len().saturating_sub(place))?.trim();
    (!value.is_empty()).then(|| value.to_owned())
}

/// The element of `Forwarded` that the outermost trusted proxy has written.
fn outermost(headers: &HeaderMap, trusted: &Networks) -> String {
    let values = headers.get_all(header::FORWARDED).iter();
    let elements: Vec<&str> = values
        .flat_map(|value| value.to_str().unwrap_or_default().split(','))
        .collect();
    let is_trusted = |element: &str| {
        let client = pair(element, "for");
        let client = client.and_then(|node| crate::wire::client::node_address(&node));
        client.is_some_and(|address| trusted.contain(address.to_canonical()))
    };
    let mut chosen = "";
    for element in elements.iter().rev() {
        chosen = element;
        if !is_trusted(element) {
            break;
        }
    }
    chosen.to_owned()
}

/// A parameter of an element of `Forwarded`.
fn pair(element: &str, name: &str) -> Option<String> {
    let pairs = element.split(';').filter_map(|pair| pair.split_once('='));
    let mut values = pairs.filter(|(key, _)| key.trim().eq_ignore_ascii_case(name));
    let value = values.next()?.1.trim().trim_matches('"');
    (!value.is_empty()).then(|| value.to_owned())
}

/// Whether this can be a host with or without a port.
fn is_host(host: &str) -> bool {
    let allowed = |b: u8| b.is_ascii_alphanumeric() || b"-.:[]_".contains(&b);
    (1..=LONGEST_HOST).contains(&host.len()) && host.bytes().all(allowed)
}

fn has_port(host: &str) -> bool {
    // The colons of an IPv6 address stand before the bracket.
    let end = host.rsplit(']').next().unwrap_or_default();
    end.contains(':')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen(peer: &str, pairs: &[(&'static str, &str)]) -> String {
        let mut headers = HeaderMap::new();
        for (name, value) in pairs {
            headers.append(*name, value.parse().unwrap());
        }
        let policy = ProxyPolicy {
            trusted: "10.0.0.0/8".parse().unwrap(),
            base_path: "/own".parse().unwrap(),
            tls: false,
        };
        PublicBase::from_request(peer.parse().unwrap(), &headers, &policy).url()
    }

    #[test]
    fn only_trusted_proxies_name_the_address() {
        let said = [
            ("host", "backend:8080"),
            ("x-forwarded-proto", "https"),
            ("x-forwarded-host", "heart.example"),
            ("x-forwarded-prefix", "/heart/"),
        ];
        assert_eq!(seen("10.1.2.3", &said), "https://heart.example/heart");
        assert_eq!(
            seen("::ffff:10.1.2.3", &said),
            "https://heart.example/heart"
        );
        assert_eq!(seen("192.0.2.1", &said), "http://backend:8080/own");
        assert_eq!(seen("10.1.2.3", &said[..1]), "http://backend:8080/own");
    }

    #[test]
    fn what_several_proxies_say_is_put_together() {
        let lists = [
            ("x-forwarded-for", "203.0.113.7, 10.2.2.2"),
            ("x-forwarded-proto", "https, http"),
            ("x-forwarded-host", "[2001:db8::1], inner"),
            ("x-forwarded-port", "8443"),
            ("x-forwarded-prefix", "/outer, /inner"),
        ];
        assert_eq!(
            seen("10.1.2.3", &lists),
            "https://[2001:db8::1]:8443/outer/inner"
        );
        // Behind one trusted proxy, only the last value is that of a proxy.
        let made_up = [
            ("x-forwarded-for", "10.2.2.2, 203.0.113.7"),
            ("x-forwarded-proto", "http"),
            ("x-forwarded-proto", "https"),
            ("x-forwarded-host", "evil.example, heart.example"),
            ("x-forwarded-prefix", "/evil"),
            ("x-forwarded-prefix", "/heart"),
        ];
        assert_eq!(seen("10.1.2.3", &made_up), "https://heart.example/heart");
        let listed = [
            ("host", "backend"),
            ("x-forwarded-for", "198.51.100.1, 203.0.113.7, 10.2.2.2"),
            ("x-forwarded-prefix", "/evil, /outer, /inner"),
        ];
        assert_eq!(seen("10.1.2.3", &listed), "http://backend/outer/inner");
        let disagreeing = [
            ("host", "backend"),
            ("x-forwarded-host", "evil.example"),
            ("forwarded", "for=203.0.113.7;host=heart.example"),
        ];
        assert_eq!(seen("10.1.2.3", &disagreeing), "http://backend/own");
        let usual = [
            ("x-forwarded-proto", "HTTPS"),
            ("x-forwarded-host", "heart.example"),
            ("x-forwarded-port", "443"),
        ];
        assert_eq!(seen("10.1.2.3", &usual), "https://heart.example/own");
        // The element of a stranger does not count before that of the trusted proxy.
        let forwarded = [(
            "forwarded",
            "for=198.51.100.1;host=evil.example, for=203.0.113.7;proto=https;host=\"heart.example\", \
             for=10.2.2.2;proto=http",
        )];
        assert_eq!(seen("10.1.2.3", &forwarded), "https://heart.example/own");
    }

    #[test]
    fn what_is_no_part_of_an_address_is_not_used() {
        for (name, value) in [
            ("x-forwarded-proto", "gopher"),
            ("x-forwarded-host", "a\"b"),
            ("x-forwarded-host", "heart.example/path"),
            ("x-forwarded-prefix", "heart"),
            ("x-forwarded-prefix", "//evil.example"),
            ("x-forwarded-prefix", "/a/../b"),
            ("x-forwarded-prefix", "/<script>"),
            ("x-forwarded-prefix", "/"),
            ("x-forwarded-port", "99999"),
            ("forwarded", "proto"),
        ] {
            let pairs = [("host", "backend"), (name, value)];
            assert_eq!(
                seen("10.1.2.3", &pairs),
                "http://backend/own",
                "{name}: {value}"
            );
        }
    }
}
