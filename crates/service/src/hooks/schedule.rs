//! When a failed delivery is tried again.

use crate::records::Timestamp;
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

impl RetrySchedule {
    /// When to try again after attempt number `attempts` failed at `now`; `None` if that was the
    /// last. `asked` is the receiver's `Retry-After`; `random` is from 0 to 1.
    pub fn next(
        &self,
        attempts: u32,
        since: Timestamp,
        now: Timestamp,
        asked: Option<Duration>,
        random: f64,
    ) -> Option<Timestamp> {
        if attempts >= self.attempts {
            return None;
        }
        let pause = self
            .pause(attempts)
            .mul_f64(1.0 - random.clamp(0.0, 1.0) / 2.0);
        let pause = pause.max(asked.unwrap_or_default());
        let again = now.saturating_add(milliseconds(pause));
        (again <= since.saturating_add(milliseconds(self.age))).then_some(again)
    }

    /// The full pause after that many attempts, counted from 1.
    pub fn pause(&self, attempts: u32) -> Duration {
        let factor = PAUSE_GROWTH.saturating_pow(attempts.saturating_sub(1).min(12));
        self.first.saturating_mul(factor).min(LONGEST_PAUSE)
    }
}

/// A length of time in the unit of [`Timestamp`].
pub(super) fn milliseconds(span: Duration) -> i64 {
    i64::try_from(span.as_millis()).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEST_SCHEDULE: RetrySchedule = RetrySchedule {
        first: Duration::from_secs(5),
        attempts: 4,
        age: Duration::from_secs(1000),
    };

    #[test]
    fn pauses_grow_with_a_random_part_and_end() {
        let next = |attempts, random| TEST_SCHEDULE.next(attempts, 0, 0, None, random);
        assert_eq!(next(1, 0.0), Some(5_000));
        assert_eq!(next(1, 1.0), Some(2_500));
        assert_eq!(next(3, 0.0), Some(80_000));
        assert_eq!(next(4, 0.0), None);
        assert_eq!(TEST_SCHEDULE.pause(200), LONGEST_PAUSE);
    }

    #[test]
    fn the_receiver_may_ask_for_a_longer_pause_within_the_age() {
        let asked = |seconds| TEST_SCHEDULE.next(1, 0, 0, Some(Duration::from_secs(seconds)), 0.0);
        assert_eq!(asked(1), Some(5_000));
        assert_eq!(asked(900), Some(900_000));
        assert_eq!(asked(2_000), None);
        assert_eq!(TEST_SCHEDULE.next(1, 0, 999_000, None, 0.0), None);
    }
}
