//! Why an attempt failed, and whether another one may succeed.

use crate::base::error::ServiceError;
use crate::base::records::{Failure, Fault, StoreError};
use std::time::Duration;

/// Why an attempt did not succeed.
#[derive(Debug)]
pub enum Trouble {
    /// It may pass: the archive does not answer, or is busy.
    Passing {
        /// The cause, as a sentence without patient data.
        what: String,
        /// How long the archive asks to wait.
        asked: Option<Duration>,
    },
    /// Trying again does not help.
    Final(Failure),
}

impl Trouble {
    /// A trouble that may pass.
    pub fn passing(what: impl Into<String>) -> Self {
        Self::Passing {
            what: what.into(),
            asked: None,
        }
    }

    /// One that lasts, with its code, what happened and what to do about it.
    pub fn lasting(fault: Fault, code: &str, what: impl Into<String>, fix: &str) -> Self {
        Self::Final(Failure::new(fault, code, what).fix(fix))
    }

    /// The cause.
    pub fn what(&self) -> &str {
        match self {
            Trouble::Passing { what, .. } => what,
            Trouble::Final(failure) => &failure.detail,
        }
    }
}

impl From<ServiceError> for Trouble {
    fn from(error: ServiceError) -> Self {
        if error.may_pass() {
            Self::passing(error.failure.detail)
        } else {
            Self::Final(*error.failure)
        }
    }
}

impl From<StoreError> for Trouble {
    fn from(error: StoreError) -> Self {
        tracing::error!(%error, "the storage failed while exchanging with an archive");
        Self::passing("The storage of this service failed.")
    }
}

/// An archive's answer that is not what the standard asks for.
pub(super) fn odd_answer(what: impl Into<String>) -> Trouble {
    Trouble::lasting(
        Fault::Service,
        "archive-answer",
        what,
        "Ask the operator to compare `dicomweb` in the settings with the archive's documentation.",
    )
}
