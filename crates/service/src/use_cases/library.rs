//! Templates, readers' profiles and normal limits, added by a tenant.
//!
//! Their number, names and bytes are checked where they are added ([`crate::items`]), so that the command line meets
//! the same limits; here they are refused before the body is read, and read under the budget of decoding.

use crate::base::error::{Refusal, ServiceError, ServiceResult, invalid_field};
use crate::base::records::{
    ItemFilter, ListRequest, Owned, Product, ProductRoom, Resource, StoreError, Tenant,
};
use crate::callers::{Agent, Quota};
use crate::items::{NotAdded, TemplateSource, WorkOutput};
use crate::limits::decoding::LITTLE_MEMORY;
use crate::limits::quotas::Counting;
use crate::use_cases::service::Service;
use crate::work::TEMPLATE_BYTES;
use bytes::Bytes;
use futures::TryStreamExt;
use ventriform::base::progress::Monitor;
use ventriform::mesh::files::MeshStatement;

/// Memory for a byte of a mesh: numbers as text, parsed, and as files of several formats.
const MEMORY_PER_BYTE: u64 = 16;
/// Memory for a byte of normal limits: what is parsed, its copy, and the text of it that is hashed. The costliest text
/// is a list of people without names: 14 bytes of it take 370.
const LIMITS_MEMORY_PER_BYTE: u64 = 26;

/// A product with its owner's record, and whether it is new.
pub type Added = (Owned<Product>, bool);

/// A mesh that is given to become a template.
pub struct GivenMesh {
    /// The organ that it shows.
    pub organ: String,
    /// Its file.
    pub bytes: Bytes,
    /// What is stated of it where the file does not say it.
    pub stated: MeshStatement,
}

impl From<NotAdded> for ServiceError {
    fn from(error: NotAdded) -> Self {
        match error {
            NotAdded::Refused(failure) => failure.into(),
            NotAdded::TooMany(failure) => Self::new(Refusal::Conflict, failure),
            NotAdded::TooLarge(failure) => Self::new(Refusal::NoRoom, failure),
            NotAdded::Store(error) => error.into(),
        }
    }
}

impl Service {
    /// Adds a mesh in any format as a template of its organ, for `by`.
    ///
    /// # Errors
    /// If the mesh or the name cannot be used, the tenant has no room for it, or the storage fails.
    pub async fn add_template(
        &self,
        by: &Agent,
        source: TemplateSource<'_>,
        mesh: GivenMesh,
        quota: Quota,
        _counting: &Counting,
    ) -> ServiceResult<Added> {
        let bytes = mesh.bytes.len() as u64;
        let memory = LITTLE_MEMORY + MEMORY_PER_BYTE * bytes;
        let (reader, organ) = (self.engine.reader.clone(), mesh.organ.clone());
        let make = move |_: &Monitor<'_>| reader.template(&mesh.bytes, &mesh.organ, &mesh.stated);
        let output = self.decoding.run_on(bytes, memory, make).await??;
        let room = self.product_room(Resource::Template, quota);
        let items = self.items().clone();
        let (tenant, name) = (source.tenant.clone(), source.name.to_owned());
        let (volume, library) = (source.volume.map(str::to_owned), source.library);
        let add = async move {
            let source = TemplateSource {
                tenant: &tenant,
                name: &name,
                volume: volume.as_deref(),
                library,
            };
            items.add_template(source, &organ, output, room).await
        };
        Ok(by.change(add).await?)
    }

    /// Adds a reader's profile, for `by`.
    ///
    /// # Errors
    /// As [`Service::add_template`].
    pub async fn add_reader(
        &self,
        by: &Agent,
        tenant: &Tenant,
        name: &str,
        profile: Bytes,
        quota: Quota,
        _counting: &Counting,
    ) -> ServiceResult<Added> {
        let reader = self.engine.reader.clone();
        let bytes = profile.len() as u64;
        let check = move |_: &Monitor<'_>| reader.profile(&profile);
        // At most 1 MiB of text, parsed to at most 5001 entries, and written again.
        let output = self.decoding.run_on(bytes, LITTLE_MEMORY, check).await??;
        let room = self.product_room(Resource::Reader, quota);
        self.add_named(by, (tenant, Resource::Reader), name, output, room)
            .await
    }

