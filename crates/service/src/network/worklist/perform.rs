//! Performing a work item: claim, progress, result, giving up.

use super::dataset::DataSetJson;
use super::workitem::{Performer, Refusal, Workitem, WorkitemState};
use crate::base::dicom_tags::{
    CODE_MEANING, CODE_VALUE, CODING_SCHEME_DESIGNATOR, DICOM_RETRIEVAL_SEQUENCE,
    OUTPUT_INFORMATION_SEQUENCE, PERFORMED_PROCEDURE_STEP_END_DATE_TIME,
    PERFORMED_PROCEDURE_STEP_START_DATE_TIME, PERFORMED_STATION_NAME_CODE_SEQUENCE,
    PERFORMED_WORKITEM_CODE_SEQUENCE, PROCEDURE_STEP_CANCELLATION_DATE_TIME,
    PROCEDURE_STEP_PROGRESS, PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE, REASON_FOR_CANCELLATION,
    REFERENCED_SOP_CLASS_UID, REFERENCED_SOP_INSTANCE_UID, REFERENCED_SOP_SEQUENCE,
    RETRIEVE_AE_TITLE, RETRIEVE_URL, SCHEDULED_PROCEDURE_STEP_PRIORITY,
    SCHEDULED_WORKITEM_CODE_SEQUENCE, SERIES_INSTANCE_UID, STUDY_INSTANCE_UID, TYPE_OF_INSTANCES,
    UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE, WADORS_RETRIEVAL_SEQUENCE,
};
use crate::base::records::{Priority, Timestamp};
use serde_json::{Map, Value, json};

/// An object that was made and stored in an archive.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WorkOutputObject {
    /// SOP Class UID.
    pub class: String,
    /// SOP Instance UID.
    pub instance: String,
    /// Study Instance UID.
    pub study: String,
    /// Series Instance UID.
    pub series: String,
    /// Base URL of the archive's DICOMweb service.
    pub dicomweb: Option<String>,
    /// AE title of the archive.
    pub ae_title: Option<String>,
}

impl Workitem {
    /// Claims the item for this service under a Transaction UID that nobody else knows.
    ///
    /// # Errors
    /// [`Refusal::State`] if it is not scheduled.
    pub fn claim(&mut self, transaction: &str, now: (Timestamp, &str)) -> Result<(), Refusal> {
        self.change_state(Some(transaction), WorkitemState::InProgress, now)?;
        self.performer = Performer::Claimed;
        Ok(())
    }

    /// How urgent its job is, by its Scheduled Procedure Step Priority.
    pub fn priority(&self) -> Priority {
        match self.attributes.text(SCHEDULED_PROCEDURE_STEP_PRIORITY) {
            Some("HIGH") => Priority::Urgent,
            Some("LOW") => Priority::Bulk,
            _ => Priority::Routine,
        }
    }

    /// Whether somebody has asked to cancel it since it was claimed.
    pub fn is_to_be_cancelled(&self) -> bool {
        let mut progress = self
            .attributes
            .items(PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE);
        progress.any(|item| item.contains_key(PROCEDURE_STEP_CANCELLATION_DATE_TIME))
    }

    /// The progress of the work that was noted last, 0 to 100.
    pub fn progress_percent(&self) -> Option<u8> {
        self.progress().text(PROCEDURE_STEP_PROGRESS)?.parse().ok()
    }

    /// Notes the progress of the work, 0 to 100. Returns whether that is new.
    pub fn note_progress(&mut self, percent: u8, now: (Timestamp, &str)) -> bool {
        let mut progress = self.progress();
        let percent = percent.to_string();
        if progress.text(PROCEDURE_STEP_PROGRESS) == Some(percent.as_str()) {
            return false;
        }
        progress.put(PROCEDURE_STEP_PROGRESS, "DS", &percent);
        self.put_progress(progress, now);
        true
    }

