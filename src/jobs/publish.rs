//! Results on their way into the store: files first, then the row that makes them visible.

use super::ids::hex;
use super::{
    BlobError, Failure, Fault, Job, Outcome, Output, OutputFile, Product, ProductFile, Queue,
    Resource, StoreError, content_id,
};
use serde_json::Value;
use sha2::{Digest, Sha256};

impl Queue {
    /// Stores what was made; the row comes with the commit.
    pub(super) async fn publish(&self, made: Resource, job: &Job, output: Output) -> Outcome {
        let product = self.describe(made, job, &output);
        match self.shelve(&product.id, output).await {
            Ok(()) => Outcome::Succeeded(Box::new(product)),
            Err(error) => {
                tracing::error!(job = %job.id, %error, "the result could not be stored");
                Outcome::Failed(
                    Failure::new(
                        Fault::Service,
                        "storage",
                        "The result was computed but could not be stored.",
                    )
                    .fix("Ask the operator for room on the disk, then file the job again."),
                )
            }
        }
    }

    async fn shelve(&self, id: &str, output: Output) -> Result<(), BlobError> {
        let staged = self.blobs.stage().await?;
        for file in output.files {
            tokio::fs::write(staged.folder().join(&file.name), file.bytes).await?;
        }
        self.blobs.publish(id, staged).await
    }

    fn describe(&self, made: Resource, job: &Job, output: &Output) -> Product {
        let files = described(&output.files);
        let parameters = Value::Object(job.parameters.clone()).to_string();
        // The report carries times, so only the mesh decides the name.
        let mesh = mesh_hash(&files);
        let parts = [made.noun(), &job.volume, &parameters, mesh];
        Product {
            id: content_id(made.prefix(), parts.map(str::as_bytes)),
            sequence: 0,
            created_at: self.clock.now(),
            volume: Some(job.volume.clone()),
            parameters: job.parameters.clone(),
            summary: output.summary.clone(),
            software: env!("CARGO_PKG_VERSION").into(),
            files,
        }
    }

    /// Adds a template to the library, durably. Tells whether it is new: the same mesh for the
    /// same organ is the same template, whatever its name.
    ///
    /// # Errors
    /// If files or row cannot be written.
    pub async fn add_template(
        &self,
        name: &str,
        organ: &str,
        output: Output,
    ) -> Result<(Product, bool), StoreError> {
        let files = described(&output.files);
        let made = Resource::Template;
        let parts = [made.noun(), organ, mesh_hash(&files)];
        let parameters = [("name", name), ("organ", organ)];
        let template = Product {
            id: content_id(made.prefix(), parts.map(str::as_bytes)),
            sequence: 0,
            created_at: self.clock.now(),
            volume: None,
            parameters: parameters
                .map(|(key, value)| (key.to_owned(), Value::from(value)))
                .into_iter()
                .collect(),
            summary: output.summary.clone(),
            software: env!("CARGO_PKG_VERSION").into(),
            files,
        };
        let _shelving = self.shelving.lock().await;
        let shelved = self.shelve(&template.id, output).await;
        shelved.map_err(|error| StoreError(error.to_string()))?;
        let new = self.catalogue.add_product(&template).await?;
        let stored = self.catalogue.product(&template.id).await?;
        Ok((stored.unwrap_or(template), new))
    }
}

/// The mesh's hash, which stands for all that was computed.
fn mesh_hash(files: &[ProductFile]) -> &str {
    files
        .iter()
        .find(|file| file.name == "mesh.json")
        .or(files.first())
        .map_or("", |file| file.sha256.as_str())
}

fn described(files: &[OutputFile]) -> Vec<ProductFile> {
    files
        .iter()
        .map(|file| ProductFile {
            name: file.name.clone(),
            media_type: file.media_type.into(),
            bytes: file.bytes.len() as u64,
            sha256: hex(&Sha256::digest(&file.bytes)),
        })
        .collect()
}