    /// Adds normal limits, for `by`.
    ///
    /// # Errors
    /// As [`Service::add_template`].
    pub async fn add_normals(
        &self,
        by: &Agent,
        tenant: &Tenant,
        name: &str,
        limits: Bytes,
        quota: Quota,
        _counting: &Counting,
    ) -> ServiceResult<Added> {
        let bytes = limits.len() as u64;
        let memory = LITTLE_MEMORY + LIMITS_MEMORY_PER_BYTE * bytes;
        let reader = self.engine.reader.clone();
        let check = move |_: &Monitor<'_>| reader.normals(&limits);
        let output = self.decoding.run_on(bytes, memory, check).await??;
        let room = self.product_room(Resource::Normals, quota);
        self.add_named(by, (tenant, Resource::Normals), name, output, room)
            .await
    }

    /// Sets whether every `model=auto` of the tenant fits a template of it.
    pub async fn set_library(
        &self,
        by: &Agent,
        template: &str,
        library: bool,
    ) -> ServiceResult<()> {
        let (items, tenant) = (self.items().clone(), by.tenant().clone());
        let id = template.to_owned();
        let set = async move {
            let catalogue = items.catalogue();
            catalogue.set_library(&tenant, &id, library).await
        };
        by.change::<_, StoreError>(set).await?;
        Ok(())
    }

    /// The JSON mesh of a tenant's model or segmentation, with the id of its volume.
    ///
    /// # Errors
    /// `invalid-field` if there is none, or it is too large for a template; if the storage fails.
    pub async fn stored_mesh(
        &self,
        tenant: &Tenant,
        id: &str,
    ) -> ServiceResult<(Bytes, Option<String>)> {
        let product = match Resource::from_id(id) {
            Some(Resource::Model | Resource::Segmentation) => self.product(tenant, id).await?,
            _ => None,
        };
        let Some(product) = product else {
            return Err(self.names_nothing(tenant, "model", id).await?);
        };
        match product.file("mesh.json") {
            Some(file) if file.bytes <= TEMPLATE_BYTES => {
                let blobs = self.items().blobs();
                let pieces = blobs.read(id, &file.record(), 0..file.bytes).await?;
                let pieces: Vec<Bytes> = pieces.try_collect().await?;
                Ok((pieces.concat().into(), product.volume.clone()))
            }
            _ => {
                let detail = "The mesh of this model is too large to be fitted.";
                let fix = "Name a model of at most 5000 points.";
                Err(invalid_field("model", detail).fix(fix).into())
            }
        }
    }

    async fn add_named(
        &self,
        by: &Agent,
        (tenant, made): (&Tenant, Resource),
        name: &str,
        output: WorkOutput,
        room: ProductRoom,
    ) -> ServiceResult<Added> {
        let (items, tenant, name) = (self.items().clone(), tenant.clone(), name.to_owned());
        let add = async move {
            let added = items.add_named((&tenant, made), &name, output, room);
            added.await
        };
        Ok(by.change(add).await?)
    }

    /// Refuses another template, reader or set of normal limits where the tenant has as many as it may have, before it
    /// is sent.
    ///
    /// # Errors
    /// `library-full`.
    pub async fn require_product_room(&self, tenant: &Tenant, kind: Resource) -> ServiceResult<()> {
        let limit = self.product_room(kind, Quota::default()).count;
        let page = ListRequest {
            before: None,
            limit,
        };
        let filter = ItemFilter::default();
        let catalogue = self.items().catalogue();
        let page = catalogue.products(tenant, kind, &filter, page).await?;
        if page.items.len() < limit as usize {
            return Ok(());
        }
        Err(NotAdded::too_many(kind, limit).into())
    }

    fn product_room(&self, kind: Resource, quota: Quota) -> ProductRoom {
        ProductRoom {
            count: match kind {
                Resource::Reader => self.settings.reader_limit,
                Resource::Normals => self.settings.normals_limit,
                _ => self.settings.template_limit,
            },
            bytes: quota.bytes,
        }
    }
}
