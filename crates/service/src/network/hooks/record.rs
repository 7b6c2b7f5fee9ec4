//! Deliveries and endpoints, and the trait that a database implements.

use super::{AttemptOutcome, HookEvent, Lane, SigningSecret};
use crate::base::records::{Cutoff, StoreResult, Tenant, Timestamp};
use async_trait::async_trait;

/// The state of a delivery.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DeliveryState {
    /// It will be tried.
    Pending,
    /// The receiver took it.
    Delivered,
    /// It was given up.
    Dead,
}

impl DeliveryState {
    /// Every state.
    pub const ALL: [DeliveryState; 3] = [
        DeliveryState::Pending,
        DeliveryState::Delivered,
        DeliveryState::Dead,
    ];

    /// Its name in answers and in the database.
    pub fn as_str(self) -> &'static str {
        match self {
            DeliveryState::Pending => "pending",
            DeliveryState::Delivered => "delivered",
            DeliveryState::Dead => "dead",
        }
    }

    /// The state of that name.
    pub fn parse(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == name)
    }
}

/// A delivery, for people who ask what became of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Delivery {
    /// `msg_...`; the header `webhook-id` of every attempt.
    pub id: String,
    /// The job it tells of.
    pub job: String,
    /// The registered endpoint; `None` for the job's own webhook.
    pub endpoint: Option<String>,
    /// Where it goes.
    pub url: String,
    /// The event that it tells.
    pub event: HookEvent,
    /// Its state.
    pub state: DeliveryState,
    /// Number of attempts.
    pub attempts: u32,
    /// When the event happened.
    pub occurred_at: Timestamp,
    /// When it will be tried next; only while it is pending.
    pub next_attempt_at: Option<Timestamp>,
    /// When it was tried last.
    pub last_attempt_at: Option<Timestamp>,
    /// The status of the receiver's last answer.
    pub last_status: Option<u16>,
    /// The outcome of the last attempt.
    pub last_outcome: Option<String>,
}

/// A delivery whose time has come, with all that its attempt needs.
#[derive(Debug, Clone)]
pub struct DueDelivery {
    /// See [`Delivery::id`].
    pub id: String,
    /// Whose job it is.
    pub tenant: Tenant,
    /// See [`Delivery::job`].
    pub job: String,
    /// See [`Delivery::url`].
    pub url: String,
    /// The secret that signs it: its own secret, its endpoint's, or its tenant's. Empty if the tenant has none.
    pub secrets: Vec<SigningSecret>,
    /// See [`Delivery::event`].
    pub event: HookEvent,
    /// The kind of the job.
    pub kind: String,
    /// Id of the product that the job made.
    pub result: Option<String>,
    /// Why it failed: the code of the failure.
    pub cause: Option<String>,
    /// The number of times that a worker had started the job.
    pub run: u32,
    /// See [`Delivery::occurred_at`].
    pub occurred_at: Timestamp,
    /// Attempts before this one.
    pub attempts: u32,
    /// From when its age counts.
    pub since: Timestamp,
}

/// The record of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settlement {
    /// The outcome of the attempt.
    pub outcome: AttemptOutcome,
    /// When to try again; `None` if this was the last attempt.
    pub again_at: Option<Timestamp>,
    /// Whether the attempt, which has been counted, counts towards the most that are made.
    pub counts: bool,
}

/// A receiver that is told about every job of its tenant.
#[derive(Debug, Clone, PartialEq)]
pub struct HookEndpoint {
    /// `whk_...`
    pub id: String,
    /// Whose jobs it is told about.
    pub tenant: Tenant,
    /// When it was registered.
    pub created_at: Timestamp,
    /// Where it is.
    pub url: String,
    /// Scheme, host and port of the URL: what shares one place in the order of sending.
    pub destination: String,
    /// The events that it is told.
    pub events: Vec<HookEvent>,
    /// Since when it answers 410 and is not told any more.
    pub gone_at: Option<Timestamp>,
}

