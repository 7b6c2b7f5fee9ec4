//! When a group of slices is complete: the associations and requests that bring objects, and how long
//! ago each group got its last one.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::Notify;
use tokio::time::Instant;

/// How long a group waits.
#[derive(Debug, Clone, Copy)]
pub struct Waits {
    /// After its last association was released.
    pub quiet: Duration,
    /// After its last object, while an association is open or if one broke off.
    pub patience: Duration,
}

/// A group that is not complete yet.
#[derive(Debug, Clone, Copy)]
struct Watched {
    /// Open sessions that brought an object of it.
    open: usize,
    /// The last object, or the end of the last session.
    last: Instant,
    /// Whether a session broke off.
    broken: bool,
    /// It is not looked at before.
    not_before: Instant,
    /// Whether one object is all of it.
    whole: bool,
}

/// The groups that wait.
pub struct Sessions {
    waits: Waits,
    groups: Mutex<BTreeMap<String, Watched>>,
    changed: Notify,
}

impl Sessions {
    /// No group waits.
    pub fn new(waits: Waits) -> Arc<Self> {
        Arc::new(Self {
            waits,
            groups: Mutex::default(),
            changed: Notify::new(),
        })
    }

    fn groups(&self) -> MutexGuard<'_, BTreeMap<String, Watched>> {
        // A panic cannot leave the map half changed: each change is a few plain statements.
        self.groups.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// An association or a request begins.
    pub fn begin(self: &Arc<Self>) -> Session {
        Session {
            sessions: self.clone(),
            groups: BTreeSet::new(),
            recorded: RecordedGroups::default(),
            released: false,
        }
    }

    /// Watches a group that an earlier run has left, as after a session that broke off. One that this run receives
    /// already is left to its session.
    pub fn resume(&self, group: &str, whole: bool) {
        if !self.watches(group) {
            self.change(group, whole, |watched| watched.broken = true);
        }
    }

    /// Whether a group is on the list.
    pub(super) fn watches(&self, group: &str) -> bool {
        self.groups().contains_key(group)
    }

    /// The longest time that a group waits.
    pub(super) fn patience(&self) -> Duration {
        self.waits.patience.max(self.waits.quiet)
    }

    /// Looks at a group again after `pause`.
    pub fn retry(&self, group: &str, pause: Duration) {
        let again = Instant::now() + pause;
        self.change(group, true, |watched| watched.not_before = again);
    }

    /// Changes a group, which is entered if it is not on the list.
    fn change(&self, group: &str, whole: bool, change: impl FnOnce(&mut Watched)) {
        let mut groups = self.groups();
        let now = Instant::now();
        change(groups.entry(group.to_owned()).or_insert(Watched {
            open: 0,
            last: now,
            broken: false,
            not_before: now,
            whole,
        }));
        drop(groups);
        self.changed.notify_one();
    }

    /// How long after its last change a group is complete.
    fn wait(&self, watched: &Watched) -> Duration {
        match watched {
            Watched { whole: true, .. } => Duration::ZERO,
            Watched {
                open: 0,
                broken: false,
                ..
            } => self.waits.quiet,
            _ => self.waits.patience.max(self.waits.quiet),
        }
    }

    /// When a group is complete.
    fn due(&self, watched: &Watched) -> Instant {
        (watched.last + self.wait(watched)).max(watched.not_before)
    }

    /// Waits for the next group that is complete, and takes it off the list.
    pub async fn next(&self) -> String {
        loop {
            let changed = self.changed.notified();
            let next = {
                let mut groups = self.groups();
                let due = groups.iter().map(|(id, watched)| (self.due(watched), id));
                let first = due.min().map(|(due, id)| (due, id.clone()));
                if let Some((due, id)) = &first
                    && *due <= Instant::now()
                {
                    groups.remove(id);
                    return id.clone();
                }
                first
            };
            match next {
                Some((due, _)) => tokio::select! {
                    () = changed => {}
                    () = tokio::time::sleep_until(due) => {}
                },
                None => changed.await,
            }
        }
    }
}

/// An association or a request that brings objects. Dropping it without [`Session::release`] says that
/// it broke off.
pub struct Session {
    sessions: Arc<Sessions>,
    groups: BTreeSet<String>,
    recorded: RecordedGroups,
    released: bool,
}

