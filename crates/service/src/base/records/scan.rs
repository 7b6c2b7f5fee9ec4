//! Whose scan a volume is: what its file says of patient, study and acquisition, and what its tenant
//! states beside that.
//!
//! It belongs to the tenant's ownership of the volume and not to the content, which tenants share. It goes with the
//! ownership, can be erased by itself, and no result contains it.

use super::{FileRecord, StoreResult};
use super::{Tenant, Timestamp};
use async_trait::async_trait;
use serde_json::{Map, Value};
use std::fmt;

/// Names and values. Personal data: `Debug` shows none of it.
#[derive(Clone, Default, PartialEq)]
pub struct ScanFields(pub Map<String, Value>);

impl ScanFields {
    /// The text with that name.
    pub fn text(&self, name: &str) -> Option<&str> {
        self.0.get(name)?.as_str()
    }
}

impl fmt::Debug for ScanFields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ScanFields").finish_non_exhaustive()
    }
}

/// Whose scan a volume is, as one tenant knows it.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ScanIdentity {
    /// The fields in the file; `None` if it says nothing, or it was erased here.
    pub found: Option<ScanFields>,
    /// The fields that the tenant states.
    pub stated: Option<ScanFields>,
    /// When the tenant erased both.
    pub erased_at: Option<Timestamp>,
}

impl ScanIdentity {
    /// Whether nothing is known.
    pub fn is_empty(&self) -> bool {
        self.found.is_none() && self.stated.is_none()
    }

    /// The text with that name, as the file says or else as the tenant states.
    pub fn text(&self, name: &str) -> Option<&str> {
        let all = [&self.found, &self.stated];
        all.into_iter()
            .flatten()
            .find_map(|fields| fields.text(name))
    }

    /// All that is known, what the file says first.
    pub fn whole(&self) -> Map<String, Value> {
        let mut whole = Map::new();
        for (name, value) in [&self.found, &self.stated]
            .into_iter()
            .flatten()
            .flat_map(|f| &f.0)
        {
            whole.entry(name.clone()).or_insert_with(|| value.clone());
        }
        whole
    }
}

/// Which scans to list.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ScanFilter {
    /// Only those of the study with this Study Instance UID.
    pub study: Option<String>,
    /// Only those of the series with this Series Instance UID.
    pub series: Option<String>,
    /// Only those with this Accession Number.
    pub accession: Option<String>,
}

/// A volume whose scan a repair of the database has lost.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnreadScan {
    /// The place in the list of such volumes.
    pub sequence: i64,
    /// Whose volume.
    pub tenant: Tenant,
    /// Its id.
    pub volume: String,
    /// Its files.
    pub files: Vec<FileRecord>,
}

/// The table of scans. Every method is one transaction and fails only if the database does.
#[async_trait]
pub trait Scans: Send + Sync + 'static {
    /// The scan of a tenant's volume, as the tenant knows it; `None` if a repair has lost it and it was not read again
    /// yet, or the tenant has no such volume.
    async fn scan(&self, tenant: &Tenant, volume: &str) -> StoreResult<Option<ScanIdentity>>;

    /// Notes what the file of a tenant's volume says, unless that is known or erased.
    async fn note_scan(
        &self,
        tenant: &Tenant,
        volume: &str,
        found: Option<&ScanFields>,
    ) -> StoreResult<()>;

    /// Replaces what a tenant states. `false` if it has no such volume.
    async fn state_scan(
        &self,
        tenant: &Tenant,
        volume: &str,
        stated: &ScanFields,
    ) -> StoreResult<bool>;

    /// Erases all that a tenant knows of a scan, unless the volume is on legal hold. Returns whether
    /// nothing is known any more.
    async fn erase_scan(&self, tenant: &Tenant, volume: &str, now: Timestamp) -> StoreResult<bool>;

    /// At most `limit` volumes after position `after` whose scan a repair has lost.
    async fn unread_scans(&self, after: i64, limit: u32) -> StoreResult<Vec<UnreadScan>>;

    /// The secret from which the UIDs of a tenant's de-identified objects are derived. It is drawn
    /// when it is first asked for.
    async fn deidentification_secret(&self, tenant: &Tenant) -> StoreResult<Vec<u8>>;
}
