//! One work item and what may be done to it in each state.

use super::dataset::DataSetJson;
use crate::base::dicom_tags::{
    CONTACT_DISPLAY_NAME, CONTACT_URI, INPUT_INFORMATION_SEQUENCE, INPUT_READINESS_STATE,
    OUTPUT_INFORMATION_SEQUENCE, PERFORMED_PROCEDURE_STEP_END_DATE_TIME,
    PERFORMED_PROCEDURE_STEP_START_DATE_TIME, PERFORMED_STATION_NAME_CODE_SEQUENCE,
    PERFORMED_WORKITEM_CODE_SEQUENCE, PROCEDURE_STEP_CANCELLATION_DATE_TIME,
    PROCEDURE_STEP_DISCONTINUATION_REASON_CODE_SEQUENCE, PROCEDURE_STEP_LABEL,
    PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE, PROCEDURE_STEP_STATE, REASON_FOR_CANCELLATION,
    SCHEDULED_PROCEDURE_STEP_MODIFICATION_DATE_TIME, SCHEDULED_PROCEDURE_STEP_PRIORITY,
    SOP_CLASS_UID, SOP_INSTANCE_UID, TRANSACTION_UID,
    UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE,
};
use crate::base::records::{Tenant, Timestamp};
use serde_json::{Map, Value};

/// The SOP class Unified Procedure Step Push.
const UPS_PUSH_CLASS: &str = "1.2.840.10008.5.1.4.34.6.1";

/// Attributes that an item of the Performed Procedure Sequence must have when the work is completed
/// (PS3.4 table CC.2.5-3, final state).
const FINAL_ATTRIBUTES: [(&str, &str); 5] = [
    (
        PERFORMED_STATION_NAME_CODE_SEQUENCE,
        "Performed Station Name Code Sequence",
    ),
    (
        PERFORMED_PROCEDURE_STEP_START_DATE_TIME,
        "Performed Procedure Step Start DateTime",
    ),
    (
        PERFORMED_WORKITEM_CODE_SEQUENCE,
        "Performed Workitem Code Sequence",
    ),
    (
        PERFORMED_PROCEDURE_STEP_END_DATE_TIME,
        "Performed Procedure Step End DateTime",
    ),
    (OUTPUT_INFORMATION_SEQUENCE, "Output Information Sequence"),
];

/// The attributes of a cancellation request that are passed on to the performer.
const CANCELLATION_TAGS: [&str; 4] = [
    REASON_FOR_CANCELLATION,
    PROCEDURE_STEP_DISCONTINUATION_REASON_CODE_SEQUENCE,
    CONTACT_URI,
    CONTACT_DISPLAY_NAME,
];

/// The state of a work item.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkitemState {
    /// It waits for a performer.
    Scheduled,
    /// A performer has claimed it.
    InProgress,
    /// Done.
    Completed,
    /// Given up.
    Canceled,
}

impl WorkitemState {
    /// Every state.
    pub const ALL: [Self; 4] = [
        Self::Scheduled,
        Self::InProgress,
        Self::Completed,
        Self::Canceled,
    ];

    /// The value of Procedure Step State (0074,1000).
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Scheduled => "SCHEDULED",
            Self::InProgress => "IN PROGRESS",
            Self::Completed => "COMPLETED",
            Self::Canceled => "CANCELED",
        }
    }

    /// The state with that value.
    pub fn parse(text: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|state| state.as_str() == text)
    }

    /// Whether the item can change no more.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Completed | Self::Canceled)
    }
}

/// Why a request about a work item is refused.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// An attribute is missing or has a value that it must not have.
    #[error("{name} ({tag}): {reason}")]
    Attribute {
        /// Tag.
        tag: &'static str,
        /// Name.
        name: &'static str,
        /// The fault.
        reason: &'static str,
    },
    /// The request names no Transaction UID, and the item is claimed.
    #[error("The Transaction UID is missing.")]
    NoTransaction,
    /// The request names another Transaction UID than that by which the item was claimed.
    #[error("The Transaction UID is incorrect.")]
    OtherTransaction,
    /// The item's state does not allow it.
    #[error("The submitted request is inconsistent with the current state of the UPS Instance.")]
    State {
        /// The state.
        state: WorkitemState,
    },
    /// An attribute that the final state needs is missing.
    #[error(
        "The submitted request does not meet the requirements of the requested state: {0} is missing."
    )]
    Unfinished(&'static str),
}

