//! Which URLs may be told: the guard against requests that a client makes this machine send
//! (OWASP API7, server-side request forgery).
//!
//! A URL is taken apart and its host resolved, and all of these must hold:
//!
//! 1. the scheme is `https`; `http` is for allowed hosts only;
//! 2. there is no user, no password and no fragment, and the URL is at most 2048 bytes long;
//! 3. the port is 443, 80 or above 1023; allowed hosts may have any;
//! 4. every address that the name resolves to is public, or allowed.
//!
//! Public are the addresses of the global unicast ranges without those that the registries of
//! special-purpose addresses name (RFC 6890, IANA): no loopback, private, link-local (metadata
//! services of clouds), shared, multicast, documentation or benchmark ranges, and no IPv6 address
//! that stands for an IPv4 address (mapped, NAT64, 6to4, Teredo).
//!
//! The answer holds the addresses, and a connection is made to these ([`PinnedNames`]). The name
//! is not resolved again, so a name server cannot give another address after the check (DNS
//! rebinding).

use crate::base::http_client::Resolver;
use ipnet::IpNet;
use std::collections::BTreeMap;
use std::fmt;
use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;
use url::Url;

/// Longest URL, bytes.
const LONGEST_URL: usize = 2048;

/// Longest time to resolve a name.
const RESOLVE_LIMIT: Duration = Duration::from_secs(5);

/// Ranges of IPv4 that are not public.
const CLOSED_V4: [&str; 17] = [
    "0.0.0.0/8",
    "10.0.0.0/8",
    "100.64.0.0/10",
    "127.0.0.0/8",
    // The agent of Azure's machines.
    "168.63.129.16/32",
    "169.254.0.0/16",
    "172.16.0.0/12",
    "192.0.0.0/24",
    "192.0.2.0/24",
    "192.31.196.0/24",
    "192.52.193.0/24",
    "192.88.99.0/24",
    "192.168.0.0/16",
    "198.18.0.0/15",
    "198.51.100.0/24",
    "203.0.113.0/24",
    // Multicast, reserved and broadcast.
    "224.0.0.0/3",
];

/// The one range of IPv6 in which addresses are public, and what is not public within it.
const OPEN_V6: &str = "2000::/3";
const CLOSED_V6: [&str; 6] = [
    // Protocols, among them Teredo and ORCHID.
    "2001::/23",
    "2001:db8::/32",
    "2002::/16",
    "2620:4f:8000::/48",
    "3ffe::/16",
    "3fff::/20",
];

/// Hosts and networks that may be told although they are not public, separated by commas.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct AllowList {
    names: Vec<String>,
    networks: Vec<IpNet>,
}

impl FromStr for AllowList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut list = Self::default();
        for entry in text.split(',').map(str::trim).filter(|e| !e.is_empty()) {
            let network = entry.parse().or(entry.parse::<IpAddr>().map(IpNet::from));
            let letter = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
            match network {
                Ok(network) => list.networks.push(network),
                Err(_) if entry.chars().all(letter) => {
                    list.names
                        .push(entry.trim_end_matches('.').to_ascii_lowercase());
                }
                Err(_) => {
                    return Err(format!(
                        "`{entry}` is no host name, address or network: give some such as \
                         `ris.example.org,10.1.0.0/16`"
                    ));
                }
            }
        }
        Ok(list)
    }
}

impl fmt::Display for AllowList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let networks = self.networks.iter().map(ToString::to_string);
        let all: Vec<String> = self.names.iter().cloned().chain(networks).collect();
        f.write_str(&all.join(","))
    }
}

impl AllowList {
    fn has_name(&self, host: &str) -> bool {
        let host = host.trim_end_matches('.').to_ascii_lowercase();
        self.names.contains(&host)
    }

    fn has_address(&self, address: IpAddr) -> bool {
        self.networks.iter().any(|net| net.contains(&address))
    }
}

/// Why a URL may not be told. The text is for the client that gave it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct UrlRefusal(pub &'static str);

/// A URL that may be told, and the addresses to which it leads.
#[derive(Debug, Clone)]
pub struct CheckedUrl {
    /// The URL.
    pub url: Url,
    /// Its host.
    pub host: String,
    /// The addresses that were checked.
    pub addresses: Vec<SocketAddr>,
}

