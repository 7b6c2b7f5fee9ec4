//! The one clock of a service.
//!
//! In: the wall clock (the machine's, or the database server's where processes of several machines share one), the
//! monotonic clock of the process, and the last time at which a run on the same store trusted its clock. Out: the time
//! of stamps ([`Clock::now`]), whether ages count by it ([`Clock::is_trusted`]), and the latest time that it may be
//! ([`Clock::latest`]).
//!
//! 1. **Steady.** Corrections of up to [`CLOCK_STEP_MS`] are followed at once. After a step of the wall clock, time
//!    goes on as the monotonic clock says until the step has lasted for [`SETTLING_TIME`]; meanwhile no ages count.
//!    Then a step of up to [`EXPECTED_GAP`] is followed; a longer one is in doubt.
//! 2. **In doubt** is also a start more than [`EXPECTED_GAP`] after the last trusted time, or before it: the service
//!    has not run for so long, or the clock is wrong, and nobody can tell. No ages count. Time is the later of the wall
//!    clock and of the trusted time with what the monotonic clock has counted since: what is stamped in doubt never
//!    looks older than it is.
//! 3. **Trusted again** is a wall clock that comes back to where it was expected; or one that has gone on without a
//!    step for [`DOUBT_LASTS`], in which somebody could set it.
//!
//! A wrong clock that nobody corrects in that time is believed: ages cannot wait for ever.

use super::clock::{Clock, SystemClock, Timestamp};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Greatest correction that is followed at once.
const CLOCK_STEP_MS: i64 = 2_000;

/// How long a step of the wall clock must last until it is followed.
pub const SETTLING_TIME: Duration = Duration::from_secs(600);

/// Longest time between the last trusted time and a start, and longest step, that raise no doubt.
pub const EXPECTED_GAP: Duration = Duration::from_secs(3600);

/// How long the wall clock must go on without a step until a doubtful time is believed.
pub const DOUBT_LASTS: Duration = Duration::from_secs(3600);

/// The one clock of a service. In doubt until [`ServiceClock::begin`].
pub struct ServiceClock {
    started: Instant,
    state: Mutex<State>,
}

struct State {
    /// The wall clock of the server of the database minus the monotonic clock; `None` where the machine's counts.
    server: Option<i64>,
    course: Course,
    /// Whether the doubt was told in the log.
    told: bool,
}

impl Default for ServiceClock {
    fn default() -> Self {
        Self {
            started: Instant::now(),
            state: Mutex::new(State {
                server: None,
                course: Course::unknown(SystemClock.now()),
                told: false,
            }),
        }
    }
}

impl ServiceClock {
    /// Follows the clock of the database's server, which has just said that it is `now`, instead of the machine's.
    pub fn follow(&self, now: Timestamp) {
        let monotonic = self.monotonic();
        self.state().server = Some(now.saturating_sub(monotonic));
    }

    /// Begins: compares the time with the last one that a run on the same store trusted, if one did.
    pub fn begin(&self, last_trusted: Option<Timestamp>) {
        let monotonic = self.monotonic();
        let mut state = self.state();
        let wall = state.wall(monotonic);
        state.course = Course::begin(wall, monotonic, last_trusted);
        state.tell(wall, monotonic);
    }

    fn monotonic(&self) -> i64 {
        i64::try_from(self.started.elapsed().as_millis()).unwrap_or(i64::MAX)
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the course half changed: it is a few numbers.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The state after the clocks were read: the wall clock, and the course at that time.
    fn read<T>(&self, look: impl FnOnce(Timestamp, Timestamp, &Course) -> T) -> T {
        let mut state = self.state();
        // Read under the lock: time must not go back between two readers.
        let monotonic = self.monotonic();
        let wall = state.wall(monotonic);
        let now = state.course.now(wall, monotonic);
        state.tell(wall, monotonic);
        look(wall, now, &state.course)
    }
}

impl State {
    fn wall(&self, monotonic: i64) -> Timestamp {
        match self.server {
            Some(offset) => offset.saturating_add(monotonic),
            None => SystemClock.now(),
        }
    }

