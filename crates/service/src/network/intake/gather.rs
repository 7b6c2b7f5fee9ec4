//! Making volumes of complete groups, and starting the jobs that rules ask for.
//!
//! Several groups are made at the same time, of one sender only some of them, so that a sender's costly
//! objects do not keep those of others waiting.
//!
//! Each step is written down before the next one begins, and can be done again: a volume is known by
//! its content, a job by its idempotency key. What fails for a passing reason (a full disk, a full
//! queue) is tried again; a group that cannot be read is kept with the reason for a set time.

use super::observer::IntakeObserver;
use super::record::{GroupState, IntakeGroup, IntakeStore, Origin, ReceivedFiles};
use super::rules::Rule;
use super::session::Sessions;
use crate::base::error::AttemptError;
use crate::base::records::{
    BlobError, ErasureAgent, ErasureReason, Fault, LocalFile, StoreError, StoreFault, StoreResult,
    milliseconds,
};
use crate::jobs::Queue;
use async_trait::async_trait;
use futures::StreamExt;
use futures::stream::FuturesUnordered;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;
use tokio_util::sync::CancellationToken;

/// Groups that are made at the same time, and those of one sender.
const AT_ONCE: usize = 8;
const AT_ONCE_OF_SENDER: usize = 2;
/// Pause before a group is looked at again that changed while it was made.
const CHANGED_PAUSE: Duration = Duration::from_secs(1);
/// Pause after a failure that may pass.
const RETRY_PAUSE: Duration = Duration::from_secs(10);
/// How often a process looks for groups that others have left, and how long these are late then.
const ADOPT_EVERY: Duration = Duration::from_secs(10);
const LATE_AFTER: Duration = Duration::from_secs(30);
/// Time between two sweeps.
const SWEEP_EVERY: Duration = Duration::from_secs(600);
/// A file without a row that was written this long ago will not get one.
const ABANDONED_AFTER: Duration = Duration::from_secs(3600);

/// A file that cannot be read; one that is damaged will not be better.
fn unread(error: BlobError) -> AttemptError {
    match error.cause {
        StoreFault::DamagedFile => damaged(),
        _ => StoreError::from(error).into(),
    }
}

fn damaged() -> AttemptError {
    AttemptError::permanent(
        Fault::Service,
        "damaged-file",
        "A stored file of the series no longer holds what was received.",
        "Erase the volume of the series, then send the series again.",
    )
}

/// Who sent the objects of a group. A title can be made up, an address hardly.
fn sender_of(origin: &Origin) -> String {
    format!("{} {}", origin.tenant, origin.address)
}

/// The groups that are complete: which are being made, and which wait for their turn.
#[derive(Default)]
struct Turns {
    /// Sender and group of each.
    making: Vec<(String, String)>,
    waiting: VecDeque<(String, String)>,
}

impl Turns {
    /// Whether a group is being made; `None` if it does not wait either.
    fn knows(&self, group: &str) -> Option<bool> {
        let is = |(_, known): &(String, String)| known == group;
        if self.making.iter().any(is) {
            Some(true)
        } else {
            self.waiting.iter().any(is).then_some(false)
        }
    }

    fn wait(&mut self, sender: String, group: String) {
        self.waiting.push_back((sender, group));
    }

    /// Takes the first group that waits and whose sender has not too many being made.
    fn start(&mut self) -> Option<(String, String)> {
        if self.making.len() >= AT_ONCE {
            return None;
        }
        let of = |sender: &String| self.making.iter().filter(|(s, _)| s == sender).count();
        let place = self
            .waiting
            .iter()
            .position(|(sender, _)| of(sender) < AT_ONCE_OF_SENDER)?;
        let next = self.waiting.remove(place)?;
        self.making.push(next.clone());
        Some(next)
    }

    fn end(&mut self, group: &str) {
        self.making.retain(|(_, made)| made != group);
    }
}

