//! Adding volumes and products: first the files, then the record that makes them visible.

use super::Queue;
use crate::jobs::{
    BlobError, Failure, Fault, Job, JobOutcome, OutputFile, Product, ProductFile, Resource,
    StagedFiles, StoreError, StoredVolume, WorkOutput, content_id, hex,
};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};
use tokio::io::AsyncWriteExt;
use tokio::sync::MutexGuard;

impl Queue {
    /// Adds an uploaded volume durably. Returns the record, and whether it is new.
    ///
    /// # Errors
    /// If the files or the record cannot be written.
    pub async fn add_volume(
        &self,
        volume: StoredVolume,
        files: Box<dyn StagedFiles>,
    ) -> Result<(StoredVolume, bool), StoreError> {
        let _publishing = self.publishing().await;
        files.publish(&volume.id).await?;
        let new = self.catalogue.add_volume(&volume).await?;
        let stored = self.catalogue.volume(&volume.id).await?;
        Ok((stored.unwrap_or(volume), new))
    }

    /// Adds a template to the library, durably. Returns the record, and whether it is new: the
    /// same mesh for the same organ is the same template, whatever its name.
    ///
    /// # Errors
    /// If the files or the record cannot be written.
    pub async fn add_template(
        &self,
        name: &str,
        organ: &str,
        output: WorkOutput,
    ) -> Result<(Product, bool), StoreError> {
        let parameters = [("name", name), ("organ", organ)]
            .map(|(key, value)| (key.to_owned(), Value::from(value)))
            .into_iter()
            .collect();
        let template = self.product(Resource::Template, &[organ], None, parameters, &output);
        let _publishing = self.publishing().await;
        self.write_files(&template.id, output).await?;
        let new = self.catalogue.add_product(&template).await?;
        let stored = self.catalogue.product(&template.id).await?;
        Ok((stored.unwrap_or(template), new))
    }

    /// Writes the files that a job made. Its record is added with the commit of the job, until
    /// which the caller must hold [`Queue::publishing`].
    pub(in crate::jobs) async fn publish(
        &self,
        made: Resource,
        job: &Job,
        output: WorkOutput,
    ) -> JobOutcome {
        let parameters = Value::Object(job.parameters.clone()).to_string();
        let product = self.product(
            made,
            &[&job.volume, &parameters],
            Some(&job.volume),
            job.parameters.clone(),
            &output,
        );
        match self.write_files(&product.id, output).await {
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
        }
    }

    /// The lock to hold while the files and the record of one item are added or deleted.
    pub(in crate::jobs) async fn publishing(&self) -> MutexGuard<'_, ()> {
        self.publishing.lock().await
    }

    async fn write_files(&self, id: &str, output: WorkOutput) -> Result<(), BlobError> {
        let staged = self.blobs.stage().await?;
        for file in output.files {
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
        media_type: file.media_type.into(),
        bytes: file.bytes.len() as u64,
        sha256: hex(&Sha256::digest(&file.bytes)),
    }
}