/// The effect of a permitted request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// It was carried out.
    Done,
    /// The item was in that state already.
    Already,
}

/// The work of this service on an item.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Performer {
    /// This service has not claimed the item.
    None,
    /// It has claimed the item; the job is not filed yet.
    Claimed,
    /// The job of that id does the work.
    Job(String),
}

/// A work item of a tenant.
#[derive(Debug, Clone, PartialEq)]
pub struct Workitem {
    /// Whose item it is.
    pub tenant: Tenant,
    /// SOP Instance UID.
    pub uid: String,
    /// Position in the order of creation; 0 before it is stored.
    pub sequence: i64,
    /// Increases with every change.
    pub revision: i64,
    /// Procedure Step State.
    pub state: WorkitemState,
    /// The Transaction UID under which it was claimed.
    pub transaction: Option<String>,
    /// The work of this service on it.
    pub performer: Performer,
    /// All attributes but the Transaction UID.
    pub attributes: DataSetJson,
    /// When it was last changed.
    pub changed_at: Timestamp,
}

impl Workitem {
    /// A new item with the identifier `uid`. Attributes that a schedule needs and that are absent get
    /// the standard's neutral values; also returns whether there were any.
    ///
    /// # Errors
    /// [`Refusal::Attribute`] if the attributes are not those of a scheduled item.
    pub fn create(
        tenant: &Tenant,
        uid: &str,
        mut attributes: DataSetJson,
        now: (Timestamp, &str),
    ) -> Result<(Self, bool), Refusal> {
        let wrong = |tag, name, reason| Err(Refusal::Attribute { tag, name, reason });
        match attributes.text(PROCEDURE_STEP_STATE) {
            Some("SCHEDULED") => {}
            _ => {
                return wrong(
                    PROCEDURE_STEP_STATE,
                    "Procedure Step State",
                    "must be SCHEDULED",
                );
            }
        }
        if attributes.has_value(TRANSACTION_UID) {
            return wrong(
                TRANSACTION_UID,
                "Transaction UID",
                "must be empty in a new item",
            );
        }
        if attributes.has_value(UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE) {
            let name = "Performed Procedure Sequence";
            return wrong(
                UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE,
                name,
                "must be empty in a new item",
            );
        }
        if attributes
            .text(SOP_INSTANCE_UID)
            .is_some_and(|own| own != uid)
        {
            let reason = "differs from the UID in the path";
            return wrong(SOP_INSTANCE_UID, "SOP Instance UID", reason);
        }
        match attributes.text(SCHEDULED_PROCEDURE_STEP_PRIORITY) {
            None | Some("HIGH" | "MEDIUM" | "LOW") => {}
            _ => {
                let name = "Scheduled Procedure Step Priority";
                return wrong(
                    SCHEDULED_PROCEDURE_STEP_PRIORITY,
                    name,
                    "must be HIGH, MEDIUM or LOW",
                );
            }
        }
        match attributes.text(INPUT_READINESS_STATE) {
            None | Some("READY" | "UNAVAILABLE" | "INCOMPLETE") => {}
            _ => {
                let reason = "must be READY, UNAVAILABLE or INCOMPLETE";
                return wrong(INPUT_READINESS_STATE, "Input Readiness State", reason);
            }
        }
        let mut completed = false;
        for (tag, vr, neutral) in [
            (SCHEDULED_PROCEDURE_STEP_PRIORITY, "CS", "MEDIUM"),
            (INPUT_READINESS_STATE, "CS", "READY"),
            (PROCEDURE_STEP_LABEL, "LO", "Work item"),
        ] {
            if attributes.text(tag).is_none() {
                attributes.put(tag, vr, neutral);
                completed = true;
            }
        }
        if !attributes.has(INPUT_INFORMATION_SEQUENCE) {
            let empty = Map::from_iter([("vr".to_owned(), Value::from("SQ"))]);
            let element =
                Map::from_iter([(INPUT_INFORMATION_SEQUENCE.to_owned(), Value::from(empty))]);
            attributes.replace(DataSetJson::from_object(element).unwrap_or_default());
            completed = true;
        }
        attributes.remove(TRANSACTION_UID);
        attributes.put(SOP_CLASS_UID, "UI", UPS_PUSH_CLASS);
        attributes.put(SOP_INSTANCE_UID, "UI", uid);
        let mut item = Self {
            tenant: tenant.clone(),
            uid: uid.to_owned(),
            sequence: 0,
            revision: 0,
            state: WorkitemState::Scheduled,
            transaction: None,
            performer: Performer::None,
            attributes,
            changed_at: 0,
        };
        item.stamp(now);
        Ok((item, completed))
    }

