//! Adding volumes and products: first the files, then the record that makes them visible.
//!
//! The two steps run in a task of their own, which goes on if the caller goes away: a client that
//! hangs up leaves neither files without a record nor a record that nobody waited for.

use super::{Items, OutputFile, WorkOutput, to_its_end};
use crate::base::records::{
    AddedProduct, BlobError, Failure, Fault, FileRecord, ItemRecord, Owned, Product, ProductFile,
    ProductRoom, Resource, ScanFields, StagedFiles, StagedFor, StoreError, StoreFault,
    StoredVolume, Tags, Tenant, content_id, hex,
};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use ventriform::base::text::is_printable;

/// Attempts at adding an item that other processes erase at the same time.
const PUBLISH_ROUNDS: u32 = 3;

impl Items {
    /// Adds an uploaded volume durably, with what its file says of the scan. Returns the record, and
    /// whether it is new for the tenant.
    ///
    /// # Errors
    /// If the files or the record cannot be written.
    pub async fn add_volume(
        self: &Arc<Self>,
        mut volume: StoredVolume,
        files: Box<dyn StagedFiles>,
        tenant: &Tenant,
        tags: &Tags,
        scan: Option<ScanFields>,
    ) -> Result<(Owned<StoredVolume>, bool), StoreError> {
        let (items, tenant, tags) = (self.clone(), tenant.clone(), tags.clone());
        to_its_end(async move {
            let _lock = items.locks.lock(&volume.id).await;
            items.locks.unsettle(&volume.id);
            let record = ItemRecord::Volume(volume.clone());
            let mut files = Some(files);
            let mut again = PUBLISH_ROUNDS;
            let new = loop {
                volume.files = items
                    .publish_unless_intact(record.clone(), &mut files)
                    .await?;
                let added = items
                    .catalogue
                    .add_volume(&volume, &tenant, &tags, scan.as_ref());
                match added.await {
                    Err(error) if again > 0 && items.was_erased_meanwhile(&error, &files) => {
                        again -= 1;
                    }
                    added => break added?,
                }
            };
            items.locks.settle(&volume.id);
            let stored = items.catalogue.volume(&tenant, &volume.id).await?;
            Ok((stored.ok_or_else(vanished)?, new))
        })
        .await
    }

