//! The way to and from the hospital's archive (PACS): scans are fetched from it, results are sent
//! back.
//!
//! In: the archives of the settings ([`Archive`]), and jobs that name one. Out: a stored volume for
//! each job with a source, and the objects of its result in the archive.
//!
//! | where | what |
//! |---|---|
//! | `archive` | an archive as the operator describes it |

mod archive;

pub use archive::{Archive, ArchiveFault, Archives, Credentials, DicomPeer};
