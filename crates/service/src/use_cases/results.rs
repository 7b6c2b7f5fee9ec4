//! What is made of a stored result when somebody asks for it: a part of a mesh, a DICOM object, the report as a page.
//!
//! In: a product of a tenant. Out: the bytes, made under the budget of decoding; nothing of it is stored.

use crate::base::error::{Refusal, ServiceError, ServiceResult};
use crate::base::memory::charge;
use crate::base::records::{Failure, Fault, Product, Tenant};
use crate::items::OutputFile;
use crate::limits::decoding::LITTLE_MEMORY;
use crate::use_cases::service::Service;
use crate::work::dicom::{self, ResultObject};
use crate::work::{UploadFacts, part};
use serde_json::{Map, Value};
use ventriform::base::progress::Monitor;
use ventriform::results::export::{Format, Part};

/// Memory for a byte of a JSON mesh: numbers as text, parsed, and as a file.
const MEMORY_PER_MESH_BYTE: u64 = 16;

/// Memory for a byte of the files that a page is made of: the file, what is read of it, and the page.
const PAGE_MEMORY_PER_BYTE: u64 = 8;

impl Service {
    /// One part of the mesh `stem` of a product, as an open surface. `None` if the product has no such mesh.
    ///
    /// # Errors
    /// `not-found` if the mesh does not say which triangles are of that part; if the format cannot hold it, the storage
    /// fails, or there is no memory.
    pub async fn mesh_part(
        &self,
        product: &Product,
        stem: &str,
        part: Part,
        format: Format,
    ) -> ServiceResult<Option<Option<OutputFile>>> {
        let source = format!("{stem}.json");
        let Some(size) = product.file(&source).map(|file| file.bytes) else {
            return Ok(None);
        };
        charge(size).await?;
        let wanted = [source.as_str()];
        let stored = self.items().whole(product.clone(), &wanted).await?;
        let stem = stem.to_owned();
        let memory = LITTLE_MEMORY + MEMORY_PER_MESH_BYTE * size;
        let make = move |_: &Monitor<'_>| part::part_file(&stored, &stem, part, format);
        Ok(Some(self.decoding.run_on(size, memory, make).await??))
    }

    /// A DICOM object of a product: made of the product's files and the scan of its volume. `None` if the product has
    /// no such object.
    ///
    /// # Errors
    /// `volume-erased` if the tenant has a volume of it no more; a conflict if it is not known whose scan it is; if the
    /// storage fails, or there is no memory.
    pub async fn dicom_object(
        &self,
        tenant: &Tenant,
        product: &Product,
        object: ResultObject,
        deidentify: bool,
    ) -> ServiceResult<Option<OutputFile>> {
        let sources = object.source_files(product);
        let sources = sources.iter().filter_map(|name| product.file(name));
        charge(sources.map(|file| file.bytes).sum()).await?;
        let (items, id) = (self.items(), &product.id);
        let result = items.result(tenant, id, |product| object.source_files(product));
        let result = result.await?.ok_or_else(|| volume_erased(id))?;
        let secret = match deidentify {
            true => Some(items.catalogue().deidentification_secret(tenant).await?),
            false => None,
        };
        let memory = dicom::object_memory(UploadFacts::from_volume(&result.source.volume)?.shape);
        let (bytes, limits) = (result.bytes(), self.engine.limits);
        let make =
            move |_: &Monitor<'_>| dicom::object(&result, object, secret.as_deref(), &limits);
        let made = self.decoding.run_on(bytes, memory, make).await?;
        made.map_err(|failure| match failure.code.as_str() {
            "identity-needed" | "identity-differs" => ServiceError::new(Refusal::Conflict, failure),
            _ => failure.into(),
        })
    }

    /// The report on a product as an HTML page that names whose scan it is as far as `scans` do: of its volume, of a
    /// comparison then of the one at rest. `None` if products of its kind have no page.
    ///
    /// # Errors
    /// If the storage fails, or there is no memory.
    pub async fn report_page(
        &self,
        product: &Product,
        scans: Vec<Map<String, Value>>,
    ) -> ServiceResult<Option<String>> {
        let work = self.engine.work(product.resource().noun());
        let Some(work) = work.filter(|work| !work.page_files().is_empty()) else {
            return Ok(None);
        };
        let work = work.clone();
        let files = product.files.iter();
        let needed = files.filter(|file| work.page_files().contains(&&file.name[..]));
        let size: u64 = needed.map(|file| file.bytes).sum();
        charge(PAGE_MEMORY_PER_BYTE * size).await?;
        let stored = self.items().whole(product.clone(), work.page_files());
        let stored = stored.await?;
        let draw = move |_: &Monitor<'_>| work.page(&stored, &scans);
        let page = self.decoding.run_on(size, LITTLE_MEMORY, draw);
        Ok(Some(page.await??))
    }
}

/// The refusal of what needs whose scan a result is of, which went with its volume.
pub fn volume_erased(id: &str) -> ServiceError {
    let detail = format!("The volume of `{id}` was erased, and with it whose scan it is.");
    let fix = "Upload the same file again; DICOM objects of the result can then be had.";
    let failure = Failure::new(Fault::Request, "volume-erased", detail).fix(fix);
    ServiceError::new(Refusal::Conflict, failure)
}
