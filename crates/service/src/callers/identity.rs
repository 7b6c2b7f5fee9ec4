//! Who sends a request.

use super::{Quota, Scope};
use crate::base::records::{Tenant, Timestamp};

/// Who sends a request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Whose items and jobs it sees.
    pub tenant: Tenant,
    /// The name of its key, the subject of its token, or `anonymous`.
    pub name: String,
    /// Its scope.
    pub scope: Scope,
    /// Id of its key.
    pub key: Option<String>,
    /// Limits that replace the general ones.
    pub quota: Quota,
    /// The keys that have made its key, its own maker first.
    pub makers: Makers,
    /// When its key or its token expires.
    pub expires_at: Option<Timestamp>,
    /// The subject of the issuer that sends it, or whose key it is.
    pub owner: Option<String>,
    /// Tells callers apart where requests are counted; `None` for the anonymous caller.
    pub account: Option<String>,
}

/// The keys that have made a key, one the other.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Makers {
    /// Whether a caller of the service has made it, with or without a key.
    pub any: bool,
    /// Their accounts and their own limits.
    pub keys: Vec<(String, Quota)>,
}

impl Identity {
    /// The limits on this caller where the operator's are `general`. Limits that the operator gave to a key replace
    /// them; a key that a caller has made has no more than the operator allowed the first in the row.
    pub fn limits(&self, general: Quota) -> Quota {
        let own = self.quota.or(general);
        if !self.makers.any {
            own
        } else {
            let first = self.makers.keys.last().map(|(_, quota)| *quota);
            own.within(first.unwrap_or_default().or(general))
        }
    }

    /// The accounts, besides its own, for which its requests count, with the requests that each may send.
    pub fn shared_accounts(&self) -> impl Iterator<Item = (&str, u64)> {
        let makers = self.makers.keys.iter();
        makers.filter_map(|(account, quota)| Some((account.as_str(), quota.requests?)))
    }
}
