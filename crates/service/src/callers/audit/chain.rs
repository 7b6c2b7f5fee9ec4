//! The chain of hashes, and its check.

use super::event::{Activity, Anchor, AuditEvent, KeptRow};
use crate::base::records::{StoreResult, hex};
use crate::callers::AccessStore;
use sha2::{Digest, Sha256};

/// The hash before the first row.
pub const NO_HASH: &str = "0000000000000000000000000000000000000000000000000000000000000000";

/// Rows that the check reads at a time.
const BATCH_ROWS: u32 = 1000;

/// SHA-256 of the hash before it, the position and the text of a row, in hexadecimal digits.
pub fn chain_hash(previous: &str, sequence: i64, event: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(previous.as_bytes());
    hash.update(sequence.to_be_bytes());
    hash.update(event.as_bytes());
    hex(&hash.finalize())
}

/// The first place where the chain is broken.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum BrokenLink {
    /// Rows are missing.
    #[error("the rows {first} to {last} are missing")]
    Missing {
        /// The first missing row.
        first: i64,
        /// The last.
        last: i64,
    },
    /// A row does not have the hash that the rows before it and its content give.
    #[error("row {0} was changed: its hash does not follow from its content and the row before it")]
    Changed(i64),
    /// Rows were removed, and no event of the chain says so.
    #[error("the rows up to {0} were removed, but no event of the trail says so")]
    UnrecordedRemoval(i64),
    /// Another place names a row that the trail does not have.
    #[error(
        "{place} names row {sequence} with the hash {hash}, which the trail does not have: rows are lost, or the \
         database is an older copy"
    )]
    Unconfirmed {
        /// The place: the id of a receipt, or what keeps the newest row.
        place: String,
        /// Position of the row.
        sequence: i64,
        /// Its hash there.
        hash: String,
    },
}

impl From<&KeptRow> for BrokenLink {
    fn from(kept: &KeptRow) -> Self {
        Self::Unconfirmed {
            place: kept.place.clone(),
            sequence: kept.sequence,
            hash: kept.hash.clone(),
        }
    }
}

/// The result of the check.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AuditReport {
    /// Rows that were checked.
    pub rows: u64,
    /// Position of the newest row.
    pub newest: i64,
    /// Hash of the newest row: to be kept in another place.
    pub head: String,
    /// The first place where the chain is broken, if it is; else what other places say and the chain does not.
    pub broken: Option<BrokenLink>,
    /// The rows that other places name and the trail lacks.
    pub unconfirmed: Vec<KeptRow>,
}

/// Walks the chain from the oldest row that is kept to the newest, and compares it with what other places say of it.
///
/// # Errors
/// If the database fails.
pub async fn verify(store: &dyn AccessStore) -> StoreResult<AuditReport> {
    let anchor = store.anchor().await?;
    let (mut sequence, mut head) = match &anchor {
        Some(anchor) => (anchor.sequence, anchor.hash.clone()),
        None => (0, NO_HASH.to_owned()),
    };
    let removal = anchor.as_ref().map(Anchor::name);
    let mut removal_recorded = anchor.is_none();
    let mut rows = 0;
    let broken = 'chain: loop {
        let links = store.links(sequence, BATCH_ROWS).await?;
        if links.is_empty() {
            break None;
        }
        for link in links {
            if link.sequence != sequence + 1 {
                break 'chain Some(BrokenLink::Missing {
                    first: sequence + 1,
                    last: link.sequence - 1,
                });
            }
            if link.hash != chain_hash(&head, link.sequence, &link.event) {
                break 'chain Some(BrokenLink::Changed(link.sequence));
            }
            if !removal_recorded {
                removal_recorded = records(&link.event, removal.as_deref());
            }
            (sequence, head) = (link.sequence, link.hash);
            rows += 1;
        }
    };
    let unconfirmed = store.unconfirmed().await?;
    let greatest = store.greatest_sequence().await?;
    let broken = broken.or_else(|| {
        if greatest > sequence {
            Some(BrokenLink::Missing {
                first: sequence + 1,
                last: greatest,
            })
        } else {
            let anchor = anchor.filter(|_| !removal_recorded)?;
            Some(BrokenLink::UnrecordedRemoval(anchor.sequence))
        }
    });
    let broken = broken.or_else(|| unconfirmed.first().map(BrokenLink::from));
    Ok(AuditReport {
        rows,
        newest: sequence,
        head,
        broken,
        unconfirmed,
    })
}

/// Whether the event says that the rows up to `removal` were removed.
fn records(event: &str, removal: Option<&str>) -> bool {
    let event: Option<AuditEvent> = serde_json::from_str(event).ok();
    event.is_some_and(|event| {
        event.activity == Activity::AuditPruned && event.object.as_deref() == removal
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hash_covers_everything_before_it() {
        let hash = chain_hash(NO_HASH, 1, "{}");
        assert_eq!(hash.len(), NO_HASH.len());
        assert_ne!(hash, chain_hash(NO_HASH, 2, "{}"));
        assert_ne!(hash, chain_hash(NO_HASH, 1, "{ }"));
        assert_ne!(hash, chain_hash(&hash, 1, "{}"));
    }
}
