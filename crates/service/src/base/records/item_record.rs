//! The record beside the files of an item, so that its row can be made anew if the database is
//! lost.

use super::{FileRecord, Product, ProductFile, StoredVolume};
use serde::{Deserialize, Serialize};

/// The row of an item: a copy of it lies beside the item's files.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ItemRecord {
    /// An upload.
    Volume(StoredVolume),
    /// A model, a segmentation, a beat, a comparison, normal limits, a template or a reader.
    Product(Product),
}

impl ItemRecord {
    /// The item's id.
    pub fn id(&self) -> &str {
        match self {
            ItemRecord::Volume(volume) => &volume.id,
            ItemRecord::Product(product) => &product.id,
        }
    }

    /// Its position in the order of rows of its table.
    pub fn sequence(&self) -> i64 {
        match self {
            ItemRecord::Volume(volume) => volume.sequence,
            ItemRecord::Product(product) => product.sequence,
        }
    }

    /// Notes where the files were published.
    pub fn put_at(&mut self, place: Option<&str>) {
        let place = place.map(str::to_owned);
        match self {
            ItemRecord::Volume(volume) => {
                let files = volume.files.iter_mut();
                files.for_each(|file| file.place.clone_from(&place));
            }
            ItemRecord::Product(product) => {
                let files = product.files.iter_mut();
                files.for_each(|file| file.place.clone_from(&place));
            }
        }
    }

    /// Its files and what they must contain.
    pub fn files(&self) -> Vec<FileRecord> {
        match self {
            ItemRecord::Volume(volume) => volume.files.clone(),
            ItemRecord::Product(product) => product.files.iter().map(ProductFile::record).collect(),
        }
    }
}
