//! The record of an uploaded volume.

use crate::jobs::Timestamp;
use serde_json::Value;

/// One row of the volumes table.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredVolume {
    /// `vol_...`, derived from the content.
    pub id: String,
    /// Position in the order of arrival; 0 before it is stored.
    pub sequence: i64,
    /// When it was stored.
    pub created_at: Timestamp,
    /// Total length of its files in bytes.
    pub bytes: u64,
    /// Names of its files in the file store. These are not the names given by the client.
    pub files: Vec<String>,
    /// What was found out about the content when it was uploaded; the queue does not read it.
    pub facts: Value,
}
