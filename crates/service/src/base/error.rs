//! Errors of the use cases: a failure with advice, and whether trying again may help.
//!
//! A [`ServiceError`] goes one way, from here to whoever asked: the HTTP interface maps it to a status, the intake
//! and the exchange with archives to "later" or "never", the command line to a line.

use crate::base::records::{BlobError, Failure, Fault, StoreError, StoreFault};
use std::time::Duration;

/// Pause before a use case is tried again that failed for a reason which may pass.
const STORAGE_RETRY: Duration = Duration::from_secs(5);

/// Pause before a change is made again that others came before.
const CONTENDED_RETRY: Duration = Duration::from_secs(1);

/// Longest text of a caller that a message repeats, characters.
const SHORTENED_LENGTH: usize = 80;

/// Why a use case was refused or failed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{failure}")]
pub struct ServiceError {
    /// The reason, with advice. Contains no internals of the service.
    pub failure: Box<Failure>,
    /// The kind of refusal.
    pub refusal: Refusal,
    /// When to try again; `None` if that is not known, or does not help.
    pub retry_after: Option<Duration>,
}

/// The result of a use case.
pub type ServiceResult<T> = Result<T, ServiceError>;

/// The kind of a [`ServiceError`], by what the caller can do about it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refusal {
    /// The request cannot be fulfilled; [`Failure::fault`] says where the cause lies.
    Failed,
    /// It contradicts what is stored.
    Conflict,
    /// It was erased.
    Gone,
    /// The caller has too much waiting. May pass.
    TooMany,
    /// The service is overloaded, or something that it depends on does not answer. May pass.
    Unavailable,
    /// There is no room: of the disk, or under the tenant's quota. May pass.
    NoRoom,
}

impl ServiceError {
    /// An error of that kind.
    pub fn new(refusal: Refusal, failure: Failure) -> Self {
        Self {
            failure: Box::new(failure),
            refusal,
            retry_after: None,
        }
    }

    /// The same, which says when to try again.
    #[must_use]
    pub fn after(mut self, pause: Duration) -> Self {
        self.retry_after = Some(pause);
        self
    }

    /// A defect of the program, or of its surroundings. The cause goes to the log only.
    pub fn internal(cause: impl std::fmt::Display) -> Self {
        tracing::error!(%cause, "internal error while answering a request");
        let detail =
            "The service failed to answer because of an internal error, which has been logged.";
        Failure::new(Fault::Service, "internal", detail)
            .fix("Report it with the x-request-id of this answer.")
            .into()
    }

    /// Other callers change the same thing all the time, so that it was not changed.
    pub fn contended(what: &str) -> Self {
        let detail =
            format!("Other requests change {what} at the same time, so that was not changed.");
        let failure = Failure::new(Fault::Service, "busy", detail).fix(RETRY_FIX);
        Self::new(Refusal::Unavailable, failure).after(CONTENDED_RETRY)
    }

    /// Whether trying again later may help.
    pub fn may_pass(&self) -> bool {
        matches!(
            self.refusal,
            Refusal::TooMany | Refusal::Unavailable | Refusal::NoRoom
        )
    }

    /// Tells whoever sent a file its texts ([`Failure::for_sender`]).
    #[must_use]
    pub fn for_sender(mut self) -> Self {
        *self.failure = self.failure.for_sender();
        self
    }

    /// Says that the field concerned is `field`.
    #[must_use]
    pub fn at(mut self, field: impl Into<String>) -> Self {
        self.failure.field = Some(field.into());
        self
    }
}

impl ServiceError {
    /// Says that the field concerned is `named` if it is `field`, which the request has under that name.
    #[must_use]
    pub fn naming(self, field: &str, named: impl Into<String>) -> Self {
        if self.failure.field.as_deref() == Some(field) {
            self.at(named)
        } else {
            self
        }
    }
}

/// Why an attempt failed that nobody waits for: a fetch, a delivery, a volume of received objects.
#[derive(Debug)]
pub enum AttemptError {
    /// It may succeed later.
    Retry {
        /// The cause, as a sentence without patient data.
        why: String,
        /// How long the other side asks to wait.
        asked: Option<Duration>,
    },
    /// Trying again does not help.
    Permanent(Failure),
}

impl AttemptError {
    /// One that may pass.
    pub fn retry(why: impl Into<String>) -> Self {
        Self::Retry {
            why: why.into(),
            asked: None,
        }
    }

