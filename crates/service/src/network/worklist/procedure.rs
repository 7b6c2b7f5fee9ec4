//! Which work items this service performs itself, as the operator configures it.

use super::dataset::text_in;
use super::workitem::Workitem;
use crate::base::dicom_tags::{
    CODE_VALUE, CODING_SCHEME_DESIGNATOR, INPUT_INFORMATION_SEQUENCE, INPUT_READINESS_STATE,
    SCHEDULED_WORKITEM_CODE_SEQUENCE, SERIES_INSTANCE_UID, STUDY_INSTANCE_UID,
};
use crate::base::records::Tenant;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The work that a code asks for: a job on a series of an archive.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Procedure {
    /// Code Value of the Scheduled Workitem Code.
    pub code: String,
    /// Its Coding Scheme Designator.
    pub scheme: String,
    /// The archive that has the series.
    pub archive: String,
    /// The kind of job: `model`, `segmentation` or `beat`.
    pub kind: String,
    /// The job's parameters.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// The results to send, such as `mask.dcm`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub send: Vec<String>,
    /// The archive to send them to; the one that has the series if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
    /// The tenant whose work items are performed.
    #[serde(default)]
    pub tenant: Tenant,
}

impl Procedure {
    /// Whether `item` is ready and asks for this work.
    pub fn is_asked_by(&self, item: &Workitem) -> bool {
        let text = |code, tag| text_in(code, tag).map(str::trim);
        let named = item
            .attributes
            .items(SCHEDULED_WORKITEM_CODE_SEQUENCE)
            .any(|code| {
                text(code, CODE_VALUE) == Some(self.code.as_str())
                    && text(code, CODING_SCHEME_DESIGNATOR) == Some(self.scheme.as_str())
            });
        named
            && item.tenant == self.tenant
            && item
                .attributes
                .text(INPUT_READINESS_STATE)
                .is_none_or(|state| state == "READY")
    }
}

impl Workitem {
    /// Study and Series Instance UID of its input.
    ///
    /// # Errors
    /// Why no series can be told from it.
    pub fn input(&self) -> Result<(String, String), &'static str> {
        let mut found: Option<(String, String)> = None;
        for item in self.attributes.items(INPUT_INFORMATION_SEQUENCE) {
            let uid = |tag: &str| {
                let uid = text_in(item, tag)?.trim_matches(['\0', ' ']);
                (!uid.is_empty()).then(|| uid.to_owned())
            };
            let (Some(study), Some(series)) = (uid(STUDY_INSTANCE_UID), uid(SERIES_INSTANCE_UID))
            else {
                return Err("An input names no Study and Series Instance UID.");
            };
            let named = (study, series);
            if found.as_ref().is_some_and(|other| *other != named) {
                return Err("The input is more than one series.");
            }
            found = Some(named);
        }
        found.ok_or("The Input Information Sequence is empty.")
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::super::DataSetJson;
    use super::*;
    use serde_json::json;

    fn item(change: impl FnOnce(&mut Value)) -> Workitem {
        let code = json!({"00080100": {"vr": "SH", "Value": ["LVSEG"]},
                          "00080102": {"vr": "SH", "Value": ["99HOSPITAL"]},
                          "00080104": {"vr": "LO", "Value": ["Segment the left ventricle"]}});
        let input = json!({"0020000D": {"vr": "UI", "Value": ["1.2"]},
                           "0020000E": {"vr": "UI", "Value": ["1.2.3"]}});
        let mut set = json!({"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
                             "00404018": {"vr": "SQ", "Value": [code]},
                             "00404041": {"vr": "CS", "Value": ["READY"]},
                             "00404021": {"vr": "SQ", "Value": [input]}});
        change(&mut set);
        let set = DataSetJson::from_object(set.as_object().unwrap().clone()).unwrap();
        Workitem::create(&Tenant::default(), "1.2", set, (7, "20261123"))
            .unwrap()
            .0
    }

    #[test]
    fn an_item_is_performed_if_it_is_ready_and_has_the_code() {
        let procedure = json!({"code": "LVSEG", "scheme": "99HOSPITAL", "archive": "pacs",
                               "kind": "segmentation"});
        let procedure: Procedure = serde_json::from_value(procedure).unwrap();
        assert!(procedure.is_asked_by(&item(|_| {})));
        let waiting = item(|set| set["00404041"]["Value"][0] = "INCOMPLETE".into());
        assert!(!procedure.is_asked_by(&waiting));
        let other = item(|set| set["00404018"]["Value"][0]["00080102"]["Value"][0] = "DCM".into());
        assert!(!procedure.is_asked_by(&other));
        let uncoded = item(|set| set["00404018"] = json!({"vr": "SQ"}));
        assert!(!procedure.is_asked_by(&uncoded));
        let elsewhere = Procedure {
            tenant: "nuclear".parse().unwrap(),
            ..procedure
        };
        assert!(!elsewhere.is_asked_by(&item(|_| {})));
    }

    #[test]
    fn the_input_is_one_series() {
        let series = ("1.2".to_owned(), "1.2.3".to_owned());
        assert_eq!(item(|_| {}).input(), Ok(series.clone()));
        let repeated = |set: &mut Value| {
            let again = set["00404021"]["Value"][0].clone();
            set["00404021"]["Value"].as_array_mut().unwrap().push(again);
        };
        assert_eq!(item(repeated).input(), Ok(series));
        let two = item(|set| {
            repeated(set);
            set["00404021"]["Value"][1]["0020000E"]["Value"][0] = "1.2.4".into();
        });
        assert!(two.input().unwrap_err().contains("more than one"));
        let none = item(|set| set["00404021"] = json!({"vr": "SQ"}));
        assert!(none.input().is_err());
        let study = item(|set| {
            set["00404021"]["Value"][0]
                .as_object_mut()
                .unwrap()
                .remove("0020000E");
        });
        assert!(study.input().is_err());
    }
}
