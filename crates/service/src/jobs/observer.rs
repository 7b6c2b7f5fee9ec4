//! Reports of the queue about its jobs, for metrics and traces.

use crate::base::records::Job;

/// Is told of each change of a job, in the order of the changes. Its methods are called while jobs
/// are handled, so they must be quick.
pub trait JobObserver: Send + Sync + 'static {
    /// A job was accepted.
    fn filed(&self, job: &Job);

    /// A job has started, gone on, returned to the queue, or ended.
    fn changed(&self, job: &Job);

    /// The computation of a job has ended; its result is stored next.
    fn computed(&self, job: &Job);
}
