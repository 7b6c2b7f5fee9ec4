//! The tasks of the leader: of the only process on a store, or of one of several at a time
//! ([`Queue::while_leader`](crate::jobs::Queue::while_leader)).
//!
//! Each of these is right also if two processes do it for a moment: what is sent is settled by its row
//! and known to its receiver by its id, what is deleted is deleted in one statement, what is filed is
//! filed by an idempotency key.

use super::{Upkeep, exchange};
use crate::items::Custodian;
use crate::network::intake::{GatherSettings, Gatherer};
use crate::use_cases::procedures;
use crate::use_cases::service::{Service, retention_ages};
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;

/// Interval at which the upkeep looks for expired items and for jobs beyond their attempt limit.
pub(crate) const UPKEEP_EVERY: Duration = Duration::from_secs(30);

/// Interval at which old rows of the audit trail are removed.
const PRUNE_EVERY: Duration = Duration::from_secs(3600);

/// Runs all of them until `end`, whenever this process is the leader.
pub(crate) async fn run(service: Arc<Service>, end: CancellationToken) {
    let term = |term: CancellationToken| perform(&service, term);
    service.queue().while_leader(end, term).await;
}

/// Runs all of them until `end`. Deliveries to other systems then get some time; the rest is broken off, as by a
/// crash.
async fn perform(service: &Arc<Service>, end: CancellationToken) {
    let (queue, settings) = (service.queue(), &service.settings);
    let mut sending = JoinSet::new();
    sending.spawn(service.hooks.dispatcher.clone().run(
        queue.changes(),
        end.clone(),
        settings.shutdown_grace.0,
    ));
    sending.spawn(exchange::run(service.clone(), end.clone()));
    let mut others = JoinSet::new();
    others.spawn(procedures::run(service.clone(), end.clone()));
    others.spawn(read_scans(service.clone(), end.clone()));
    others.spawn(gatherer(service).keep_house(end.clone()));
    let upkeep = Upkeep {
        queue: queue.clone(),
        retention: retention_ages(settings),
        every: UPKEEP_EVERY,
    };
    others.spawn(upkeep.run(end.clone()));
    let custodian = Custodian {
        items: queue.items().clone(),
        quarantine_keep: settings.quarantine_keep.0.map(|span| span.0),
        scrub_rate: settings.scrub_rate.0,
    };
    others.spawn(custodian.run(end.clone()));
    if let Some(age) = retention_ages(settings).jobs {
        others.spawn(prune_workitems(service.clone(), age, end.clone()));
    }
    if let Some(age) = settings.audit_retention.0 {
        others.spawn(prune_audit(service.clone(), age.0, end));
    }
    while let Some(ended) = sending.join_next().await {
        if let Err(error) = ended {
            tracing::error!(%error, "sending to other systems has ended");
        }
    }
}

/// The maker of volumes of received objects.
pub(crate) fn gatherer(service: &Arc<Service>) -> Gatherer {
    Gatherer {
        store: service.intake.store.clone(),
        files: service.intake.files.clone(),
        queue: service.queue().clone(),
        maker: service.clone(),
        observer: Arc::new(service.metrics.intake.clone()),
        sessions: service.intake.sessions.clone(),
        settings: GatherSettings {
            rules: service.settings.rules.0.clone(),
            keep_failed: service.settings.intake_keep.0.map(|age| age.0),
        },
    }
}

/// Removes rows of the audit trail that are older than `age`, while ages count.
async fn prune_audit(service: Arc<Service>, age: Duration, end: CancellationToken) {
    let mut round = tokio::time::interval(PRUNE_EVERY);
    while end.run_until_cancelled(round.tick()).await.is_some() {
        let Some(now) = service.clock().trusted() else {
            continue;
        };
        let pruned = service.access.prune(now.older_than(age), now.moment());
        if let Err(error) = pruned.await {
            tracing::error!(%error, "old rows of the audit trail could not be removed");
        }
    }
}

/// Deletes work items that ended as long ago as jobs are kept, while ages count.
async fn prune_workitems(service: Arc<Service>, age: Duration, end: CancellationToken) {
    let mut round = tokio::time::interval(PRUNE_EVERY);
    while end.run_until_cancelled(round.tick()).await.is_some() {
        let Some(now) = service.clock().trusted() else {
            continue;
        };
        let before = now.older_than(age);
        let deleted = async {
            service
                .worklist
                .delete_ended_workitems(before, now.moment())
                .await?;
            service.items().overwrite_if_due().await
        };
        if let Err(error) = deleted.await {
            tracing::error!(%error, "ended work items could not be deleted");
        }
    }
}

async fn read_scans(service: Arc<Service>, end: CancellationToken) {
    service.read_unread_scans(end).await;
}
