//! The open connections: how many there are, of which clients, and which ones stall.
//!
//! A new connection is admitted if there are fewer than allowed, in all and of its client. Else
//! the connection that has stalled the longest, of all or of its client, is closed in its place,
//! if it has stalled for at least [`EVICTION_PATIENCE`]. If there is none, the new connection belongs to
//! the reserve: a small number beyond the limits, which live for seconds and on which only
//! `/healthz` and `/readyz` are answered, so that a full service can still be watched. When the
//! reserve is full, its oldest connection makes room.

use super::ConnectionLimits;
use crate::wire::client::ClientAddress;
use prometheus::IntGauge;
use std::collections::{BTreeMap, BTreeSet};
use std::net::IpAddr;
use std::sync::atomic::{AtomicBool, AtomicU8, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio_util::sync::CancellationToken;

/// Time for which a connection may stall before another may take its place.
const EVICTION_PATIENCE: Duration = Duration::from_millis(500);

/// Connections beyond the limits.
const RESERVED_CONNECTIONS: usize = 64;

/// File descriptors that are kept for the database, stored files and connections to others: one
/// in this many.
const DESCRIPTORS_KEPT: usize = 4;

/// Every open connection.
pub struct Registry {
    connections: usize,
    of_one_client: usize,
    open: IntGauge,
    table: Mutex<Table>,
}

#[derive(Default)]
struct Table {
    next: u64,
    ordinary: BTreeMap<u64, Arc<OpenConnection>>,
    of_clients: BTreeMap<ClientAddress, BTreeSet<u64>>,
    reserve: BTreeMap<u64, Arc<OpenConnection>>,
}

/// An admitted connection, until this is dropped.
pub struct Ticket {
    /// The connection.
    pub connection: Arc<OpenConnection>,
    /// Whether it belongs to the reserve.
    pub reserve: bool,
    number: u64,
    registry: Arc<Registry>,
}

impl Drop for Ticket {
    fn drop(&mut self) {
        self.registry.open.dec();
        self.registry.table().remove(self.number);
    }
}

impl Registry {
    /// With these limits, lowered if the system allows fewer file descriptors. `open` is kept at the
    /// number of connections.
    pub fn new(limits: &ConnectionLimits, open: IntGauge) -> Arc<Self> {
        let connections = match descriptor_limit() {
            Some(descriptors)
                if limits.connections > descriptors - descriptors / DESCRIPTORS_KEPT =>
            {
                let possible = descriptors - descriptors / DESCRIPTORS_KEPT;
                tracing::warn!(
                    connection_limit = limits.connections,
                    possible,
                    "the system allows fewer open files than connection_limit; raise `ulimit -n`"
                );
                possible
            }
            _ => limits.connections,
        };
        Arc::new(Self {
            connections,
            of_one_client: limits.of_one_client,
            open,
            table: Mutex::default(),
        })
    }

    /// Admits a connection. Those of a `trusted` proxy belong to many clients and are not counted
    /// as one client's.
    pub fn admit(self: &Arc<Self>, peer: IpAddr, trusted: bool) -> Ticket {
        let client = (!trusted).then(|| ClientAddress::of_peer(peer));
        let connection = Arc::new(OpenConnection::new(client));
        let mut table = self.table();
        let own = client.and_then(|client| table.of_clients.get(&client));
        let mut room = true;
        if own.is_some_and(|own| own.len() >= self.of_one_client) {
            let own: Vec<u64> = own.into_iter().flatten().copied().collect();
            room = table.close_longest_stalled(own);
        }
        if room && table.ordinary.len() >= self.connections {
            let all: Vec<u64> = table.ordinary.keys().copied().collect();
            room = table.close_longest_stalled(all);
        }
        let number = table.next;
        table.next += 1;
        if room {
            table.ordinary.insert(number, connection.clone());
            if let Some(client) = client {
                table.of_clients.entry(client).or_default().insert(number);
            }
        } else {
            table.reserve.insert(number, connection.clone());
            if table.reserve.len() > RESERVED_CONNECTIONS
                && let Some((_, oldest)) = table.reserve.pop_first()
            {
                oldest.closed.cancel();
            }
        }
        self.open.inc();
        Ticket {
            connection,
            reserve: !room,
            number,
            registry: self.clone(),
        }
    }

    /// Closes the connection that has stalled the longest, if any has stalled for long.
    pub fn close_stalled(&self) {
        let mut table = self.table();
        let all: Vec<u64> = table.ordinary.keys().copied().collect();
        table.close_longest_stalled(all);
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        // A panic cannot leave the table half changed: nothing between its changes can panic.
        self.table.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Table {
    /// Of the connections with these numbers, closes the one that has stalled the longest. Returns
    /// whether one was closed.
    fn close_longest_stalled(&mut self, numbers: Vec<u64>) -> bool {
        let stalled = |number: &u64| self.ordinary.get(number)?.stalled_for();
        let stalls = numbers.iter().filter_map(|n| Some((stalled(n)?, *n)));
        match stalls.filter(|(time, _)| *time >= EVICTION_PATIENCE).max() {
            Some((_, number)) => {
                if let Some(connection) = self.remove(number) {
                    connection.closed.cancel();
                }
                true
            }
            None => false,
        }
    }

    fn remove(&mut self, number: u64) -> Option<Arc<OpenConnection>> {
        self.reserve.remove(&number);
        let connection = self.ordinary.remove(&number)?;
        if let Some(client) = connection.client
            && let Some(own) = self.of_clients.get_mut(&client)
        {
            own.remove(&number);
            if own.is_empty() {
                self.of_clients.remove(&client);
            }
        }
        Some(connection)
    }
}

/// The reason for which a connection waits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Phase {
    /// For the client: the head of a request.
    Head,
    /// For the client: the body of a request.
    Body,
    /// For the service: an answer.
    Answer,
    /// For the client: to read the answer.
    Reading,
}

/// One open connection.
pub struct OpenConnection {
    /// Cancelled to close it.
    pub closed: CancellationToken,
    client: Option<ClientAddress>,
    opened: Instant,
    /// Milliseconds from `opened` to the last byte in either direction.
    moved_at: AtomicU64,
    phase: AtomicU8,
    /// Requests that were answered, and the milliseconds from `opened` to the end of the last answer.
    answered: AtomicU64,
    answered_at: AtomicU64,
    /// Whether the current request was received to its end.
    whole: AtomicBool,
    /// Whether bytes have come since the last request that was received to its end.
    unread: AtomicBool,
    /// Whether a head did not come in time, or not all of it.
    late: AtomicBool,
}

impl OpenConnection {
    /// A connection of that client that has just been opened.
    pub fn new(client: Option<ClientAddress>) -> Self {
        Self {
            closed: CancellationToken::new(),
            client,
            opened: Instant::now(),
            moved_at: AtomicU64::new(0),
            phase: AtomicU8::new(Phase::Head as u8),
            answered: AtomicU64::new(0),
            answered_at: AtomicU64::new(0),
            whole: AtomicBool::new(true),
            unread: AtomicBool::new(false),
            late: AtomicBool::new(false),
        }
    }

    /// It is closed because a head did not come in time, or not all of it.
    pub fn set_late(&self) {
        self.late.store(true, Ordering::Relaxed);
    }

    /// Whether it was closed for that.
    pub fn is_late(&self) -> bool {
        self.late.load(Ordering::Relaxed)
    }

    /// Bytes came from the client.
    pub fn received(&self) {
        self.unread.store(true, Ordering::Relaxed);
        self.moved();
    }

    /// The head of a request was received; `whole` if it has no body.
    pub fn begin(&self, whole: bool) {
        self.whole.store(whole, Ordering::Relaxed);
    }

    /// The body of the current request was received to its end.
    pub fn received_whole(&self) {
        self.whole.store(true, Ordering::Relaxed);
    }

    /// Whether the body of the current request was received to its end.
    pub fn is_whole(&self) -> bool {
        self.whole.load(Ordering::Relaxed)
    }

    /// The current request is answered, and the next head is awaited.
    pub fn answered(&self) {
        if self.whole.load(Ordering::Relaxed) {
            self.unread.store(false, Ordering::Relaxed);
        }
        let now = self.milliseconds();
        self.answered_at.store(now, Ordering::Relaxed);
        self.answered.fetch_add(1, Ordering::Relaxed);
        self.enter(Phase::Head);
    }

    /// If a head is awaited: the number of requests answered before it, and since when.
    pub fn awaits_head(&self) -> Option<(u64, Instant)> {
        (self.phase.load(Ordering::Relaxed) == Phase::Head as u8).then(|| {
            let since = self.answered_at.load(Ordering::Relaxed);
            let since = self.opened + Duration::from_millis(since);
            (self.answered.load(Ordering::Relaxed), since)
        })
    }

    fn milliseconds(&self) -> u64 {
        u64::try_from(self.opened.elapsed().as_millis()).unwrap_or(u64::MAX)
    }

    /// Whether the client has sent, or may still be sending, what nobody reads.
    pub fn has_unread(&self) -> bool {
        self.unread.load(Ordering::Relaxed)
    }

    /// Bytes went over the connection.
    pub fn moved(&self) {
        self.moved_at.store(self.milliseconds(), Ordering::Relaxed);
    }

    /// It waits for something else from now on.
    pub fn enter(&self, phase: Phase) {
        self.phase.store(phase as u8, Ordering::Relaxed);
    }

    /// It enters `to` if it is in `from`.
    pub fn leave(&self, from: Phase, to: Phase) {
        let order = Ordering::Relaxed;
        // Fails if it is in another phase, which then stays.
        let _ = self
            .phase
            .compare_exchange(from as u8, to as u8, order, order);
    }

    /// How long it has waited for the client without a byte; `None` if it waits for the service.
    fn stalled_for(&self) -> Option<Duration> {
        if self.phase.load(Ordering::Relaxed) == Phase::Answer as u8 {
            return None;
        }
        let moved_at = Duration::from_millis(self.moved_at.load(Ordering::Relaxed));
        Some(self.opened.elapsed().saturating_sub(moved_at))
    }
}

/// Most file descriptors of this process, after raising the limit as far as it may.
#[cfg(unix)]
fn descriptor_limit() -> Option<usize> {
    use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
    let Rlimit { current, maximum } = getrlimit(Resource::Nofile);
    let raised = Rlimit {
        current: maximum,
        maximum,
    };
    let limit = match setrlimit(Resource::Nofile, raised) {
        Ok(()) => maximum,
        Err(_) => current,
    };
    limit.and_then(|limit| usize::try_from(limit).ok())
}

#[cfg(not(unix))]
fn descriptor_limit() -> Option<usize> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn registry(connections: usize, of_one_client: usize) -> Arc<Registry> {
        let limits = ConnectionLimits {
            connections,
            of_one_client,
            trusted_proxies: Default::default(),
            base_path: Default::default(),
            head: EVICTION_PATIENCE,
            idle: EVICTION_PATIENCE,
            write: EVICTION_PATIENCE,
            linger: super::super::Linger {
                total: EVICTION_PATIENCE,
                pause: EVICTION_PATIENCE,
                bytes: 0,
            },
            grace: EVICTION_PATIENCE,
        };
        Registry::new(&limits, IntGauge::new("open", "Open connections.").unwrap())
    }

    fn peer(n: u8) -> IpAddr {
        IpAddr::from([192, 0, 2, n])
    }

    /// A connection that has stalled for `seconds`.
    fn stalled(registry: &Arc<Registry>, n: u8, seconds: u64) -> Ticket {
        let mut ticket = registry.admit(peer(n), false);
        let mut old = OpenConnection::new(Some(ClientAddress::of_peer(peer(n))));
        old.opened = Instant::now() - Duration::from_secs(seconds);
        ticket.connection = Arc::new(old);
        let mut table = registry.table();
        table
            .ordinary
            .insert(ticket.number, ticket.connection.clone());
        drop(table);
        ticket
    }

    #[test]
    fn a_greedy_client_loses_its_own_longest_stalled_connection() {
        let registry = registry(10, 2);
        let other = stalled(&registry, 1, 90);
        let tickets = [stalled(&registry, 2, 3), stalled(&registry, 2, 5)];
        let next = registry.admit(peer(2), false);
        assert!(!next.reserve && tickets[1].connection.closed.is_cancelled());
        assert!(!tickets[0].connection.closed.is_cancelled());
        assert!(!other.connection.closed.is_cancelled());
        drop((tickets, next, other));
        let table = registry.table();
        assert!(table.ordinary.is_empty() && table.of_clients.is_empty());
    }

    #[test]
    fn who_waits_for_an_answer_is_not_closed_and_the_new_one_is_reserve() {
        let registry = registry(2, 10);
        let busy = [stalled(&registry, 1, 90), stalled(&registry, 2, 90)];
        busy.iter().for_each(|b| b.connection.enter(Phase::Answer));
        let mut reserve: Vec<_> = (0..RESERVED_CONNECTIONS)
            .map(|_| registry.admit(peer(3), false))
            .collect();
        assert!(reserve.iter().all(|ticket| ticket.reserve));
        reserve.push(registry.admit(peer(4), false));
        assert!(reserve[0].connection.closed.is_cancelled());
        assert!(!reserve[1].connection.closed.is_cancelled());
        busy[1].connection.enter(Phase::Reading);
        assert!(!registry.admit(peer(5), false).reserve);
        assert!(busy[1].connection.closed.is_cancelled());
        assert!(!busy[0].connection.closed.is_cancelled());
    }

    #[test]
    fn connections_of_a_trusted_proxy_are_not_one_clients() {
        let registry = registry(10, 1);
        let proxied = [registry.admit(peer(1), true), registry.admit(peer(1), true)];
        assert!(proxied.iter().all(|ticket| !ticket.reserve));
        let own = [
            registry.admit(peer(2), false),
            registry.admit(peer(2), false),
        ];
        assert!(!own[0].reserve && own[1].reserve);
    }
}