/// Makes volumes and files jobs.
#[async_trait]
pub trait VolumeMaker: Send + Sync + 'static {
    /// Stores the volume of these files for the tenant of `group`. Returns its id. Done again, it gives
    /// the same id.
    async fn make(&self, group: &IntakeGroup, files: &[LocalFile]) -> Result<String, AttemptError>;

    /// Files the job of `rule` on the volume of `group`. Returns its id; `None` if the job needs another volume, which
    /// has not come. Done again with the same `key`, it gives the same job.
    async fn file(
        &self,
        group: &IntakeGroup,
        rule: &Rule,
        volume: &str,
        key: String,
    ) -> Result<Option<String>, AttemptError>;
}

/// Settings for complete groups.
pub struct GatherSettings {
    /// The rules; the first that matches counts.
    pub rules: Vec<Rule>,
    /// How long a group that cannot be read is kept; `None` keeps it.
    pub keep_failed: Option<Duration>,
}

/// Makes volumes of what was received.
pub struct Gatherer {
    /// The rows of received objects.
    pub store: Arc<dyn IntakeStore>,
    /// Their files.
    pub files: Arc<dyn ReceivedFiles>,
    /// Volumes, and the time of day.
    pub queue: Arc<Queue>,
    /// Makes volumes and files jobs.
    pub maker: Arc<dyn VolumeMaker>,
    /// Is told of the volumes.
    pub observer: Arc<dyn IntakeObserver>,
    /// The groups that wait.
    pub sessions: Arc<Sessions>,
    /// See [`GatherSettings`].
    pub settings: GatherSettings,
}

impl Gatherer {
    /// Runs until `end` is cancelled, in every process that receives objects. A process that shares its
    /// store leaves it to [`Gatherer::keep_house`] what earlier ones have left.
    pub async fn run(self, end: CancellationToken) {
        end.run_until_cancelled(self.gather_for_ever()).await;
    }

    /// Sweeps until `end` is cancelled, in one process at a time; of several, it also takes on what
    /// those that received it do not finish.
    pub async fn keep_house(self, end: CancellationToken) {
        let work = async { tokio::join!(self.adopt_for_ever(), self.sweep_for_ever()) };
        end.run_until_cancelled(work).await;
    }

    async fn adopt_for_ever(&self) {
        if !self.queue.is_shared() {
            return;
        }
        let mut round = tokio::time::interval(ADOPT_EVERY);
        loop {
            round.tick().await;
            if let Err(error) = self.adopt().await {
                tracing::error!(%error, "unfinished series could not be listed; tried again");
            }
        }
    }

    /// Takes on the groups that their process should have finished a while ago: it has ended.
    async fn adopt(&self) -> StoreResult<()> {
        let files = self.store.releasable().await?;
        self.release(&files).await?;
        let late = self.sessions.patience() + LATE_AFTER;
        // Nothing is lost if a clock calls one late that is not: its volume is made twice, with the same id. So this
        // needs no trusted time, and a series does not wait for one. One of the future waits for nobody either.
        let (now, late) = (self.queue.now(), milliseconds(late));
        for group in self.store.unfinished().await? {
            let is_late = now.abs_diff(group.changed_at) > late.unsigned_abs();
            if is_late && !self.sessions.watches(&group.id) {
                self.sessions.resume(&group.id, true);
            }
        }
        Ok(())
    }

