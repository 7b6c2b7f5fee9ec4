//! Collecting the input of a job from the store.

use super::Queue;
use crate::base::records::{Failure, Fault, Job, StoreError, StoreFault};
use crate::items::StoredItem;
use crate::jobs::{Needs, Work, WorkInput};
use std::collections::BTreeMap;

impl Queue {
    /// The input of `job`, or why it cannot be computed. Every file is verified.
    ///
    /// # Errors
    /// If the storage fails.
    pub(in crate::jobs) async fn input(
        &self,
        job: &Job,
        work: &dyn Work,
    ) -> Result<Result<WorkInput, Failure>, StoreError> {
        match self.collect(job, work).await {
            Err(error) if error.cause() == StoreFault::DamagedFile => {
                tracing::error!(job = %job.id, %error, "the input of a job is damaged");
                Ok(Err(input_damaged()))
            }
            other => other,
        }
    }

    async fn collect(
        &self,
        job: &Job,
        work: &dyn Work,
    ) -> Result<Result<WorkInput, Failure>, StoreError> {
        let Needs {
            items,
            library,
            files,
        } = work.needs(&job.parameters);
        let id = job.volume.as_deref().unwrap_or_default();
        let Some(volume) = self.items.item(&job.tenant, id, files).await? else {
            return Ok(Err(volume_missing(id)));
        };
        let mut found = BTreeMap::new();
        for (field, id) in items {
            if let Some(item) = self.items.item(&job.tenant, &id, files).await? {
                found.insert(field, item);
            }
        }
        let others = found.values().map(|item: &StoredItem| item.voxels);
        Ok(Ok(WorkInput {
            voxels: others.fold(volume.voxels, u64::max),
            volume: volume.id,
            files: volume.files,
            parameters: job.parameters.clone(),
            items: found,
            library: if library {
                self.items.library(&job.tenant, files).await?
            } else {
                Vec::new()
            },
        }))
    }
}

fn input_damaged() -> Failure {
    Failure::new(
        Fault::Service,
        "damaged-file",
        "A stored file that the job needs no longer holds what was stored.",
    )
    .fix("Upload the volume again, which repairs it, then start the job again.")
}

fn volume_missing(id: &str) -> Failure {
    Failure::new(
        Fault::Service,
        "unreadable",
        format!("The volume `{id}` or one of its files is missing from the store."),
    )
    .fix("Upload the volume again, then start the job again.")
}