/// The groups of a session of which the audit trail has a row that names them.
#[derive(Debug, Clone, Default)]
pub struct RecordedGroups(Arc<Mutex<BTreeSet<String>>>);

impl RecordedGroups {
    fn groups(&self) -> MutexGuard<'_, BTreeSet<String>> {
        // A panic cannot leave the set half changed: each change is a single call.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether there is a row of that group.
    pub fn contains(&self, group: &str) -> bool {
        self.groups().contains(group)
    }

    /// There is a row of that group.
    pub(super) fn insert(&self, group: &str) {
        self.groups().insert(group.to_owned());
    }
}

impl Session {
    /// Those of its groups that the audit trail names.
    pub(super) fn recorded(&self) -> RecordedGroups {
        self.recorded.clone()
    }

    /// It has brought an object of `group`; `whole` if that is all of it.
    pub fn brought(&mut self, group: &str, whole: bool) {
        let first = self.groups.insert(group.to_owned());
        self.sessions.change(group, whole, |watched| {
            watched.last = Instant::now();
            // The group may have been taken off the list since this session brought its last object.
            watched.open = if first {
                watched.open + 1
            } else {
                watched.open.max(1)
            };
        });
    }

    /// It ends as it should: nothing more is to come.
    pub fn release(mut self) {
        self.released = true;
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let mut groups = self.sessions.groups();
        for group in &self.groups {
            if let Some(watched) = groups.get_mut(group) {
                watched.open = watched.open.saturating_sub(1);
                watched.last = Instant::now();
                watched.broken |= !self.released;
            }
        }
        drop(groups);
        self.sessions.changed.notify_one();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const QUIET_TIME: Duration = Duration::from_secs(5);
    const SESSION_PATIENCE: Duration = Duration::from_secs(120);

    fn sessions() -> Arc<Sessions> {
        Sessions::new(Waits {
            quiet: QUIET_TIME,
            patience: SESSION_PATIENCE,
        })
    }

    fn wait(sessions: &Sessions, group: &str) -> Duration {
        sessions.wait(&sessions.groups()[group])
    }

    #[test]
    fn a_series_waits_for_the_release_and_then_a_quiet_time() {
        let sessions = sessions();
        let mut session = sessions.begin();
        session.brought("a", false);
        session.brought("a", false);
        assert_eq!(wait(&sessions, "a"), SESSION_PATIENCE);
        session.release();
        assert_eq!(wait(&sessions, "a"), QUIET_TIME);
    }

    #[test]
    fn two_associations_that_bring_one_series_must_both_be_released() {
        let sessions = sessions();
        let (mut first, mut second) = (sessions.begin(), sessions.begin());
        first.brought("a", false);
        second.brought("a", false);
        first.release();
        assert_eq!(wait(&sessions, "a"), SESSION_PATIENCE);
        second.release();
        assert_eq!(wait(&sessions, "a"), QUIET_TIME);
    }

    #[test]
    fn what_the_start_finds_of_this_run_is_left_to_its_session() {
        let sessions = sessions();
        let mut session = sessions.begin();
        session.brought("a", false);
        sessions.resume("a", false);
        session.release();
        assert_eq!(wait(&sessions, "a"), QUIET_TIME);
    }

    #[test]
    fn a_series_that_broke_off_waits_for_its_rest() {
        let sessions = sessions();
        let mut session = sessions.begin();
        session.brought("a", false);
        drop(session);
        assert_eq!(wait(&sessions, "a"), SESSION_PATIENCE);
        sessions.resume("b", false);
        assert_eq!(wait(&sessions, "b"), SESSION_PATIENCE);
    }

    #[tokio::test]
    async fn an_object_that_is_a_volume_does_not_wait() {
        let sessions = sessions();
        let mut session = sessions.begin();
        session.brought("series", false);
        session.brought("volume", true);
        assert_eq!(sessions.next().await, "volume");
        // The association goes on and brings more of what was taken off the list.
        session.brought("volume", true);
        assert_eq!(sessions.next().await, "volume");
        session.release();
        assert_eq!(sessions.groups().len(), 1);
    }

    #[test]
    fn what_failed_for_a_passing_reason_is_tried_again_later() {
        let sessions = sessions();
        let failed = Instant::now();
        sessions.retry("a", SESSION_PATIENCE);
        let watched = sessions.groups()["a"];
        assert!(sessions.due(&watched) >= failed + SESSION_PATIENCE);
    }
}
