//! A stored model: what it was made from, and its files.

use super::Timestamp;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// One row of the catalogue of models. Immutable once written.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// `mdl_...`, from volume, parameters and mesh.
    pub id: String,
    /// Order of making; 0 before it is stored.
    pub sequence: i64,
    /// When it was made.
    pub created_at: Timestamp,
    /// The volume it was made from.
    pub volume: String,
    /// The parameters used, every default written out.
    pub parameters: Map<String, Value>,
    /// Counts and main figures, as the work gave them.
    pub summary: Map<String, Value>,
    /// The program's version that made it.
    pub software: String,
    /// What can be downloaded.
    pub files: Vec<ModelFile>,
}

/// One download of a model.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ModelFile {
    /// `mesh.glb`, `report.html` ...
    pub name: String,
    /// Its `Content-Type`.
    pub media_type: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl Model {
    /// The download of that name.
    pub fn file(&self, name: &str) -> Option<&ModelFile> {
        self.files.iter().find(|file| file.name == name)
    }
}
