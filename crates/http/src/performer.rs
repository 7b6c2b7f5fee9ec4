//! Work items that the service performs itself: `[[procedures]]` of the settings.
//!
//! 1. A scheduled item that is ready and has the code of a procedure is claimed, under a Transaction UID that
//!    nobody else knows.
//! 2. A job is filed for it, by an idempotency key that is this UID: a crash in between files it once.
//! 3. The job's progress is noted. When it has succeeded and its objects are in the archive, the item is
//!    completed and names them; when it fails, or somebody asks to cancel it, it is canceled with the reason.
//!
//! Each step is written down before the next one begins and is found again after a restart.

use super::app::App;
use super::volume_maker::{UnattendedJob, file_unattended, order};
use super::workitems::{dicom_time, new_uid};
use serde_json::json;
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;
use ventriform_service::archive::{ExchangeHost, ObjectDelivery};
use ventriform_service::hooks::DeliveryState;
use ventriform_service::intake::MakeError;
use ventriform_service::records::{Interrupted, Job, JobState, StoreError, Timestamp};
use ventriform_service::worklist::{Procedure, Refusal, WorkOutputObject, Workitem};

/// How often claimed items are looked at.
const ROUND: Duration = Duration::from_secs(1);
/// How often all scheduled items are looked at, also if none was announced.
const ALL: Duration = Duration::from_secs(60);
/// Items read from the table at a time.
const BATCH: u32 = 200;
/// Steps in which progress is noted, percent.
const STEP: u8 = 10;

/// Performs work items until `end`.
pub async fn run(app: App, end: CancellationToken) {
    if app.settings.procedures.0.is_empty() {
        return;
    }
    let mut all_at = Instant::now();
    loop {
        let mut ended = Ok(());
        if Instant::now() >= all_at {
            all_at = Instant::now() + ALL;
            ended = claim_all(&app).await;
        }
        if let Err(error) = ended.and(follow_all(&app).await) {
            tracing::error!(%error, "work items could not be read or written; the next round tries again");
        }
        tokio::select! {
            () = tokio::time::sleep(ROUND) => {}
            () = app.scheduled.notified() => all_at = Instant::now(),
            () = end.cancelled() => return,
        }
    }
}

/// Claims the scheduled items that are to be performed.
async fn claim_all(app: &App) -> Result<(), StoreError> {
    let mut after = 0;
    loop {
        let items = app.worklist.scheduled_workitems(after, BATCH).await?;
        let Some(last) = items.last() else {
            return Ok(());
        };
        after = last.sequence;
        for mut item in items {
            if procedure(app, &item).is_none() {
                continue;
            }
            let transaction = new_uid();
            let claimed = change(app, &mut item, |item, now| item.claim(&transaction, now));
            if claimed.await? {
                tracing::info!(workitem = item.sequence, "a work item was claimed");
            }
        }
    }
}

fn procedure<'a>(app: &'a App, item: &Workitem) -> Option<&'a Procedure> {
    let mut all = app.settings.procedures.0.iter();
    all.find(|procedure| procedure.is_asked_by(item))
}

async fn follow_all(app: &App) -> Result<(), StoreError> {
    let mut after = 0;
    loop {
        let items = app.worklist.performed_workitems(after, BATCH).await?;
        let Some(last) = items.last() else {
            return Ok(());
        };
        after = last.sequence;
        for item in items {
            follow(app, item).await?;
        }
    }
}

/// Takes a claimed item one step on.
async fn follow(app: &App, mut item: Workitem) -> Result<(), StoreError> {
    let id = item.performer.clone().unwrap_or_default();
    if id.is_empty() {
        return file(app, item).await;
    }
    let Some(job) = app.queue.table().job(&id).await? else {
        return give_up(app, item, "The job was deleted.").await;
    };
    if item.is_to_be_cancelled() && !job.state.is_final() {
        if let Interrupted::Cancelled(_) = app.queue.interrupt(&id).await? {
            return give_up(app, item, "The job was cancelled.").await;
        }
        return Ok(());
    }
    match job.state {
        JobState::Queued | JobState::Running => {
            let percent = (job.progress.clamp(0.0, 1.0) * 100.0) as u8 / STEP * STEP;
            let mut news = item.clone();
            if news.note_progress(percent, (0, "")) {
                change(app, &mut item, |item, now| {
                    item.note_progress(percent, now);
                    Ok(())
                })
                .await?;
            }
            Ok(())
        }
        JobState::Succeeded => settle(app, item, &job).await,
        JobState::Cancelled => give_up(app, item, "The job was cancelled.").await,
        JobState::Failed => {
            let why = job.failure.as_ref().map(|failure| failure.detail.clone());
            give_up(app, item, &why.unwrap_or_default()).await
        }
    }
}

