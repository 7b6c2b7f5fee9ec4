//! Who sent a request: the address that limits are counted for.
//!
//! It is the address of the other end of the connection. If that is a trusted proxy (setting
//! `trusted_proxies`), it is the last address in `X-Forwarded-For` or `Forwarded` (RFC 7239) that
//! is not itself a trusted proxy; what stands before it could have been made up by the client. A proxy
//! appends to one of the two headers and may pass on the other as its client sent it, so if both are
//! there and name different clients, it is the proxy's own address.
//! Connections of any other sender are not asked for these headers.
//!
//! An IPv6 address stands for its /64 network, which one host can use as a whole.
//!
//! [`crate::edge::connections`] puts a [`ClientAddress`] into the extensions of each request and
//! runs the request within [`ClientAddress::scope`], so that shared code can ask for
//! [`ClientAddress::current`] without being handed the request.

use axum::http::{HeaderMap, HeaderName, header};
use std::net::{IpAddr, SocketAddr};
pub use ventriform_service::base::client::ClientAddress;
use ventriform_service::config::Networks;

const X_FORWARDED_FOR: HeaderName = HeaderName::from_static("x-forwarded-for");

/// The address from which a request came that arrived from `peer`.
pub fn client_of(peer: IpAddr, headers: &HeaderMap, trusted: &Networks) -> ClientAddress {
    if !trusted.contain(peer.to_canonical()) {
        return ClientAddress::of_peer(peer);
    }
    let named = [x_forwarded_for(headers), forwarded(headers)];
    let mut named = named
        .iter()
        .flatten()
        .map(|hops| ClientAddress::of_peer(walk(hops, trusted).nearest.unwrap_or(peer)));
    let own = ClientAddress::of_peer(peer);
    match (named.next(), named.next()) {
        (Some(one), Some(other)) if one != other => own,
        (Some(one), _) => one,
        (None, _) => own,
    }
}

/// Number of trusted proxies that a request has passed one after the other, the one that sent it to us included.
pub(crate) fn trusted_hops(headers: &HeaderMap, trusted: &Networks) -> usize {
    let named = [x_forwarded_for(headers), forwarded(headers)];
    let passed = named
        .iter()
        .flatten()
        .map(|hops| walk(hops, trusted).passed);
    1 + passed.min().unwrap_or(0)
}

/// The end of a list of hops as far as trusted proxies have written it.
struct Walk {
    /// The first address from the right that is no trusted proxy's, or else the leftmost that can be read.
    nearest: Option<IpAddr>,
    /// Number of trusted proxies right of it.
    passed: usize,
}

fn walk(hops: &[Option<IpAddr>], trusted: &Networks) -> Walk {
    let mut walk = Walk {
        nearest: None,
        passed: 0,
    };
    for hop in hops.iter().rev().map_while(|hop| *hop) {
        walk.nearest = Some(hop);
        if !trusted.contain(hop.to_canonical()) {
            break;
        }
        walk.passed += 1;
    }
    walk
}

/// The addresses through which a request came, the nearest last; `None` for one that is hidden or
/// cannot be read. No list without `X-Forwarded-For`.
fn x_forwarded_for(headers: &HeaderMap) -> Option<Vec<Option<IpAddr>>> {
    let present = headers.contains_key(X_FORWARDED_FOR);
    present.then(|| {
        elements(headers, X_FORWARDED_FOR)
            .map(node_address)
            .collect()
    })
}

/// As [`x_forwarded_for`], of `Forwarded`.
fn forwarded(headers: &HeaderMap) -> Option<Vec<Option<IpAddr>>> {
    let node = |element: &str| {
        let pairs = element.split(';').filter_map(|pair| pair.split_once('='));
        let mut nodes = pairs.filter(|(name, _)| name.trim().eq_ignore_ascii_case("for"));
        nodes.next().and_then(|(_, node)| node_address(node))
    };
    let present = headers.contains_key(header::FORWARDED);
    present.then(|| elements(headers, header::FORWARDED).map(node).collect())
}

