//! The time of day, injected so that tests can set it.
//!
//! [`SteadyClock`] is the system's clock without its steps. Somebody who sets the clock to a wrong
//! year for five minutes must not expire every stored item, and a step back must not turn the
//! order of a job's stamps. Small corrections are followed at once. A step is followed only after
//! it has lasted for [`SETTLING_TIME`]; until then time goes on as the monotonic clock says.

use std::num::NonZero;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use time::OffsetDateTime;
use time::format_description::well_known::iso8601::{Config, EncodedConfig, TimePrecision};
use time::format_description::well_known::{Iso8601, Rfc3339};

/// Milliseconds since 1970-01-01T00:00:00Z.
pub type Timestamp = i64;

/// A source of the current time.
pub trait Clock: Send + Sync + 'static {
    /// The current time.
    fn now(&self) -> Timestamp;
}

/// The system clock.
#[derive(Debug, Clone, Copy, Default)]
pub struct SystemClock;

impl Clock for SystemClock {
    fn now(&self) -> Timestamp {
        SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| {
                Timestamp::try_from(since.as_millis()).unwrap_or(Timestamp::MAX)
            })
    }
}

/// Three digits of a second, zeros included: texts of equal length sort as the times do.
const RFC3339_MILLISECONDS: EncodedConfig = Config::DEFAULT
    .set_time_precision(TimePrecision::Second {
        decimal_digits: NonZero::new(3),
    })
    .encode();

/// A time in UTC as RFC 3339 writes it, always with three digits of milliseconds, so that the texts
/// sort in the order of time. Empty before year 0 and after year 9999.
pub fn rfc3339(at: Timestamp) -> String {
    OffsetDateTime::from_unix_timestamp_nanos(i128::from(at) * 1_000_000)
        .ok()
        .and_then(|time| time.format(&Iso8601::<RFC3339_MILLISECONDS>).ok())
        .unwrap_or_default()
}

/// The time that an RFC 3339 text names.
pub fn parse_rfc3339(text: &str) -> Option<Timestamp> {
    let time = OffsetDateTime::parse(text, &Rfc3339).ok()?;
    Timestamp::try_from(time.unix_timestamp_nanos() / 1_000_000).ok()
}

/// Greatest correction that is followed at once.
const CLOCK_STEP_MS: i64 = 2_000;

/// How long a step of the system's clock must last until it is followed.
pub const SETTLING_TIME: Duration = Duration::from_secs(600);

/// The system clock without its steps.
pub struct SteadyClock {
    started: Instant,
    course: Mutex<Option<Course>>,
}

impl Default for SteadyClock {
    fn default() -> Self {
        Self {
            started: Instant::now(),
            course: Mutex::default(),
        }
    }
}

impl Clock for SteadyClock {
    fn now(&self) -> Timestamp {
        let monotonic = i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX);
        let wall = SystemClock.now();
        // A panic cannot leave the course half changed: it is a few numbers.
        let mut course = self.course.lock().unwrap_or_else(PoisonError::into_inner);
        course
            .get_or_insert_with(|| Course::new(wall, monotonic))
            .now(wall, monotonic)
    }
}

/// How the served time follows the wall clock; all in milliseconds.
#[derive(Debug)]
struct Course {
    /// Served time minus monotonic time.
    offset: i64,
    /// Another offset that the wall clock has shown, and since when on the monotonic clock.
    doubt: Option<(i64, i64)>,
    last: Timestamp,
}

impl Course {
    fn new(wall: Timestamp, monotonic: i64) -> Self {
        Self {
            offset: wall - monotonic,
            doubt: None,
            last: wall,
        }
    }

    fn now(&mut self, wall: Timestamp, monotonic: i64) -> Timestamp {
        let shown = wall - monotonic;
        let settling = SETTLING_TIME.as_millis() as i64;
        if (shown - self.offset).abs() <= CLOCK_STEP_MS {
            (self.offset, self.doubt) = (shown, None);
            self.last = self.last.max(wall);
            return self.last;
        }
        match self.doubt {
            Some((offset, since)) if (shown - offset).abs() <= CLOCK_STEP_MS => {
                if monotonic - since >= settling {
                    tracing::warn!(
                        milliseconds = shown - self.offset,
                        "the system's clock was set, and has stayed so: following it"
                    );
                    *self = Self::new(wall, monotonic);
                    return wall;
                }
            }
            _ => self.doubt = Some((shown, monotonic)),
        }
        self.last = self.last.max(monotonic + self.offset);
        self.last
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HOUR_MS: i64 = 3_600_000;
    const START_MS: i64 = 1_000 * HOUR_MS;

    fn course() -> Course {
        Course::new(START_MS, 0)
    }

    #[test]
    fn texts_of_times_sort_as_the_times_do_and_read_back() {
        let times = [
            0,
            1,
            10,
            99,
            100,
            120,
            123,
            999,
            1_000,
            START_MS,
            START_MS + 5,
        ];
        let texts = times.map(rfc3339);
        assert!(texts.is_sorted(), "{texts:?}");
        assert_eq!(texts[5], "1970-01-01T00:00:00.120Z");
        let read = texts.each_ref().map(|text| parse_rfc3339(text));
        assert_eq!(read, times.map(Some));
    }

    #[test]
    fn a_step_that_does_not_last_changes_nothing() {
        for step in [-500 * HOUR_MS, 9 * HOUR_MS, 100_000 * HOUR_MS] {
            let mut course = course();
            for minute in 0..30 {
                let monotonic = minute * 60_000;
                let stepped = (5..14).contains(&minute);
                let wall = START_MS + monotonic + if stepped { step } else { 0 };
                assert_eq!(course.now(wall, monotonic), START_MS + monotonic);
            }
        }
    }

    #[test]
    fn a_step_that_lasts_is_followed() {
        for step in [-500 * HOUR_MS, 9 * HOUR_MS] {
            let mut course = course();
            for minute in 1..=30 {
                let monotonic = minute * 60_000;
                let now = course.now(START_MS + monotonic + step, monotonic);
                let followed = if minute > 10 { step } else { 0 };
                assert_eq!(now, START_MS + monotonic + followed, "minute {minute}");
            }
        }
    }

    #[test]
    fn small_corrections_are_followed_and_never_go_back() {
        let mut course = course();
        assert_eq!(course.now(START_MS + 1_500, 1_000), START_MS + 1_500);
        assert_eq!(course.now(START_MS + 1_000, 1_100), START_MS + 1_500);
        assert_eq!(course.now(START_MS + 2_000, 2_100), START_MS + 2_000);
    }
}
