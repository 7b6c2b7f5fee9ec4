//! Ending a job with what it made.

use super::Queue;
use crate::base::records::{
    Failure, Fault, Job, JobOutcome, JobState, Lease, Product, Resource, StoreError,
};
use crate::items::WorkOutput;
use serde_json::Value;

impl Queue {
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
        let volume = job.volume.as_deref();
        let product = self.items.product(
            (&job.tenant, made),
            &[volume.unwrap_or_default(), &parameters],
            volume.filter(|_| made.belongs_to_volume()),
            job.parameters.clone(),
            output,
        );
        let commit = async |written: Result<Product, StoreError>| {
            let outcome = outcome(job, written)?;
            let ended = self.jobs.finish(lease, &outcome, self.clock.now()).await?;
            // It fails all the same where the tenant's quota has no room for the result.
            let stored = ended
                .as_ref()
                .is_some_and(|job| job.state == JobState::Succeeded);
            Ok((ended, stored))
        };
        self.items.publish_with(product, output, commit).await
    }
}

/// The outcome of a job by whether its product's files were written.
///
/// # Errors
/// The storage's error, if it may pass.
fn outcome(job: &Job, written: Result<Product, StoreError>) -> Result<JobOutcome, StoreError> {
    match written {
        Ok(product) => Ok(JobOutcome::Succeeded(Box::new(product))),
        Err(error) if error.cause().may_pass() => Err(error),
        Err(error) => {
            tracing::error!(job = %job.id, %error, "the result could not be stored");
            let failure = Failure::new(
                Fault::Service,
                "storage",
                "The result was computed but could not be stored.",
            );
            Ok(JobOutcome::Failed(failure.fix(
                "Ask the operator to look into the log, then start the job again.",
            )))
        }
    }
}
