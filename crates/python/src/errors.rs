//! Failures as exceptions: `ventriform.InputError(field, reason, fix, code)` and its kin.

use pyo3::prelude::*;
use std::fmt::Display;
use ventriform::base::progress::Cancelled;
use ventriform::runs::advice::{Explain, Failure, Fault};

/// Why work ended without a result.
#[derive(Debug)]
pub enum Stopped {
    /// It failed.
    Failed(Failure),
    /// It was cancelled.
    Cancelled,
}

impl From<Cancelled> for Stopped {
    fn from(_: Cancelled) -> Self {
        Self::Cancelled
    }
}

/// The end of work by `error`.
pub fn stopped(error: &impl Explain) -> Stopped {
    if error.is_cancelled() {
        Stopped::Cancelled
    } else {
        Stopped::Failed(error.explain().for_sender())
    }
}

/// An input that cannot be used.
pub fn refused(field: &str, reason: impl Display, fix: &str) -> Failure {
    Failure::new(Fault::Request, "unusable-input", reason.to_string())
        .at(field)
        .fix(fix)
}

/// A failure that nobody's input explains, such as a result that cannot be written.
pub fn broken(reason: impl Display) -> Failure {
    Failure::new(Fault::Service, "failed", reason.to_string())
}

/// The exception for `failure`.
pub fn exception(py: Python<'_>, failure: &Failure) -> PyErr {
    let name = match failure.fault {
        Fault::Request | Fault::Content => "InputError",
        Fault::TooLarge => "TooLargeError",
        Fault::Service => "UnreadableError",
    };
    let made = class(py, name).and_then(|class| {
        let fix = failure.fix.as_deref().unwrap_or_default();
        let told = (
            failure.field.as_deref(),
            &failure.detail,
            fix,
            &failure.code,
        );
        class.call1(told)
    });
    made.map_or_else(|error| error, PyErr::from_value)
}

/// The exception for a panic with this message.
pub fn internal(py: Python<'_>, message: &str) -> PyErr {
    let made = class(py, "InternalError").and_then(|class| class.call1((message,)));
    made.map_or_else(|error| error, PyErr::from_value)
}

fn class<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("ventriform._errors")?.getattr(name)
}
