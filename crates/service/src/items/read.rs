//! Reading items: records with local copies of their files, every file verified.

use super::{Items, StoredItem, StoredResult, StoredSource};
use crate::base::error::ServiceError;
use crate::base::memory::read_row;
use crate::base::records::{
    BlobError, BlobStream, FileRecord, ItemFilter, ListRequest, LocalFile, Product, ProductFile,
    Resource, StoreError, StoreFault, Tenant,
};
use serde_json::Map;
use std::ops::Range;

/// Templates read from the catalogue at a time.
const LIBRARY_PAGE: u32 = 100;

impl Items {
    /// The files of a volume, if it is stored, whoever has it, and they are not damaged.
    ///
    /// # Errors
    /// If the storage fails.
    pub async fn intact_volume(&self, id: &str) -> Result<Option<Vec<FileRecord>>, StoreError> {
        match self.catalogue.record(id).await? {
            Some(record) if self.is_intact(&record).await? => Ok(Some(record.files())),
            _ => Ok(None),
        }
    }

    /// A volume with all its files, or a product with the `wanted` ones. `None` if it does not
    /// exist, or a file of a volume does not.
    pub(crate) async fn item(
        &self,
        tenant: &Tenant,
        id: &str,
        wanted: &[&str],
    ) -> Result<Option<StoredItem>, StoreError> {
        if Resource::from_id(id) != Some(Resource::Volume) {
            return Ok(match self.catalogue.product(tenant, id).await? {
                Some(product) => Some(self.with_files(product.item, wanted).await?),
                None => None,
            });
        }
        let Some(volume) = self.catalogue.volume(tenant, id).await? else {
            return Ok(None);
        };
        let files = self.volume_files(id, &volume.files).await?;
        Ok(files.map(|files| StoredItem {
            voxels: volume.item.voxels(),
            id: volume.item.id,
            parameters: Map::new(),
            files,
        }))
    }

    /// The files of a volume on the local disk; `None` if one does not exist.
    ///
    /// # Errors
    /// If the file store fails.
    pub async fn volume_files(
        &self,
        id: &str,
        records: &[FileRecord],
    ) -> Result<Option<Vec<LocalFile>>, BlobError> {
        let mut files = Vec::with_capacity(records.len());
        for record in records {
            match self.blobs.local(id, record).await? {
                Some(file) => files.push(file),
                None => return Ok(None),
            }
        }
        Ok(Some(files))
    }

    /// A range of bytes of a file; see [`BlobStore::read`](crate::base::records::BlobStore::read).
    ///
    /// # Errors
    /// If the storage fails; [`StoreFault::Erased`] if the item was erased since its row was read.
    pub async fn read(
        &self,
        id: &str,
        file: &FileRecord,
        range: Range<u64>,
    ) -> Result<BlobStream, StoreError> {
        match self.blobs.read(id, file, range).await {
            Err(error) if error.cause == StoreFault::DamagedFile => {
                Err(self.unless_erased(id, error).await)
            }
            read => Ok(read?),
        }
    }

    /// The reason why a file could not be read: `error`, unless its item was erased meanwhile.
    pub async fn unless_erased(&self, id: &str, error: BlobError) -> StoreError {
        match self.catalogue.record(id).await {
            Ok(None) => BlobError::new(StoreFault::Erased, error.message).into(),
            Ok(Some(_)) => error.into(),
            Err(error) => error,
        }
    }

    /// A product with those of its files that are `wanted` and exist.
    ///
    /// # Errors
    /// If the file store fails.
    pub async fn with_files(
        &self,
        product: Product,
        wanted: &[&str],
    ) -> Result<StoredItem, BlobError> {
        let mut files = Vec::new();
        for file in &product.files {
            if wanted.contains(&file.name.as_str()) {
                files.extend(self.blobs.local(&product.id, &file.record()).await?);
            }
        }
        Ok(StoredItem {
            id: product.id,
            parameters: product.parameters,
            files,
            voxels: 0,
        })
    }

    /// As [`Items::with_files`], for what is made of all of them.
    ///
    /// # Errors
    /// If the file store fails; [`StoreFault::Erased`] if the item was erased since its row was read.
    pub async fn whole(&self, product: Product, wanted: &[&str]) -> Result<StoredItem, StoreError> {
        let listed = |file: &&ProductFile| wanted.contains(&file.name.as_str());
        let count = product.files.iter().filter(listed).count();
        let id = product.id.clone();
        let error = match self.with_files(product, wanted).await {
            Ok(item) if item.files.len() == count => return Ok(item),
            Ok(_) => BlobError::new(
                StoreFault::DamagedFile,
                format!("a file of {id} is missing"),
            ),
            Err(error) => error,
        };
        Err(match error.cause {
            StoreFault::DamagedFile => self.unless_erased(&id, error).await,
            _ => error.into(),
        })
    }

    /// A tenant's product with those of its files that `wanted` names, and the volumes that it was made
    /// of with their files. `None` if the tenant has one of them no more, or the product was made of
    /// no volume.
    ///
    /// # Errors
    /// If the storage fails, and `busy` if the request has no memory for the rows.
    pub async fn result(
        &self,
        tenant: &Tenant,
        id: &str,
        wanted: impl FnOnce(&Product) -> Vec<String> + Send,
    ) -> Result<Option<StoredResult>, ServiceError> {
        let product = read_row(|bytes| self.catalogue.product_within(tenant, id, bytes));
        let Some(product) = product.await? else {
            return Ok(None);
        };
        let Some(source) = self.source(tenant, product.volume.as_deref()).await? else {
            return Ok(None);
        };
        let mut others = Vec::new();
        for id in product.other_scans() {
            let Some(other) = self.source(tenant, Some(id)).await? else {
                return Ok(None);
            };
            others.push(other);
        }
        let wanted = wanted(&product.item);
        let wanted: Vec<&str> = wanted.iter().map(String::as_str).collect();
        Ok(Some(StoredResult {
            made_at: product.ownership.created_at,
            files: self.whole(product.item, &wanted).await?,
            source,
            others,
        }))
    }

    /// A tenant's volume with its files; `None` if the tenant has it no more, or there is none.
    async fn source(
        &self,
        tenant: &Tenant,
        id: Option<&str>,
    ) -> Result<Option<StoredSource>, ServiceError> {
        let Some(id) = id else {
            return Ok(None);
        };
        let volume = read_row(|bytes| self.catalogue.volume_within(tenant, id, bytes));
        let Some(volume) = volume.await? else {
            return Ok(None);
        };
        let files = self.volume_files(id, &volume.files).await?;
        Ok(files.map(|files| StoredSource {
            files,
            scan: volume.ownership.scan,
            volume: volume.item,
        }))
    }

    /// Every template that the tenant flagged for `model=auto`, in the order of ids, which does not
    /// depend on when they were added.
    pub(crate) async fn library(
        &self,
        tenant: &Tenant,
        wanted: &[&str],
    ) -> Result<Vec<StoredItem>, StoreError> {
        let mut library = Vec::new();
        let (filter, mut before) = (ItemFilter::default(), None);
        loop {
            let request = ListRequest {
                before,
                limit: LIBRARY_PAGE,
            };
            let page = self
                .catalogue
                .products(tenant, Resource::Template, &filter, request)
                .await?;
            for product in page.items.into_iter().filter(|p| p.ownership.library) {
                library.push(self.with_files(product.item, wanted).await?);
            }
            before = page.next;
            if before.is_none() {
                break;
            }
        }
        library.sort_by(|a, b| a.id.cmp(&b.id));
        Ok(library)
    }
}