    /// One that lasts, with its code, what happened and what to do about it.
    pub fn permanent(fault: Fault, code: &str, what: impl Into<String>, fix: &str) -> Self {
        Self::Permanent(Failure::new(fault, code, what).fix(fix))
    }

    /// The cause.
    pub fn why(&self) -> &str {
        match self {
            Self::Retry { why, .. } => why,
            Self::Permanent(failure) => &failure.detail,
        }
    }
}

impl From<ServiceError> for AttemptError {
    fn from(error: ServiceError) -> Self {
        match error.may_pass() {
            true => Self::retry(error.failure.detail),
            false => Self::Permanent(*error.failure),
        }
    }
}

impl From<StoreError> for AttemptError {
    fn from(error: StoreError) -> Self {
        tracing::error!(%error, "the storage failed during an attempt");
        Self::retry("The storage of this service failed.")
    }
}

impl From<Failure> for ServiceError {
    fn from(failure: Failure) -> Self {
        Self::new(Refusal::Failed, failure)
    }
}

impl From<BlobError> for ServiceError {
    fn from(error: BlobError) -> Self {
        StoreError::from(error).into()
    }
}

impl From<StoreError> for ServiceError {
    fn from(error: StoreError) -> Self {
        let cause = error.cause();
        if cause == StoreFault::Other {
            return Self::internal(error);
        }
        let failure = storage_failure(&error);
        let refusal = match cause {
            StoreFault::Full => Refusal::NoRoom,
            StoreFault::Busy | StoreFault::Disk | StoreFault::Away => Refusal::Unavailable,
            StoreFault::Erased => Refusal::Gone,
            _ => Refusal::Failed,
        };
        if cause != StoreFault::Erased {
            let code = &failure.code;
            tracing::error!(%error, code, "the storage failed");
        }
        let refused = Self::new(refusal, failure);
        if cause.may_pass() {
            refused.after(STORAGE_RETRY)
        } else {
            refused
        }
    }
}

/// A failure of the storage in words for clients.
fn storage_failure(error: &StoreError) -> Failure {
    let (code, detail, fix) = match (error.cause(), error) {
        (StoreFault::Full, _) => (
            "insufficient-storage",
            "The service has no room left on its disk, so nothing was stored.",
            "Erase volumes and results that are no longer needed, or ask the operator to free \
             disk space; then send the request again.",
        ),
        (StoreFault::Busy, _) => (
            "storage-busy",
            "The service's database was not free in time, so nothing was stored: the machine is \
             overloaded, or another program holds the database.",
            RETRY_FIX,
        ),
        (StoreFault::Disk, _) => (
            "storage-failed",
            "The service's disk failed to read or write, so nothing was stored.",
            "Send the request again after the number of seconds in Retry-After; if that does \
             not help, ask the operator to check the disk.",
        ),
        (StoreFault::Away, StoreError::Files(_)) => (
            "storage-away",
            "The store of the service's files does not answer, so nothing was stored or read.",
            RETRY_FIX,
        ),
        (StoreFault::Away, StoreError::Database { .. }) => (
            "database-away",
            "The service's database does not answer, so nothing was stored or read.",
            RETRY_FIX,
        ),
        (StoreFault::DamagedFile, _) => (
            "damaged-file",
            "A stored file is missing, or no longer holds what was stored.",
            "Upload the volume again, which repairs it; of a result, start the same job again.",
        ),
        (StoreFault::Erased, _) => (
            "gone",
            "It was erased while it was read.",
            "Upload the same volume again, or start the same job again; ids stay the same.",
        ),
        (StoreFault::DamagedDatabase | StoreFault::Other, _) => (
            "damaged-database",
            "The service's database is damaged.",
            "Ask the operator to restore a backup or to run `ventriform doctor`.",
        ),
    };
    Failure::new(Fault::Service, code, detail).fix(fix)
}

const RETRY_FIX: &str = "Send the request again after the number of seconds in Retry-After.";

/// A failure of a request whose `field` cannot be used.
pub fn invalid_field(field: &str, detail: impl Into<String>) -> Failure {
    Failure::new(Fault::Request, "invalid-field", detail).at(field)
}

/// A caller's text, cut to 80 characters for use in a message.
pub fn shorten(text: &str) -> String {
    match text.char_indices().nth(SHORTENED_LENGTH) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