    /// The stored volume with that id, which the tenant has from now on, and whether it had it not
    /// before: it was uploaded again, so its age counts from now.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn renew_volume(
        &self,
        tenant: &Tenant,
        id: &str,
        tags: &Tags,
        scan: Option<&ScanFields>,
    ) -> Result<Option<(Owned<StoredVolume>, bool)>, StoreError> {
        let now = self.clock.now();
        let catalogue = &self.catalogue;
        catalogue.renew_volume(tenant, id, tags, scan, now).await
    }

    /// Adds a template to the library, durably. Returns the record, and whether it is new: the
    /// same mesh for the same organ is the same template, whatever its name.
    ///
    /// # Errors
    /// [`NotAdded`] if its name cannot be used, the tenant has no room for it, or it cannot be written.
    pub async fn add_template(
        self: &Arc<Self>,
        source: TemplateSource<'_>,
        organ: &str,
        output: WorkOutput,
        room: ProductRoom,
    ) -> Result<(Owned<Product>, bool), NotAdded> {
        check_name(source.name)?;
        self.blobs.require_room(0).map_err(StoreError::from)?;
        let parameters = [("name", source.name), ("organ", organ)]
            .map(|(key, value)| (key.to_owned(), Value::from(value)))
            .into_iter()
            .collect();
        let made = (source.tenant, Resource::Template);
        let template = self.product(made, &[organ], None, parameters, &output);
        self.add_product(template, source, output, room).await
    }

    /// Adds what a tenant brings in one file, a reader's profile or normal limits, durably. Returns the record, and
    /// whether it is new: the same content is the same item, whatever its name.
    ///
    /// # Errors
    /// As [`Items::add_template`].
    pub async fn add_named(
        self: &Arc<Self>,
        (tenant, made): (&Tenant, Resource),
        name: &str,
        output: WorkOutput,
        room: ProductRoom,
    ) -> Result<(Owned<Product>, bool), NotAdded> {
        check_name(name)?;
        self.blobs.require_room(0).map_err(StoreError::from)?;
        let parameters = [("name".to_owned(), Value::from(name))]
            .into_iter()
            .collect();
        let named = self.product((tenant, made), &[], None, parameters, &output);
        let source = TemplateSource {
            tenant,
            name,
            volume: None,
            library: None,
        };
        self.add_product(named, source, output, room).await
    }

    /// Adds a product that no job made.
    async fn add_product(
        self: &Arc<Self>,
        mut product: Product,
        source: TemplateSource<'_>,
        output: WorkOutput,
        room: ProductRoom,
    ) -> Result<(Owned<Product>, bool), NotAdded> {
        let (items, tenant) = (self.clone(), source.tenant.clone());
        let (volume, library) = (source.volume.map(str::to_owned), source.library);
        to_its_end(async move {
            let _lock = items.locks.lock(&product.id).await;
            items.locks.unsettle(&product.id);
            let mut again = PUBLISH_ROUNDS;
            let added = loop {
                let unused = items.write_files(&mut product, &output).await?;
                let added = items
                    .catalogue
                    .add_product(&product, &tenant, volume.as_deref(), room);
                match added.await {
                    Err(error) if again > 0 && items.was_erased_meanwhile(&error, &unused) => {
                        again -= 1;
                    }
                    added => break added?,
                }
            };
            let new = match added {
                AddedProduct::New => true,
                AddedProduct::Known => false,
                // Its files have no record, so the upkeep deletes them.
                AddedProduct::TooMany => {
                    return Ok(Err(NotAdded::too_many(product.resource(), room.count)));
                }
                AddedProduct::TooLarge { stored } => {
                    return Ok(Err(NotAdded::too_large(&product, stored, room)));
                }
            };
            if let Some(library) = library {
                let catalogue = &items.catalogue;
                catalogue.set_library(&tenant, &product.id, library).await?;
            }
            items.locks.settle(&product.id);
            let stored = items.catalogue.product(&tenant, &product.id).await?;
            Ok(Ok((stored.ok_or_else(vanished)?, new)))
        })
        .await?
    }

    /// Stores the files of a product, then calls `commit`, which writes its record and returns whether it did. It is
    /// given the product, or the storage's error.
    ///
    /// # Errors
    /// Those of `commit`.
    pub(crate) async fn publish_with<T>(
        &self,
        mut product: Product,
        output: &WorkOutput,
        commit: impl AsyncFnOnce(Result<Product, StoreError>) -> Result<(T, bool), StoreError>,
    ) -> Result<T, StoreError> {
        let id = product.id.clone();
        let _lock = self.locks.lock(&id).await;
        self.locks.unsettle(&id);
        let written = self.write_files(&mut product, output).await;
        let (done, stored) = commit(written.map(|_| product)).await?;
        if stored {
            self.locks.settle(&id);
        }
        Ok(done)
    }

    /// Publishes what was made, and notes in `product` where its files are. Returns the files that
    /// were not needed because the product is stored already.
    async fn write_files(
        &self,
        product: &mut Product,
        output: &WorkOutput,
    ) -> Result<Option<Box<dyn StagedFiles>>, StoreError> {
        let staged = self.blobs.stage(StagedFor::Result).await?;
        for file in &output.files {
            let mut writer = staged.create(&file.name).await?;
            writer
                .write_all(&file.bytes)
                .await
                .map_err(BlobError::from)?;
            writer.shutdown().await.map_err(BlobError::from)?;
        }
        let record = ItemRecord::Product(product.clone());
        let mut staged = Some(staged);
        let stored = self.publish_unless_intact(record, &mut staged).await?;
        for file in &mut product.files {
            if let Some(stored) = stored.iter().find(|stored| stored.name == file.name) {
                file.bytes = stored.bytes;
                file.sha256.clone_from(&stored.sha256);
                file.place.clone_from(&stored.place);
            }
        }
        Ok(staged)
    }

    /// Whether a row was refused because another process has erased the item since it was found
    /// intact, so that its files, which are at hand, have to be published after all.
    fn was_erased_meanwhile(
        &self,
        error: &StoreError,
        unused: &Option<Box<dyn StagedFiles>>,
    ) -> bool {
        self.is_shared() && unused.is_some() && error.cause() == StoreFault::Busy
    }

    /// Publishes the files of an item, unless it has a row and its files are what the row says.
    /// If it has a row and damaged files, these are replaced, and the row with them. Returns the files
    /// that the item has now; those that were published are taken.
    async fn publish_unless_intact(
        &self,
        mut record: ItemRecord,
        staged: &mut Option<Box<dyn StagedFiles>>,
    ) -> Result<Vec<FileRecord>, StoreError> {
        let known = self.catalogue.record(record.id()).await?;
        if let Some(known) = &known {
            if self.is_intact(known).await? {
                return Ok(known.files());
            }
            tracing::warn!(id = record.id(), "damaged files are replaced");
        }
        let files = staged.take().ok_or_else(vanished)?;
        record.put_at(files.place());
        // Without a row, the upkeep deletes these and no others.
        self.locks.doom(record.id(), record.files());
        files.publish(&record).await?;
        if known.is_some() {
            self.catalogue.amend(&record).await?;
        }
        Ok(record.files())
    }

    /// Whether every file of an item is there and holds what its row says.
    pub(super) async fn is_intact(&self, record: &ItemRecord) -> Result<bool, BlobError> {
        for file in record.files() {
            match self.blobs.local(record.id(), &file).await {
                Ok(Some(_)) => {}
                Ok(None) => return Ok(false),
                Err(error) if error.cause == StoreFault::DamagedFile => return Ok(false),
                Err(error) => return Err(error),
            }
        }
        Ok(true)
    }

    /// The record of a product. Its id is a hash of the kind, of `origin`, of the tenant and of the
    /// mesh; the report contains times and must not change the id.
    ///
    /// The tenant is part of it because reports say when they were made, and which templates of the
    /// tenant's library were tried: no tenant gets the files of another one. The default tenant is
    /// not hashed, so that its ids are those of a service without tenants.
    pub(crate) fn product(
        &self,
        (tenant, made): (&Tenant, Resource),
        origin: &[&str],
        volume: Option<&str>,
        parameters: Map<String, Value>,
        output: &WorkOutput,
    ) -> Product {
        let files: Vec<_> = output.files.iter().map(described).collect();
        let own = (*tenant != Tenant::default()).then_some(tenant.as_str());
        let parts = std::iter::once(made.noun())
            .chain(origin.iter().copied())
            .chain(own)
            .chain([mesh_hash(&files)]);
        Product {
            id: content_id(made.prefix(), parts.map(str::as_bytes)),
            sequence: 0,
            created_at: self.clock.now(),
            volume: volume.map(str::to_owned),
            parameters,
            summary: output.summary.clone(),
            software: env!("CARGO_PKG_VERSION").into(),
            files,
        }
    }
}

