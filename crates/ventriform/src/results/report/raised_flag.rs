//! Reasons to look closer, as reports have them.

use serde::{Deserialize, Serialize};
use std::fmt::Display;

/// A reason to look closer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(utoipa::ToSchema), schema(as = Flag))]
pub struct RaisedFlag {
    /// Its stable name.
    pub code: String,
    /// The finding.
    pub reason: String,
}

impl RaisedFlag {
    /// A flag with this stable name, whose text says what was found.
    pub fn new(code: &str, flag: &impl Display) -> Self {
        Self {
            code: code.to_owned(),
            reason: flag.to_string(),
        }
    }
}
