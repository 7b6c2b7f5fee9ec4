//! Turns of clients at a few places.
//!
//! Whoever computes has a place. A free place goes to the waiting work of the client that has computed least
//! lately; of one client, to what waits longest. So work of a client that asks for little waits for no more
//! than the next free place, whatever others have begun. What a client has computed counts half after
//! [`HALF_LIFE`], so that nobody waits for ever.

use crate::client::ClientAddress;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// After which time of computing counts half.
const HALF_LIFE: Duration = Duration::from_secs(10);

/// Time of computing below which a client is forgotten, seconds.
const NEGLIGIBLE_S: f64 = 1e-3;

/// The places, and who waits for one.
pub struct Turns {
    state: Mutex<State>,
}

/// A place. Dropping it frees it.
pub struct Turn(Arc<Turns>);

struct State {
    free: usize,
    used: BTreeMap<ClientAddress, Used>,
    /// In the order of asking.
    waiting: Vec<Waiting>,
}

/// Time that a client has computed, seconds, as it counted at that moment.
#[derive(Clone, Copy)]
struct Used {
    seconds: f64,
    at: Instant,
}

struct Waiting {
    client: ClientAddress,
    give: oneshot::Sender<Turn>,
}

impl Used {
    fn now(&self, now: Instant) -> f64 {
        let age = now.saturating_duration_since(self.at).as_secs_f64();
        self.seconds * (-age / HALF_LIFE.as_secs_f64()).exp2()
    }
}

impl Turns {
    /// So many places.
    pub fn new(places: usize) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::new(State {
                free: places,
                used: BTreeMap::new(),
                waiting: Vec::new(),
            }),
        })
    }

    /// Waits for a place. Dropping the future gives up waiting.
    pub async fn take(self: &Arc<Self>, client: ClientAddress) -> Option<Turn> {
        let (give, given) = oneshot::channel();
        self.state().waiting.push(Waiting { client, give });
        self.advance();
        given.await.ok()
    }

    /// Counts time that a client has computed.
    pub fn count(&self, client: ClientAddress, time: Duration) {
        let now = Instant::now();
        let mut state = self.state();
        state.used.retain(|_, used| used.now(now) > NEGLIGIBLE_S);
        let before = state.used.get(&client).map_or(0.0, |used| used.now(now));
        let seconds = before + time.as_secs_f64();
        state.used.insert(client, Used { seconds, at: now });
    }

    /// Whether work waits that goes before further work of this client.
    pub fn others_wait(&self, client: ClientAddress) -> bool {
        let now = Instant::now();
        let state = self.state();
        let own = state.used_by(client, now);
        let goes = |one: &Waiting| one.client == client || state.used_by(one.client, now) <= own;
        let mut waiting = state.waiting.iter().filter(|one| !one.give.is_closed());
        waiting.any(goes)
    }

    /// Gives free places to those who wait.
    fn advance(self: &Arc<Self>) {
        while let Some(next) = self.next() {
            // Without a receiver, the turn is dropped and the place is free again.
            let _ = next.give.send(Turn(self.clone()));
        }
    }

    /// Takes who is next, and a place.
    fn next(&self) -> Option<Waiting> {
        let now = Instant::now();
        let mut state = self.state();
        state.waiting.retain(|one| !one.give.is_closed());
        if state.free == 0 {
            return None;
        }
        let used = |one: &Waiting| state.used_by(one.client, now);
        let all = state.waiting.iter().enumerate();
        // The first of several that are alike.
        let (next, _) = all.min_by(|a, b| used(a.1).total_cmp(&used(b.1)))?;
        state.free -= 1;
        Some(state.waiting.remove(next))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed: nothing between its changes can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    fn used_by(&self, client: ClientAddress, now: Instant) -> f64 {
        self.used.get(&client).map_or(0.0, |used| used.now(now))
    }
}

impl Drop for Turn {
    fn drop(&mut self) {
        self.0.state().free += 1;
        self.0.advance();
    }
}

#[cfg(test)]
impl Turns {
    /// The number of free places.
    pub fn free(&self) -> usize {
        self.state().free
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::net::IpAddr;

    fn client(n: u8) -> ClientAddress {
        ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]))
    }

    #[tokio::test]
    async fn who_has_computed_least_is_next() {
        let turns = Turns::new(1);
        let first = turns.take(client(1)).await;
        turns.count(client(1), Duration::from_secs(3));
        turns.count(client(2), Duration::from_secs(1));
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut tasks = Vec::new();
        for (n, who) in [1, 1, 2, 2, 3].into_iter().enumerate() {
            let (turns, order) = (turns.clone(), order.clone());
            tasks.push(tokio::spawn(async move {
                let turn = turns.take(client(who)).await;
                order.lock().unwrap().push((who, n));
                drop(turn);
            }));
            tokio::task::yield_now().await;
        }
        // One that has gone is passed over.
        let gone = tokio::spawn({
            let turns = turns.clone();
            async move { turns.take(client(9)).await }
        });
        tokio::task::yield_now().await;
        gone.abort();
        assert!(gone.await.is_err());
        assert!(turns.others_wait(client(1)));
        assert!(turns.others_wait(client(3)), "more of its own waits");
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(
            *order.lock().unwrap(),
            [(3, 4), (2, 2), (2, 3), (1, 0), (1, 1)]
        );
        assert_eq!(turns.free(), 1);
        assert!(!turns.others_wait(client(1)));
    }

    #[tokio::test]
    async fn who_has_computed_less_goes_on() {
        let turns = Turns::new(0);
        turns.count(client(1), Duration::from_secs(3));
        let waiting = turns.take(client(1));
        let mut waiting = std::pin::pin!(waiting);
        assert!(futures::poll!(&mut waiting).is_pending());
        assert!(!turns.others_wait(client(2)), "it has computed nothing");
        turns.count(client(2), Duration::from_secs(4));
        assert!(turns.others_wait(client(2)));
    }

    #[test]
    fn what_was_computed_counts_ever_less() {
        let at = Instant::now();
        let used = Used { seconds: 8.0, at };
        for (halves, left) in [(0, 8.0), (1, 4.0), (3, 1.0)] {
            let then = used.now(at + HALF_LIFE * halves);
            assert!((then - left).abs() < 1e-9, "{then}");
        }
    }
}
