//! Errors of the domain and of the store as problems.

use super::Problem;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::any::Any;
use ventriform_service::items::NotAdded;
use ventriform_service::records::{BlobError, Failure, Fault, StoreError, StoreFault};

/// When to try again after the storage failed for a reason that may pass.
const RETRY_AFTER_SECONDS: &str = "5";

impl From<Failure> for Problem {
    fn from(failure: Failure) -> Self {
        let status = match failure.fault {
            Fault::Request | Fault::Content => StatusCode::UNPROCESSABLE_ENTITY,
            Fault::TooLarge => StatusCode::PAYLOAD_TOO_LARGE,
            Fault::Service => StatusCode::INTERNAL_SERVER_ERROR,
        };
        let mut problem = Self::new(status, &failure.code, failure.detail);
        problem.body.field = failure.field;
        problem.body.fix = failure.fix;
        problem
    }
}

impl From<NotAdded> for Problem {
    fn from(error: NotAdded) -> Self {
        let of = |failure: Failure, status: StatusCode| {
            let mut problem = Self::from(failure);
            problem.body.status = status.as_u16();
            problem
        };
        match error {
            NotAdded::Refused(failure) => failure.into(),
            NotAdded::TooMany(failure) => of(failure, StatusCode::CONFLICT),
            NotAdded::TooLarge(failure) => of(failure, StatusCode::INSUFFICIENT_STORAGE),
            NotAdded::Store(error) => error.into(),
        }
    }
}

/// Statuses of problems that may pass.
const PASSING: [StatusCode; 3] = [
    StatusCode::TOO_MANY_REQUESTS,
    StatusCode::SERVICE_UNAVAILABLE,
    StatusCode::INSUFFICIENT_STORAGE,
];

impl Problem {
    /// What is to be written down of work that nobody waits for.
    ///
    /// # Errors
    /// What happened, if it may pass and the work is to be tried again.
    pub fn into_failure(self) -> Result<Failure, String> {
        let body = self.into_body();
        if PASSING.iter().any(|status| status.as_u16() == body.status) {
            return Err(body.detail);
        }
        Ok(Failure {
            code: body.code().to_owned(),
            fault: match body.status {
                500.. => Fault::Service,
                413 => Fault::TooLarge,
                _ => Fault::Content,
            },
            detail: body.detail,
            field: body.field,
            fix: body.fix,
        })
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        let problem = |status, code: &str, detail: &str| {
            tracing::error!(%error, code, "the storage failed while answering a request");
            Self::new(status, code, detail)
        };
        let later = |problem: Self| problem.header(header::RETRY_AFTER, RETRY_AFTER_SECONDS);
        match error.cause() {
            StoreFault::Full => later(problem(
                StatusCode::INSUFFICIENT_STORAGE,
                "insufficient-storage",
                "The service has no room left on its disk, so nothing was stored.",
            ))
            .fix(
                "Erase volumes and results that are no longer needed, or ask the operator to free \
                 disk space; then send the request again.",
            ),
            StoreFault::Busy => later(problem(
                StatusCode::SERVICE_UNAVAILABLE,
                "storage-busy",
                "The service's database was not free in time, so nothing was stored: the machine is \
                 overloaded, or another program holds the database.",
            ))
            .fix("Send the request again after the number of seconds in Retry-After."),
            StoreFault::Disk => later(problem(
                StatusCode::SERVICE_UNAVAILABLE,
                "storage-failed",
                "The service's disk failed to read or write, so nothing was stored.",
            ))
            .fix(
                "Send the request again after the number of seconds in Retry-After; if that does \
                 not help, ask the operator to check the disk.",
            ),
            StoreFault::Away => {
                let (code, detail) = match &error {
                    StoreError::Files(_) => (
                        "storage-away",
                        "The store of the service's files does not answer, so nothing was stored or read.",
                    ),
                    StoreError::Database { .. } => (
                        "database-away",
                        "The service's database does not answer, so nothing was stored or read.",
                    ),
                };
                later(problem(StatusCode::SERVICE_UNAVAILABLE, code, detail))
                    .fix("Send the request again after the number of seconds in Retry-After.")
            }
            StoreFault::DamagedFile => problem(
                StatusCode::INTERNAL_SERVER_ERROR,
                "damaged-file",
                "A stored file is missing, or no longer holds what was stored.",
            )
            .fix(
                "Upload the volume again, which repairs it; of a result, start the same job again.",
            ),
            StoreFault::Erased => Self::new(
                StatusCode::GONE,
                "gone",
                "It was erased while it was read.",
            )
            .fix("Upload the same volume again, or start the same job again; ids stay the same."),
            StoreFault::DamagedDatabase => problem(
                StatusCode::INTERNAL_SERVER_ERROR,
                "damaged-database",
                "The service's database is damaged.",
            )
            .fix("Ask the operator to restore a backup or to run `ventriform doctor`."),
            StoreFault::Other => Self::internal(error),
        }
    }
}

impl From<BlobError> for Problem {
    fn from(error: BlobError) -> Self {
        StoreError::from(error).into()
    }
}

/// The answer when a handler panicked.
pub fn from_panic(_: Box<dyn Any + Send + 'static>) -> Response {
    Problem::internal("a handler panicked").into_response()
}
