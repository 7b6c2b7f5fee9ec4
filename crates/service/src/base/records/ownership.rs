//! The record of an item that a tenant has: when it came, the tenant's own names for it, and
//! whether it may be erased.
//!
//! Content is stored once, however many tenants have it. Each has a [`Ownership`] of its own, and
//! sees neither the others nor what they call the item.

use super::{ScanFilter, ScanIdentity, ScanSearch};
use super::{Tenant, Timestamp};
use std::collections::BTreeMap;
use std::ops::Deref;

/// A tenant's own names for an item or a job, by which it is searched.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Tags {
    /// The item's id in the tenant's own system.
    pub external_id: Option<String>,
    /// Names and values.
    pub labels: BTreeMap<String, String>,
}

/// Why an item must not be erased, whatever its age and whoever asks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LegalHold {
    /// The reason, as the caller gave it.
    pub reason: String,
    /// Since when.
    pub since: Timestamp,
    /// The name of the caller.
    pub by: String,
}

impl LegalHold {
    /// Longest reason, characters.
    pub const REASON_LENGTH: usize = 1000;
}

/// That a tenant has an item.
#[derive(Debug, Clone, PartialEq)]
pub struct Ownership {
    /// The tenant.
    pub tenant: Tenant,
    /// When it first stored or computed the item.
    pub created_at: Timestamp,
    /// When it last stored, computed or used the item; retention counts from here.
    pub renewed_at: Timestamp,
    /// Its names for the item.
    pub tags: Tags,
    /// Its legal hold on the item.
    pub legal_hold: Option<LegalHold>,
    /// Whether a volume that the item was made of is on legal hold.
    pub source_on_hold: bool,
    /// Whose scan it is, or the volume that it was made of.
    pub scan: ScanIdentity,
    /// Whether every `model=auto` of the tenant fits the item; templates only.
    pub library: bool,
}

/// An item as one tenant has it.
#[derive(Debug, Clone, PartialEq)]
pub struct Owned<T> {
    /// The item. Its sequence number and time of creation are the tenant's.
    pub item: T,
    /// The tenant's record of it.
    pub ownership: Ownership,
}

impl<T> Deref for Owned<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.item
    }
}

/// Which items or jobs of a tenant to list, by its own names for them.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct TagFilter {
    /// Only those with this external id.
    pub external_id: Option<String>,
    /// Only those with all of these labels.
    pub labels: BTreeMap<String, String>,
}

/// Which items of a tenant to list.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ItemFilter {
    /// Only those with these tags.
    pub tags: TagFilter,
    /// Only those of these scans, or made of them.
    pub scan: ScanFilter,
    /// Of volumes, which of them and in which order: [`ScanLists`](super::ScanLists) alone reads it.
    pub search: ScanSearch,
}