/// Files the job of an item that was claimed.
async fn file(app: &App, mut item: Workitem) -> Result<(), StoreError> {
    if item.is_to_be_cancelled() {
        return give_up(app, item, "It was cancelled.").await;
    }
    let Some(procedure) = procedure(app, &item) else {
        let reason = "The settings have no procedure for this code any more.";
        return give_up(app, item, reason).await;
    };
    let (study, series) = match item.input() {
        Ok(input) => input,
        Err(reason) => return give_up(app, item, reason).await,
    };
    let mut order = order(&procedure.send, procedure.to.as_deref());
    let source = json!({"archive": procedure.archive, "study": study, "series": series});
    order.insert("source".into(), source);
    let transaction = item.transaction.clone().unwrap_or_default();
    let job = UnattendedJob {
        by: "procedure",
        tenant: &procedure.tenant,
        kind: &procedure.kind,
        priority: item.priority(),
        parameters: &procedure.parameters,
        volume: None,
        order,
        key: format!("workitem-{transaction}"),
    };
    match file_unattended(app, job).await {
        Ok(job) => {
            change(app, &mut item, |item, _| {
                item.performer = Some(job.clone());
                Ok(())
            })
            .await?;
            Ok(())
        }
        Err(MakeError::Never(failure)) => give_up(app, item, &failure.detail).await,
        Err(MakeError::Later(reason)) => {
            tracing::warn!(
                workitem = item.sequence,
                reason,
                "the job of a work item is filed later"
            );
            Ok(())
        }
    }
}

/// Completes an item whose job has succeeded, once its objects are in the archive.
async fn settle(app: &App, mut item: Workitem, job: &Job) -> Result<(), StoreError> {
    let sends = app.archives.store.sends(&[&job.id]).await?;
    let sends = sends.get(&job.id).map(Vec::as_slice).unwrap_or_default();
    if sends
        .iter()
        .any(|send| send.state == DeliveryState::Pending)
    {
        return Ok(());
    }
    if let Some(dead) = sends.iter().find(|send| send.state == DeliveryState::Dead) {
        let why = dead.last_error.as_deref().unwrap_or_default();
        let reason = format!("{} could not be stored in {}. {why}", dead.name, dead.to);
        return give_up(app, item, &reason).await;
    }
    let mut outputs = Vec::with_capacity(sends.len());
    for send in sends {
        match output(app, job, send).await {
            Ok(output) => outputs.push(output),
            Err(why) => {
                tracing::warn!(
                    workitem = item.sequence,
                    why,
                    "an output of a work item is not named"
                );
            }
        }
    }
    let began = dicom_time(job.started_at.unwrap_or(job.created_at));
    change(app, &mut item, |item, now| {
        item.complete(&began, &outputs, now)
    })
    .await?;
    tracing::info!(workitem = item.sequence, job = %job.id, "a work item was completed");
    Ok(())
}

/// An object of the result, as it was sent.
async fn output(app: &App, job: &Job, send: &ObjectDelivery) -> Result<WorkOutputObject, String> {
    let result = job.result.as_deref().unwrap_or_default();
    let object = app.object(&job.tenant, result, &send.name).await;
    let object = object.map_err(|trouble| trouble.what().to_owned())?;
    let archive = app.settings.archives.named(&send.to, &job.tenant);
    Ok(WorkOutputObject {
        class: object.class,
        instance: object.instance,
        study: object.study,
        series: object.series,
        dicomweb: archive.and_then(|archive| archive.dicomweb.clone()),
        ae_title: archive.and_then(|archive| Some(archive.dicom.as_ref()?.called.clone())),
    })
}

async fn give_up(app: &App, mut item: Workitem, reason: &str) -> Result<(), StoreError> {
    if change(app, &mut item, |item, now| item.give_up(reason, now)).await? {
        tracing::info!(workitem = item.sequence, "a work item was canceled");
    }
    Ok(())
}

/// Changes an item, unless it is not in the state for that or another change came between; the next round
/// sees that one.
async fn change(
    app: &App,
    item: &mut Workitem,
    how: impl FnOnce(&mut Workitem, (Timestamp, &str)) -> Result<(), Refusal>,
) -> Result<bool, StoreError> {
    let now = app.queue.now();
    match how(item, (now, &dicom_time(now))) {
        Ok(()) => app.worklist.change_workitem(item).await,
        Err(refusal) => {
            tracing::warn!(workitem = item.sequence, %refusal, "a work item could not be changed");
            Ok(false)
        }
    }
}
