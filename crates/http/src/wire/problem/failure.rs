//! Errors of the service as problems: each kind of refusal has its status.

use super::Problem;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::any::Any;
use ventriform_service::base::error::{Refusal, ServiceError};
use ventriform_service::base::records::{BlobError, Failure, Fault, StoreError};

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

impl From<ServiceError> for Problem {
    fn from(error: ServiceError) -> Self {
        let status = match error.refusal {
            Refusal::Failed => None,
            Refusal::Conflict => Some(StatusCode::CONFLICT),
            Refusal::Gone => Some(StatusCode::GONE),
            Refusal::TooMany => Some(StatusCode::TOO_MANY_REQUESTS),
            Refusal::Unavailable => Some(StatusCode::SERVICE_UNAVAILABLE),
            Refusal::NoRoom => Some(StatusCode::INSUFFICIENT_STORAGE),
        };
        let mut problem = Self::from(*error.failure);
        if let Some(status) = status {
            problem.body.status = status.as_u16();
        }
        match error.retry_after {
            Some(pause) => problem.header(header::RETRY_AFTER, pause.as_secs().to_string()),
            None => problem,
        }
    }
}

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        ServiceError::from(error).into()
    }
}

impl From<BlobError> for Problem {
    fn from(error: BlobError) -> Self {
        ServiceError::from(error).into()
    }
}

/// The answer when a handler panicked.
pub fn from_panic(_: Box<dyn Any + Send + 'static>) -> Response {
    Problem::internal("a handler panicked").into_response()
}
