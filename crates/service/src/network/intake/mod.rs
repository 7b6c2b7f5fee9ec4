//! Images that other systems send: a C-STORE SCP, and what STOW-RS and it share.
//!
//! In: DICOM objects over associations (PS3.7, PS3.8) or HTTP. Out: stored volumes, and the jobs that
//! rules ask for.
//!
//! 1. [`Listener`] accepts connections; each becomes an association, if the caller is one of the
//!    operator's [`Sender`]s. [`Wire`](wire) reads PDUs within limits; the contexts are negotiated to the
//!    SOP classes and transfer syntaxes that [`ventriform::image::volume`] reads.
//! 2. [`Receiver`] takes one object: its bytes go to the disk as they come, its header is checked ([`HeaderTurns`]),
//!    and its row is committed ([`IntakeStore`]). Only then the sender is told that it is stored.
//! 3. [`Gatherer`] waits until a group of objects is complete: at once for an object that is a volume of
//!    its own; for a series of slices, when the association is released and nothing more has come
//!    for a while. Then it makes the volume and files the job of the first [`Rule`] that matches, by
//!    a [`VolumeMaker`].
//!
//! Guaranteed: an object that was acknowledged is on disk, with its row, and survives a crash; the same
//! object is stored once, however often it is sent; a job is started once for what was sent; an
//! association, whatever it sends, takes no more memory than one PDU of the set length beside the
//! buffers of one file, and no more time than set; a series that cannot be read is kept for a set time
//! and shown with the reason.
//!
//! Several processes that share a store each watch the groups that they receive; what a process that has
//! ended leaves is taken on by one of the others.
//!
//! Not guaranteed: that a series is complete. A sender that stops in the middle and comes back after the
//! set time makes a second volume, of all slices.
//!
//! | where | what |
//! |---|---|
//! | `record` | groups and objects, the traits that a database and a file store implement |
//! | `receive` | one object: from bytes to a row |
//! | `gather`, `session` | when a group is complete, and what is done then |
//! | `rules`, `senders` | what the operator configures: jobs to start, systems to trust |
//! | `wire`, `negotiate`, `command` | PDUs, presentation contexts, DIMSE commands |
//! | `association`, `service`, `listener` | one association; what all share; all of them |

mod association;
mod command;
mod gather;
mod listener;
mod negotiate;
mod observer;
mod receive;
mod record;
mod rules;
mod senders;
mod service;
mod session;
mod wire;

pub use gather::{GatherSettings, Gatherer, VolumeMaker};
pub use listener::{Listener, TlsConfiguration};
pub use observer::{AssociationEnd, IntakeObserver};
pub use receive::{
    HeaderTurns, HeaderWork, Incoming, ReceiveError, Receiver, ReceiverSettings, Refused, Stated,
};
pub use record::{
    Added, GROUP_PREFIX, GroupState, IncomingFile, IntakeGroup, IntakeRoom, IntakeStore, NewObject,
    Origin, Protocol, ReceivedFiles, ReceivedObject,
};
pub use rules::Rule;
pub use senders::{AeTitle, Sender, Senders};
pub use service::ScpSettings;
pub use session::{RecordedGroups, Session, Sessions, Waits};
pub use wire::{WireError, decode};

use std::sync::Arc;

/// The reception of objects.
pub struct Intake {
    /// Takes objects.
    pub(crate) receiver: Arc<Receiver>,
    /// The groups that wait.
    pub(crate) sessions: Arc<Sessions>,
    /// The tables.
    pub(crate) store: Arc<dyn IntakeStore>,
    /// The files.
    pub(crate) files: Arc<dyn ReceivedFiles>,
}
