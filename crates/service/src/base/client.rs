//! The client whose request is answered: the address that limits are counted for.
//!
//! An IPv6 address stands for its /64 network, which one host can use as a whole. Whoever answers a request runs the
//! answering within [`ClientAddress::scope`], so that shared code can ask for [`ClientAddress::current`] without being
//! handed the request.

use std::fmt;
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr};

tokio::task_local! {
    static REQUEST_CLIENT: ClientAddress;
}

/// The address of a client, or its network where a host can take any address of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClientAddress(IpAddr);

impl ClientAddress {
    /// The unspecified address, of work that belongs to no request.
    pub const NONE: Self = Self(IpAddr::V4(Ipv4Addr::UNSPECIFIED));

    /// The address of the other end of a connection.
    pub fn of_peer(peer: IpAddr) -> Self {
        Self(match peer.to_canonical() {
            IpAddr::V6(address) => {
                let network = u128::from(address) & !u128::from(u64::MAX);
                IpAddr::V6(Ipv6Addr::from(network))
            }
            v4 => v4,
        })
    }

    /// The client of the request that the current task answers. Work that belongs to no request
    /// counts as that of the unspecified address.
    pub fn current() -> Self {
        REQUEST_CLIENT
            .try_with(|client| *client)
            .unwrap_or(Self::NONE)
    }

    /// Runs the answering of a request of this client.
    pub async fn scope<T>(self, answer: impl Future<Output = T>) -> T {
        REQUEST_CLIENT.scope(self, answer).await
    }
}

impl fmt::Display for ClientAddress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            IpAddr::V4(address) => address.fmt(f),
            IpAddr::V6(network) => write!(f, "{network}/64"),
        }
    }
}
