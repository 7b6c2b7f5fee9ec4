//! Places for work of one kind, shared out in turn.
//!
//! In: whoever asks for a place, a client of a tenant or an anonymous one ([`Requester`]). Out: a [`Place`], when it is
//! its turn. Free places go round between tenants (and anonymous clients), those of a tenant between its clients, and
//! each client's requests are served in their order ([`Rounds`]). So whoever asks for little waits for about one piece
//! of work of each other tenant, however many requests, from however many addresses, others have waiting.
//!
//! [`crate::limits::decoding`] shares out memory in the same order, the store its connections to the database.

use crate::base::memory::{Group, Requester};
use std::collections::{BTreeMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use tokio::sync::oneshot;

/// Waiting work in the order of its turns.
pub struct Rounds<T> {
    /// No group is empty.
    groups: BTreeMap<Group, Round<T>>,
    /// The groups in `groups`; the first is next.
    order: VecDeque<Group>,
}

/// The waiting work of one group.
struct Round<T> {
    /// In the order of arrival; no list is empty.
    clients: BTreeMap<Requester, VecDeque<T>>,
    /// The clients in `clients`; the first is next.
    order: VecDeque<Requester>,
}

impl<T> Default for Rounds<T> {
    fn default() -> Self {
        Self {
            groups: BTreeMap::new(),
            order: VecDeque::new(),
        }
    }
}

impl<T> Default for Round<T> {
    fn default() -> Self {
        Self {
            clients: BTreeMap::new(),
            order: VecDeque::new(),
        }
    }
}

impl<T> Rounds<T> {
    /// Adds work at the end of its requester's list.
    pub fn push(&mut self, requester: Requester, work: T) {
        if !self.groups.contains_key(requester.group()) {
            self.order.push_back(requester.group().clone());
        }
        let round = self.groups.entry(requester.group().clone()).or_default();
        if !round.clients.contains_key(&requester) {
            round.order.push_back(requester.clone());
        }
        round.clients.entry(requester).or_default().push_back(work);
    }

    /// The work that is next of those requesters whose first piece `may` begin.
    pub fn next(&self, may: impl Fn(&Requester, &T) -> bool) -> Option<(&Requester, &T)> {
        let rounds = self.order.iter().filter_map(|group| self.groups.get(group));
        let mut firsts = rounds.flat_map(|round| {
            let requesters = round.order.iter();
            requesters.filter_map(move |one| Some((one, round.clients.get(one)?.front()?)))
        });
        firsts.find(|(requester, work)| may(requester, work))
    }

    /// Takes a requester's first piece of work. Its group, and it among the clients of its group, are last then.
    pub fn take(&mut self, requester: &Requester) -> Option<T> {
        let group = requester.group();
        let round = self.groups.get_mut(group)?;
        let list = round.clients.get_mut(requester)?;
        let work = list.pop_front();
        round.order.retain(|other| other != requester);
        if list.is_empty() {
            round.clients.remove(requester);
        } else {
            round.order.push_back(requester.clone());
        }
        self.order.retain(|other| other != group);
        if round.clients.is_empty() {
            self.groups.remove(group);
        } else {
            self.order.push_back(group.clone());
        }
        work
    }

    /// Keeps the work for which `keep` is true.
    pub fn retain(&mut self, keep: impl Fn(&T) -> bool) {
        self.groups.retain(|_, round| {
            round.clients.retain(|_, list| {
                list.retain(&keep);
                !list.is_empty()
            });
            let clients = &round.clients;
            round.order.retain(|one| clients.contains_key(one));
            !clients.is_empty()
        });
        let groups = &self.groups;
        self.order.retain(|one| groups.contains_key(one));
    }

    /// Number of pieces of work.
    pub fn len(&self) -> usize {
        let rounds = self.groups.values();
        let lists = rounds.flat_map(|round| round.clients.values());
        lists.map(VecDeque::len).sum()
    }

    /// Whether nothing waits.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Number of pieces of work of a requester.
    fn len_of(&self, requester: &Requester) -> usize {
        let round = self.groups.get(requester.group());
        let list = round.and_then(|round| round.clients.get(requester));
        list.map_or(0, VecDeque::len)
    }

    /// Whether among at most `longest` pieces there is room for one more of this requester. One that has less than its
    /// equal share of its group's equal share has room also where others have taken it.
    pub fn has_room(&self, requester: &Requester, longest: usize) -> bool {
        let (groups, clients) = self.sharers_with(requester);
        self.len() < longest || self.len_of(requester) * groups * clients < longest
    }

    /// The number of groups, and of clients in the group of a requester, if that had work waiting too.
    fn sharers_with(&self, requester: &Requester) -> (usize, usize) {
        let Some(round) = self.groups.get(requester.group()) else {
            return (self.groups.len() + 1, 1);
        };
        let is_new = !round.clients.contains_key(requester);
        (self.groups.len(), round.clients.len() + usize::from(is_new))
    }
}

/// A number of places.
pub struct Places {
    state: Mutex<State>,
}

struct State {
    free: usize,
    waiting: Rounds<oneshot::Sender<Place>>,
}

/// A place. Dropping it frees it.
pub struct Place(Arc<Places>);

impl Places {
    /// So many places.
    pub fn new(places: usize) -> Arc<Self> {
        Arc::new(Self {
            state: Mutex::new(State {
                free: places,
                waiting: Rounds::default(),
            }),
        })
    }

    /// Waits for a place for the caller of the current request; work that belongs to no request is one requester
    /// too. Dropping the future gives up waiting.
    pub async fn take(self: &Arc<Self>) -> Place {
        self.take_for(Requester::current()).await
    }

    /// Whether one more of this requester may wait where `longest` may.
    pub fn has_room(&self, requester: &Requester, longest: usize) -> bool {
        let mut state = self.state();
        // Some may have gone.
        state.waiting.retain(|give| !give.is_closed());
        state.waiting.has_room(requester, longest)
    }

    /// [`Places::take`] for that requester.
    pub async fn take_for(self: &Arc<Self>, requester: Requester) -> Place {
        loop {
            let (give, given) = oneshot::channel();
            self.state().waiting.push(requester.clone(), give);
            self.advance();
            // Whoever waits is told, as its sender is kept until then.
            if let Ok(place) = given.await {
                return place;
            }
        }
    }

    /// Gives free places to those who wait.
    fn advance(self: &Arc<Self>) {
        while let Some(give) = self.next() {
            // Without a receiver, the place is dropped and free again.
            let _ = give.send(Place(self.clone()));
        }
    }

    /// Takes who is next, and a place.
    fn next(&self) -> Option<oneshot::Sender<Place>> {
        let mut state = self.state();
        while state.free > 0 {
            let (requester, _) = state.waiting.next(|_, _| true)?;
            let requester = requester.clone();
            let give = state.waiting.take(&requester)?;
            if !give.is_closed() {
                state.free -= 1;
                return Some(give);
            }
        }
        None
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed: nothing between its changes can panic.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.0.state().free += 1;
        self.0.advance();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::client::ClientAddress;
    use std::net::IpAddr;

    fn caller(tenant: &str, n: u8) -> Requester {
        let client = ClientAddress::of_peer(IpAddr::from([10, 0, 0, n]));
        Requester::of_tenant(tenant.parse().unwrap(), client)
    }

    /// The requesters of waiting work, in the order in which it is taken.
    fn order(mut rounds: Rounds<usize>) -> Vec<usize> {
        let mut order = Vec::new();
        while let Some((requester, _)) = rounds.next(|_, _| true) {
            let requester = requester.clone();
            order.extend(rounds.take(&requester));
        }
        assert!(rounds.is_empty() && rounds.order.is_empty());
        order
    }

    #[test]
    fn a_tenant_counts_once_whatever_its_addresses() {
        let mut rounds = Rounds::default();
        // One tenant waits from many addresses when another one comes.
        for n in 0..100 {
            rounds.push(caller("a", n), usize::from(n));
            rounds.push(caller("a", n), 100 + usize::from(n));
        }
        rounds.push(caller("b", 1), 1000);
        rounds.push(caller("b", 1), 1001);
        rounds.push(caller("b", 2), 1002);
        assert_eq!(rounds.len(), 203);
        assert_eq!(rounds.len_of(&caller("b", 1)), 2);
        assert_eq!(rounds.sharers_with(&caller("b", 3)), (2, 3));
        assert_eq!(rounds.sharers_with(&caller("c", 1)), (3, 1));
        let order = order(rounds);
        assert_eq!(order[..6], [0, 1000, 1, 1002, 2, 1001]);
        // Those of one tenant take turns too.
        assert_eq!(order[6..103], (3..100).collect::<Vec<_>>());
        assert_eq!(order[103..], (100..200).collect::<Vec<_>>());
    }

    #[test]
    fn who_may_not_begin_is_passed_over_and_keeps_its_turn() {
        let mut rounds = Rounds::default();
        for (tenant, work) in [("a", 1), ("b", 2), ("a", 3)] {
            rounds.push(caller(tenant, 1), work);
        }
        let small = rounds.next(|_, work| *work == 2);
        assert_eq!(small, Some((&caller("b", 1), &2)));
        assert_eq!(rounds.take(&caller("b", 1)), Some(2));
        rounds.push(caller("b", 1), 4);
        assert_eq!(rounds.next(|_, _| true), Some((&caller("a", 1), &1)));
        rounds.retain(|work| *work > 3);
        assert_eq!(order(rounds), [4]);
    }

    #[tokio::test]
    async fn a_place_is_free_again_when_who_waited_for_it_has_gone() {
        let places = Places::new(1);
        let first = places.take_for(caller("a", 1)).await;
        let waiting = |who: Requester| {
            let places = places.clone();
            tokio::spawn(async move { drop(places.take_for(who).await) })
        };
        let (gone, stays) = (waiting(caller("a", 1)), waiting(caller("a", 2)));
        while places.state().waiting.len() < 2 {
            tokio::task::yield_now().await;
        }
        gone.abort();
        drop(first);
        stays.await.unwrap();
        assert!(gone.await.unwrap_err().is_cancelled());
        assert_eq!(places.state().free, 1);
        assert!(places.state().waiting.is_empty());
    }
}
