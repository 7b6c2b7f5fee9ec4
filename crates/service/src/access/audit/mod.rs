//! The audit trail: who did what to which item, and when.
//!
//! An event is one row of JSON. Its hash covers the hash of the row before it, so a row that is
//! changed, removed or put in between breaks the chain at that place. Rows hold ids, never names
//! of patients or contents of files. [`mod@fhir`] shows a row as an AuditEvent of FHIR R4, in the form
//! of IHE BALP.
//!
//! Not guaranteed: somebody who can write to the database file can write the whole chain anew.
//! Against that, keep the newest hash in another place; `ventriform audit verify` prints it.

mod agent;
mod chain;
mod event;
mod fhir;
mod recorder;

pub use agent::Agent;
pub use chain::{AuditReport, BrokenLink, NO_HASH, chain_hash, verify};
pub use event::{Activity, Anchor, AuditEvent, AuditFilter, AuditLink, AuditRecord, Outcome};
pub use fhir::fhir;
pub use recorder::{NotRecorded, Recorder};
