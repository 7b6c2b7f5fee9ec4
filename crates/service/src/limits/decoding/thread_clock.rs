//! How long a thread has computed: the time that passes without that for which it waits for a processor.
//!
//! On a busy machine a thread stands still for much of the time. What is honest would be refused there by a
//! limit on the time that passes. The processor time of the thread alone is no measure either: while it
//! waits for the disk, or for threads that it has asked to compute, it uses none.
//!
//! Linux counts the wait for a processor in `/proc/PID/task/TID/schedstat`. Elsewhere, and where that cannot
//! be read, all time counts.

use std::path::PathBuf;
use std::time::{Duration, Instant};

/// The clock of one thread; others may read it.
#[derive(Debug, Clone)]
pub struct ThreadClock {
    statistics: Option<PathBuf>,
}

/// A moment on a [`ThreadClock`].
#[derive(Debug, Clone, Copy)]
pub struct Moment {
    at: Instant,
    waited: Duration,
}

impl ThreadClock {
    /// That of the thread that calls.
    pub fn of_this_thread() -> Self {
        // A link to the folder of the thread: `PID/task/TID`.
        let folder = std::fs::read_link("/proc/thread-self");
        let statistics = folder.map(|folder| PathBuf::from("/proc").join(folder).join("schedstat"));
        Self {
            statistics: statistics.ok(),
        }
    }

    /// Now.
    pub fn now(&self) -> Moment {
        Moment {
            at: Instant::now(),
            waited: self.waited().unwrap_or_default(),
        }
    }

    /// The time that the thread has computed since then.
    pub fn since(&self, then: Moment) -> Duration {
        let waited = self.waited().unwrap_or(then.waited);
        then.at
            .elapsed()
            .saturating_sub(waited.saturating_sub(then.waited))
    }

    /// The time that the thread has waited for a processor in all.
    fn waited(&self) -> Option<Duration> {
        let text = std::fs::read_to_string(self.statistics.as_ref()?).ok()?;
        // Nanoseconds of computing, nanoseconds of waiting, and how often.
        let waited = text.split_whitespace().nth(1)?;
        waited.parse().ok().map(Duration::from_nanos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computes for so much time of the clock of its thread. Returns that and the time that passed.
    fn computes(time: Duration) -> (Duration, Duration) {
        let clock = ThreadClock::of_this_thread();
        let (then, begun) = (clock.now(), Instant::now());
        let mut number = 1_u64;
        while clock.since(then) < time {
            for _ in 0..100_000 {
                number = std::hint::black_box(number.wrapping_mul(3));
            }
        }
        (clock.since(then), begun.elapsed())
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_busy_machine_makes_nothing_longer() {
        // More threads than processors: each waits for more than half of the time that passes.
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let time = Duration::from_millis(200);
        let threads: Vec<_> = (0..3 * cores)
            .map(|_| std::thread::spawn(move || computes(time)))
            .collect();
        let ended: Vec<_> = threads.into_iter().map(|one| one.join().unwrap()).collect();
        for (computed, _) in &ended {
            assert!(*computed < time * 3 / 2, "{computed:?}");
        }
        let longest = ended.iter().map(|(_, passed)| *passed).max().unwrap();
        assert!(longest > time * 2, "{longest:?}");
    }

    #[test]
    fn waiting_for_something_else_counts() {
        let clock = ThreadClock::of_this_thread();
        let then = clock.now();
        std::thread::sleep(Duration::from_millis(50));
        assert!(clock.since(then) >= Duration::from_millis(40));
    }
}