/// Longest name of a template, a reader or normal limits, characters.
const NAME_LENGTH: usize = 80;

/// Why a template, a reader or normal limits were not added.
#[derive(Debug)]
pub enum NotAdded {
    /// It may not be: what is wrong, and what to do.
    Refused(Failure),
    /// The tenant has as many as it may have.
    TooMany(Failure),
    /// The tenant's quota of bytes has no room for it.
    TooLarge(Failure),
    /// The files or the record cannot be written.
    Store(StoreError),
}

impl From<StoreError> for NotAdded {
    fn from(error: StoreError) -> Self {
        Self::Store(error)
    }
}

impl NotAdded {
    pub(crate) fn too_many(kind: Resource, limit: u32) -> Self {
        let (noun, label) = (kind.noun(), kind.label());
        let detail = format!(
            "There are {limit} {} already, the most that this service allows.",
            kind.plural()
        );
        let failure = Failure::new(Fault::Request, "library-full", detail);
        Self::TooMany(failure.fix(format!(
            "DELETE a {label} first, or ask the operator to raise `{noun}_limit`."
        )))
    }

    fn too_large(product: &Product, stored: u64, room: ProductRoom) -> Self {
        let size: u64 = product.files.iter().map(|file| file.bytes).sum();
        let limit = room.bytes.unwrap_or(u64::MAX);
        let detail = format!(
            "It has {size} bytes; the tenant stores {stored} of the {limit} bytes that it may store."
        );
        let failure = Failure::new(Fault::TooLarge, "storage-quota", detail);
        Self::TooLarge(
            failure.fix("DELETE items that are no longer needed, or ask the operator for more."),
        )
    }
}

/// Refuses a name that is empty, longer than [`NAME_LENGTH`] or not printable.
///
/// # Errors
/// [`NotAdded::Refused`].
pub fn check_name(name: &str) -> Result<(), NotAdded> {
    let length = name.chars().count();
    if (1..=NAME_LENGTH).contains(&length) && name.chars().all(is_printable) {
        return Ok(());
    }
    let detail = format!("The name must have 1 to {NAME_LENGTH} printable characters.");
    let failure = Failure::new(Fault::Request, "invalid-field", detail).at("name");
    Err(NotAdded::Refused(
        failure.fix("Give a short name such as t1_150."),
    ))
}

/// Where a template comes from.
#[derive(Debug, Clone, Copy)]
pub struct TemplateSource<'a> {
    /// The tenant whose library it joins.
    pub tenant: &'a Tenant,
    /// The name that reports show.
    pub name: &'a str,
    /// The volume from whose model it was copied.
    pub volume: Option<&'a str>,
    /// Whether every `model=auto` fits it; `None` leaves that as it is, not so at first.
    pub library: Option<bool>,
}

/// The record of an item that was just added under its lock is not there.
fn vanished() -> StoreError {
    StoreError::database("a record is missing that was just added")
}

/// The hash of the mesh, which stands for the whole result.
fn mesh_hash(files: &[ProductFile]) -> &str {
    files
        .iter()
        .find(|file| file.name == "mesh.json")
        .or(files.first())
        .map_or("", |file| file.sha256.as_str())
}

fn described(file: &OutputFile) -> ProductFile {
    ProductFile {
        name: file.name.clone(),
        media_type: file.media_type.clone().into_owned(),
        bytes: file.bytes.len() as u64,
        sha256: hex(&Sha256::digest(&file.bytes)),
        place: None,
    }
}
