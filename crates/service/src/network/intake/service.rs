//! The state that all associations share, and their number.

use super::negotiate::Offer;
use super::observer::IntakeObserver;
use super::receive::Receiver;
use super::senders::{AeTitle, Senders};
use super::session::Sessions;
use crate::base::records::Clock;
use crate::callers::Recorder;
use std::collections::BTreeMap;
use std::net::IpAddr;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Settings of the SCP.
#[derive(Debug, Clone)]
pub struct ScpSettings {
    /// The AE title that callers must name.
    pub ae_title: AeTitle,
    /// Who may call.
    pub senders: Senders,
    /// Most associations.
    pub associations: usize,
    /// Most associations of one address.
    pub of_one_peer: usize,
    /// Longest P-DATA-TF PDU, bytes.
    pub longest_pdu: u32,
    /// Most bytes of one association.
    pub association_bytes: u64,
    /// Longest time for one PDU to come.
    pub idle: Duration,
    /// Longest time of one association.
    pub time_limit: Duration,
    /// Time for messages under way when the service shuts down.
    pub grace: Duration,
}

/// The state that all associations share.
pub struct Service {
    /// The settings.
    pub settings: ScpSettings,
    /// The transfer syntaxes and classes that are accepted.
    pub offer: Offer,
    /// Takes objects.
    pub receiver: Arc<Receiver>,
    /// The groups that wait.
    pub sessions: Arc<Sessions>,
    /// The audit trail.
    pub recorder: Arc<Recorder>,
    /// The time of day.
    pub clock: Arc<dyn Clock>,
    /// Is told of associations.
    pub observer: Arc<dyn IntakeObserver>,
    /// The open associations.
    pub places: Places,
    /// Cancelled when the service shuts down.
    pub closing: CancellationToken,
    /// Cancelled when messages under way are to be broken off.
    pub ending: CancellationToken,
}

/// The open associations by address.
pub struct Places {
    all: usize,
    of_one: usize,
    open: Mutex<BTreeMap<IpAddr, usize>>,
}

/// The place of one association, until this is dropped.
pub struct Place<'a> {
    places: &'a Places,
    peer: IpAddr,
}

impl Places {
    /// At most `all` places, and `of_one` for one address.
    pub fn new(all: usize, of_one: usize) -> Self {
        Self {
            all,
            of_one,
            open: Mutex::default(),
        }
    }

    fn open(&self) -> MutexGuard<'_, BTreeMap<IpAddr, usize>> {
        // A panic cannot leave the map half changed: each change is a single call.
        self.open.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// A place for an association of that address; `None` if there is none.
    pub fn take(&self, peer: IpAddr) -> Option<Place<'_>> {
        let peer = peer.to_canonical();
        let mut open = self.open();
        let of_peer = open.get(&peer).copied().unwrap_or(0);
        // A caller that has none finds room also where others have taken all, as long as that is not twice as many.
        let all: usize = open.values().sum();
        let full = all >= self.all && (of_peer > 0 || all >= 2 * self.all);
        if full || of_peer >= self.of_one {
            return None;
        }
        open.insert(peer, of_peer + 1);
        Some(Place { places: self, peer })
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        let mut open = self.places.open();
        match open.get_mut(&self.peer) {
            Some(count) if *count > 1 => *count -= 1,
            _ => {
                open.remove(&self.peer);
            }
        }
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;

    #[test]
    fn places_are_limited_in_all_and_for_each_address() {
        let places = Places::new(3, 2);
        let [a, b, mapped] =
            ["10.0.0.1", "10.0.0.2", "::ffff:10.0.0.1"].map(|a| a.parse().unwrap());
        let first = places.take(a).unwrap();
        let _second = places.take(mapped).unwrap();
        assert!(places.take(a).is_none());
        let _third = places.take(b).unwrap();
        assert!(places.take(b).is_none());
        let others: Vec<_> = (3..9_u8)
            .map(|n| places.take(IpAddr::from([10, 0, 0, n])))
            .collect();
        let taken = others.iter().filter(|place| place.is_some()).count();
        assert_eq!(
            taken, 3,
            "those that have none get one, up to twice as many"
        );
        drop(others);
        drop(first);
        assert!(places.take(a).is_some() && places.open().len() == 2);
    }
}
