//! What a job's work is to have, found in the store.

use super::{Input, Job, Needs, PageRequest, Product, Queue, Resource, StoreError, Stored, Work};
use serde_json::Map;
use std::collections::BTreeMap;

impl Queue {
    /// Finds in the store what the work is to have.
    pub(super) async fn input(
        &self,
        job: &Job,
        work: Option<&dyn Work>,
    ) -> Result<Input, StoreError> {
        let Needs { things, library } =
            work.map_or_else(Needs::default, |work| work.needs(&job.parameters));
        let mut found = BTreeMap::new();
        for (field, id) in things {
            if let Some(stored) = self.stored(&id).await? {
                found.insert(field, stored);
            }
        }
        let volume = self.stored(&job.volume).await?;
        Ok(Input {
            volume: job.volume.clone(),
            files: volume.map(|stored| stored.files).unwrap_or_default(),
            parameters: job.parameters.clone(),
            things: found,
            library: if library {
                self.library().await?
            } else {
                Vec::new()
            },
        })
    }

    async fn stored(&self, id: &str) -> Result<Option<Stored>, StoreError> {
        if Resource::of(id) != Some(Resource::Volume) {
            let product = self.catalogue.product(id).await?;
            return Ok(product.map(|product| self.shelved(product)));
        }
        let volume = self.catalogue.volume(id).await?;
        Ok(volume.map(|volume| Stored {
            files: self.blobs.paths(&volume.id, &volume.files),
            id: volume.id,
            parameters: Map::new(),
        }))
    }

    /// A product with the files that are kept of it.
    pub fn shelved(&self, product: Product) -> Stored {
        let names: Vec<String> = product.files.into_iter().map(|file| file.name).collect();
        Stored {
            files: self.blobs.paths(&product.id, &names),
            id: product.id,
            parameters: product.parameters,
        }
    }

    /// Every template, in the order of ids, which is the same wherever they are kept.
    async fn library(&self) -> Result<Vec<Stored>, StoreError> {
        let mut library = Vec::new();
        let mut before = None;
        loop {
            let page = PageRequest { before, limit: 100 };
            let page = self.catalogue.products(Resource::Template, page).await?;
            library.extend(page.items.into_iter().map(|product| self.shelved(product)));
            before = page.next;
            if before.is_none() {
                break;
            }
        }
        library.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(library)
    }
}
