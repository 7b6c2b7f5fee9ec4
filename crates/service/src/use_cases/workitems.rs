//! Work items of other systems: created, searched, changed.
//!
//! What a work item allows in each state is decided in [`crate::network::worklist`]; here it is read, changed and stored,
//! again if another change came before.

use crate::base::dicom_tags::PROCEDURE_STEP_STATE;
use crate::base::error::{self, ServiceError, ServiceResult};
use crate::base::memory::{charge, end_rows, read_row};
use crate::base::records::{Failure, Fault, Tenant, Timestamp};
use crate::callers::Agent;
use crate::config::Size;
use crate::limits::quotas::Counting;
use crate::network::worklist::{
    AddedWorkitem, Change, DataSetJson, Matching, Refusal, Workitem, WorkitemState, dicom_time,
};
use crate::use_cases::service::Service;
use std::time::{Duration, Instant};
use ventriform::base::progress::{Monitor, Stage};

/// Most items of a tenant.
const MAX_WORKITEMS: u64 = 100_000;

/// Items read from the table at a time.
const BATCH_ITEMS: u32 = 200;

/// Bytes of a page of items, unless one alone has more.
const ANSWER_BYTES: usize = 2 << 20;

/// Memory of a search: a batch of items, parsed, and the answer.
const SEARCH_MEMORY: u64 = 20 << 20;

/// Longest search.
const LONGEST_SEARCH: Duration = Duration::from_secs(10);

/// Attempts at a change that another one came before.
const CHANGE_TRIES: u32 = 20;

/// Pause before the second try of a change; it grows by as much with each further one, so that the tries
/// of many requests spread.
const CHANGE_PAUSE: Duration = Duration::from_millis(2);

/// What came of a change.
pub enum ChangedWorkitem {
    /// It was made, or the item was so already.
    Done(Change),
    /// The tenant has no such item.
    Unknown,
    /// The state of the item, or what is asked for, does not allow it.
    Refused(Refusal),
    /// The item would be larger than a request's JSON may be.
    TooLarge(Size),
}

/// The items that a search finds.
pub struct FoundWorkitems {
    /// A JSON array of their attributes; empty if there is none.
    pub text: String,
    /// Whether there are more than one answer holds.
    pub more: bool,
}

impl Service {
    /// Adds a work item. Returns whether absent attributes got neutral values, or why the attributes cannot be used.
    ///
    /// # Errors
    /// `workitem-exists`; `too-many-workitems`; `storage-quota`.
    pub async fn create_workitem(
        &self,
        by: &Agent,
        uid: &str,
        attributes: DataSetJson,
        counting: &Counting,
    ) -> ServiceResult<Result<bool, Refusal>> {
        counting.arrived(stored_bytes(&attributes)? as u64).await?;
        let now = self.now();
        let made = Workitem::create(by.tenant(), uid, attributes, (now, &dicom_time(now)));
        let (item, completed) = match made {
            Ok(made) => made,
            Err(refusal) => return Ok(Err(refusal)),
        };
        let worklist = self.worklist.clone();
        let add = async move { worklist.add_workitem(&item, MAX_WORKITEMS).await };
        match by.change(add).await? {
            AddedWorkitem::Done => self.scheduled.notify_one(),
            AddedWorkitem::Exists => return Err(exists()),
            AddedWorkitem::Full => return Err(too_many()),
        }
        Ok(Ok(completed))
    }

    /// The tenant's work item of that UID.
    pub async fn workitem(&self, tenant: &Tenant, uid: &str) -> ServiceResult<Option<Workitem>> {
        read_row(|bytes| self.worklist.workitem_within(tenant, uid, bytes)).await
    }

    /// Replaces attributes of a tenant's work item, which needs the Transaction UID under which it is claimed.
    ///
    /// # Errors
    /// As [`Service::change_workitem`], and if the tenant's quota is full.
    pub async fn update_workitem(
        &self,
        by: &Agent,
        uid: &str,
        transaction: Option<&str>,
        changes: &DataSetJson,
        counting: &Counting,
    ) -> ServiceResult<ChangedWorkitem> {
        counting.arrived(stored_bytes(changes)? as u64).await?;
        let update = |item: &mut Workitem, now: (Timestamp, &str)| {
            item.update(transaction, changes.clone(), now)?;
            Ok(Change::Done)
        };
        let changed = self.change_workitem(by, uid, update).await?;
        if matches!(changed, ChangedWorkitem::Done(_)) {
            // It may be ready now.
            self.scheduled.notify_one();
        }
        Ok(changed)
    }

