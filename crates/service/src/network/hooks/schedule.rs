//! When a failed delivery is tried again.

use crate::base::records::{Timestamp, TrustedNow, milliseconds};
use std::time::Duration;

/// The longest pause between two attempts.
const LONGEST_PAUSE: Duration = Duration::from_secs(6 * 3600);

/// How much longer each pause is than the one before.
const PAUSE_GROWTH: u32 = 4;

/// Pauses that grow: the first is `first`, each is four times the one before, at most six hours.
/// A random part of up to a half is taken off, so that what failed together does not return
/// together.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetrySchedule {
    /// The first pause.
    pub first: Duration,
    /// Most attempts.
    pub attempts: u32,
    /// Greatest age of a delivery.
    pub age: Duration,
}

/// The attempt after one that failed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct NextAttempt {
    /// When it is made.
    pub at: Timestamp,
    /// Whether the one that failed counts towards the most that are made.
    pub counts: bool,
}

impl RetrySchedule {
    /// When to try again after attempt number `attempts` failed at `now`; `None` if that was the
    /// last. `asked` is the receiver's `Retry-After`; `random` is from 0 to 1.
    ///
    /// While the time is not `trusted`, nothing is given up, and no attempt counts: a clock that is ahead skips the
    /// pauses between them.
    pub fn next(
        &self,
        attempts: u32,
        since: Timestamp,
        (now, trusted): (Timestamp, Option<TrustedNow>),
        asked: Option<Duration>,
        random: f64,
    ) -> Option<NextAttempt> {
        let pause = self
            .pause(attempts)
            .mul_f64(1.0 - random.clamp(0.0, 1.0) / 2.0);
        let pause = pause.max(asked.unwrap_or_default());
        let at = now.saturating_add(milliseconds(pause));
        let last = trusted.is_some_and(|trusted| {
            attempts >= self.attempts || trusted.is_too_old(since, self.age, at)
        });
        let counts = trusted.is_some();
        (!last).then_some(NextAttempt { at, counts })
    }

    /// The full pause after that many attempts, counted from 1.
    pub fn pause(&self, attempts: u32) -> Duration {
        let factor = PAUSE_GROWTH.saturating_pow(attempts.saturating_sub(1).min(12));
        self.first.saturating_mul(factor).min(LONGEST_PAUSE)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::records::Clock;

    const TEST_SCHEDULE: RetrySchedule = RetrySchedule {
        first: Duration::from_secs(5),
        attempts: 4,
        age: Duration::from_secs(1000),
    };

    /// A clock of which the ages count, or do not.
    struct Clockwork(Timestamp, bool);

    impl Clock for Clockwork {
        fn now(&self) -> Timestamp {
            self.0
        }

        fn is_trusted(&self) -> bool {
            self.1
        }

        fn latest(&self) -> Timestamp {
            self.0
        }
    }

    fn time(now: Timestamp, trusted: bool) -> (Timestamp, Option<TrustedNow>) {
        let clock: &dyn Clock = &Clockwork(now, trusted);
        (now, clock.trusted())
    }

    fn next(attempts: u32, now: Timestamp, asked: u64, random: f64) -> Option<Timestamp> {
        let asked = (asked > 0).then_some(Duration::from_secs(asked));
        let next = TEST_SCHEDULE.next(attempts, 0, time(now, true), asked, random);
        assert!(next.is_none_or(|next| next.counts));
        next.map(|next| next.at)
    }

    #[test]
    fn pauses_grow_with_a_random_part_and_end() {
        assert_eq!(next(1, 0, 0, 0.0), Some(5_000));
        assert_eq!(next(1, 0, 0, 1.0), Some(2_500));
        assert_eq!(next(3, 0, 0, 0.0), Some(80_000));
        assert_eq!(next(4, 0, 0, 0.0), None);
        assert_eq!(TEST_SCHEDULE.pause(200), LONGEST_PAUSE);
    }

    #[test]
    fn the_receiver_may_ask_for_a_longer_pause_within_the_age() {
        assert_eq!(next(1, 0, 1, 0.0), Some(5_000));
        assert_eq!(next(1, 0, 900, 0.0), Some(900_000));
        assert_eq!(next(1, 0, 2_000, 0.0), None);
        assert_eq!(next(1, 999_000, 0, 0.0), None);
    }

    #[test]
    fn nothing_is_given_up_and_no_attempt_counts_while_the_time_is_in_doubt() {
        for (attempts, now) in [(1, 999_000), (4, 0), (9, i64::from(i32::MAX) * 1_000)] {
            let next = TEST_SCHEDULE.next(attempts, 0, time(now, false), None, 0.0);
            let at = now + milliseconds(TEST_SCHEDULE.pause(attempts));
            assert_eq!(next, Some(NextAttempt { at, counts: false }));
        }
    }
}