impl CheckedUrl {
    /// Scheme, host and port.
    pub fn destination(&self) -> String {
        let port = self.url.port_or_known_default().unwrap_or_default();
        format!("{}://{}:{port}", self.url.scheme(), self.host)
    }
}

/// Decides which URLs may be told.
#[derive(Debug, Clone)]
pub struct UrlGuard {
    allow: AllowList,
    /// Whether public addresses pass beside the allowed ones.
    public: bool,
    closed: Vec<IpNet>,
    open_v6: Option<IpNet>,
}

impl UrlGuard {
    /// A guard that lets pass what is public or in the list.
    pub fn new(allow: AllowList) -> Self {
        let ranges = CLOSED_V4.iter().chain(&CLOSED_V6);
        Self {
            allow,
            public: true,
            closed: ranges.filter_map(|range| range.parse().ok()).collect(),
            open_v6: OPEN_V6.parse().ok(),
        }
    }

    /// A guard that lets pass only what is in the list.
    pub fn of_listed(allow: AllowList) -> Self {
        Self {
            public: false,
            ..Self::new(allow)
        }
    }

    /// Checks a URL when it is given; returns its destination: scheme, host and port.
    ///
    /// # Errors
    /// Why it may not be told.
    pub async fn check(&self, url: &str) -> Result<String, UrlRefusal> {
        Ok(self.resolve(url).await?.destination())
    }

    /// Checks a URL and resolves its host.
    ///
    /// # Errors
    /// Why it may not be told.
    pub async fn resolve(&self, text: &str) -> Result<CheckedUrl, UrlRefusal> {
        if text.len() > LONGEST_URL {
            return Err(UrlRefusal("The URL is longer than 2048 bytes."));
        }
        let url = Url::parse(text).map_err(|_| UrlRefusal("It is not an absolute URL."))?;
        if !matches!(url.scheme(), "https" | "http") {
            return Err(UrlRefusal("The URL must begin with `https://`."));
        }
        if !url.username().is_empty() || url.password().is_some() || url.fragment().is_some() {
            return Err(UrlRefusal(
                "The URL must have no user, no password and no fragment.",
            ));
        }
        let host = url.host_str().unwrap_or_default().to_owned();
        let port = url.port_or_known_default().unwrap_or_default();
        let addresses = resolve_host(&host, port).await?;
        let named = self.allow.has_name(&host);
        let allowed = |a: &SocketAddr| named || self.allow.has_address(a.ip().to_canonical());
        let addresses_allowed = addresses.iter().all(allowed);
        if !addresses_allowed && !self.public {
            return Err(UrlRefusal("The operator has not allowed that host."));
        }
        if !addresses_allowed {
            if url.scheme() == "http" {
                return Err(UrlRefusal(
                    "The URL must begin with `https://`: `http` is for hosts that the operator has \
                     allowed.",
                ));
            }
            if !(port == 443 || port == 80 || port > 1023) {
                return Err(UrlRefusal("The port must be 443, 80 or above 1023."));
            }
            if !addresses
                .iter()
                .all(|a| allowed(a) || self.is_public(a.ip()))
            {
                return Err(UrlRefusal("The host's address is not public."));
            }
        }
        Ok(CheckedUrl {
            url,
            host,
            addresses,
        })
    }

    /// Whether requests to this address reach the public network only.
    fn is_public(&self, address: IpAddr) -> bool {
        let open = match address {
            IpAddr::V4(_) => true,
            IpAddr::V6(_) => self.open_v6.is_some_and(|net| net.contains(&address)),
        };
        open && !self.closed.iter().any(|net| net.contains(&address))
    }
}

async fn resolve_host(host: &str, port: u16) -> Result<Vec<SocketAddr>, UrlRefusal> {
    let literal = host.trim_start_matches('[').trim_end_matches(']');
    if let Ok(address) = literal.parse::<IpAddr>() {
        return Ok(vec![SocketAddr::new(address, port)]);
    }
    let found = tokio::time::timeout(RESOLVE_LIMIT, tokio::net::lookup_host((host, port))).await;
    let found: Vec<SocketAddr> = match found {
        Ok(Ok(addresses)) => addresses.collect(),
        Ok(Err(_)) | Err(_) => Vec::new(),
    };
    if found.is_empty() {
        Err(UrlRefusal("The host's name cannot be resolved."))
    } else {
        Ok(found)
    }
}

