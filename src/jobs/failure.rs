//! Why something was refused or did not come to an end, in a form that outlives the process.

use serde::{Deserialize, Serialize};

/// A reason with the way out. Kept with a failed job; becomes a problem object over HTTP.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{detail}")]
pub struct Failure {
    /// A stable word for programs: `no-surface`, `job-time-limit` ...
    pub code: String,
    /// Whose fault it is; decides the status.
    pub fault: Fault,
    /// What happened, with the values concerned. No patient data, no internals.
    pub detail: String,
    /// The parameter or header field concerned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// What to do about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fix: Option<String>,
}

/// Whose fault a [`Failure`] is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// The request: a parameter or the form of the call.
    Request,
    /// The file or what it shows.
    Content,
    /// It is larger than the operator allows.
    TooLarge,
    /// Ours.
    Service,
}

impl Failure {
    /// A failure without field and fix; add them with [`Failure::at`] and [`Failure::fix`].
    pub fn new(fault: Fault, code: &str, detail: impl Into<String>) -> Self {
        Self {
            code: code.into(),
            fault,
            detail: detail.into(),
            field: None,
            fix: None,
        }
    }

    /// Names the field concerned.
    #[must_use]
    pub fn at(mut self, field: impl Into<String>) -> Self {
        self.field = Some(field.into());
        self
    }

    /// Says what to do about it.
    #[must_use]
    pub fn fix(mut self, fix: impl Into<String>) -> Self {
        self.fix = Some(fix.into());
        self
    }
}
