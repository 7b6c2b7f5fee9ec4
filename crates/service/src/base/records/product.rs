//! The record of a product: a model, a segmentation, a beat, a comparison, normal limits, a template or a reader.

use super::FileRecord;
use super::{Resource, Timestamp};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// One row of the products table. It never changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Product {
    /// Derived from the content, with the prefix of its [`Resource`].
    pub id: String,
    /// Position in the order of creation; 0 before it is stored.
    pub sequence: i64,
    /// When it was made.
    pub created_at: Timestamp,
    /// Id of the volume it was made from; of a comparison that of the scan at stress. `None` for what was not made of a
    /// volume: templates, readers, normal limits.
    pub volume: Option<String>,
    /// The parameters used, with every default written out.
    pub parameters: Map<String, Value>,
    /// Counts and main figures, as returned by the work.
    pub summary: Map<String, Value>,
    /// The version of the program that made it.
    pub software: String,
    /// Its files.
    pub files: Vec<ProductFile>,
}

/// One file of a product.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ProductFile {
    /// `mesh.glb`, `report.json` ...
    pub name: String,
    /// Its media type.
    pub media_type: String,
    /// Its length in bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
    /// As of [`FileRecord::place`].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<String>,
}

impl ProductFile {
    /// Its name in the file store, and what it must contain.
    pub fn record(&self) -> FileRecord {
        FileRecord {
            name: self.name.clone(),
            bytes: self.bytes,
            sha256: self.sha256.clone(),
            place: self.place.clone(),
        }
    }
}

impl Product {
    /// Its kind.
    pub fn resource(&self) -> Resource {
        Resource::from_id(&self.id).unwrap_or(Resource::Model)
    }

    /// The ids of the volumes of its other scans: of a comparison, or of a reading of one, that at rest; of a serial
    /// comparison those of all but the first.
    pub fn other_scans(&self) -> impl Iterator<Item = &str> {
        let field = match self.resource() {
            Resource::Comparison | Resource::Reading => Some("rest"),
            Resource::Serial => Some("others"),
            _ => None,
        };
        let named = field.and_then(|field| self.parameters.get(field)?.as_str());
        named.into_iter().flat_map(|ids| ids.split(','))
    }

    /// The file with that name.
    pub fn file(&self, name: &str) -> Option<&ProductFile> {
        self.files.iter().find(|file| file.name == name)
    }
}
