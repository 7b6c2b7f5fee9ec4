//! Turns of requesters at a few places.
//!
//! Whoever computes has a place. A free place goes to the waiting work of the tenant (or anonymous client) that has
//! computed least lately; of one tenant, to its client that has; of one client, to what waits longest. So work of who
//! asks for little waits for no more than the next free place, whatever others have begun. What was computed counts
//! half after [`HALF_LIFE`], so that nobody waits for ever.

use crate::base::memory::{Group, Requester};
use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tokio::sync::oneshot;

/// After which time of computing counts half.
const HALF_LIFE: Duration = Duration::from_secs(10);

/// Time of computing below which a requester is forgotten, seconds.
const NEGLIGIBLE_S: f64 = 1e-3;

/// The places, and who waits for one.
pub struct Turns {
    state: Mutex<State>,
}

/// A place. Dropping it frees it.
pub struct Turn(Arc<Turns>);

struct State {
    free: usize,
    used: BTreeMap<Requester, Used>,
    used_by_groups: BTreeMap<Group, Used>,
    /// In the order of asking.
    waiting: Vec<Waiting>,
}

/// Time that somebody has computed, seconds, as it counted at that moment.
#[derive(Clone, Copy)]
struct Used {
    seconds: f64,
    at: Instant,
}

struct Waiting {
    requester: Requester,
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
                used_by_groups: BTreeMap::new(),
                waiting: Vec::new(),
            }),
        })
    }

    /// Waits for a place. Dropping the future gives up waiting.
    pub async fn take(self: &Arc<Self>, requester: Requester) -> Option<Turn> {
        let (give, given) = oneshot::channel();
        self.state().waiting.push(Waiting { requester, give });
        self.advance();
        given.await.ok()
    }

    /// Counts time that a requester has computed.
    pub fn count(&self, requester: &Requester, time: Duration) {
        let now = Instant::now();
        let mut state = self.state();
        add(&mut state.used, requester, time, now);
        add(&mut state.used_by_groups, requester.group(), time, now);
    }

    /// Whether work waits that goes before further work of this requester.
    pub fn others_wait(&self, requester: &Requester) -> bool {
        let now = Instant::now();
        let state = self.state();
        let own = state.used_by(requester, now);
        let goes = |one: &Waiting| {
            one.requester == *requester || before(&state.used_by(&one.requester, now), &own).is_le()
        };
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
        let used = |one: &Waiting| state.used_by(&one.requester, now);
        let all = state.waiting.iter().enumerate();
        // The first of several that are alike.
        let (next, _) = all.min_by(|a, b| before(&used(a.1), &used(b.1)))?;
        state.free -= 1;
        Some(state.waiting.remove(next))
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed: nothing between its changes can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl State {
    /// The time that a requester's group, and it itself, have computed.
    fn used_by(&self, requester: &Requester, now: Instant) -> [f64; 2] {
        let of = |used: Option<&Used>| used.map_or(0.0, |used| used.now(now));
        let group = self.used_by_groups.get(requester.group());
        [of(group), of(self.used.get(requester))]
    }
}

/// The order of two requesters by the times that [`State::used_by`] gives.
fn before(a: &[f64; 2], b: &[f64; 2]) -> Ordering {
    a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]))
}

/// Adds time to what somebody has computed, and forgets who has computed nothing lately.
fn add<K: Ord + Clone>(used: &mut BTreeMap<K, Used>, of: &K, time: Duration, now: Instant) {
    used.retain(|_, used| used.now(now) > NEGLIGIBLE_S);
    let before = used.get(of).map_or(0.0, |used| used.now(now));
    let seconds = before + time.as_secs_f64();
    used.insert(of.clone(), Used { seconds, at: now });
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
    use crate::base::client::ClientAddress;
    use std::net::IpAddr;

    fn client(n: u8) -> Requester {
        Requester::anonymous(ClientAddress::of_peer(IpAddr::from([10, 0, 0, n])))
    }

    #[tokio::test]
    async fn who_has_computed_least_is_next() {
        let turns = Turns::new(1);
        let first = turns.take(client(1)).await;
        turns.count(&client(1), Duration::from_secs(3));
        turns.count(&client(2), Duration::from_secs(1));
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
        assert!(turns.others_wait(&client(1)));
        assert!(turns.others_wait(&client(3)), "more of its own waits");
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(
            *order.lock().unwrap(),
            [(3, 4), (2, 2), (2, 3), (1, 0), (1, 1)]
        );
        assert_eq!(turns.free(), 1);
        assert!(!turns.others_wait(&client(1)));
    }

    /// Two tenants behind one address, one of them also at many others.
    #[tokio::test]
    async fn tenants_have_turns_whatever_their_addresses() {
        let at = |tenant: &str, n: u8| {
            let address = ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]));
            Requester::of_tenant(tenant.parse().unwrap(), address)
        };
        let turns = Turns::new(1);
        let first = turns.take(at("busy", 1)).await;
        turns.count(&at("busy", 1), Duration::from_secs(3));
        assert!(!turns.others_wait(&at("calm", 1)));
        let order = Arc::new(Mutex::new(Vec::new()));
        let mut tasks = Vec::new();
        for (tenant, n) in [("busy", 1), ("busy", 2), ("busy", 3), ("calm", 1)] {
            let (turns, order) = (turns.clone(), order.clone());
            tasks.push(tokio::spawn(async move {
                let turn = turns.take(at(tenant, n)).await;
                order.lock().unwrap().push((tenant, n));
                drop(turn);
            }));
            tokio::task::yield_now().await;
        }
        drop(first);
        for task in tasks {
            task.await.unwrap();
        }
        assert_eq!(
            *order.lock().unwrap(),
            [("calm", 1), ("busy", 2), ("busy", 3), ("busy", 1)]
        );
    }

    #[tokio::test]
    async fn who_has_computed_less_goes_on() {
        let turns = Turns::new(0);
        turns.count(&client(1), Duration::from_secs(3));
        let waiting = turns.take(client(1));
        let mut waiting = std::pin::pin!(waiting);
        assert!(futures::poll!(&mut waiting).is_pending());
        assert!(!turns.others_wait(&client(2)), "it has computed nothing");
        turns.count(&client(2), Duration::from_secs(4));
        assert!(turns.others_wait(&client(2)));
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