/// The resolver of the HTTP client: it knows only names that were checked, while they are pinned.
#[derive(Debug, Clone, Default)]
pub struct PinnedNames(Arc<Mutex<BTreeMap<String, PinnedAddresses>>>);

/// How often a name is pinned, and the addresses that were checked.
type PinnedAddresses = (usize, Vec<SocketAddr>);

/// Keeps a name pinned.
pub struct Pin {
    names: PinnedNames,
    host: String,
}

impl PinnedNames {
    /// Makes the host lead to the addresses that were checked, until the pin is dropped.
    pub fn pin(&self, checked: &CheckedUrl) -> Pin {
        let mut names = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let entry = names.entry(checked.host.clone()).or_default();
        entry.0 += 1;
        entry.1.clone_from(&checked.addresses);
        Pin {
            names: self.clone(),
            host: checked.host.clone(),
        }
    }
}

impl Drop for Pin {
    fn drop(&mut self) {
        let names = &self.names.0;
        let mut names = names.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(entry) = names.get_mut(&self.host) {
            entry.0 -= 1;
            if entry.0 == 0 {
                names.remove(&self.host);
            }
        }
    }
}

impl Resolver for PinnedNames {
    fn resolve(&self, host: &str) -> Option<Vec<SocketAddr>> {
        let names = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        names.get(host).map(|(_, addresses)| addresses.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guard(allow: &str) -> UrlGuard {
        UrlGuard::new(allow.parse().unwrap())
    }

    async fn refusal(guard: &UrlGuard, url: &str) -> Option<&'static str> {
        guard.check(url).await.err().map(|refusal| refusal.0)
    }

    #[test]
    fn only_global_unicast_addresses_are_public() {
        let guard = guard("");
        for public in [
            "8.8.8.8",
            "1.1.1.1",
            "100.63.255.255",
            "100.128.0.0",
            "172.15.255.255",
            "172.32.0.1",
            "192.0.1.1",
            "198.17.255.255",
            "198.20.0.1",
            "223.255.255.255",
            "2606:4700:4700::1111",
            "2a00:1450::1",
        ] {
            assert!(guard.is_public(public.parse().unwrap()), "{public}");
        }
        for closed in [
            "0.0.0.0",
            "0.1.2.3",
            "10.0.0.1",
            "100.64.0.1",
            "100.100.100.200",
            "127.0.0.1",
            "127.255.255.254",
            "168.63.129.16",
            "169.254.169.254",
            "172.16.0.1",
            "172.31.255.255",
            "192.0.0.192",
            "192.0.2.1",
            "192.88.99.1",
            "192.168.1.1",
            "198.18.0.1",
            "198.19.255.255",
            "198.51.100.7",
            "203.0.113.9",
            "224.0.0.1",
            "239.1.1.1",
            "240.0.0.1",
            "255.255.255.255",
            "::",
            "::1",
            // Addresses that stand for IPv4: mapped, compatible, NAT64, 6to4, Teredo.
            "::ffff:8.8.8.8",
            "::ffff:169.254.169.254",
            "::8.8.8.8",
            "64:ff9b::8.8.8.8",
            "64:ff9b:1::1",
            "2002:7f00:1::",
            "2001:0:4136:e378::1",
            "100::1",
            "2001:db8::1",
            "3fff::1",
            "5f00::1",
            "fc00::1",
            "fd00:ec2::254",
            "fe80::1",
            "fec0::1",
            "ff02::1",
        ] {
            assert!(!guard.is_public(closed.parse().unwrap()), "{closed}");
        }
    }

    #[tokio::test]
    async fn a_guard_of_listed_hosts_lets_nothing_else_pass() {
        let guard = UrlGuard::of_listed("10.1.0.0/16".parse().unwrap());
        assert_eq!(refusal(&guard, "http://10.1.2.3/dicom-web").await, None);
        for other in ["https://8.8.8.8/", "https://10.2.0.1/", "http://127.0.0.1/"] {
            let refused = refusal(&guard, other).await;
            assert_eq!(refused, Some("The operator has not allowed that host."));
        }
    }

    #[test]
    fn every_range_of_the_tables_is_valid() {
        assert_eq!(guard("").closed.len(), CLOSED_V4.len() + CLOSED_V6.len());
        assert!(guard("").open_v6.is_some());
    }

    #[tokio::test]
    async fn urls_that_reach_this_machine_are_refused_however_they_are_written() {
        let guard = guard("");
        for url in [
            "https://127.0.0.1/",
            "https://127.1/",
            "https://0x7f.1/",
            "https://2130706433/",
            "https://0177.0.0.1/",
            "https://[::1]/",
            "https://[::ffff:127.0.0.1]/",
            "https://[::ffff:7f00:1]:8443/",
            "https://169.254.169.254/latest/meta-data/",
            "https://localhost/",
            "https://LOCALHOST:8443/",
            "https://１２７.0.0.1/",
        ] {
            assert_eq!(
                refusal(&guard, url).await,
                Some("The host's address is not public."),
                "{url}"
            );
        }
    }

    #[tokio::test]
    async fn schemes_users_fragments_ports_and_lengths_are_checked() {
        let guard = guard("");
        assert_eq!(refusal(&guard, "https://8.8.8.8/hook?a=b").await, None);
        assert_eq!(refusal(&guard, "https://8.8.8.8:8443/").await, None);
        let long = format!("https://8.8.8.8/{}", "a".repeat(2048));
        for url in [
            "http://8.8.8.8/",
            "ftp://8.8.8.8/",
            "file:///etc/passwd",
            "https://user@8.8.8.8/",
            "https://user:word@8.8.8.8/",
            "https://8.8.8.8/#part",
            "https://8.8.8.8:22/",
            "https://8.8.8.8:25/",
            "//8.8.8.8/",
            "hook",
            "",
            "https://",
            long.as_str(),
        ] {
            assert!(refusal(&guard, url).await.is_some(), "{url}");
        }
        assert_eq!(
            refusal(&guard, "https://no-such-host.invalid/").await,
            Some("The host's name cannot be resolved.")
        );
    }

    #[tokio::test]
    async fn allowed_networks_and_names_may_be_private_and_speak_http() {
        let networks = guard("127.0.0.0/8, 10.1.2.3");
        assert_eq!(refusal(&networks, "http://127.0.0.1:81/").await, None);
        assert_eq!(refusal(&networks, "https://10.1.2.3/").await, None);
        assert!(refusal(&networks, "https://10.1.2.4/").await.is_some());
        // The network is allowed, however the address is written.
        assert_eq!(refusal(&networks, "http://[::ffff:127.0.0.1]/").await, None);
        let names = guard("Localhost");
        assert_eq!(refusal(&names, "http://localhost:22/").await, None);
        assert!(refusal(&names, "http://127.0.0.1/").await.is_some());
    }

    #[test]
    fn allow_lists_are_written_as_they_are_read() {
        let list: AllowList = "ris.example.org, 10.0.0.0/8,fd00::/8".parse().unwrap();
        assert_eq!(list.to_string(), "ris.example.org,10.0.0.0/8,fd00::/8");
        assert_eq!(list.to_string().parse(), Ok(list));
        assert!("http://ris".parse::<AllowList>().is_err());
    }

    #[tokio::test]
    async fn names_lead_to_their_addresses_while_they_are_pinned() {
        let names = PinnedNames::default();
        let resolved = || names.resolve("localhost");
        assert_eq!(resolved(), None);
        let checked = guard("localhost")
            .resolve("http://localhost:1/")
            .await
            .unwrap();
        let (pin, second) = (names.pin(&checked), names.pin(&checked));
        assert_eq!(resolved().as_ref(), Some(&checked.addresses));
        drop(pin);
        assert_eq!(resolved().as_ref(), Some(&checked.addresses));
        drop(second);
        assert_eq!(resolved(), None);
    }
}
