//! Stored volumes as they are looked at and looked after: previews, voxels, names, legal holds.

use crate::base::error::{ServiceError, ServiceResult, invalid_field};
use crate::base::records::{
    BlobError, FileRecord, LegalHold, LocalFile, StoreError, StoreFault, StoredVolume, Tags,
};
use crate::callers::Agent;
use crate::limits::decoding::LITTLE_MEMORY;
use crate::use_cases::service::Service;
use crate::work::{UploadFacts, preview_memory, voxels_memory};
use ventriform::base::progress::Monitor;
use ventriform::base::text::is_printable;
use ventriform::image::volume::given_mask::MaskChoice;

/// The voxels that are asked for.
#[derive(Debug, Clone)]
pub enum VoxelChoice {
    /// Those of a frame, of gates their sum unless one is named.
    Frame(Option<usize>),
    /// An expert's mask, as jobs compare with it.
    Mask(MaskChoice),
}

impl Service {
    /// The three orthogonal slices through the middle of a volume, as PNG.
    ///
    /// # Errors
    /// If the storage fails, or too much waits to be read.
    pub async fn preview(&self, volume: &StoredVolume) -> ServiceResult<Vec<u8>> {
        let files = self.volume_files(volume).await?;
        let reader = self.engine.reader.clone();
        let memory = preview_memory(UploadFacts::from_volume(volume)?.shape);
        let draw = move |monitor: &Monitor<'_>| reader.preview(&files, monitor);
        let preview = self.decoding.run_on(volume.bytes, memory, draw).await?;
        preview.map_err(ServiceError::internal)
    }

    /// Voxels of a volume as a NIfTI file.
    ///
    /// # Errors
    /// If there is no such frame or structure, the storage fails, or too much waits to be read.
    pub async fn voxels(
        &self,
        volume: &StoredVolume,
        choice: VoxelChoice,
    ) -> ServiceResult<Vec<u8>> {
        let files = self.volume_files(volume).await?;
        let reader = self.engine.reader.clone();
        let memory = voxels_memory(UploadFacts::from_volume(volume)?.shape);
        let read = move |monitor: &Monitor<'_>| match &choice {
            VoxelChoice::Mask(choice) => reader.mask(&files, choice, monitor),
            VoxelChoice::Frame(frame) => reader.voxels(&files, *frame, monitor),
        };
        Ok(self.decoding.run_on(volume.bytes, memory, read).await??)
    }

    /// Whether a file of a volume cannot name a patient: it is one NIfTI file that holds nothing but voxels.
    ///
    /// # Errors
    /// If the storage fails, or too much waits to be read.
    pub async fn is_bare(&self, volume: &StoredVolume, file: &FileRecord) -> ServiceResult<bool> {
        if volume.files.len() > 1 {
            return Ok(false);
        }
        let Some(local) = self.items().blobs().local(&volume.id, file).await? else {
            return Ok(false);
        };
        let reader = self.engine.reader.clone();
        let look = move |monitor: &Monitor<'_>| reader.is_bare(&local, monitor);
        let looked = self.decoding.run_on(file.bytes, LITTLE_MEMORY, look);
        Ok(looked.await??)
    }

    /// Replaces the tags of a tenant's item or job. `false` if there is none with that id, or its tags are not `before`
    /// any more.
    pub async fn change_tags(
        &self,
        by: &Agent,
        id: &str,
        before: Tags,
        after: Tags,
    ) -> ServiceResult<bool> {
        let (items, tenant, id) = (self.items().clone(), by.tenant().clone(), id.to_owned());
        let change = async move {
            let catalogue = items.catalogue();
            catalogue.change_tags(&tenant, &id, &before, &after).await
        };
        Ok(by.change::<_, StoreError>(change).await?)
    }

    /// Puts a volume on legal hold from now on. `None` if it has no such
    /// volume.
    ///
    /// # Errors
    /// `invalid-field` for a reason that cannot be used; if the database fails.
    pub async fn hold_volume(
        &self,
        by: &Agent,
        id: &str,
        reason: &str,
    ) -> ServiceResult<Option<LegalHold>> {
        let hold = LegalHold {
            reason: checked_reason(reason)?,
            since: self.now(),
            by: by.name().to_owned(),
        };
        let is_set = self.set_hold(by, id, Some(hold.clone())).await?;
        Ok(is_set.then_some(hold))
    }

    /// Lifts the legal hold of a tenant's volume, if there is one. `false` if it has no such volume.
    pub async fn release_volume(&self, by: &Agent, id: &str) -> ServiceResult<bool> {
        self.set_hold(by, id, None).await
    }

    async fn set_hold(&self, by: &Agent, id: &str, hold: Option<LegalHold>) -> ServiceResult<bool> {
        let (items, tenant, id) = (self.items().clone(), by.tenant().clone(), id.to_owned());
        let set = async move {
            let catalogue = items.catalogue();
            catalogue.set_legal_hold(&tenant, &id, hold.as_ref()).await
        };
        Ok(by.change::<_, StoreError>(set).await?)
    }

    /// The files of a stored volume, to be read.
    async fn volume_files(&self, volume: &StoredVolume) -> ServiceResult<Vec<LocalFile>> {
        let (items, id) = (self.items(), &volume.id);
        if let Some(files) = items.volume_files(id, &volume.files).await? {
            return Ok(files);
        }
        let missing = format!("a file of {id} is missing");
        let missing = BlobError::new(StoreFault::DamagedFile, missing);
        Err(items.unless_erased(id, missing).await.into())
    }
}

fn checked_reason(reason: &str) -> ServiceResult<String> {
    let text = reason.trim();
    let control = |c: char| !is_printable(c) && c != '\n';
    let most = LegalHold::REASON_LENGTH;
    if (1..=most).contains(&text.chars().count()) && !text.contains(control) {
        return Ok(text.to_owned());
    }
    let detail = format!("`reason` must be a text of 1 to {most} printable characters.");
    let fix = "Say why the volume must be kept, such as the number of a case.";
    Err(invalid_field("reason", detail).fix(fix).into())
}
