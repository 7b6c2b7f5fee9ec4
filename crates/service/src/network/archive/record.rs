//! Fetches and deliveries, and the trait that a database implements.

use crate::base::records::{Failure, Job, SeriesSource, StoreResult, Tenant, Timestamp};
use crate::network::hooks::{Backlog, DeliveryState, Lane, NextAttempt};
use async_trait::async_trait;
use std::collections::BTreeMap;

/// The fetching of a job's series, whose time has come.
#[derive(Debug, Clone)]
pub struct DuePull {
    /// The job.
    pub job: String,
    /// Whose job it is.
    pub tenant: Tenant,
    /// The series.
    pub source: SeriesSource,
    /// Attempts before this one.
    pub attempts: u32,
    /// From when its age counts.
    pub since: Timestamp,
}

/// The fetching of a job's series, for people who ask what became of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pull {
    /// How far it has come: delivered means that the volume is stored.
    pub state: DeliveryState,
    /// Number of attempts.
    pub attempts: u32,
    /// When it will be tried next; only while it is pending.
    pub next_attempt_at: Option<Timestamp>,
    /// Why the last attempt failed.
    pub last_error: Option<String>,
}

/// A series as it was when it was fetched.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeldSeries {
    /// A hash of the SOP Instance UIDs.
    pub instances: String,
    /// The volume.
    pub volume: String,
}

/// Names a series of an archive that a tenant holds.
#[derive(Debug, Clone, Copy)]
pub struct SeriesKey<'a> {
    /// The tenant.
    pub tenant: &'a Tenant,
    /// Base URL of the DICOMweb service.
    pub base: &'a str,
    /// Study Instance UID.
    pub study: &'a str,
    /// Series Instance UID.
    pub series: &'a str,
}

/// A delivery whose time has come.
#[derive(Debug, Clone)]
pub struct DueSend {
    /// See [`ObjectDelivery::id`].
    pub id: String,
    /// Whose job it is.
    pub tenant: Tenant,
    /// The job.
    pub job: String,
    /// Id of the result.
    pub result: String,
    /// See [`ObjectDelivery::name`].
    pub name: String,
    /// See [`ObjectDelivery::to`].
    pub to: String,
    /// Attempts before this one.
    pub attempts: u32,
    /// From when its age counts.
    pub since: Timestamp,
}

/// The delivery of one object, for people who ask what became of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectDelivery {
    /// `snd_...`
    pub id: String,
    /// The object: `mask.dcm` ...
    pub name: String,
    /// The archive.
    pub to: String,
    /// Its state.
    pub state: DeliveryState,
    /// Number of attempts.
    pub attempts: u32,
    /// When it will be tried next; only while it is pending.
    pub next_attempt_at: Option<Timestamp>,
    /// When it was tried last.
    pub last_attempt_at: Option<Timestamp>,
    /// The outcome of the last attempt.
    pub last_outcome: Option<String>,
    /// Why the last attempt failed.
    pub last_error: Option<String>,
}

/// The record of an attempt to deliver.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SendSettlement {
    /// Its state.
    pub state: DeliveryState,
    /// The outcome of the attempt.
    pub outcome: &'static str,
    /// Why it failed.
    pub error: Option<String>,
    /// When to try again, if it is pending.
    pub again_at: Option<Timestamp>,
    /// Whether the attempt, which has been counted, counts towards the most that are made.
    pub counts: bool,
}

/// The tables of archives. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait ArchiveStore: Send + Sync + 'static {
    /// The lanes that have pending fetches, each with the time when the first is due.
    async fn pull_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>>;

    /// The fetches of a lane that are due, the longest due first.
    async fn due_pulls(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DuePull>>;

    /// Counts an attempt to fetch before it is made, so that one with which the process ends counts too.
    async fn pull_begun(&self, job: &str, now: Timestamp) -> StoreResult<()>;

    /// Gives a waiting job its volume. `None` if the job waits no more.
    async fn pulled(&self, job: &str, volume: &str, now: Timestamp) -> StoreResult<Option<Job>>;

    /// Writes down that an attempt to fetch failed, which has been counted; `again.counts` says whether that stays so.
    async fn pull_failed(
        &self,
        job: &str,
        error: &str,
        again: NextAttempt,
        now: Timestamp,
    ) -> StoreResult<()>;

    /// Makes those fetches due that a clock which was ahead has put off.
    async fn recall_pulls(&self, now: Timestamp) -> StoreResult<u64>;

    /// Fails a job whose volume cannot be fetched. `None` if it waits no more.
    async fn pull_given_up(
        &self,
        job: &str,
        failure: &Failure,
        now: Timestamp,
    ) -> StoreResult<Option<Job>>;

    /// The outcome of the fetches of those jobs.
    async fn pulls(&self, jobs: &[&str]) -> StoreResult<BTreeMap<String, Pull>>;

    /// The volume as which a series is held.
    async fn held_series(&self, key: SeriesKey<'_>) -> StoreResult<Option<HeldSeries>>;

    /// Notes the volume as which a series is held, if the tenant has that volume.
    async fn note_series(&self, key: SeriesKey<'_>, held: &HeldSeries) -> StoreResult<()>;

    /// The lanes that have pending deliveries, each with the time when the first is due.
    async fn send_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>>;

    /// The deliveries of a lane that are due, the longest due first.
    async fn due_sends(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DueSend>>;

    /// Counts an attempt to deliver before it is made, so that one with which the process ends counts too.
    async fn send_begun(&self, id: &str, now: Timestamp) -> StoreResult<()>;

    /// Writes down how an attempt to deliver ended, which has been counted. If it was the last one, the row of the
    /// audit trail is part of that: the result was read, or that was refused.
    async fn settle_send(
        &self,
        send: &DueSend,
        settled: &SendSettlement,
        now: Timestamp,
    ) -> StoreResult<()>;

    /// Makes those deliveries due that a clock which was ahead has put off.
    async fn recall_sends(&self, now: Timestamp) -> StoreResult<u64>;

    /// The outcome of the deliveries of those jobs, in the order of the job's list.
    async fn sends(&self, jobs: &[&str]) -> StoreResult<BTreeMap<String, Vec<ObjectDelivery>>>;

    /// Makes an ended delivery pending again, due at once. Returns it as it is then; `None` if
    /// that job has no such delivery, or its result was erased.
    async fn redeliver_object(
        &self,
        tenant: &Tenant,
        job: &str,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<Option<ObjectDelivery>>;

    /// The number of fetches and deliveries that wait.
    async fn archive_backlog(&self) -> StoreResult<ArchiveBacklog>;
}

/// How much waits for archives.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ArchiveBacklog {
    /// Number of pending fetches.
    pub pulls: u64,
    /// Deliveries.
    pub sends: Backlog,
}
