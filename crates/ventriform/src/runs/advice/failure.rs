//! Why work failed or was refused, in a form that can be stored.

use serde::{Deserialize, Serialize};

/// A reason with advice.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, thiserror::Error)]
#[error("{detail}")]
pub struct Failure {
    /// A stable identifier for programs: `no-surface`, `job-time-limit` ...
    pub code: String,
    /// Where the cause lies.
    pub fault: Fault,
    /// The cause, with the values involved, as a sentence. Contains patient data only where files contradict each other
    /// on whose they are.
    pub detail: String,
    /// The parameter, or the field of the file, that caused it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub field: Option<String>,
    /// Advice, as a sentence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fix: Option<String>,
    /// The cause with the texts of the file that it is about, for whoever sent the file, in the answer to that. Never
    /// stored.
    #[serde(skip)]
    pub to_sender: Option<Box<str>>,
}

/// Where the cause of a [`Failure`] lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fault {
    /// In the request: a parameter, or the form of the call.
    Request,
    /// In the file or its content.
    Content,
    /// The file exceeds a limit.
    TooLarge,
    /// In the machine or the program that does the work.
    Service,
}

impl Failure {
    /// A failure without field and advice; add them with [`Failure::at`] and [`Failure::fix`].
    pub fn new(fault: Fault, code: &str, detail: impl Into<String>) -> Self {
        Self {
            code: code.into(),
            fault,
            detail: detail.into(),
            field: None,
            fix: None,
            to_sender: None,
        }
    }

    /// Sets the field that caused the failure.
    #[must_use]
    pub fn at(mut self, field: impl Into<String>) -> Self {
        self.field = Some(field.into());
        self
    }

    /// Sets what whoever sent the file is told instead.
    #[must_use]
    pub fn or_to_sender(mut self, detail: String) -> Self {
        self.to_sender = (detail != self.detail).then(|| detail.into());
        self
    }

    /// Tells whoever sent the file its texts.
    #[must_use]
    pub fn for_sender(mut self) -> Self {
        self.detail = self.to_sender.take().map_or(self.detail, String::from);
        self
    }

    /// Says that the field concerned is inside of the field `outer`.
    #[must_use]
    pub fn within(mut self, outer: &str) -> Self {
        self.field = self.field.map(|field| format!("{outer}.{field}"));
        self
    }

    /// Sets the advice.
    #[must_use]
    pub fn fix(mut self, fix: impl Into<String>) -> Self {
        self.fix = Some(fix.into());
        self
    }
}
