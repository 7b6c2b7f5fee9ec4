//! Whose turn it is: fairness among tenants and among destinations.
//!
//! What one tenant has for one destination (scheme, host and port; or an archive) is a [`Lane`]. The places are a limit
//! on what is on the way in all, and each destination has a limit of its own. A tenant takes all places of a limit
//! while nobody else wants one, and half of them while another tenant has something due. Who has nothing on the way
//! gets one place also where others have taken all, up to twice the limit in all: what they have on the way may take as
//! long as its receivers like.
//!
//! A lane whose last attempt failed has one place, after a pause that grows. All failing lanes together have half of
//! the places, shared in the same way, so that receivers that hang leave the other half to those that answer.

use super::RetrySchedule;
use crate::base::records::{Tenant, Timestamp, milliseconds};
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// The longest pause of a failing lane.
const LONGEST_REST: Duration = Duration::from_secs(60);

/// What one tenant has to do at one destination.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct Lane {
    /// The other end: scheme, host and port, or the name of an archive.
    pub destination: String,
    /// Whose errands they are.
    pub tenant: Tenant,
}

/// The lanes, and what is on the way in them.
#[derive(Debug)]
pub struct Lanes {
    places: usize,
    per_destination: usize,
    pauses: RetrySchedule,
    traffic: BTreeMap<Lane, Traffic>,
    /// The tenants that have something due, for each destination.
    due: BTreeMap<String, BTreeSet<Tenant>>,
    /// The same, for all destinations together.
    due_anywhere: BTreeSet<Tenant>,
    /// The lane that was served last; the next round begins after it.
    last: Option<Lane>,
}

#[derive(Debug, Default)]
struct Traffic {
    on_the_way: BTreeSet<String>,
    failures: u32,
    not_before: Timestamp,
    /// The length of that rest.
    rest: Duration,
}

impl Lanes {
    /// Empty lanes with that many places in all and at each destination.
    pub fn new(places: usize, per_destination: usize, pauses: RetrySchedule) -> Self {
        Self {
            places: places.max(2),
            per_destination: per_destination.max(1),
            pauses,
            traffic: BTreeMap::new(),
            due: BTreeMap::new(),
            due_anywhere: BTreeSet::new(),
            last: None,
        }
    }

    /// Begins a round at `now` with the lanes that have something pending and the time when the first of it is due:
    /// notes whose it is, and forgets the lanes that have nothing on the way and nothing pending.
    pub fn begin_round(&mut self, pending: &[(Lane, Timestamp)], now: Timestamp) {
        let known: BTreeSet<&Lane> = pending.iter().map(|(lane, _)| lane).collect();
        self.traffic
            .retain(|lane, traffic| !traffic.on_the_way.is_empty() || known.contains(lane));
        for traffic in self.traffic.values_mut() {
            // After the clock was set back, no lane rests for longer than it was to.
            let latest = now.saturating_add(milliseconds(traffic.rest));
            traffic.not_before = traffic.not_before.min(latest);
        }
        self.due.clear();
        self.due_anywhere.clear();
        for (lane, due_at) in pending {
            if *due_at <= now && self.rests_until(lane) <= now {
                let here = self.due.entry(lane.destination.clone()).or_default();
                here.insert(lane.tenant.clone());
                self.due_anywhere.insert(lane.tenant.clone());
            }
        }
    }

    /// The lanes in the order of their turns: first those of tenants with the least on the way, and among them those
    /// after the last one served.
    pub fn in_turn(&self, lanes: Vec<(Lane, Timestamp)>) -> Vec<(Lane, Timestamp)> {
        let (mut first, then): (Vec<_>, Vec<_>) = lanes
            .into_iter()
            .partition(|(lane, _)| Some(lane) > self.last.as_ref());
        first.extend(then);
        let mut busy: BTreeMap<&Tenant, usize> = BTreeMap::new();
        for (lane, traffic) in &self.traffic {
            *busy.entry(&lane.tenant).or_default() += traffic.on_the_way.len();
        }
        first.sort_by_key(|(lane, _)| busy.get(&lane.tenant).copied().unwrap_or(0));
        first
    }

