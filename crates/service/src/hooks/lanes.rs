//! Whose turn it is: fairness among destinations.
//!
//! Each destination (scheme, host and port) has a lane. A lane has at most
//! [`HookSettings::per_destination`](super::HookSettings::per_destination) deliveries on the way,
//! and one whose last attempt failed has one, after a pause that grows. All failing lanes together
//! have half of the places, so that receivers that hang leave the other half to those that answer.

use super::RetrySchedule;
use super::schedule::milliseconds;
use crate::records::Timestamp;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

/// The longest pause of a failing lane.
const LONGEST_REST: Duration = Duration::from_secs(60);

/// The lanes, and what is on the way in them.
#[derive(Debug)]
pub struct Lanes {
    places: usize,
    per_lane: usize,
    pauses: RetrySchedule,
    lanes: BTreeMap<String, Lane>,
    /// The lane that was served last; the next round begins after it.
    last: String,
}

#[derive(Debug, Default)]
struct Lane {
    on_the_way: BTreeSet<String>,
    failures: u32,
    not_before: Timestamp,
}

impl Lanes {
    /// Empty lanes with that many places in all and in each lane.
    pub fn new(places: usize, per_lane: usize, pauses: RetrySchedule) -> Self {
        Self {
            places: places.max(2),
            per_lane: per_lane.max(1),
            pauses,
            lanes: BTreeMap::new(),
            last: String::new(),
        }
    }

    /// The destinations in the order of their turns: those after the last one served come first.
    pub fn in_turn(&self, destinations: Vec<(String, Timestamp)>) -> Vec<(String, Timestamp)> {
        let (mut first, then): (Vec<_>, Vec<_>) = destinations
            .into_iter()
            .partition(|(name, _)| *name > self.last);
        first.extend(then);
        first
    }

    /// How many more deliveries may be sent to a destination at `now`.
    pub fn room(&self, destination: &str, now: Timestamp) -> usize {
        let busy = |lane: &Lane| lane.on_the_way.len();
        let free = self
            .places
            .saturating_sub(self.lanes.values().map(busy).sum());
        let Some(lane) = self.lanes.get(destination) else {
            return free.min(self.per_lane);
        };
        if lane.failures == 0 {
            return free.min(self.per_lane.saturating_sub(busy(lane)));
        }
        let failing = self.lanes.values().filter(|lane| lane.failures > 0);
        let taken: usize = failing.map(busy).sum();
        let may = now >= lane.not_before && busy(lane) == 0 && taken < self.places / 2;
        free.min(usize::from(may))
    }

    /// Number of deliveries on the way to a destination.
    pub fn busy(&self, destination: &str) -> usize {
        self.lanes
            .get(destination)
            .map_or(0, |lane| lane.on_the_way.len())
    }

    /// When a failing lane may be served again.
    pub fn rests_until(&self, destination: &str) -> Timestamp {
        self.lanes
            .get(destination)
            .map_or(0, |lane| lane.not_before)
    }

    /// Takes a place for a delivery. `false` if it is on the way already.
    pub fn enter(&mut self, destination: &str, id: &str) -> bool {
        self.last = destination.to_owned();
        let lane = self.lanes.entry(destination.to_owned()).or_default();
        lane.on_the_way.insert(id.to_owned())
    }

    /// Gives the place back. `failed` makes the lane rest, for at least the time that the
    /// receiver asked for.
    pub fn leave(
        &mut self,
        destination: &str,
        id: &str,
        now: Timestamp,
        failed: Option<Option<Duration>>,
    ) {
        let Some(lane) = self.lanes.get_mut(destination) else {
            return;
        };
        lane.on_the_way.remove(id);
        match failed {
            None => {
                lane.failures = 0;
                lane.not_before = 0;
            }
            Some(asked) => {
                lane.failures = lane.failures.saturating_add(1);
                let rest = self.pauses.pause(lane.failures).min(LONGEST_REST);
                let rest = rest.max(asked.unwrap_or_default());
                lane.not_before = now.saturating_add(milliseconds(rest));
            }
        }
    }

    /// Forgets the lanes that have nothing on the way and nothing pending.
    pub fn keep(&mut self, pending: &[(String, Timestamp)]) {
        self.lanes.retain(|name, lane| {
            !lane.on_the_way.is_empty() || pending.iter().any(|(other, _)| other == name)
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lanes() -> Lanes {
        let pauses = RetrySchedule {
            first: Duration::from_secs(1),
            attempts: 5,
            age: Duration::from_secs(1000),
        };
        Lanes::new(4, 2, pauses)
    }

    #[test]
    fn one_destination_never_takes_all_places() {
        let mut lanes = lanes();
        assert_eq!(lanes.room("a", 0), 2);
        assert!(lanes.enter("a", "1") && lanes.enter("a", "2"));
        assert!(!lanes.enter("a", "2"), "it is on the way");
        assert_eq!((lanes.room("a", 0), lanes.room("b", 0)), (0, 2));
    }

    #[test]
    fn failing_destinations_take_half_of_the_places_at_most() {
        let mut lanes = lanes();
        for name in ["a", "b", "c"] {
            lanes.enter(name, "1");
            lanes.leave(name, "1", 0, Some(None));
        }
        assert_eq!(lanes.room("a", 999), 0, "it rests");
        assert_eq!(lanes.rests_until("a"), 1000);
        assert_eq!(
            lanes.room("a", 1000),
            1,
            "one attempt shows whether it answers again"
        );
        lanes.enter("a", "2");
        lanes.enter("b", "2");
        assert_eq!(
            lanes.room("c", 1000),
            0,
            "the failing ones have had their half"
        );
        assert_eq!(lanes.room("healthy", 1000), 2);
        lanes.leave("a", "2", 1000, None);
        assert_eq!(lanes.room("a", 1000), 2, "it answers again");
    }

    #[test]
    fn turns_go_round() {
        let mut lanes = lanes();
        let all = || ["a", "b", "c"].map(|name| (name.to_owned(), 0)).to_vec();
        let first = |lanes: &Lanes| lanes.in_turn(all())[0].0.clone();
        assert_eq!(first(&lanes), "a");
        lanes.enter("a", "1");
        assert_eq!(first(&lanes), "b");
        lanes.enter("c", "2");
        assert_eq!(first(&lanes), "a");
        lanes.leave("c", "2", 0, None);
        lanes.keep(&all()[..1]);
        assert_eq!(lanes.lanes.len(), 1);
    }
}
