//! The record of an uploaded volume.

use super::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A stored file and what it must contain.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FileRecord {
    /// Its name in the file store.
    pub name: String,
    /// Its length in bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
    /// In a store that keeps every publication of an item apart, the one that this file is part of;
    /// see [`StagedFiles::place`](super::StagedFiles::place).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
}

/// One row of the volumes table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StoredVolume {
    /// `vol_...`, derived from the content.
    pub id: String,
    /// Position in the order of arrival; 0 before it is stored.
    pub sequence: i64,
    /// When it was stored.
    pub created_at: Timestamp,
    /// Total length of its files in bytes.
    pub bytes: u64,
    /// Its files in the file store. Their names are not those given by the client.
    pub files: Vec<FileRecord>,
    /// Facts about the content, found when it was uploaded. Of them, the queue reads [`StoredVolume::voxels`] alone.
    pub facts: Value,
}

impl StoredVolume {
    /// Voxels of all its frames together, as far as its facts say.
    pub fn voxels(&self) -> u64 {
        let shape = self.facts.get("shape").and_then(Value::as_array);
        let lengths = shape.into_iter().flatten().chain(self.facts.get("frames"));
        lengths
            .filter_map(Value::as_u64)
            .fold(1, u64::saturating_mul)
    }
}