    /// Logs a doubt when it begins and when it ends.
    fn tell(&mut self, wall: Timestamp, monotonic: i64) {
        match self.course.doubt() {
            Some(expected) if !self.told => {
                self.told = true;
                let off = wall.saturating_sub(monotonic).saturating_sub(expected);
                tracing::warn!(
                    hours = off / 3_600_000,
                    "the time of day is so far from the last trusted one: the service has not run, or the clock \
                     is wrong. Nothing is erased or given up by age until it has gone on without a step for an hour"
                );
            }
            None if self.told => {
                self.told = false;
                tracing::warn!("the time of day is trusted again");
            }
            _ => {}
        }
    }
}

impl Clock for ServiceClock {
    fn now(&self) -> Timestamp {
        self.read(|_, now, _| now)
    }

    fn is_trusted(&self) -> bool {
        self.read(|_, _, course| course.is_trusted())
    }

    fn latest(&self) -> Timestamp {
        self.read(|wall, now, _| wall.max(now))
    }
}

/// How the served time follows the wall clock; all in milliseconds.
#[derive(Debug)]
struct Course {
    trust: Trust,
    last: Timestamp,
}

/// What is known of the wall clock. Offsets are wall time minus monotonic time.
#[derive(Debug)]
enum Trust {
    /// Nothing yet.
    Unknown,
    /// It goes on with that offset.
    Steady { offset: i64, step: Option<Step> },
    /// It has gone on without another step since `step`; trusted was `expected`.
    Doubt { step: Step, expected: i64 },
}

/// An offset that the wall clock shows, and since when on the monotonic clock.
#[derive(Debug, Clone, Copy)]
struct Step {
    shown: i64,
    since: i64,
}

impl Course {
    fn unknown(wall: Timestamp) -> Self {
        Self {
            trust: Trust::Unknown,
            last: wall,
        }
    }

    fn begin(wall: Timestamp, monotonic: i64, last_trusted: Option<Timestamp>) -> Self {
        let shown = wall.saturating_sub(monotonic);
        let expected = last_trusted.map_or(shown, |last| last.saturating_sub(monotonic));
        let trust = if is_near(shown, expected) {
            Trust::Steady {
                offset: shown,
                step: None,
            }
        } else {
            let step = Step {
                shown,
                since: monotonic,
            };
            Trust::Doubt { step, expected }
        };
        let mut course = Self { trust, last: 0 };
        course.now(wall, monotonic);
        course
    }

    fn is_trusted(&self) -> bool {
        matches!(self.trust, Trust::Steady { step: None, .. })
    }

    /// The expected offset, if the time is in doubt.
    fn doubt(&self) -> Option<i64> {
        match self.trust {
            Trust::Doubt { expected, .. } => Some(expected),
            _ => None,
        }
    }

    fn now(&mut self, wall: Timestamp, monotonic: i64) -> Timestamp {
        let shown = wall.saturating_sub(monotonic);
        match &mut self.trust {
            Trust::Unknown => {
                self.last = wall;
                return wall;
            }
            Trust::Steady { offset, step } => {
                if is_same(shown, *offset) {
                    (*offset, *step) = (shown, None);
                    return self.serve(wall);
                }
                let (served, expected) = (monotonic.saturating_add(*offset), *offset);
                let since = settled(step, shown, monotonic);
                if since < milliseconds(SETTLING_TIME) {
                    return self.serve(served);
                }
                if is_near(shown, expected) {
                    return self.believe(wall, monotonic);
                }
                let step = Step {
                    shown,
                    since: monotonic,
                };
                self.trust = Trust::Doubt { step, expected };
            }
            Trust::Doubt { step, expected } => {
                let expected = *expected;
                let mut seen = Some(*step);
                let lasted = settled(&mut seen, shown, monotonic);
                if let Some(seen) = seen {
                    // Small corrections are no steps, however many there are.
                    *step = Step { shown, ..seen };
                }
                if is_near(shown, expected) || lasted >= milliseconds(DOUBT_LASTS) {
                    return self.believe(wall, monotonic);
                }
            }
        }
        let expected = self.doubt().unwrap_or(shown);
        // What is served in doubt is no floor for later: the wall clock may be set back to the truth.
        self.last = wall.max(monotonic.saturating_add(expected));
        self.last
    }