    /// Completes the item, of which the work began at `began` (DT): what was made is its output.
    ///
    /// # Errors
    /// [`Refusal`] if it is not claimed.
    pub fn complete(
        &mut self,
        began: &str,
        outputs: &[WorkOutputObject],
        now: (Timestamp, &str),
    ) -> Result<(), Refusal> {
        let station = json!({
            CODE_VALUE: {"vr": "SH", "Value": ["VENTRIFORM"]},
            CODING_SCHEME_DESIGNATOR: {"vr": "SH", "Value": ["99VENTRIFORM"]},
            CODE_MEANING: {"vr": "LO", "Value": ["ventriform"]},
        });
        let code: Vec<_> = self
            .attributes
            .items(SCHEDULED_WORKITEM_CODE_SEQUENCE)
            .cloned()
            .collect();
        let outputs: Vec<Value> = outputs.iter().map(output).collect();
        let performed = json!({
            PERFORMED_STATION_NAME_CODE_SEQUENCE: {"vr": "SQ", "Value": [station]},
            PERFORMED_PROCEDURE_STEP_START_DATE_TIME: {"vr": "DT", "Value": [began]},
            PERFORMED_WORKITEM_CODE_SEQUENCE: {"vr": "SQ", "Value": code},
            PERFORMED_PROCEDURE_STEP_END_DATE_TIME: {"vr": "DT", "Value": [now.1]},
            OUTPUT_INFORMATION_SEQUENCE: {"vr": "SQ", "Value": outputs},
        });
        let Value::Object(performed) = performed else {
            return Ok(());
        };
        self.note_progress(100, now);
        self.attributes.put_item(
            UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE,
            performed,
        );
        let transaction = self.transaction.clone();
        self.change_state(transaction.as_deref(), WorkitemState::Completed, now)?;
        Ok(())
    }

    /// Gives the item up for that reason, unless somebody who wanted it cancelled gave one.
    ///
    /// # Errors
    /// [`Refusal`] if it is not claimed.
    pub fn give_up(&mut self, reason: &str, now: (Timestamp, &str)) -> Result<(), Refusal> {
        let mut progress = self.progress();
        if !progress.has(PROCEDURE_STEP_CANCELLATION_DATE_TIME) {
            progress.put(PROCEDURE_STEP_CANCELLATION_DATE_TIME, "DT", now.1);
            progress.put(REASON_FOR_CANCELLATION, "LT", reason);
        }
        self.put_progress(progress, now);
        let transaction = self.transaction.clone();
        self.change_state(transaction.as_deref(), WorkitemState::Canceled, now)?;
        Ok(())
    }

    fn progress(&self) -> DataSetJson {
        let known: Option<Map<String, Value>> = self
            .attributes
            .items(PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE)
            .next()
            .cloned();
        DataSetJson::from_object(known.unwrap_or_default()).unwrap_or_default()
    }

    fn put_progress(&mut self, progress: DataSetJson, now: (Timestamp, &str)) {
        self.attributes.put_item(
            PROCEDURE_STEP_PROGRESS_INFORMATION_SEQUENCE,
            progress.object().clone(),
        );
        self.stamp(now);
    }
}