    /// How many more errands of a lane may be started at `now`.
    pub fn room(&self, lane: &Lane, now: Timestamp) -> usize {
        let tenant = &lane.tenant;
        let others = |due: &BTreeSet<Tenant>| due.iter().any(|other| other != tenant);
        let contended = others(&self.due_anywhere);
        let own = |other: &Lane, _: &Traffic| other.tenant == *tenant;
        let in_all = share(self.places, self.sum(|_, _| true), self.sum(own), contended);
        let here = |other: &Lane, _: &Traffic| other.destination == lane.destination;
        let at_destination = share(
            self.per_destination,
            self.sum(here),
            self.busy(lane),
            self.due.get(&lane.destination).is_some_and(others),
        );
        let room = in_all.min(at_destination);
        let Some(traffic) = self.traffic.get(lane).filter(|t| t.failures > 0) else {
            return room;
        };
        let failing = |_: &Lane, traffic: &Traffic| traffic.failures > 0;
        let own_failing = |l: &Lane, t: &Traffic| own(l, t) && failing(l, t);
        let left = share(
            self.places / 2,
            self.sum(failing),
            self.sum(own_failing),
            contended,
        );
        let may = now >= traffic.not_before && traffic.on_the_way.is_empty() && left > 0;
        room.min(usize::from(may))
    }

    /// Number of errands on the way in the lanes that `counts`.
    fn sum(&self, counts: impl Fn(&Lane, &Traffic) -> bool) -> usize {
        let counted = self.traffic.iter().filter(|(lane, t)| counts(lane, t));
        counted.map(|(_, traffic)| traffic.on_the_way.len()).sum()
    }

    /// Number of errands on the way in a lane.
    pub fn busy(&self, lane: &Lane) -> usize {
        self.traffic
            .get(lane)
            .map_or(0, |traffic| traffic.on_the_way.len())
    }

    /// When a failing lane may be served again.
    pub fn rests_until(&self, lane: &Lane) -> Timestamp {
        self.traffic
            .get(lane)
            .map_or(0, |traffic| traffic.not_before)
    }

    /// Takes a place for an errand. `false` if it is on the way already.
    pub fn enter(&mut self, lane: &Lane, id: &str) -> bool {
        self.last = Some(lane.clone());
        let traffic = self.traffic.entry(lane.clone()).or_default();
        traffic.on_the_way.insert(id.to_owned())
    }

    /// Gives the place back. `failed` makes the lane rest, for at least the time that the
    /// receiver asked for.
    pub fn leave(
        &mut self,
        lane: &Lane,
        id: &str,
        now: Timestamp,
        failed: Option<Option<Duration>>,
    ) {
        let Some(traffic) = self.traffic.get_mut(lane) else {
            return;
        };
        traffic.on_the_way.remove(id);
        match failed {
            None => {
                traffic.failures = 0;
                traffic.not_before = 0;
            }
            Some(asked) => {
                traffic.failures = traffic.failures.saturating_add(1);
                let rest = self.pauses.pause(traffic.failures).min(LONGEST_REST);
                let rest = rest.max(asked.unwrap_or_default());
                traffic.rest = rest;
                traffic.not_before = now.saturating_add(milliseconds(rest));
            }
        }
    }
}

