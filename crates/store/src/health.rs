//! What statements tell of the state of the database.
//!
//! A statement that fails because the database is damaged or cannot be read says more than a probe of one small table
//! does. It is noted here, and the service is not ready until the whole database has been read again without a defect:
//! [`SqlStore::read_again`](super::database::SqlStore), which the upkeep calls.

use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use ventriform_service::base::records::{StoreError, StoreFault};

/// Shortest pause between two checks of the whole database; longer if a check takes long.
const RECHECK_PAUSE: Duration = Duration::from_secs(10);
/// A check takes at most one in so many parts of the time.
const RECHECK_SHARE: u32 = 10;
/// After a check that found none of the defects of which statements tell again within this time, the pause is twice as
/// long, up to so many times: a check does not see everything.
const RELAPSE_TIME: Duration = Duration::from_secs(3600);
const MOST_RELAPSES: u32 = 6;

/// The defect that was told last, until a check finds none.
#[derive(Debug, Default)]
pub(super) struct Health(Mutex<State>);

#[derive(Debug, Default)]
struct State {
    defect: Option<Defect>,
    /// Number of defects told.
    told: u64,
    /// Before then no check begins.
    rest: Option<Instant>,
    /// When a check has found no defect last, and how often one was told soon after that.
    cleared: Option<Instant>,
    relapses: u32,
}

#[derive(Debug, Clone)]
struct Defect {
    cause: StoreFault,
    message: String,
}

impl Health {
    /// Notes an error that tells of a damaged or unreadable database, and returns it.
    pub fn noted(&self, error: StoreError) -> StoreError {
        if let StoreError::Database { cause, message } = &error
            && matches!(cause, StoreFault::DamagedDatabase | StoreFault::Disk)
        {
            self.note(*cause, message.clone());
        }
        error
    }

    /// Notes a defect.
    pub fn note(&self, cause: StoreFault, message: String) {
        let mut state = self.state();
        if state.defect.is_none() {
            tracing::error!(message, "the database is damaged or cannot be read");
            let again = state.cleared.is_some_and(|at| at.elapsed() < RELAPSE_TIME);
            if again {
                state.relapses = (state.relapses + 1).min(MOST_RELAPSES);
                state.rest = Some(Instant::now() + RECHECK_PAUSE * 2_u32.pow(state.relapses));
            } else {
                state.relapses = 0;
            }
        }
        state.told += 1;
        state.defect = Some(Defect { cause, message });
    }

    /// Whether no defect is known.
    ///
    /// # Errors
    /// The defect that was told last.
    pub fn sound(&self) -> Result<(), StoreError> {
        match &self.state().defect {
            None => Ok(()),
            Some(Defect { cause, message }) => Err(StoreError::Database {
                cause: *cause,
                message: message.clone(),
            }),
        }
    }

    /// The number of defects told, if there is one and it is time to check the whole database.
    pub fn check_due(&self) -> Option<u64> {
        let state = self.state();
        let rested = state.rest.is_none_or(|rest| Instant::now() >= rest);
        (state.defect.is_some() && rested).then_some(state.told)
    }

    /// Takes the outcome of a check that began when `told` defects had been told, and has taken so long.
    pub fn checked(&self, told: u64, took: Duration, outcome: Result<(), StoreError>) {
        match outcome {
            Ok(()) => {
                let mut state = self.state();
                // A defect that was told meanwhile may lie where the check had been already.
                if state.told == told {
                    state.defect = None;
                    state.cleared = Some(Instant::now());
                    tracing::warn!("the whole database was read without a defect");
                }
            }
            // One that could not be made leaves the defect as it is.
            Err(error) => drop(self.noted(error)),
        }
        let pause = RECHECK_PAUSE.max(took.saturating_mul(RECHECK_SHARE));
        let rest = Instant::now() + pause;
        let mut state = self.state();
        state.rest = Some(state.rest.map_or(rest, |known| known.max(rest)));
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic cannot leave the state half changed: each change is an assignment.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(cause: StoreFault) -> StoreError {
        StoreError::Database {
            cause,
            message: "why".into(),
        }
    }

    #[test]
    fn only_what_tells_of_the_database_itself_is_a_defect() {
        for cause in [
            StoreFault::Full,
            StoreFault::Busy,
            StoreFault::Away,
            StoreFault::DamagedFile,
            StoreFault::Erased,
            StoreFault::Other,
        ] {
            let health = Health::default();
            health.noted(error(cause));
            assert!(health.sound().is_ok(), "{cause:?}");
        }
        for cause in [StoreFault::DamagedDatabase, StoreFault::Disk] {
            let health = Health::default();
            assert_eq!(health.noted(error(cause)).cause(), cause);
            assert_eq!(health.sound().unwrap_err().cause(), cause);
        }
    }

    #[test]
    fn a_defect_is_known_until_a_check_that_began_after_it_finds_none() {
        let health = Health::default();
        assert_eq!(health.check_due(), None);
        health.noted(error(StoreFault::DamagedDatabase));
        let told = health.check_due().unwrap();
        health.noted(error(StoreFault::Disk));
        health.checked(told, Duration::ZERO, Ok(()));
        assert!(health.sound().is_err(), "another one was told meanwhile");
        assert_eq!(health.check_due(), None, "a check rests");
        health.checked(told + 1, Duration::ZERO, Err(error(StoreFault::Busy)));
        assert!(health.sound().is_err(), "the check could not be made");
        health.checked(told + 1, Duration::ZERO, Ok(()));
        assert!(health.sound().is_ok());
    }
}