/// An item of the Output Information Sequence.
fn output(object: &WorkOutputObject) -> Value {
    let mut item = json!({
        TYPE_OF_INSTANCES: {"vr": "CS", "Value": ["DICOM"]},
        STUDY_INSTANCE_UID: {"vr": "UI", "Value": [object.study]},
        SERIES_INSTANCE_UID: {"vr": "UI", "Value": [object.series]},
        REFERENCED_SOP_SEQUENCE: {"vr": "SQ", "Value": [{
            REFERENCED_SOP_CLASS_UID: {"vr": "UI", "Value": [object.class]},
            REFERENCED_SOP_INSTANCE_UID: {"vr": "UI", "Value": [object.instance]},
        }]},
    });
    if let Some(title) = &object.ae_title {
        let retrieval = json!({RETRIEVE_AE_TITLE: {"vr": "AE", "Value": [title]}});
        item[DICOM_RETRIEVAL_SEQUENCE] = json!({"vr": "SQ", "Value": [retrieval]});
    }
    if let Some(base) = &object.dicomweb {
        let (study, series) = (&object.study, &object.series);
        let url = format!("{base}/studies/{study}/series/{series}");
        let retrieval = json!({RETRIEVE_URL: {"vr": "UR", "Value": [url]}});
        item[WADORS_RETRIEVAL_SEQUENCE] = json!({"vr": "SQ", "Value": [retrieval]});
    }
    item
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use crate::base::records::Tenant;

    const TEST_MOMENT: (Timestamp, &str) = (7, "20261123050000+0000");

    fn claimed() -> Workitem {
        let set = json!({"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
            "00404018": {"vr": "SQ", "Value": [{"00080100": {"vr": "SH", "Value": ["LVSEG"]}}]}});
        let set = DataSetJson::from_object(set.as_object().unwrap().clone()).unwrap();
        let (mut item, _) = Workitem::create(&Tenant::default(), "1.2", set, TEST_MOMENT).unwrap();
        item.claim("9.9", TEST_MOMENT).unwrap();
        item
    }

    #[test]
    fn an_item_is_claimed_once_and_completed_with_its_outputs() {
        let mut item = claimed();
        assert_eq!(item.performer, Performer::Claimed);
        assert!(item.claim("9.8", TEST_MOMENT).is_err());
        assert!(item.note_progress(40, TEST_MOMENT));
        assert!(!item.note_progress(40, TEST_MOMENT));
        let object = WorkOutputObject {
            class: "1.1".into(),
            instance: "1.2".into(),
            study: "1.3".into(),
            series: "1.4".into(),
            dicomweb: Some("http://pacs/dicom-web".into()),
            ae_title: None,
        };
        item.complete("20261123045900+0000", &[object], TEST_MOMENT)
            .unwrap();
        assert_eq!(item.state, WorkitemState::Completed);
        let performed = item
            .attributes
            .items(UNIFIED_PROCEDURE_STEP_PERFORMED_PROCEDURE_SEQUENCE)
            .next()
            .unwrap();
        assert_eq!(performed["00404050"]["Value"][0], "20261123045900+0000");
        assert_eq!(
            performed["00404019"]["Value"][0]["00080100"]["Value"][0],
            "LVSEG"
        );
        let output = &performed["00404033"]["Value"][0];
        assert_eq!(
            output["00081199"]["Value"][0]["00081155"]["Value"][0],
            "1.2"
        );
        let url = &output["0040E025"]["Value"][0]["00081190"]["Value"][0];
        assert_eq!(url, "http://pacs/dicom-web/studies/1.3/series/1.4");
        assert_eq!(item.progress().text(PROCEDURE_STEP_PROGRESS), Some("100"));
    }

    #[test]
    fn what_is_given_up_says_why() {
        let mut item = claimed();
        assert!(!item.is_to_be_cancelled());
        item.give_up("There is no such series.", TEST_MOMENT)
            .unwrap();
        assert_eq!(item.state, WorkitemState::Canceled);
        assert_eq!(
            item.progress().text(REASON_FOR_CANCELLATION),
            Some("There is no such series.")
        );
        // Who asked for it has said why.
        let mut item = claimed();
        let reason = json!({"00741238": {"vr": "LT", "Value": ["wrong patient"]}});
        let reason = DataSetJson::from_object(reason.as_object().unwrap().clone()).unwrap();
        item.request_cancel(&reason, TEST_MOMENT).unwrap();
        assert!(item.is_to_be_cancelled());
        item.give_up("The job was cancelled.", TEST_MOMENT).unwrap();
        assert_eq!(
            item.progress().text(REASON_FOR_CANCELLATION),
            Some("wrong patient")
        );
    }
}
