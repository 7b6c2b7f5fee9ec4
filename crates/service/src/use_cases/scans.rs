//! Whose scan a volume is: read from its files when it is stored, and again if a repair of the database has lost it;
//! stated and erased by callers.

use crate::base::error::{Refusal, ServiceError, ServiceResult};
use crate::base::records::{BlobError, FileRecord, ScanFields, StoreError, StoreFault, Tenant};
use crate::callers::Agent;
use crate::use_cases::service::Service;
use crate::work::{INSPECTION_MEMORY, dicom};
use serde_json::{Map, Value};
use std::time::Duration;
use tokio_util::sync::CancellationToken;
use ventriform::base::progress::Monitor;

/// Pause after a failure to read the volumes whose scan was lost.
const READ_RETRY: Duration = Duration::from_secs(30);

impl Service {
    /// States whose scan a tenant's volume with these files is, in place of what was stated before.
    ///
    /// # Errors
    /// Those of [`dicom::check_stated`], a conflict if the header says otherwise; if the storage fails.
    pub async fn state_scan(
        &self,
        by: &Agent,
        volume: &str,
        files: &[FileRecord],
        stated: Map<String, Value>,
    ) -> ServiceResult<()> {
        let tenant = by.tenant();
        let scan = match self.scan(tenant, volume).await? {
            None => {
                self.note_scan(tenant, volume, files).await?;
                self.scan(tenant, volume).await?
            }
            known => known,
        };
        dicom::check_stated(&scan.unwrap_or_default(), &stated).map_err(|failure| match failure
            .code
            .as_str()
        {
            "identity-differs" => ServiceError::new(Refusal::Conflict, failure),
            _ => failure.into(),
        })?;
        let (items, tenant, volume) =
            (self.items().clone(), by.tenant().clone(), volume.to_owned());
        let state = async move {
            let catalogue = items.catalogue();
            let stated = ScanFields(stated);
            catalogue.state_scan(&tenant, &volume, &stated).await
        };
        by.change::<_, StoreError>(state).await?;
        Ok(())
    }

    /// Erases whose scan a tenant's volume is; the volume stays. `false` if there is no such volume, or it is on legal
    /// hold.
    pub async fn erase_scan(&self, by: &Agent, volume: &str) -> ServiceResult<bool> {
        let (items, tenant, volume) =
            (self.items().clone(), by.tenant().clone(), volume.to_owned());
        let erase = async move { items.erase_scan(&tenant, &volume).await };
        Ok(by.change(erase).await?)
    }

    /// The scan fields in the files of a stored volume, unless the tenant knows them already. To be
    /// noted when the tenant uploads the volume again.
    pub(crate) async fn scan_to_note(
        &self,
        tenant: &Tenant,
        volume: &str,
        files: &[FileRecord],
    ) -> ServiceResult<Option<ScanFields>> {
        match self.items().catalogue().scan(tenant, volume).await? {
            Some(known) if known.erased_at.is_none() => Ok(None),
            _ => self.read_scan(volume, files).await,
        }
    }

    /// The scan fields in the files of a stored volume; `None` if they name none.
    pub(crate) async fn read_scan(
        &self,
        volume: &str,
        files: &[FileRecord],
    ) -> ServiceResult<Option<ScanFields>> {
        let bytes = files.iter().map(|file| file.bytes).sum();
        let files = self.items().volume_files(volume, files).await?;
        let files = files.ok_or_else(|| {
            let which = format!("a file of {volume} is missing");
            BlobError::new(StoreFault::DamagedFile, which)
        })?;
        let reader = self.engine.reader.clone();
        let scan = move |monitor: &Monitor<'_>| reader.scan(&files, monitor);
        let found = self.decoding.run_on(bytes, INSPECTION_MEMORY, scan);
        let found = found.await?;
        // The volume was read when it was uploaded. A program that reads less of it now leaves it
        // without identity.
        Ok(found.unwrap_or_default())
    }

    /// Reads the scans of volumes that a repair has lost. Ends when all are read, or at `end`.
    pub(crate) async fn read_unread_scans(&self, end: CancellationToken) {
        end.run_until_cancelled(async {
            let mut after = 0;
            loop {
                let next = self.items().catalogue().unread_scans(after, 1).await;
                let Some(unread) = (match next {
                    Ok(page) => page.into_iter().next(),
                    Err(error) => {
                        tracing::warn!(%error, "the volumes whose scan a repair has lost could not be listed; again soon");
                        tokio::time::sleep(READ_RETRY).await;
                        continue;
                    }
                }) else {
                    return;
                };
                after = unread.sequence;
                if self.note_scan(&unread.tenant, &unread.volume, &unread.files).await.is_err() {
                    let volume = &unread.volume;
                    tracing::warn!(volume, "the scan of this volume could not be read; the next start tries again");
                }
            }
        })
        .await;
    }

    /// Reads the scan of a stored volume and notes it for the tenant.
    pub(crate) async fn note_scan(
        &self,
        tenant: &Tenant,
        volume: &str,
        files: &[FileRecord],
    ) -> ServiceResult<()> {
        let found = self.read_scan(volume, files).await?;
        let noted = self
            .items()
            .catalogue()
            .note_scan(tenant, volume, found.as_ref());
        Ok(noted.await?)
    }
}
