//! Adding volumes and products: first the files, then the record that makes them visible.
//!
//! The two steps run in a task of their own, which goes on if the caller goes away: a client that
//! hangs up leaves neither files without a record nor a record that nobody waited for.

use super::Queue;
use crate::jobs::{
    BlobError, Failure, Fault, Job, JobOutcome, Lease, OutputFile, Product, ProductFile, Resource,
    StagedFiles, StoreError, StoredVolume, WorkOutput, content_id, hex,
};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use std::sync::Arc;
use tokio::io::AsyncWriteExt;
use tracing::Instrument;

impl Queue {
    /// Adds an uploaded volume durably. Returns the record, and whether it is new.
    ///
    /// # Errors
    /// If the files or the record cannot be written.
    pub async fn add_volume(
        self: &Arc<Self>,
        volume: StoredVolume,
        files: Box<dyn StagedFiles>,
    ) -> Result<(StoredVolume, bool), StoreError> {
        let queue = self.clone();
        to_its_end(async move {
            let _lock = queue.items.lock(&volume.id).await;
            queue.items.unsettle(&volume.id);
            files.publish(&volume.id).await?;
            let new = queue.catalogue.add_volume(&volume).await?;
            queue.items.settle(&volume.id);
            let stored = queue.catalogue.volume(&volume.id).await?;
            Ok((stored.unwrap_or(volume), new))
        })
        .await
    }

    /// The volume with that id, whose age counts from now: it was uploaded again.
    ///
    /// # Errors
    /// If the database fails.
    pub async fn renew_volume(&self, id: &str) -> Result<Option<StoredVolume>, StoreError> {
        // Most uploads are new: those shall not wait for a write that changes nothing.
        if self.catalogue.volume(id).await?.is_none() {
            return Ok(None);
        }
        self.catalogue.renew_volume(id, self.clock.now()).await
    }

    /// Adds a template to the library, durably. Returns the record, and whether it is new: the
    /// same mesh for the same organ is the same template, whatever its name.
    ///
    /// # Errors
    /// If the files or the record cannot be written.
    pub async fn add_template(
        self: &Arc<Self>,
        name: &str,
        organ: &str,
        output: WorkOutput,
    ) -> Result<(Product, bool), StoreError> {
        let parameters = [("name", name), ("organ", organ)]
            .map(|(key, value)| (key.to_owned(), Value::from(value)))
            .into_iter()
            .collect();
        let template = self.product(Resource::Template, &[organ], None, parameters, &output);
        let queue = self.clone();
        to_its_end(async move {
            let _lock = queue.items.lock(&template.id).await;
            queue.items.unsettle(&template.id);
            queue.write_files(&template.id, &output).await?;
            let new = queue.catalogue.add_product(&template).await?;
            queue.items.settle(&template.id);
            let stored = queue.catalogue.product(&template.id).await?;
            Ok((stored.unwrap_or(template), new))
        })
        .await
    }

    /// Stores what a job made and ends the job: the files first, then, in one commit, the record
    /// and the job's state. `None` if the lease was lost. May be called again after an error.
    ///
    /// # Errors
    /// If the database fails; then the job is still running.
    pub(in crate::jobs) async fn finish_with(
        &self,
        made: Resource,
        job: &Job,
        lease: &Lease,
        output: &WorkOutput,
    ) -> Result<Option<Job>, StoreError> {
        let parameters = Value::Object(job.parameters.clone()).to_string();
        let product = self.product(
            made,
            &[&job.volume, &parameters],
            Some(&job.volume),
            job.parameters.clone(),
            output,
        );
        let id = product.id.clone();
        let _lock = self.items.lock(&id).await;
        self.items.unsettle(&id);
        let outcome = match self.write_files(&id, output).await {
            Ok(()) => JobOutcome::Succeeded(Box::new(product)),
            Err(error) => {
                tracing::error!(job = %job.id, %error, "the result could not be stored");
                JobOutcome::Failed(
                    Failure::new(
                        Fault::Service,
                        "storage",
                        "The result was computed but could not be stored.",
                    )
                    .fix("Ask the operator to free disk space, then start the job again."),
                )
            }
        };
        let ended = self.jobs.finish(lease, &outcome, self.clock.now()).await?;
        if ended.is_some() && matches!(outcome, JobOutcome::Succeeded(_)) {
            self.items.settle(&id);
        }
        Ok(ended)
    }

    async fn write_files(&self, id: &str, output: &WorkOutput) -> Result<(), BlobError> {
        let staged = self.blobs.stage().await?;
        for file in &output.files {
            let mut writer = staged.create(&file.name).await?;
            writer.write_all(&file.bytes).await?;
            writer.shutdown().await?;
        }
        staged.publish(id).await
    }

    /// The record of a product. Its id is a hash of the kind, of `origin` and of the mesh; the
    /// report contains times and must not change the id.
    fn product(
        &self,
        made: Resource,
        origin: &[&str],
        volume: Option<&str>,
        parameters: Map<String, Value>,
        output: &WorkOutput,
    ) -> Product {
        let files: Vec<_> = output.files.iter().map(described).collect();
        let parts = std::iter::once(made.noun())
            .chain(origin.iter().copied())
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

/// Runs a section to its end even if the caller is dropped meanwhile.
pub(super) async fn to_its_end<T: Send + 'static>(
    section: impl Future<Output = Result<T, StoreError>> + Send + 'static,
) -> Result<T, StoreError> {
    tokio::spawn(section.in_current_span())
        .await
        .unwrap_or_else(|error| Err(BlobError(error.to_string()).into()))
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
    }
}
