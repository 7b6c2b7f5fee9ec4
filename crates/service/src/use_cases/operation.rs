//! What operators read of a running service: metrics, readiness, the audit trail.

use crate::base::error::ServiceResult;
use crate::base::records::{ListPage, ListRequest};
use crate::callers::{AuditFilter, AuditRecord};
use crate::telemetry::{Check, Dependencies, MetricReadings, why_unready};
use crate::use_cases::service::Service;

impl Service {
    /// The metrics in the text format of Prometheus.
    pub async fn metrics_text(&self) -> ServiceResult<String> {
        let reading = MetricReadings {
            load: self.queue.table().load().await?,
            figures: self.figures.queue_figures().await?,
            received: self.intake.store.waiting().await?,
            backlog: self.hooks.store.backlog().await?,
            sent: self.hooks.dispatcher.counts(),
            archives: self.archives.read().await?,
            ready: self.readiness.is_ready(self.dependencies()).await,
            space: self.items().blobs().space(),
            settings: &self.settings,
            now: self.now(),
        };
        Ok(self.metrics.text(&reading))
    }

    /// The state of everything that the service depends on, and why no work can be accepted; `None` if it can.
    pub async fn readiness(&self) -> (Vec<Check>, Option<&'static str>) {
        let checks = self.readiness.check(self.dependencies()).await;
        let closing = self.closing.is_cancelled();
        let closing = closing.then_some("The service is shutting down.");
        let why = closing.or_else(|| why_unready(&checks));
        (checks, why)
    }

    /// A page of the audit trail, newest first.
    pub async fn audit_trail(
        &self,
        filter: &AuditFilter,
        page: ListRequest,
    ) -> ServiceResult<ListPage<AuditRecord>> {
        // What was noted within the last second belongs to the answer.
        self.recorder.flush().await;
        Ok(self.access.audit(filter, page).await?)
    }

    fn dependencies(&self) -> Dependencies<'_> {
        Dependencies {
            queue: &self.queue,
            access: &*self.access,
        }
    }
}