    /// Replaces attributes. A claimed item needs the Transaction UID of its claim.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn update(
        &mut self,
        transaction: Option<&str>,
        mut changes: DataSetJson,
        now: (Timestamp, &str),
    ) -> Result<(), Refusal> {
        self.require(transaction)?;
        if self.state.is_final() {
            return Err(Refusal::State { state: self.state });
        }
        for (tag, name) in [
            (PROCEDURE_STEP_STATE, "Procedure Step State"),
            (SOP_CLASS_UID, "SOP Class UID"),
            (SOP_INSTANCE_UID, "SOP Instance UID"),
        ] {
            let same = changes.text(tag) == self.attributes.text(tag);
            if changes.has_value(tag) && !same {
                let reason = "cannot be changed by an update";
                return Err(Refusal::Attribute { tag, name, reason });
            }
            changes.remove(tag);
        }
        changes.remove(TRANSACTION_UID);
        self.attributes.replace(changes);
        self.stamp(now);
        Ok(())
    }

    /// Claims or ends the item, for the performer with that Transaction UID.
    ///
    /// # Errors
    /// [`Refusal`].
    pub fn change_state(
        &mut self,
        transaction: Option<&str>,
        wanted: WorkitemState,
        now: (Timestamp, &str),
    ) -> Result<Change, Refusal> {
        use WorkitemState::{Canceled, Completed, InProgress, Scheduled};
        let Some(transaction) = transaction else {
            return Err(Refusal::NoTransaction);
        };
        match (self.state, wanted) {
            (Scheduled, InProgress) => self.transaction = Some(transaction.to_owned()),
            (InProgress, Completed | Canceled) => {
                self.require(Some(transaction))?;
                if wanted == Completed {
                    self.require_results()?;
                }
            }
            (Completed, Completed) | (Canceled, Canceled) => {
                self.require(Some(transaction))?;
                return Ok(Change::Already);
            }
            (state, _) => return Err(Refusal::State { state }),
        }
        self.enter(wanted, now);
        Ok(Change::Done)
    }

    /// Cancels a scheduled item. Of a claimed one, notes the request where its performer sees it: in
    /// the Procedure Step Progress Information.
    ///
    /// # Errors
    /// [`Refusal::State`] if the item is completed.
    pub fn request_cancel(
        &mut self,
        details: &DataSetJson,
        now: (Timestamp, &str),
    ) -> Result<Change, Refusal> {
        match self.state {
            WorkitemState::Canceled => return Ok(Change::Already),
            WorkitemState::Completed => return Err(Refusal::State { state: self.state }),
            WorkitemState::Scheduled | WorkitemState::InProgress => {}
        }
        let known = self
            .attributes
            .items(PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE)
            .next()
            .cloned();
        let mut progress = DataSetJson::from_object(known.unwrap_or_default()).unwrap_or_default();
        for tag in CANCELLATION_TAGS {
            if let Some(element) = details.object().get(tag) {
                let element = Map::from_iter([(tag.to_owned(), element.clone())]);
                progress.replace(DataSetJson::from_object(element).unwrap_or_default());
            }
        }
        progress.put(PROCEDURE_STEP_CANCELLATION_DATE_TIME, "DT", now.1);
        self.attributes.put_item(
            PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE,
            progress.object().clone(),
        );
        match self.state {
            WorkitemState::Scheduled => self.enter(WorkitemState::Canceled, now),
            _ => self.stamp(now),
        }
        Ok(Change::Done)
    }

    /// The item as it is shown: without the Transaction UID.
    pub fn shown(&self) -> &Map<String, Value> {
        self.attributes.object()
    }

    fn require(&self, transaction: Option<&str>) -> Result<(), Refusal> {
        match (&self.transaction, transaction) {
            (None, _) => Ok(()),
            (Some(_), None) => Err(Refusal::NoTransaction),
            (Some(own), Some(given)) if own == given => Ok(()),
            _ => Err(Refusal::OtherTransaction),
        }
    }

    fn require_results(&self) -> Result<(), Refusal> {
        let performed = self
            .attributes
            .items(UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE)
            .next();
        let Some(performed) = performed else {
            return Err(Refusal::Unfinished(
                "Unified Procedure Step Performed Procedure Sequence",
            ));
        };
        match FINAL_ATTRIBUTES
            .iter()
            .find(|(tag, _)| !performed.contains_key(*tag))
        {
            Some((_, name)) => Err(Refusal::Unfinished(name)),
            None => Ok(()),
        }
    }

    fn enter(&mut self, state: WorkitemState, now: (Timestamp, &str)) {
        self.state = state;
        self.stamp(now);
    }

    /// Notes state and time in the attributes. `now` is the time, also as DICOM writes it (DT).
    pub(super) fn stamp(&mut self, (now, text): (Timestamp, &str)) {
        self.attributes
            .put(PROCEDURE_STEP_STATE, "CS", self.state.as_str());
        self.attributes
            .put(SCHEDULED_PROCEDURE_STEP_MODIFICATION_DATE_TIME, "DT", text);
        self.changed_at = now;
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use serde_json::json;

    const TEST_MOMENT: (Timestamp, &str) = (7, "20261123050000");

    fn set(value: Value) -> DataSetJson {
        let Value::Object(object) = value else {
            panic!("{value}")
        };
        DataSetJson::from_object(object).unwrap()
    }

    fn scheduled() -> Workitem {
        let attributes = set(json!({"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}}));
        Workitem::create(&Tenant::default(), "1.2", attributes, TEST_MOMENT)
            .unwrap()
            .0
    }

    fn finished() -> DataSetJson {
        let item: Map<String, Value> = FINAL_ATTRIBUTES
            .iter()
            .map(|(tag, _)| ((*tag).to_owned(), json!({"vr": "SQ"})))
            .collect();
        set(json!({"00741216": {"vr": "SQ", "Value": [item]}}))
    }

    #[test]
    fn every_transition_is_permitted_or_refused_as_the_standard_says() {
        use WorkitemState::{Canceled, Completed, InProgress, Scheduled};
        for (from, to, allowed) in [
            (Scheduled, Scheduled, false),
            (Scheduled, InProgress, true),
            (Scheduled, Completed, false),
            (Scheduled, Canceled, false),
            (InProgress, Scheduled, false),
            (InProgress, InProgress, false),
            (InProgress, Completed, true),
            (InProgress, Canceled, true),
            (Completed, InProgress, false),
            (Completed, Canceled, false),
            (Canceled, Completed, false),
            (Canceled, InProgress, false),
        ] {
            let mut item = scheduled();
            if from != Scheduled {
                item.change_state(Some("9.9"), InProgress, TEST_MOMENT)
                    .unwrap();
                item.update(Some("9.9"), finished(), TEST_MOMENT).unwrap();
            }
            if from.is_final() {
                item.change_state(Some("9.9"), from, TEST_MOMENT).unwrap();
            }
            let before = item.clone();
            let result = item.change_state(Some("9.9"), to, TEST_MOMENT);
            if allowed {
                assert_eq!(result, Ok(Change::Done), "{from:?} {to:?}");
                assert_eq!(
                    item.attributes.text(PROCEDURE_STEP_STATE),
                    Some(to.as_str())
                );
            } else {
                assert_eq!(
                    result,
                    Err(Refusal::State { state: from }),
                    "{from:?} {to:?}"
                );
                assert_eq!(item, before);
            }
        }
    }

    #[test]
    fn a_claimed_item_obeys_its_performer_alone() {
        let mut item = scheduled();
        item.update(
            None,
            set(json!({"00741204": {"vr": "LO", "Value": ["A"]}})),
            TEST_MOMENT,
        )
        .unwrap();
        let claim = WorkitemState::InProgress;
        assert_eq!(
            item.change_state(None, claim, TEST_MOMENT),
            Err(Refusal::NoTransaction)
        );
        item.change_state(Some("9.9"), claim, TEST_MOMENT).unwrap();
        let change = || set(json!({"00741204": {"vr": "LO", "Value": ["B"]}}));
        assert_eq!(
            item.update(None, change(), TEST_MOMENT),
            Err(Refusal::NoTransaction)
        );
        assert_eq!(
            item.update(Some("9.8"), change(), TEST_MOMENT),
            Err(Refusal::OtherTransaction)
        );
        item.update(Some("9.9"), change(), TEST_MOMENT).unwrap();
        assert_eq!(item.attributes.text(PROCEDURE_STEP_LABEL), Some("B"));
        let done = WorkitemState::Completed;
        let missing = item.change_state(Some("9.9"), done, TEST_MOMENT);
        assert!(
            matches!(missing, Err(Refusal::Unfinished(_))),
            "{missing:?}"
        );
        item.update(Some("9.9"), finished(), TEST_MOMENT).unwrap();
        let other = item.change_state(Some("9.8"), done, TEST_MOMENT);
        assert_eq!(other, Err(Refusal::OtherTransaction));
        assert_eq!(
            item.change_state(Some("9.9"), done, TEST_MOMENT),
            Ok(Change::Done)
        );
        assert_eq!(
            item.change_state(Some("9.9"), done, TEST_MOMENT),
            Ok(Change::Already)
        );
        let late = item.update(Some("9.9"), change(), TEST_MOMENT);
        assert_eq!(late, Err(Refusal::State { state: done }));
        assert!(!serde_json::to_string(item.shown()).unwrap().contains("9.9"));
        let cancel = item.request_cancel(&DataSetJson::default(), TEST_MOMENT);
        assert_eq!(cancel, Err(Refusal::State { state: done }));
    }

    #[test]
    fn a_cancellation_ends_what_waits_and_is_noted_where_work_goes_on() {
        let reason = set(json!({"00741238": {"vr": "LT", "Value": ["wrong patient"]}}));
        let mut item = scheduled();
        assert_eq!(item.request_cancel(&reason, TEST_MOMENT), Ok(Change::Done));
        assert_eq!(item.state, WorkitemState::Canceled);
        assert_eq!(
            item.request_cancel(&reason, TEST_MOMENT),
            Ok(Change::Already)
        );
        let mut item = scheduled();
        item.change_state(Some("9.9"), WorkitemState::InProgress, TEST_MOMENT)
            .unwrap();
        assert_eq!(item.request_cancel(&reason, TEST_MOMENT), Ok(Change::Done));
        assert_eq!(item.state, WorkitemState::InProgress);
        let noted = item
            .attributes
            .items(PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE)
            .next()
            .unwrap();
        assert_eq!(noted["00741238"]["Value"][0], "wrong patient");
    }

    #[test]
    fn a_new_item_must_be_one() {
        for (tag, value) in [
            (
                PROCEDURE_STEP_STATE,
                json!({"vr": "CS", "Value": ["IN PROGRESS"]}),
            ),
            (TRANSACTION_UID, json!({"vr": "UI", "Value": ["1.2.3"]})),
            (
                SCHEDULED_PROCEDURE_STEP_PRIORITY,
                json!({"vr": "CS", "Value": ["SOON"]}),
            ),
            (SOP_INSTANCE_UID, json!({"vr": "UI", "Value": ["1.3"]})),
        ] {
            let mut object = scheduled().attributes.object().clone();
            object.insert(tag.into(), value);
            let set = DataSetJson::from_object(object).unwrap();
            let refused = Workitem::create(&Tenant::default(), "1.2", set, TEST_MOMENT);
            assert!(
                matches!(refused, Err(Refusal::Attribute { tag: at, .. }) if at == tag),
                "{tag}: {refused:?}"
            );
        }
        for (wrong, part) in [
            (json!({"123": {"vr": "LO"}}), "eight"),
            (json!({"00741000": 1}), "object"),
            (json!({"00741000": {"vr": "lo"}}), "representation"),
            (json!({"00741000": {"vr": "LO", "Value": 1}}), "array"),
            (json!({"00741002": {"vr": "SQ", "Value": [1]}}), "objects"),
        ] {
            let error = DataSetJson::from_object(wrong.as_object().unwrap().clone()).unwrap_err();
            assert!(error.to_string().contains(part), "{error}");
        }
    }
}
