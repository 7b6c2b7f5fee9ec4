//! Errors of the domain and of the store as problems.

use super::Problem;
use crate::jobs::{BlobError, Failure, Fault, StoreError};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use std::any::Any;

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

impl From<StoreError> for Problem {
    fn from(error: StoreError) -> Self {
        Self::internal(error)
    }
}

impl From<BlobError> for Problem {
    fn from(error: BlobError) -> Self {
        Self::internal(error)
    }
}

/// The answer when a handler panicked.
pub fn from_panic(_: Box<dyn Any + Send + 'static>) -> Response {
    Problem::internal("a handler panicked").into_response()
}
