//! Who sends a request.

use super::{Quota, Scope};
use crate::jobs::{Tenant, Timestamp};

/// Who sends a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Whose items and jobs it sees.
    pub tenant: Tenant,
    /// The name of its key, the subject of its token, or `anonymous`.
    pub name: String,
    /// What it may do.
    pub scope: Scope,
    /// Id of its key.
    pub key: Option<String>,
    /// Limits that replace the general ones.
    pub quota: Quota,
    /// When its key expires.
    pub expires_at: Option<Timestamp>,
    /// Tells callers apart where requests are counted; `None` for the anonymous caller.
    pub account: Option<String>,
}
