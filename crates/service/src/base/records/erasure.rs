//! Erasing items, and the receipts that stay.

use super::{Cutoff, Tenant, Timestamp};
use serde::{Deserialize, Serialize};

/// An item to be erased.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ErasureOrder {
    /// Whose item.
    pub tenant: Tenant,
    /// The item's id.
    pub id: String,
    /// Whether to erase also what was made of it, and the jobs that worked on it.
    pub cascade: bool,
    /// Nothing is erased unless the item was last renewed before then.
    pub renewed_before: Option<Cutoff>,
    /// Who asks.
    pub by: ErasureAgent,
    /// Why it is erased.
    pub reason: ErasureReason,
}

/// Who erases an item, as the audit trail names it.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ErasureAgent {
    /// The name.
    pub name: String,
    /// Id of the key by which it is done.
    pub key: Option<String>,
    /// Network address.
    pub address: Option<String>,
    /// Id of the request.
    pub request: Option<String>,
}

impl ErasureAgent {
    /// The service itself, which erases what is older than the operator keeps it.
    pub fn retention() -> Self {
        Self {
            name: "retention".into(),
            ..Self::default()
        }
    }
}

/// Why an item is erased.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ErasureReason {
    /// A caller asked for it.
    Request,
    /// It reached the age that the operator has set.
    Retention,
}

/// The record of an erasure: item, time, agent. It holds no name that a tenant gave to an item.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Receipt {
    /// `ers_...`
    pub id: String,
    /// Whose item it was.
    pub tenant: Tenant,
    /// The item that was to be erased; [`SELECTED_VOLUMES`](super::SELECTED_VOLUMES) if volumes were selected.
    pub item: String,
    /// By what volumes were selected: names such as `study`, never their values.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub selected_by: Vec<String>,
    /// When it was erased.
    pub erased_at: Timestamp,
    /// The name of who asked.
    pub erased_by: String,
    /// The row of the audit trail that records it.
    pub audit: AuditMark,
    /// Why it was erased.
    pub reason: ErasureReason,
    /// The item, and what went with it.
    pub items: Vec<ErasedItem>,
    /// The jobs whose records went with it.
    pub jobs: Vec<String>,
}

/// A row of the audit trail.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct AuditMark {
    /// Its position in the chain.
    pub sequence: i64,
    /// Its hash, which the hashes of all later rows cover.
    pub hash: String,
}

/// One item of a [`Receipt`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErasedItem {
    /// Its id.
    pub id: String,
    /// Whether its files were erased; not if another tenant has the same content.
    pub files_erased: bool,
    /// Its files.
    pub files: Vec<ErasedFile>,
}

/// One file of an [`ErasedItem`].
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ErasedFile {
    /// Its name in the store.
    pub name: String,
    /// Its length in bytes.
    pub bytes: u64,
    /// SHA-256 of its content, hexadecimal.
    pub sha256: String,
}

/// The result of an order to erase an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Erased {
    /// It is erased. The files of the items of the receipt that no tenant has any more are yet to
    /// be deleted.
    Done(Box<Receipt>),
    /// A job that has not ended needs it.
    InUse,
    /// It, or something that would go with it, is on legal hold.
    OnHold {
        /// The item with the hold.
        id: String,
    },
    /// The tenant has no such item.
    Unknown,
}

/// An item beyond its age, and its place in the order of age, where the next page begins.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Expired {
    /// Whose it is.
    pub tenant: Tenant,
    /// Its id.
    pub id: String,
    /// From when its age counts.
    pub since: Timestamp,
    /// Its position in the order of filing.
    pub sequence: i64,
}
