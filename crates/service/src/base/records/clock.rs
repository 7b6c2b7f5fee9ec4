//! The time of day, and the ages that may be counted by it.
//!
//! What was stamped is older than an age only by a clock that is trusted: a machine that starts with a dead battery
//! is years off until it has asked the network, and what is erased by age then cannot be had back. So an age is never
//! a difference of two numbers. [`dyn Clock::trusted`](trait.Clock.html) gives the time by which ages count, or
//! nothing while it is in doubt; only that makes a [`Cutoff`]; and every method of a store that erases, gives up or
//! forgets what is old takes a [`Cutoff`] or a [`TrustedNow`].
//!
//! What ends at a moment that was promised, as credentials do, ends by [`Clock::latest`], the strict side.

use std::num::NonZero;
use std::time::{Duration, SystemTime, UNIX_EPOCH};
use time::OffsetDateTime;
use time::format_description::well_known::iso8601::{Config, EncodedConfig, TimePrecision};
use time::format_description::well_known::{Iso8601, Rfc3339};

/// Milliseconds since 1970-01-01T00:00:00Z.
pub type Timestamp = i64;

/// A source of the current time.
pub trait Clock: Send + Sync + 'static {
    /// The current time, for stamps and pauses.
    fn now(&self) -> Timestamp;

    /// Whether ages may be counted by it.
    fn is_trusted(&self) -> bool;

    /// The latest time that it may be. What ends at a moment, as a credential does, has ended if that moment is not
    /// later.
    fn latest(&self) -> Timestamp;
}

impl dyn Clock {
    /// The time by which ages count; `None` while the time of day is in doubt.
    pub fn trusted(&self) -> Option<TrustedNow> {
        self.is_trusted().then(|| TrustedNow(self.now()))
    }
}

/// A time by which ages count. Only [`dyn Clock::trusted`](trait.Clock.html) makes one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrustedNow(Timestamp);

impl TrustedNow {
    /// The moment.
    pub fn moment(self) -> Timestamp {
        self.0
    }

    /// The moment before which everything is older than `age`.
    pub fn older_than(self, age: Duration) -> Cutoff {
        Cutoff(self.0.saturating_sub(milliseconds(age)))
    }

    /// Whether what began at `since` will be older than `age` at `moment`.
    pub fn is_too_old(self, since: Timestamp, age: Duration, moment: Timestamp) -> bool {
        moment > since.saturating_add(milliseconds(age))
    }
}

/// The moment before which everything is older than an age. Only [`TrustedNow::older_than`] makes one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cutoff(Timestamp);

impl Cutoff {
    /// The moment.
    pub fn moment(self) -> Timestamp {
        self.0
    }
}

/// A length of time in the unit of [`Timestamp`].
pub(crate) fn milliseconds(span: Duration) -> i64 {
    i64::try_from(span.as_millis()).unwrap_or(i64::MAX)
}

/// The clock of the machine as it is. For stamps of commands, and for [`ServiceClock`](super::ServiceClock); no ages
/// are counted by it.
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

    fn is_trusted(&self) -> bool {
        false
    }

    fn latest(&self) -> Timestamp {
        self.now()
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

#[cfg(test)]
mod tests {
    use super::*;

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
            3_600_000_000,
            3_600_000_005,
        ];
        let texts = times.map(rfc3339);
        assert!(texts.is_sorted(), "{texts:?}");
        assert_eq!(texts[5], "1970-01-01T00:00:00.120Z");
        let read = texts.each_ref().map(|text| parse_rfc3339(text));
        assert_eq!(read, times.map(Some));
    }

    #[test]
    fn the_clock_of_the_machine_counts_no_ages() {
        let clock: &dyn Clock = &SystemClock;
        assert_eq!(clock.trusted(), None);
    }
}