    async fn gather_for_ever(&self) {
        while !self.queue.is_shared()
            && let Err(error) = self.resume().await
        {
            tracing::error!(%error, "what was received before the start could not be listed");
            tokio::time::sleep(RETRY_PAUSE).await;
        }
        let mut turns = Turns::default();
        let mut making = FuturesUnordered::new();
        loop {
            while let Some((sender, group)) = turns.start() {
                making.push(async move {
                    if let Err(error) = self.advance(&group).await {
                        tracing::warn!(group, error, "a received series waits: {error}");
                        self.sessions.retry(&group, RETRY_PAUSE);
                    }
                    (sender, group)
                });
            }
            tokio::select! {
                Some((_, group)) = making.next() => turns.end(&group),
                group = self.sessions.next() => match turns.knows(&group) {
                    // Two at a time would file two volumes; one that still waits is made as it is then.
                    Some(true) => self.sessions.retry(&group, CHANGED_PAUSE),
                    Some(false) => {}
                    None => match self.store.group(&group).await {
                        Ok(Some(found)) => turns.wait(sender_of(&found.origin), group),
                        Ok(None) => {}
                        Err(error) => {
                            tracing::warn!(group, %error, "a received series waits: {error}");
                            self.sessions.retry(&group, RETRY_PAUSE);
                        }
                    },
                },
            }
        }
    }

    /// Watches what an earlier run has left, and deletes the files that it no longer needed.
    async fn resume(&self) -> StoreResult<()> {
        let files = self.store.releasable().await?;
        self.release(&files).await?;
        for group in self.store.unfinished().await? {
            let whole = group.instance.is_some() || group.state == GroupState::Filing;
            self.sessions.resume(&group.id, whole);
        }
        Ok(())
    }

    async fn release(&self, files: &[String]) -> StoreResult<()> {
        if !files.is_empty() {
            self.files.discard(files).await?;
            self.store.released(files).await?;
        }
        Ok(())
    }

    /// Takes a complete group as far as possible.
    ///
    /// # Errors
    /// Why it has to wait.
    async fn advance(&self, id: &str) -> Result<(), String> {
        let text = |error: StoreError| error.to_string();
        let Some(mut group) = self.store.group(id).await.map_err(text)? else {
            return Ok(());
        };
        if group.state == GroupState::Gathering {
            match self.make(&group).await {
                Ok(()) => self.observer.group(true),
                Err(AttemptError::Retry { why, .. }) => return Err(why),
                Err(AttemptError::Permanent(failure)) => {
                    tracing::warn!(
                        group = id,
                        code = failure.code,
                        "received objects make no volume"
                    );
                    self.observer.group(false);
                    let now = self.queue.now();
                    let failed = self.store.failed(id, group.revision, &failure, now);
                    failed.await.map_err(text)?;
                }
            }
            match self.store.group(id).await.map_err(text)? {
                Some(now) => group = now,
                None => return Ok(()),
            }
        }
        if group.state == GroupState::Filing {
            self.file(&group).await?;
        }
        Ok(())
    }

    async fn make(&self, group: &IntakeGroup) -> Result<(), AttemptError> {
        let files = self.local_files(group).await?;
        let volume = self.maker.make(group, &files).await?;
        let now = self.queue.now();
        self.store
            .made(&group.id, group.revision, &volume, now)
            .await?;
        tracing::info!(
            group = group.id,
            volume,
            files = files.len(),
            "received a volume"
        );
        Ok(())
    }

    /// The files of all objects of a group: those that wait, and those that are part of its volume.
    async fn local_files(&self, group: &IntakeGroup) -> Result<Vec<LocalFile>, AttemptError> {
        let objects = self.store.objects(&group.id).await?;
        let volume = match &group.volume {
            Some(id) => {
                let tenant = &group.origin.tenant;
                self.queue.items().catalogue().volume(tenant, id).await?
            }
            None => None,
        };
        let mut files = Vec::with_capacity(objects.len());
        for object in objects {
            let found = match (object.file, &volume) {
                (Some(name), _) => self
                    .files
                    .received(&name, &object.file_sha256)
                    .await
                    .map_err(unread)?,
                (None, Some(volume)) => {
                    let mut stored = volume.files.iter();
                    match stored.find(|file| file.sha256 == object.file_sha256) {
                        Some(file) => self
                            .queue
                            .items()
                            .blobs()
                            .local(&volume.id, file)
                            .await
                            .map_err(unread)?,
                        None => None,
                    }
                }
                (None, None) => None,
            };
            files.push(found.ok_or_else(damaged)?);
        }
        Ok(files)
    }

