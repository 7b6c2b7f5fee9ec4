//! The audit trail: who did what to which item, and when.
//!
//! An event is one row of JSON. Its hash covers the hash of the row before it, so a row that is
//! changed, removed or put in between breaks the chain at that place. Rows hold ids, never names
//! of patients or contents of files. [`mod@fhir`] shows a row as an AuditEvent of FHIR R4, in the form
//! of IHE BALP.
//!
//! Receipts of erasures name rows of the trail, and the store keeps the newest number and hash outside of it;
//! [`verify`] compares: a trail that was lost, or restored from an older copy, is not in order however whole its chain
//! is.
//!
//! Not guaranteed: somebody who can write to the database and to the files beside it can write the whole chain anew.
//! Against that, keep the newest hash in another place; `ventriform audit verify` prints it.

mod agent;
mod chain;
mod event;
mod fhir;
mod recorder;

pub use agent::Agent;
pub use chain::{AuditReport, BrokenLink, NO_HASH, chain_hash, verify};
pub use event::{
    Activity, Anchor, AuditEvent, AuditFilter, AuditLink, AuditRecord, KeptRow, Outcome,
};
pub use fhir::fhir;
pub use recorder::{NotRecorded, Recorder};