    /// Serves a time, never one before the last.
    fn serve(&mut self, at: Timestamp) -> Timestamp {
        self.last = self.last.max(at);
        self.last
    }

    /// Trusts the wall clock as it is.
    fn believe(&mut self, wall: Timestamp, monotonic: i64) -> Timestamp {
        self.trust = Trust::Steady {
            offset: wall.saturating_sub(monotonic),
            step: None,
        };
        self.last = wall;
        wall
    }
}

/// Notes an offset; returns for how long it has been shown.
fn settled(step: &mut Option<Step>, shown: i64, monotonic: i64) -> i64 {
    match step {
        Some(known) if is_same(shown, known.shown) => monotonic.saturating_sub(known.since),
        _ => {
            let since = monotonic;
            *step = Some(Step { shown, since });
            0
        }
    }
}

fn is_same(one: i64, other: i64) -> bool {
    one.saturating_sub(other).saturating_abs() <= CLOCK_STEP_MS
}

fn is_near(one: i64, other: i64) -> bool {
    one.saturating_sub(other).saturating_abs() <= milliseconds(EXPECTED_GAP)
}

const fn milliseconds(span: Duration) -> i64 {
    span.as_millis() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    const MINUTE_MS: i64 = 60_000;
    const HOUR_MS: i64 = 3_600_000;
    const DAY_MS: i64 = 24 * HOUR_MS;
    const START_MS: i64 = 20_000 * DAY_MS;

    /// Jumps of more than the expected gap, in both directions.
    const JUMPS_MS: [i64; 8] = [
        -20_000 * DAY_MS,
        -400 * DAY_MS,
        -DAY_MS,
        -2 * HOUR_MS,
        2 * HOUR_MS,
        DAY_MS,
        10 * DAY_MS,
        400 * DAY_MS,
    ];

    fn course() -> Course {
        Course::begin(START_MS, 0, Some(START_MS))
    }

    #[test]
    fn a_new_store_and_a_short_pause_raise_no_doubt() {
        assert!(Course::begin(START_MS, 5, None).is_trusted());
        for pause in [0, MINUTE_MS, HOUR_MS - 1, 1 - HOUR_MS] {
            assert!(Course::begin(START_MS + pause, 5, Some(START_MS)).is_trusted());
        }
    }

    #[test]
    fn nothing_is_trusted_before_the_last_trusted_time_is_known() {
        let mut course = Course::unknown(START_MS);
        assert_eq!(course.now(START_MS + 5, 5), START_MS + 5);
        assert!(!course.is_trusted());
    }

    #[test]
    fn a_start_at_another_time_is_in_doubt_for_an_hour_and_serves_no_earlier_time() {
        for jump in JUMPS_MS {
            let mut course = Course::begin(START_MS + jump, 0, Some(START_MS));
            for minute in 0..60 {
                let monotonic = minute * MINUTE_MS;
                let now = course.now(START_MS + jump + monotonic, monotonic);
                assert!(!course.is_trusted(), "{jump} after {minute} minutes");
                assert_eq!(now, START_MS + jump.max(0) + monotonic);
            }
            let wall = START_MS + jump + HOUR_MS;
            assert_eq!(course.now(wall, HOUR_MS), wall);
            assert!(course.is_trusted(), "{jump}");
        }
    }

    #[test]
    fn a_doubtful_clock_that_is_set_right_is_trusted_at_once() {
        for jump in JUMPS_MS {
            let mut course = Course::begin(START_MS + jump, 0, Some(START_MS));
            course.now(START_MS + jump + MINUTE_MS, MINUTE_MS);
            let wall = START_MS + 2 * MINUTE_MS;
            assert_eq!(course.now(wall, 2 * MINUTE_MS), wall, "{jump}");
            assert!(course.is_trusted());
        }
    }

    #[test]
    fn another_step_in_doubt_begins_the_hour_anew() {
        for jump in JUMPS_MS {
            let mut course = Course::begin(START_MS + jump, 0, Some(START_MS));
            // As a clock does that runs a thousand times too fast, or whose battery is loose.
            for minute in 1..300 {
                let wander = minute % 7 * 3 * HOUR_MS * jump.signum();
                let wall = START_MS + jump + minute * MINUTE_MS + wander;
                course.now(wall, minute * MINUTE_MS);
                assert!(!course.is_trusted(), "{jump} after {minute} minutes");
            }
        }
    }

    #[test]
    fn a_step_that_does_not_last_changes_nothing() {
        for jump in JUMPS_MS {
            let mut course = course();
            for minute in 0..30 {
                let monotonic = minute * MINUTE_MS;
                let stepped = (5..14).contains(&minute);
                let wall = START_MS + monotonic + if stepped { jump } else { 0 };
                assert_eq!(course.now(wall, monotonic), START_MS + monotonic);
                assert_eq!(course.is_trusted(), !stepped, "minute {minute}");
            }
        }
    }

    #[test]
    fn a_step_that_lasts_is_followed_and_ages_wait_for_an_hour_more() {
        for jump in JUMPS_MS {
            let mut course = course();
            for minute in 1..=100 {
                let monotonic = minute * MINUTE_MS;
                let now = course.now(START_MS + monotonic + jump, monotonic);
                // The step is seen after one minute, settled after eleven, believed after 71.
                let followed = if minute >= 71 || (jump > 0 && minute >= 11) {
                    jump
                } else {
                    0
                };
                assert_eq!(now, START_MS + monotonic + followed, "minute {minute}");
                assert_eq!(course.is_trusted(), minute >= 71, "minute {minute}");
            }
        }
    }

    #[test]
    fn a_step_of_minutes_is_followed_without_doubt() {
        for step in [-30 * MINUTE_MS, MINUTE_MS, 30 * MINUTE_MS] {
            let mut course = course();
            for minute in 1..=20 {
                let monotonic = minute * MINUTE_MS;
                let now = course.now(START_MS + monotonic + step, monotonic);
                let followed = if minute >= 11 { step } else { 0 };
                assert_eq!(now, START_MS + monotonic + followed, "minute {minute}");
                assert_eq!(course.is_trusted(), minute >= 11);
            }
        }
    }

    #[test]
    fn small_corrections_are_followed_and_never_go_back() {
        let mut course = course();
        assert_eq!(course.now(START_MS + 1_500, 1_000), START_MS + 1_500);
        assert_eq!(course.now(START_MS + 1_000, 1_100), START_MS + 1_500);
        assert_eq!(course.now(START_MS + 2_000, 2_100), START_MS + 2_000);
        assert!(course.is_trusted());
    }

    #[test]
    fn the_clock_of_the_server_counts_where_there_is_one() {
        let clock = ServiceClock::default();
        let far = SystemClock.now() + 400 * DAY_MS;
        clock.follow(far);
        clock.begin(Some(far - MINUTE_MS));
        assert!(clock.is_trusted());
        assert!((clock.now() - far).abs() < 10_000);
        assert!((clock.latest() - far).abs() < 10_000);
    }

    #[test]
    fn a_moment_that_has_passed_stays_passed_when_the_clock_is_set_back() {
        for jump in JUMPS_MS.into_iter().filter(|jump| *jump < 0) {
            let clock = ServiceClock::default();
            clock.begin(Some(SystemClock.now() - jump));
            assert!(clock.latest() >= SystemClock.now() - jump - 10_000);
            assert!(!clock.is_trusted());
        }
    }
}
