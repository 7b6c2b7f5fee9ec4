//! What is made and kept: a model, a segmentation, a template; what it was made from, and its
//! files.

use super::{Resource, Timestamp};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// One row of the catalogue of what was made. Immutable once written.
#[derive(Debug, Clone, PartialEq)]
pub struct Product {
    /// From what it was made from and came to, with the prefix of its [`Resource`].
    pub id: String,
    /// Order of making; 0 before it is stored.
    pub sequence: i64,
    /// When it was made.
    pub created_at: Timestamp,
    /// The volume it was made from, where there was one.
    pub volume: Option<String>,
    /// The parameters used, every default written out.
    pub parameters: Map<String, Value>,
    /// Counts and main figures, as the work gave them.
    pub summary: Map<String, Value>,
    /// The program's version that made it.
    pub software: String,
    /// What can be downloaded.
    pub files: Vec<ProductFile>,
}

/// One download of a product.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProductFile {
    /// `mesh.glb`, `report.json` ...
    pub name: String,
    /// Its `Content-Type`.
    pub media_type: String,
    /// Its length.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

impl Product {
    /// What kind of thing it is.
    pub fn resource(&self) -> Resource {
        Resource::of(&self.id).unwrap_or(Resource::Model)
    }

    /// The download of that name.
    pub fn file(&self, name: &str) -> Option<&ProductFile> {
        self.files.iter().find(|file| file.name == name)
    }
}
