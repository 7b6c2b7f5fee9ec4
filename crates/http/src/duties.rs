//! What goes on in the background: in the only process on a store, or in one of several at a time
//! ([`Queue::while_leader`](ventriform_service::jobs::Queue::while_leader)).
//!
//! Each of these is right also if two processes do it for a moment: what is sent is settled by its row
//! and known to its receiver by its id, what is deleted is deleted in one statement, what is filed is
//! filed by an idempotency key.

use super::app::{App, retention_ages};
use super::{exchange, performer, scans};
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use tokio_util::sync::CancellationToken;
use ventriform_service::access::AccessStore;
use ventriform_service::background::Upkeep;
use ventriform_service::intake::{GatherSettings, Gatherer};
use ventriform_service::items::Custodian;
use ventriform_service::records::{Clock, SystemClock};

/// How often the upkeep looks for expired things and for jobs beyond their attempt limit.
pub const UPKEEP_EVERY: Duration = Duration::from_secs(30);

/// How often old rows of the audit trail are removed.
const PRUNE_EVERY: Duration = Duration::from_secs(3600);

/// Does all of it until `end`, whenever it is this process's turn.
pub async fn run(app: App, end: CancellationToken) {
    let term = |term: CancellationToken| perform(&app, term);
    app.queue.while_leader(end, term).await;
}

/// Does all of it until `end`. What is on its way to other systems then gets some time; the rest is broken
/// off, as by a crash.
async fn perform(app: &App, end: CancellationToken) {
    let (queue, settings) = (&app.queue, &app.settings);
    let mut sending = JoinSet::new();
    sending.spawn(app.hooks.dispatcher.clone().run(
        queue.changes(),
        end.clone(),
        settings.shutdown_grace.0,
    ));
    sending.spawn(exchange::run(app.clone(), end.clone()));
    let mut others = JoinSet::new();
    others.spawn(performer::run(app.clone(), end.clone()));
    others.spawn(scans::read_old(app.clone(), end.clone()));
    others.spawn(gatherer(app).keep_house(end.clone()));
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
        others.spawn(prune_workitems(app.clone(), age, end.clone()));
    }
    if let Some(age) = settings.audit_retention.0 {
        others.spawn(prune_audit(app.access.clone(), age.0, end));
    }
    while let Some(ended) = sending.join_next().await {
        if let Err(error) = ended {
            tracing::error!(%error, "sending to other systems has ended");
        }
    }
}

/// What makes volumes of received objects.
pub fn gatherer(app: &App) -> Gatherer {
    Gatherer {
        store: app.intake.store.clone(),
        files: app.intake.files.clone(),
        queue: app.queue.clone(),
        maker: Arc::new(app.clone()),
        observer: Arc::new(app.metrics.intake.clone()),
        sessions: app.intake.sessions.clone(),
        settings: GatherSettings {
            rules: app.settings.rules.0.clone(),
            keep_failed: app.settings.intake_keep.0.map(|age| age.0),
        },
    }
}

async fn prune_audit(store: Arc<dyn AccessStore>, age: Duration, end: CancellationToken) {
    let mut round = tokio::time::interval(PRUNE_EVERY);
    let age = i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
    while end.run_until_cancelled(round.tick()).await.is_some() {
        let now = SystemClock.now();
        if let Err(error) = store.prune(now.saturating_sub(age), now).await {
            tracing::error!(%error, "old rows of the audit trail could not be removed");
        }
    }
}

/// Deletes work items that ended as long ago as jobs are kept.
async fn prune_workitems(app: App, age: Duration, end: CancellationToken) {
    let mut round = tokio::time::interval(PRUNE_EVERY);
    let age = i64::try_from(age.as_millis()).unwrap_or(i64::MAX);
    while end.run_until_cancelled(round.tick()).await.is_some() {
        let before = app.queue.now().saturating_sub(age);
        if let Err(error) = app.worklist.delete_ended_workitems(before).await {
            tracing::error!(%error, "ended work items could not be deleted");
        }
    }
}