    /// Files the job that a rule asks for, and deletes the files that are part of the volume.
    async fn file(&self, group: &IntakeGroup) -> Result<(), String> {
        let Some(volume) = &group.volume else {
            return Ok(());
        };
        let rule = self.settings.rules.iter().find(|rule| rule.matches(group));
        let (job, failure) = match rule {
            None => (None, None),
            Some(rule) => {
                let key = format!("{}-{volume}", group.id);
                match self.maker.file(group, rule, volume, key).await {
                    Ok(job) => (job, None),
                    Err(AttemptError::Retry { why, .. }) => return Err(why),
                    Err(AttemptError::Permanent(failure)) => {
                        tracing::warn!(
                            group = group.id,
                            code = failure.code,
                            "the job of a rule was refused"
                        );
                        (None, Some(failure))
                    }
                }
            }
        };
        let now = self.queue.now();
        let ended = self
            .store
            .filed(&group.id, job.as_deref(), failure.as_ref(), now);
        let files = ended.await.map_err(|error| error.to_string())?;
        // What is not deleted now is deleted after the next start.
        if let Err(error) = self.release(&files).await {
            tracing::warn!(%error, "received files that are stored could not be deleted");
        }
        Ok(())
    }

    async fn sweep_for_ever(&self) {
        let mut round = tokio::time::interval(SWEEP_EVERY);
        loop {
            round.tick().await;
            if let Err(error) = self.sweep().await {
                tracing::error!(%error, "the sweep of received files failed; the next one tries again");
            }
        }
    }

    /// Forgets failed groups that are too old, and sets files without a row aside; nothing while no ages count.
    async fn sweep(&self) -> StoreResult<()> {
        let Some(trusted) = self.queue.clock().trusted() else {
            return Ok(());
        };
        let now = trusted.moment();
        if let Some(age) = self.settings.keep_failed {
            let failed = self.store.failed_before(trusted.older_than(age)).await?;
            let by = ErasureAgent::retention();
            for (tenant, id) in failed {
                let reason = ErasureReason::Retention;
                let removed = self.store.remove(&tenant, &id, &by, reason, now).await?;
                if let Some((files, _)) = removed {
                    self.files.discard(&files).await?;
                }
            }
            self.queue.items().overwrite_if_due().await?;
        }
        // Listed before the rows are: a file that gets its row meanwhile is among the rows.
        let kept = self.files.kept(ABANDONED_AFTER, trusted).await?;
        let known = self.store.files().await?;
        for name in kept.iter().filter(|name| !known.contains(*name)) {
            self.files.quarantine(name, now).await?;
            tracing::error!(
                "a received file without a record was moved to the folder `quarantine`"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_sender_leaves_places_for_others() {
        let mut turns = Turns::default();
        for n in 0..20 {
            turns.wait("busy".into(), format!("busy {n}"));
        }
        turns.wait("quiet".into(), "quiet 0".into());
        let mut started = Vec::new();
        while let Some((_, group)) = turns.start() {
            started.push(group);
        }
        assert_eq!(started, ["busy 0", "busy 1", "quiet 0"]);
        assert_eq!(turns.knows("busy 1"), Some(true));
        assert_eq!(turns.knows("busy 2"), Some(false));
        assert_eq!(turns.knows("new"), None);
        turns.end("busy 0");
        assert_eq!(turns.start().map(|(_, group)| group), Some("busy 2".into()));
        assert_eq!(turns.start(), None);
        for n in 0..9 {
            turns.wait(format!("sender {n}"), format!("group {n}"));
        }
        let more = std::iter::from_fn(|| turns.start()).count();
        assert_eq!(turns.making.len(), AT_ONCE);
        assert_eq!(more, AT_ONCE - 3);
    }
}