/// The elements of a header that is a list.
fn elements(headers: &HeaderMap, name: HeaderName) -> impl Iterator<Item = &str> {
    let values = headers.get_all(name).iter();
    values.flat_map(|value| value.to_str().unwrap_or("?").split(','))
}

/// The address in `192.0.2.1`, `192.0.2.1:80`, `2001:db8::1`, `"[2001:db8::1]:80"`.
pub(crate) fn node_address(node: &str) -> Option<IpAddr> {
    let node = node.trim().trim_matches('"');
    let bare = node
        .strip_prefix('[')
        .and_then(|rest| rest.strip_suffix(']'));
    let bare = bare.unwrap_or(node);
    let with_port = || node.parse().ok().map(|address: SocketAddr| address.ip());
    bare.parse().ok().or_else(with_port)
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn seen(peer: &str, name: &'static str, value: &'static str) -> String {
        let mut headers = HeaderMap::new();
        headers.insert(name, HeaderValue::from_static(value));
        let trusted = "127.0.0.1, 10.0.0.0/8".parse().unwrap();
        client_of(peer.parse().unwrap(), &headers, &trusted).to_string()
    }

    #[test]
    fn only_trusted_proxies_name_the_client() {
        let list = "203.0.113.7, 198.51.100.9, 10.1.2.3";
        assert_eq!(seen("127.0.0.1", "x-forwarded-for", list), "198.51.100.9");
        assert_eq!(
            seen("::ffff:127.0.0.1", "x-forwarded-for", list),
            "198.51.100.9"
        );
        assert_eq!(seen("192.0.2.1", "x-forwarded-for", list), "192.0.2.1");
        let list = "for=203.0.113.7;proto=https, For=\"[2001:db8:1:2:3::4]:99\"";
        assert_eq!(seen("10.9.9.9", "forwarded", list), "2001:db8:1:2::/64");
        assert_eq!(seen("192.0.2.1", "forwarded", list), "192.0.2.1");
    }

    #[test]
    fn two_headers_that_disagree_name_no_client() {
        let both = |x_forwarded_for, forwarded| {
            let mut headers = HeaderMap::new();
            headers.insert("x-forwarded-for", HeaderValue::from_static(x_forwarded_for));
            headers.insert("forwarded", HeaderValue::from_static(forwarded));
            let trusted = "127.0.0.1, 10.0.0.0/8".parse().unwrap();
            let client = client_of("10.1.1.1".parse().unwrap(), &headers, &trusted);
            (client.to_string(), trusted_hops(&headers, &trusted))
        };
        let own = "10.1.1.1".to_owned();
        assert_eq!(both("203.0.113.7", "for=198.51.100.9"), (own.clone(), 1));
        assert_eq!(both("203.0.113.7, 10.2.2.2", "for=x"), (own, 1));
        let same = both("203.0.113.7, 10.2.2.2", "for=203.0.113.7, for=10.2.2.2");
        assert_eq!(same, ("203.0.113.7".to_owned(), 2));
    }

    #[test]
    fn an_unreadable_hop_ends_the_trust() {
        for list in [
            "203.0.113.7, what",
            "203.0.113.7, unknown",
            "",
            "203.0.113.7,",
        ] {
            assert_eq!(
                seen("127.0.0.1", "x-forwarded-for", list),
                "127.0.0.1",
                "{list}"
            );
        }
        let hidden = "203.0.113.7, _x, 10.1.2.3:81";
        assert_eq!(seen("127.0.0.1", "x-forwarded-for", hidden), "10.1.2.3");
        assert_eq!(seen("127.0.0.1", "forwarded", "proto=http"), "127.0.0.1");
    }

    #[test]
    fn a_host_cannot_multiply_by_its_network() {
        let one = ClientAddress::of_peer("2001:db8::1".parse().unwrap());
        assert_eq!(
            one,
            ClientAddress::of_peer("2001:db8::ffff:2".parse().unwrap())
        );
        assert_ne!(
            one,
            ClientAddress::of_peer("2001:db8:0:1::1".parse().unwrap())
        );
    }
}
