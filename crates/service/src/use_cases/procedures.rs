//! Work items that the service performs itself: `[[procedures]]` of the settings.
//!
//! 1. A scheduled item that is ready and has the code of a procedure is claimed, under a Transaction UID that
//!    nobody else knows.
//! 2. A job is filed for it, by an idempotency key that is this UID: a crash in between files it once.
//! 3. The job's progress is noted. When it has succeeded and its objects are in the archive, the item is
//!    completed and names them; when it fails, or somebody asks to cancel it, it is canceled with the reason.
//!
//! Each step is written down before the next one begins and is found again after a restart.

use crate::base::error::ServiceError;
use crate::base::records::{Interrupted, Job, JobState, SeriesSource, StoreError, Timestamp};
use crate::callers::Agent;
use crate::network::archive::{ExchangeHost, ObjectDelivery};
use crate::network::hooks::DeliveryState;
use crate::network::worklist::{
    Performer, Procedure, Refusal, WorkOutputObject, Workitem, dicom_time, new_uid,
};
use crate::use_cases::filing::UnattendedJob;
use crate::use_cases::series::GivenSeries;
use crate::use_cases::service::Service;
use std::sync::Arc;
use std::time::Duration;
use tokio::time::Instant;
use tokio_util::sync::CancellationToken;

/// Interval between two looks at claimed items.
const ROUND_EVERY: Duration = Duration::from_secs(1);
/// How often all scheduled items are looked at, also if none was announced.
const CLAIM_EVERY: Duration = Duration::from_secs(60);
/// Items read from the table at a time.
const BATCH_ITEMS: u32 = 200;
/// Steps in which progress is noted, percent.
const PROGRESS_STEP_PERCENT: u8 = 10;

/// Performs work items until `end`.
pub(crate) async fn run(service: Arc<Service>, end: CancellationToken) {
    if service.settings.procedures.0.is_empty() {
        return;
    }
    let mut all_at = Instant::now();
    loop {
        let mut ended = Ok(());
        if Instant::now() >= all_at {
            all_at = Instant::now() + CLAIM_EVERY;
            ended = claim_all(&service).await;
        }
        if let Err(error) = ended.and(follow_all(&service).await) {
            tracing::error!(%error, "work items could not be read or written; the next round tries again");
        }
        tokio::select! {
            () = tokio::time::sleep(ROUND_EVERY) => {}
            () = service.scheduled.notified() => all_at = Instant::now(),
            () = end.cancelled() => return,
        }
    }
}

/// Claims the scheduled items that are to be performed.
async fn claim_all(service: &Service) -> Result<(), StoreError> {
    let mut after = 0;
    loop {
        let items = service
            .worklist
            .scheduled_workitems(after, BATCH_ITEMS)
            .await?;
        let Some(last) = items.last() else {
            return Ok(());
        };
        after = last.sequence;
        for mut item in items {
            if procedure(service, &item).is_none() {
                continue;
            }
            let transaction = new_uid();
            let claimed = change(service, &mut item, |item, now| {
                item.claim(&transaction, now)
            });
            if claimed.await? {
                tracing::info!(workitem = item.sequence, "a work item was claimed");
            }
        }
    }
}

fn procedure<'a>(service: &'a Service, item: &Workitem) -> Option<&'a Procedure> {
    let mut all = service.settings.procedures.0.iter();
    all.find(|procedure| procedure.is_asked_by(item))
}

/// The agent of an item's procedure: its number in the settings.
fn agent(service: &Service, item: &Workitem) -> Agent {
    let mut all = service.settings.procedures.0.iter();
    let place = all.position(|procedure| procedure.is_asked_by(item));
    let name = place.map_or_else(
        || "procedure".to_owned(),
        |place| format!("procedure:{}", place + 1),
    );
    service.agent(&item.tenant, name)
}

async fn follow_all(service: &Service) -> Result<(), StoreError> {
    let mut after = 0;
    loop {
        let items = service
            .worklist
            .performed_workitems(after, BATCH_ITEMS)
            .await?;
        let Some(last) = items.last() else {
            return Ok(());
        };
        after = last.sequence;
        for item in items {
            follow(service, item).await?;
        }
    }
}

/// Takes a claimed item one step on.
async fn follow(service: &Service, mut item: Workitem) -> Result<(), StoreError> {
    let id = match &item.performer {
        Performer::Job(id) => id.clone(),
        Performer::None | Performer::Claimed => return file(service, item).await,
    };
    let Some(job) = service.queue().table().job(&id).await? else {
        return give_up(service, item, "The job was deleted.").await;
    };
    if item.is_to_be_cancelled() && !job.state.is_final() {
        let by = agent(service, &item);
        if let Interrupted::Cancelled(_) = service.interrupt_job(&by, &id).await? {
            return give_up(service, item, "The job was cancelled.").await;
        }
        return Ok(());
    }
    match job.state {
        JobState::Queued | JobState::Running => {
            let tenths = (job.progress.clamp(0.0, 1.0) * 100.0) as u8 / PROGRESS_STEP_PERCENT;
            let percent = tenths * PROGRESS_STEP_PERCENT;
            if item.progress_percent() != Some(percent) {
                let now = service.queue().now();
                item.note_progress(percent, (now, &dicom_time(now)));
                service.worklist.change_workitem(&item).await?;
            }
            Ok(())
        }
        JobState::Succeeded => settle(service, item, &job).await,
        JobState::Cancelled => give_up(service, item, "The job was cancelled.").await,
        JobState::Failed => {
            let why = job.failure.as_ref().map(|failure| failure.detail.clone());
            give_up(service, item, &why.unwrap_or_default()).await
        }
    }
}

