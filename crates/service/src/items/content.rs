//! Contents of items: files that were made and are to be stored, stored files to be read.

use crate::base::records::{LocalFile, ScanIdentity, StoredVolume, Timestamp};
use serde_json::{Map, Value};
use std::borrow::Cow;
use std::io::ErrorKind;
use ventriform::results::report::header_text;

/// The output of a job.
#[derive(Debug, Clone, Default)]
pub struct WorkOutput {
    /// Counts and main figures.
    pub summary: Map<String, Value>,
    /// The files.
    pub files: Vec<OutputFile>,
}

/// One file of a [`WorkOutput`].
#[derive(Debug, Clone)]
pub struct OutputFile {
    /// Its name: `mesh.glb`, `report.json` ...
    pub name: String,
    /// Its media type.
    pub media_type: Cow<'static, str>,
    /// Its content.
    pub bytes: Vec<u8>,
}

impl WorkOutput {
    /// What was made without text of the scans' headers, which is kept with whose scan a volume is and nowhere else.
    pub fn without_header_text(mut self) -> Self {
        header_text::withhold(&mut self.summary);
        let documents = self.files.iter_mut();
        for file in documents.filter(|file| file.media_type == "application/json") {
            if let Some(bytes) = header_text::withheld(&file.bytes) {
                file.bytes = bytes;
            }
        }
        self
    }
}

/// A stored volume or product, with local copies of its files.
#[derive(Debug, Clone)]
pub struct StoredItem {
    /// Its id.
    pub id: String,
    /// The parameters it was made with; empty for a volume.
    pub parameters: Map<String, Value>,
    /// The requested files, those that exist.
    pub files: Vec<LocalFile>,
    /// Voxels of a volume; 0 of a product.
    pub voxels: u64,
}

impl StoredItem {
    /// The content of the file with that name; `None` if it does not exist or was deleted.
    ///
    /// # Errors
    /// If the file exists but cannot be read.
    pub fn read(&self, name: &str) -> std::io::Result<Option<Vec<u8>>> {
        let Some(file) = self.files.iter().find(|file| file.ends_with(name)) else {
            return Ok(None);
        };
        match std::fs::read(file) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }
}

impl StoredItem {
    /// As [`StoredItem::read`], for what is made of a whole item: `None` only if the item has no file of that name.
    ///
    /// # Errors
    /// If the file cannot be read, also because the item was erased meanwhile.
    pub fn read_whole(&self, name: &str) -> std::io::Result<Option<Vec<u8>>> {
        let file = self.files.iter().find(|file| file.ends_with(name));
        file.map(std::fs::read).transpose()
    }
}

/// A stored result beside what it was made of.
#[derive(Debug, Clone)]
pub struct StoredResult {
    /// When the tenant first had it.
    pub made_at: Timestamp,
    /// The result, with the requested files.
    pub files: StoredItem,
    /// The volume that it was made of; of a comparison that at stress.
    pub source: StoredSource,
    /// The other volumes: of a comparison that at rest, of a serial comparison those of the other scans in the order in
    /// which they were given.
    pub others: Vec<StoredSource>,
}

impl StoredResult {
    /// Bytes of the volumes of which it was made, as they are stored.
    pub fn bytes(&self) -> u64 {
        let others = self.others.iter().map(|other| other.volume.bytes);
        others.fold(self.source.volume.bytes, u64::saturating_add)
    }
}

/// A volume that a result was made of.
#[derive(Debug, Clone)]
pub struct StoredSource {
    /// The volume.
    pub volume: StoredVolume,
    /// Its files.
    pub files: Vec<LocalFile>,
    /// Whose scan it is.
    pub scan: ScanIdentity,
}
