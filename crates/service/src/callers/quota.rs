//! The rate at which each caller may ask.
//!
//! Requests are counted per caller in windows of one minute that begin with the caller's first
//! request (a quota policy of draft-ietf-httpapi-ratelimit-headers). The counts are kept in memory:
//! a restart begins new windows. A request with a key that another key has made counts for both, so that
//! all keys that a key makes have together what it has. Stored bytes and waiting jobs are counted in the database, per
//! tenant.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// The length of a window.
pub const QUOTA_WINDOW: Duration = Duration::from_secs(60);

/// Callers whose windows are kept at the same time. Beyond it, windows that are over are dropped,
/// and if none is, all are.
const MOST_CALLERS: usize = 100_000;

/// Limits on what a caller may ask for; `None` where another rule decides.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Quota {
    /// Requests per minute.
    pub requests: Option<u64>,
    /// Bytes of everything that the tenant stores.
    pub bytes: Option<u64>,
    /// Waiting jobs of the tenant.
    pub jobs: Option<u64>,
}

impl Quota {
    /// These limits, and those of `general` where there is none.
    #[must_use]
    pub fn or(self, general: Self) -> Self {
        Self {
            requests: self.requests.or(general.requests),
            bytes: self.bytes.or(general.bytes),
            jobs: self.jobs.or(general.jobs),
        }
    }

    /// These limits, and those of `bound` where they are lower.
    #[must_use]
    pub fn within(self, bound: Self) -> Self {
        let lower = |own: Option<u64>, bound: Option<u64>| match (own, bound) {
            (Some(own), Some(bound)) => Some(own.min(bound)),
            (own, bound) => own.or(bound),
        };
        Self {
            requests: lower(self.requests, bound.requests),
            bytes: lower(self.bytes, bound.bytes),
            jobs: lower(self.jobs, bound.jobs),
        }
    }
}

/// Use of the service by a tenant.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Usage {
    /// Bytes of everything that it stores.
    pub bytes: u64,
    /// Its waiting jobs.
    pub jobs: u64,
}

/// The rest of a caller's window.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Allowance {
    /// Requests of a whole window.
    pub quota: u64,
    /// Requests that are left.
    pub remaining: u64,
    /// Time until the window ends.
    pub resets_in: Duration,
    /// Whether this request was within the quota.
    pub allowed: bool,
}

struct Window {
    begun: Instant,
    count: u64,
}

/// Counts the requests of each caller.
#[derive(Default)]
pub struct RequestCounter {
    windows: Mutex<HashMap<String, Window>>,
}

impl RequestCounter {
    /// Counts a request of `caller`, of which `quota` are allowed per window.
    pub fn count(&self, caller: &str, quota: u64, now: Instant) -> Allowance {
        self.update(caller, quota, now, 1)
    }

    /// The same without counting the request.
    pub fn look(&self, caller: &str, quota: u64, now: Instant) -> Allowance {
        self.update(caller, quota, now, 0)
    }

    fn update(&self, caller: &str, quota: u64, now: Instant, add: u64) -> Allowance {
        // A panic cannot leave the map half changed: each use is a few plain statements.
        let mut windows = self.windows.lock().unwrap_or_else(PoisonError::into_inner);
        let over = |window: &Window| now.duration_since(window.begun) >= QUOTA_WINDOW;
        if windows.len() >= MOST_CALLERS && !windows.contains_key(caller) {
            windows.retain(|_, window| !over(window));
            if windows.len() >= MOST_CALLERS {
                windows.clear();
            }
        }
        if add == 0 && !windows.contains_key(caller) {
            return Allowance {
                quota,
                remaining: quota,
                resets_in: QUOTA_WINDOW,
                allowed: quota > 0,
            };
        }
        let begin = || Window {
            begun: now,
            count: 0,
        };
        let window = windows.entry(caller.to_owned()).or_insert_with(begin);
        if over(window) {
            *window = begin();
        }
        let allowed = window.count < quota;
        if allowed {
            window.count += add;
        }
        Allowance {
            quota,
            remaining: quota.saturating_sub(window.count),
            resets_in: QUOTA_WINDOW.saturating_sub(now.duration_since(window.begun)),
            allowed,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_window_allows_its_quota_and_then_the_next_begins() {
        let counter = RequestCounter::default();
        let start = Instant::now();
        for left in [1, 0] {
            let allowance = counter.count("a", 2, start);
            assert!(allowance.allowed);
            assert_eq!(allowance.remaining, left);
        }
        let later = start + Duration::from_secs(20);
        let refused = counter.count("a", 2, later);
        assert!(!refused.allowed);
        assert_eq!(refused.resets_in, Duration::from_secs(40));
        assert!(
            counter.count("b", 2, later).allowed,
            "others are not affected"
        );
        assert!(!counter.look("a", 2, later).allowed);
        assert!(counter.count("a", 2, start + QUOTA_WINDOW).allowed);
    }

    #[test]
    fn looking_counts_nothing() {
        let counter = RequestCounter::default();
        let now = Instant::now();
        for _ in 0..5 {
            assert!(counter.look("a", 1, now).allowed);
        }
        assert!(counter.count("a", 1, now).allowed);
        assert!(!counter.look("a", 1, now).allowed);
    }

    #[test]
    fn the_number_of_windows_is_bounded() {
        let counter = RequestCounter::default();
        let now = Instant::now();
        for caller in 0..=MOST_CALLERS {
            counter.count(&caller.to_string(), 1, now);
        }
        assert!(counter.windows.lock().unwrap().len() <= MOST_CALLERS);
    }

    #[test]
    fn limits_of_a_key_replace_the_general_ones() {
        let own = Quota {
            requests: Some(5),
            ..Quota::default()
        };
        let general = Quota {
            requests: Some(1),
            bytes: Some(2),
            jobs: None,
        };
        let both = own.or(general);
        assert_eq!(
            (both.requests, both.bytes, both.jobs),
            (Some(5), Some(2), None)
        );
    }
}
