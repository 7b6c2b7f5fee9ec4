//! One event of the audit trail, and the rows that hold events.

use crate::base::records::{Tenant, Timestamp};
use serde::{Deserialize, Serialize};

/// The act.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activity {
    /// Something was stored: a volume, a template.
    Create,
    /// The content of an item was read.
    Read,
    /// A list was read.
    Search,
    /// An item was changed.
    Update,
    /// An item was erased, or a job cancelled.
    Delete,
    /// A job was filed.
    Execute,
    /// Credentials were refused.
    SignInRefused,
    /// A caller asked for more than its scope allows.
    AccessRefused,
    /// A key was made.
    KeyCreated,
    /// A key was revoked.
    KeyRevoked,
    /// The audit trail was read.
    AuditRead,
    /// Old rows of the audit trail were removed.
    AuditPruned,
    /// Events could not be written and are lost; `count` says how many.
    AuditGap,
    /// The operator admitted callers without credentials again.
    AccessOpened,
    /// A repair found that rows of a table are lost. The object is `TABLE` or, with the last row that was known,
    /// `TABLE:SEQUENCE:HASH`; `count` says how many rows at least.
    RowsLost,
    /// A repair gave an item to a tenant, or put it on hold, because who had it is not known for sure; or it removed
    /// the row of an item whose files are damaged. The object is the item, or a table of which `count` rows named what
    /// nobody has.
    Repaired,
    /// What a newer trail says was revoked and erased was done here too. The object is `SEQUENCE:HASH`, the end of
    /// that trail.
    TrailApplied,
}

impl Activity {
    /// The act of adding something: an update if it was there.
    pub fn of_added(new: bool) -> Self {
        if new { Self::Create } else { Self::Update }
    }
}

/// Its outcome.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// It was done.
    Success,
    /// It was refused.
    Refused,
}

/// An act. Its JSON is stored and hashed.
#[derive(Debug, Clone, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub struct AuditEvent {
    /// When it was recorded.
    pub recorded: Timestamp,
    /// The act.
    pub activity: Activity,
    /// Its outcome.
    pub outcome: Outcome,
    /// Whose items it concerns.
    pub tenant: Tenant,
    /// Who did it.
    pub agent: String,
    /// Id of the key by which it was done.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Network address of who did it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub address: Option<String>,
    /// Id of the item, or the plural of a kind for lists.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<String>,
    /// The request's `x-request-id`, if it was one request.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub request: Option<String>,
    /// The number of times that it was done within a second.
    pub count: u64,
}

impl AuditEvent {
    /// A successful act of `agent`, done once.
    pub fn new(recorded: Timestamp, activity: Activity, tenant: Tenant, agent: String) -> Self {
        Self {
            recorded,
            activity,
            outcome: Outcome::Success,
            tenant,
            agent,
            key: None,
            address: None,
            object: None,
            request: None,
            count: 1,
        }
    }

    /// Sets the item that it concerns.
    #[must_use]
    pub fn on(mut self, object: impl Into<String>) -> Self {
        self.object = Some(object.into());
        self
    }
}

/// One row of the trail.
#[derive(Debug, Clone, PartialEq)]
pub struct AuditRecord {
    /// Its position in the chain.
    pub sequence: i64,
    /// The act.
    pub event: AuditEvent,
    /// Its hash.
    pub hash: String,
}

/// Which rows to list; `None` lists all.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct AuditFilter {
    /// Rows of this tenant.
    pub tenant: Option<Tenant>,
    /// Rows of this agent.
    pub agent: Option<String>,
    /// Rows on this item.
    pub object: Option<String>,
    /// Rows recorded at or after this time.
    pub since: Option<Timestamp>,
    /// Rows recorded before this time.
    pub until: Option<Timestamp>,
}

/// A row as the check sees it: the stored text, not its meaning.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditLink {
    /// Its position.
    pub sequence: i64,
    /// The stored JSON.
    pub event: String,
    /// The stored hash.
    pub hash: String,
}

/// A row of the trail as another place names it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptRow {
    /// The place: the id of a receipt, or a file.
    pub place: String,
    /// Position of the row.
    pub sequence: i64,
    /// Its hash.
    pub hash: String,
}

/// The last row that was removed because of its age.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Anchor {
    /// Its position.
    pub sequence: i64,
    /// Its hash, which the next row's hash covers.
    pub hash: String,
}

impl Anchor {
    /// How the event that records a removal names the last row that was removed.
    pub fn name(&self) -> String {
        format!("{}:{}", self.sequence, self.hash)
    }
}
