//! The outcomes of attempts to deliver.

use http::StatusCode;

/// The outcome of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AttemptOutcome {
    /// The receiver answered 2xx.
    Delivered(u16),
    /// It answered 410: it wants no more.
    Gone,
    /// It answered something else. Redirects are not followed.
    Rejected(u16),
    /// It did not answer in time.
    TimedOut,
    /// There was no connection, or it broke, or its TLS failed.
    Unreachable,
    /// The guard did not let it pass.
    Refused,
    /// The process ended during it.
    Interrupted,
}

impl AttemptOutcome {
    /// The names of all outcomes.
    pub const OUTCOME_NAMES: [&'static str; 7] = [
        "delivered",
        "gone",
        "rejected",
        "timed-out",
        "unreachable",
        "refused",
        "interrupted",
    ];

    /// Its place among [`AttemptOutcome::OUTCOME_NAMES`].
    pub(super) fn index(self) -> usize {
        match self {
            AttemptOutcome::Delivered(_) => 0,
            AttemptOutcome::Gone => 1,
            AttemptOutcome::Rejected(_) => 2,
            AttemptOutcome::TimedOut => 3,
            AttemptOutcome::Unreachable => 4,
            AttemptOutcome::Refused => 5,
            AttemptOutcome::Interrupted => 6,
        }
    }

    /// Its name in answers, metrics and the database.
    pub fn as_str(self) -> &'static str {
        Self::OUTCOME_NAMES[self.index()]
    }

    /// The status of the receiver's answer.
    pub fn status(self) -> Option<u16> {
        match self {
            AttemptOutcome::Delivered(status) | AttemptOutcome::Rejected(status) => Some(status),
            AttemptOutcome::Gone => Some(StatusCode::GONE.as_u16()),
            _ => None,
        }
    }
}