/// Files the job of an item that was claimed.
async fn file(service: &Service, mut item: Workitem) -> Result<(), StoreError> {
    if item.is_to_be_cancelled() {
        return give_up(service, item, "It was cancelled.").await;
    }
    let Some(procedure) = procedure(service, &item) else {
        let reason = "The settings have no procedure for this code any more.";
        return give_up(service, item, reason).await;
    };
    let (study, series) = match item.input() {
        Ok(input) => input,
        Err(reason) => return give_up(service, item, reason).await,
    };
    let given = GivenSeries {
        archive: Some(&procedure.archive),
        dicomweb: None,
        study: Some(&study),
        series: Some(&series),
    };
    let filed = async {
        let source = service.series_source(&procedure.tenant, given).await;
        let source = source.map_err(|failure| failure.within("source"))?;
        file_by(service, procedure, &item, source).await
    };
    match filed.await {
        Ok(job) => {
            change(service, &mut item, |item, _| {
                item.performer = Performer::Job(job);
                Ok(())
            })
            .await?;
            Ok(())
        }
        Err(error) if error.may_pass() => {
            let (workitem, reason) = (item.sequence, error.failure.detail);
            tracing::warn!(workitem, reason, "the job of a work item is filed later");
            Ok(())
        }
        Err(error) => give_up(service, item, &error.failure.detail).await,
    }
}

/// Files the job that a procedure asks for. Returns its id.
async fn file_by(
    service: &Service,
    procedure: &Procedure,
    item: &Workitem,
    source: SeriesSource,
) -> Result<String, ServiceError> {
    let transaction = item.transaction.clone().unwrap_or_default();
    let job = UnattendedJob {
        by: agent(service, item),
        ordered_by: "procedure",
        tenant: &procedure.tenant,
        kind: &procedure.kind,
        priority: item.priority(),
        parameters: &procedure.parameters,
        volume: None,
        source: Some(source),
        send: &procedure.send,
        to: procedure.to.as_deref(),
        key: format!("workitem-{transaction}"),
    };
    service.file_unattended(job).await
}

/// Completes an item whose job has succeeded, once its objects are in the archive.
async fn settle(service: &Service, mut item: Workitem, job: &Job) -> Result<(), StoreError> {
    let sends = service.archives.store.sends(&[&job.id]).await?;
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
        return give_up(service, item, &reason).await;
    }
    let mut outputs = Vec::with_capacity(sends.len());
    for send in sends {
        match output(service, job, send).await {
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
    change(service, &mut item, |item, now| {
        item.complete(&began, &outputs, now)
    })
    .await?;
    tracing::info!(workitem = item.sequence, job = %job.id, "a work item was completed");
    Ok(())
}

/// An object of the result, as it was sent.
async fn output(
    service: &Service,
    job: &Job,
    send: &ObjectDelivery,
) -> Result<WorkOutputObject, String> {
    let result = job.result.as_deref().unwrap_or_default();
    let object = service.object(&job.tenant, result, &send.name).await;
    let object = object.map_err(|trouble| trouble.why().to_owned())?;
    let archive = service.settings.archives.named(&send.to, &job.tenant);
    Ok(WorkOutputObject {
        class: object.class,
        instance: object.instance,
        study: object.study,
        series: object.series,
        dicomweb: archive.and_then(|archive| archive.dicomweb.clone()),
        ae_title: archive.and_then(|archive| Some(archive.dicom.as_ref()?.called.clone())),
    })
}

async fn give_up(service: &Service, mut item: Workitem, reason: &str) -> Result<(), StoreError> {
    if change(service, &mut item, |item, now| item.give_up(reason, now)).await? {
        tracing::info!(workitem = item.sequence, "a work item was canceled");
    }
    Ok(())
}

/// Changes an item, unless it is not in the state for that or another change came between; the next round
/// sees that one.
async fn change(
    service: &Service,
    item: &mut Workitem,
    how: impl FnOnce(&mut Workitem, (Timestamp, &str)) -> Result<(), Refusal>,
) -> Result<bool, StoreError> {
    let now = service.queue().now();
    match how(item, (now, &dicom_time(now))) {
        Ok(()) => {
            let (worklist, item) = (service.worklist.clone(), item.clone());
            let by = agent(service, &item);
            let change = async move { worklist.change_workitem(&item).await };
            by.change(change).await
        }
        Err(refusal) => {
            tracing::warn!(workitem = item.sequence, %refusal, "a work item could not be changed");
            Ok(false)
        }
    }
}