    /// Changes a tenant's work item, again if another change came before. `how` gets the time, also as DICOM writes it.
    ///
    /// # Errors
    /// `busy` if others change it all the time; if the database fails.
    pub async fn change_workitem(
        &self,
        by: &Agent,
        uid: &str,
        how: impl Fn(&mut Workitem, (Timestamp, &str)) -> Result<Change, Refusal>,
    ) -> ServiceResult<ChangedWorkitem> {
        for tried in 0..CHANGE_TRIES {
            tokio::time::sleep(CHANGE_PAUSE * tried).await;
            let Some(mut item) = self.workitem(by.tenant(), uid).await? else {
                return Ok(ChangedWorkitem::Unknown);
            };
            let now = self.now();
            let before = stored_bytes(&item.attributes)?;
            let done = match how(&mut item, (now, &dicom_time(now))) {
                Ok(done) => done,
                Err(refusal) => return Ok(ChangedWorkitem::Refused(refusal)),
            };
            let (size, limit) = (stored_bytes(&item.attributes)?, self.settings.json_limit);
            if size > before && size as u64 > limit.0 {
                return Ok(ChangedWorkitem::TooLarge(limit));
            }
            if done == Change::Already {
                return Ok(ChangedWorkitem::Done(done));
            }
            let worklist = self.worklist.clone();
            let change = async move { worklist.change_workitem(&item).await };
            if by.change(change).await? {
                return Ok(ChangedWorkitem::Done(done));
            }
            // It is read anew.
            end_rows(0).await;
        }
        Err(ServiceError::contended("this work item"))
    }

    /// The tenant's work items that match, oldest first: at most `limit` after the first `skip`.
    ///
    /// # Errors
    /// `search-too-broad` if the search takes too long; if the database fails, or there is no memory for it.
    pub async fn search_workitems(
        &self,
        tenant: &Tenant,
        matching: &Matching,
        mut skip: usize,
        limit: usize,
    ) -> ServiceResult<FoundWorkitems> {
        charge(SEARCH_MEMORY).await?;
        let state = matching
            .wanted(PROCEDURE_STEP_STATE)
            .and_then(WorkitemState::parse);
        let late = Instant::now() + LONGEST_SEARCH;
        let (mut text, mut count, mut after, mut more) = (String::new(), 0, 0, false);
        'search: while count < limit {
            if Instant::now() > late {
                return Err(too_broad());
            }
            let page = self.worklist.workitems(tenant, state, after, BATCH_ITEMS);
            let page = page.await?;
            let Some(last) = page.last() else { break };
            after = last.sequence;
            for item in self.matched(matching, page).await? {
                if skip > 0 {
                    skip -= 1;
                    continue;
                }
                if count == limit {
                    break 'search;
                }
                let item = serde_json::to_string(item.shown()).map_err(ServiceError::internal)?;
                if count > 0 && text.len() + item.len() > ANSWER_BYTES {
                    more = true;
                    break 'search;
                }
                text.push(match count {
                    0 => '[',
                    _ => ',',
                });
                text.push_str(&item);
                count += 1;
            }
        }
        if count > 0 {
            text.push(']');
        }
        Ok(FoundWorkitems { text, more })
    }

    /// The items that match. Wildcards may be compared with much text, so that takes turns with what is decoded.
    async fn matched(
        &self,
        matching: &Matching,
        items: Vec<Workitem>,
    ) -> ServiceResult<Vec<Workitem>> {
        let is_match = |item: &Workitem, matching: &Matching| matching.matches(item.shown());
        if !matching.has_patterns() {
            let matched = items.into_iter().filter(|item| is_match(item, matching));
            return Ok(matched.collect());
        }
        let matching = matching.clone();
        let search = move |monitor: &Monitor<'_>| {
            let going_on = |_: &Workitem| monitor.report(Stage::Read, 0.0).is_ok();
            let items = items.into_iter().take_while(going_on);
            items.filter(|item| is_match(item, &matching)).collect()
        };
        self.decoding.run(1, search).await
    }
}

/// The length of an item's attributes as they are stored, bytes.
fn stored_bytes(attributes: &DataSetJson) -> ServiceResult<usize> {
    let text = serde_json::to_string(attributes.object());
    Ok(text.map_err(ServiceError::internal)?.len())
}

fn exists() -> ServiceError {
    let detail = "There is a work item of this UID.";
    let fix = "Give another UID, or none: then the service makes one.";
    let failure = Failure::new(Fault::Request, "workitem-exists", detail).fix(fix);
    ServiceError::new(error::Refusal::Conflict, failure)
}

fn too_many() -> ServiceError {
    let detail = format!("There are {MAX_WORKITEMS} work items.");
    let fix = "Set `job_retention`, so that ended items are deleted.";
    let failure = Failure::new(Fault::Request, "too-many-workitems", detail).fix(fix);
    ServiceError::new(error::Refusal::NoRoom, failure)
}

/// PS3.18, table 8.3.4-1.
fn too_broad() -> ServiceError {
    let detail = format!(
        "The search has not ended within {} seconds.",
        LONGEST_SEARCH.as_secs()
    );
    let fix = "Name the state, as in ProcedureStepState=SCHEDULED, or ask for fewer items by `limit` and `offset`.";
    Failure::new(Fault::TooLarge, "search-too-broad", detail)
        .fix(fix)
        .into()
}