/// How much is kept of deliveries.
#[derive(Debug, Clone, Copy)]
pub struct DeliveryLimits {
    /// Pending deliveries that happened before this are given up; none while no ages count.
    pub pending_since: Option<Cutoff>,
    /// Deliveries that ended before this are deleted; none while no ages count.
    pub ended_since: Option<Cutoff>,
    /// Most pending deliveries of one lane; the oldest beyond that are given up.
    pub backlog: u32,
}

/// The number of deliveries that wait.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Backlog {
    /// Number of pending deliveries.
    pub pending: u64,
    /// When the oldest of them happened.
    pub oldest: Option<Timestamp>,
    /// Number of dead deliveries that are still kept.
    pub dead: u64,
}

/// The tables of webhooks. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait DeliveryStore: Send + Sync + 'static {
    /// The lanes that have pending deliveries, each with the time when the first is due.
    async fn delivery_lanes(&self) -> StoreResult<Vec<(Lane, Timestamp)>>;

    /// The deliveries of a lane that are due, the longest due first.
    async fn due_deliveries(
        &self,
        lane: &Lane,
        now: Timestamp,
        limit: usize,
    ) -> StoreResult<Vec<DueDelivery>>;

    /// Counts an attempt before it is made, so that one with which the process ends counts too.
    async fn begun(&self, id: &str, now: Timestamp) -> StoreResult<()>;

    /// Writes down how an attempt ended, which has been counted. After [`AttemptOutcome::Gone`] the endpoint is not
    /// told any more, and what it has not been told is given up.
    async fn settle(&self, id: &str, settled: Settlement, now: Timestamp) -> StoreResult<()>;

    /// Makes those due that a clock which was ahead has put off; see [`Errands::recall`](super::Errands::recall).
    async fn recall_deliveries(&self, now: Timestamp) -> StoreResult<u64>;

    /// Gives up and deletes deliveries beyond the limits; returns how many were given up.
    async fn expire(&self, limits: DeliveryLimits, now: Timestamp) -> StoreResult<u64>;

    /// The number of deliveries that wait.
    async fn backlog(&self) -> StoreResult<Backlog>;

    /// The deliveries of a tenant's job, the newest first, at most `limit`.
    async fn deliveries(
        &self,
        tenant: &Tenant,
        job: &str,
        limit: u32,
    ) -> StoreResult<Vec<Delivery>>;

    /// Makes an ended delivery pending again, due at once. Returns it as it is then; `None` if
    /// that job has no such delivery.
    async fn redeliver(
        &self,
        tenant: &Tenant,
        job: &str,
        id: &str,
        now: Timestamp,
    ) -> StoreResult<Option<Delivery>>;

    /// Registers an endpoint, unless its tenant has `limit` of them. Returns whether it did.
    async fn add_endpoint(
        &self,
        endpoint: &HookEndpoint,
        secret: &SigningSecret,
        limit: u32,
    ) -> StoreResult<bool>;

    /// The endpoints of a tenant, the oldest first.
    async fn endpoints(&self, tenant: &Tenant) -> StoreResult<Vec<HookEndpoint>>;

    /// Removes an endpoint and gives up what it has not been told. Returns whether it was there.
    async fn remove_endpoint(&self, tenant: &Tenant, id: &str, now: Timestamp)
    -> StoreResult<bool>;

    /// The tenant's signing secret, which is `fresh` if it had none.
    async fn signing_secret(
        &self,
        tenant: &Tenant,
        fresh: &SigningSecret,
    ) -> StoreResult<SigningSecret>;

    /// Makes `fresh` the tenant's signing secret. The one before signs too until `former_until`.
    async fn replace_secret(
        &self,
        tenant: &Tenant,
        fresh: &SigningSecret,
        former_until: Timestamp,
    ) -> StoreResult<()>;
}
