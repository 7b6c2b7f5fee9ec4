//! Work items: Unified Procedure Steps (DICOM PS3.4 annex CC) as UPS-RS serves them (PS3.18
//! section 11), for tasks that others schedule and a performer carries out.
//!
//! In: data sets as DICOM JSON. Out: the changed [`Workitem`], or a [`Refusal`] with the words of the
//! standard.
//!
//! 1. [`Workitem::create`]: an item begins as SCHEDULED.
//! 2. [`Workitem::change_state`]: a performer claims it (IN PROGRESS) under a Transaction UID that
//!    it makes up. From then on every change must name that UID, until the performer ends the item
//!    as COMPLETED or CANCELED.
//! 3. [`Workitem::update`]: replaces attributes, such as progress.
//! 4. [`Workitem::request_cancel`]: cancels a scheduled item; asks the performer of a claimed one.
//! 5. `query`: which items match a search.
//! 6. [`Procedure`]: which items this service performs itself. It claims them ([`Workitem::claim`]), and
//!    ends them with what was made ([`Workitem::complete`]) or with a reason ([`Workitem::give_up`]).
//!
//! Guaranteed: an item that has ended never changes again, and the Transaction UID is never shown.
//!
//! Not done: subscriptions and event reports, which need a second connection to the client.

mod dataset;
mod perform;
mod procedure;
mod query;
mod storage;
mod time;
mod unknown;
mod workitem;

pub use dataset::{DataSetJson, Malformed};
pub use perform::WorkOutputObject;
pub use procedure::Procedure;
pub use query::{Matching, QueryError};
pub use storage::{AddedWorkitem, BATCH_BYTES, Worklist};
pub use time::{dicom_time, new_uid};
pub use workitem::{Change, Performer, Refusal, Workitem, WorkitemState};