/// How many more of the places of a limit one may take who has `own` of the `taken` ones. `contended` says whether
/// others want one now.
fn share(limit: usize, taken: usize, own: usize, contended: bool) -> usize {
    let most = if contended { limit.div_ceil(2) } else { limit };
    let rest = limit.saturating_sub(taken).min(most.saturating_sub(own));
    let first = own == 0 && taken < limit.saturating_mul(2);
    rest.max(usize::from(first))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lanes(places: usize, per_destination: usize) -> Lanes {
        let pauses = RetrySchedule {
            first: Duration::from_secs(1),
            attempts: 5,
            age: Duration::from_secs(1000),
        };
        Lanes::new(places, per_destination, pauses)
    }

    fn lane(tenant: &str, destination: &str) -> Lane {
        Lane {
            destination: destination.to_owned(),
            tenant: tenant.parse().unwrap(),
        }
    }

    /// The lane of the only tenant.
    fn own(destination: &str) -> Lane {
        lane("default", destination)
    }

    #[test]
    fn one_destination_never_takes_all_places() {
        let mut lanes = lanes(4, 2);
        let (a, b) = (own("a"), own("b"));
        assert_eq!(lanes.room(&a, 0), 2);
        assert!(lanes.enter(&a, "1") && lanes.enter(&a, "2"));
        assert!(!lanes.enter(&a, "2"), "it is on the way");
        assert_eq!((lanes.room(&a, 0), lanes.room(&b, 0)), (0, 2));
    }

    #[test]
    fn failing_destinations_take_half_of_the_places_at_most() {
        let mut lanes = lanes(4, 2);
        let (a, b, c) = (own("a"), own("b"), own("c"));
        for lane in [&a, &b, &c] {
            lanes.enter(lane, "1");
            lanes.leave(lane, "1", 0, Some(None));
        }
        assert_eq!(lanes.room(&a, 999), 0, "it rests");
        assert_eq!(lanes.rests_until(&a), 1000);
        assert_eq!(
            lanes.room(&a, 1000),
            1,
            "one attempt shows whether it answers again"
        );
        lanes.enter(&a, "2");
        lanes.enter(&b, "2");
        assert_eq!(
            lanes.room(&c, 1000),
            0,
            "the failing ones have had their half"
        );
        assert_eq!(lanes.room(&own("healthy"), 1000), 2);
        lanes.leave(&a, "2", 1000, None);
        assert_eq!(lanes.room(&a, 1000), 2, "it answers again");
    }

    #[test]
    fn turns_go_round() {
        let mut lanes = lanes(4, 2);
        let all = || ["a", "b", "c"].map(|name| (own(name), 0)).to_vec();
        let first = |lanes: &Lanes| lanes.in_turn(all())[0].0.destination.clone();
        assert_eq!(first(&lanes), "a");
        lanes.enter(&own("a"), "1");
        assert_eq!(first(&lanes), "b");
        lanes.enter(&own("c"), "2");
        assert_eq!(first(&lanes), "a");
        lanes.leave(&own("c"), "2", 0, None);
        lanes.begin_round(&all()[..1], 0);
        assert_eq!(lanes.traffic.len(), 1);
        // A tenant with nothing on the way comes before all lanes of one that has something.
        let mut with_another = all();
        with_another.push((lane("other", "d"), 0));
        assert_eq!(lanes.in_turn(with_another)[0].0, lane("other", "d"));
    }

    /// Starts all that is due and has room, in turn. Every lane has any number of errands due.
    fn start(lanes: &mut Lanes, due: &[Lane]) -> BTreeMap<String, usize> {
        let pending: Vec<_> = due.iter().map(|lane| (lane.clone(), 0)).collect();
        lanes.begin_round(&pending, 0);
        let mut started = BTreeMap::new();
        for (lane, _) in lanes.in_turn(pending) {
            for _ in 0..lanes.room(&lane, 0) {
                let number = lanes.sum(|_, _| true);
                assert!(lanes.enter(&lane, &format!("{lane:?} {number}")));
                *started.entry(lane.tenant.to_string()).or_default() += 1;
            }
        }
        started
    }

    #[test]
    fn a_tenant_that_has_taken_all_places_keeps_no_other_out() {
        let mut lanes = lanes(4, 2);
        let slow: Vec<Lane> = (0..9)
            .map(|n| lane("slow", &format!("trickle{n}")))
            .collect();
        // Alone, a tenant uses all places.
        assert_eq!(start(&mut lanes, &slow)["slow"], 4);
        // Another one begins at once, however long those take; so does a third.
        for name in ["b", "c"] {
            let mut due = slow.clone();
            due.push(lane(name, "pacs"));
            let started = start(&mut lanes, &due);
            assert_eq!(started, [(name.to_owned(), 1)].into());
        }
        // While another has something due, the slow one begins nothing beyond half of the places.
        let taken: Vec<(Lane, String)> = lanes
            .traffic
            .iter()
            .filter(|(lane, _)| lane.tenant.as_str() == "slow")
            .flat_map(|(lane, t)| t.on_the_way.iter().map(|id| (lane.clone(), id.clone())))
            .collect();
        let mut due = slow.clone();
        due.push(lane("b", "pacs"));
        for (lane, id) in &taken {
            lanes.leave(lane, id, 0, None);
            start(&mut lanes, &due);
            start(&mut lanes, &due);
        }
        let of_slow = lanes.sum(|lane, _| lane.tenant.as_str() == "slow");
        assert_eq!(of_slow, 2);
    }

    #[test]
    fn however_many_tenants_come_the_places_are_limited() {
        let mut lanes = lanes(4, 2);
        let due: Vec<Lane> = (0..50).map(|n| lane(&format!("t{n}"), "pacs")).collect();
        start(&mut lanes, &due);
        let total = lanes.sum(|_, _| true);
        assert_eq!(total, 4, "twice the limit of the one destination");
        let due: Vec<Lane> = (0..50)
            .map(|n| lane(&format!("t{n}"), &format!("d{n}")))
            .collect();
        start(&mut lanes, &due);
        assert_eq!(lanes.sum(|_, _| true), 8, "twice the limit");
    }

    #[test]
    fn one_tenants_receivers_that_fail_do_not_make_another_wait() {
        let mut lanes = lanes(4, 2);
        // At one host, and at many.
        let failing = ["shared", "x", "y", "z"].map(|name| lane("a", name));
        for lane in &failing {
            lanes.enter(lane, "1");
            lanes.leave(lane, "1", 0, Some(None));
        }
        assert!(
            lanes.room(&lane("b", "shared"), 0) > 0,
            "its lane is its own"
        );
        for lane in &failing[1..] {
            lanes.enter(lane, "2");
        }
        let flaky = lane("b", "flaky");
        lanes.enter(&flaky, "1");
        lanes.leave(&flaky, "1", 0, Some(None));
        assert_eq!(lanes.room(&flaky, 1000), 1);
    }
}
