//! Which job a received volume starts, as the operator configures it.

use super::record::{IntakeGroup, Protocol};
use super::senders::AeTitle;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use ventriform::heart::comparison::WhichScan;

/// A rule: what to match, and the job to start. What is absent matches anything.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rule {
    /// Modality, such as `NM`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub modality: Option<String>,
    /// A value of Image Type, such as `RECON TOMO`; any of them may be it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub image_type: Option<String>,
    /// The AE title that sent it by C-STORE.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calling_ae: Option<AeTitle>,
    /// A part of the Study Description; capital and small letters are alike.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub study_description: Option<String>,
    /// The kind of job: `model`, `segmentation`, `beat`, or `comparison` of a scan at stress with its scan at rest.
    pub kind: String,
    /// For comparisons: a part of the Series Description of scans at stress, where headers do not tell them from those
    /// at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stress: Option<String>,
    /// For comparisons: a part of the Series Description of scans at rest.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest: Option<String>,
    /// For comparisons: the scan that comes first, with the lower dose, where both are made on one day and neither
    /// headers nor descriptions tell them apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub first: Option<WhichScan>,
    /// The job's parameters.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// The results to send, such as `mask.dcm`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub send: Vec<String>,
    /// The archive to send them to.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub to: Option<String>,
}

impl Rule {
    /// Whether `group` is what the rule is for.
    pub fn matches(&self, group: &IntakeGroup) -> bool {
        let is = |wanted: &Option<String>, value: Option<&String>| {
            wanted.is_none() || wanted.as_ref() == value
        };
        let image_type = self.image_type.as_ref();
        let caller = self.calling_ae.as_ref().map(AeTitle::as_str);
        let by_store = group.origin.protocol == Protocol::CStore;
        let description = group.study_description.as_deref().unwrap_or_default();
        let described = |part: &String| {
            let description = description.to_lowercase();
            description.contains(&part.to_lowercase())
        };
        is(&self.modality, group.modality.as_ref())
            && image_type.is_none_or(|wanted| group.image_type.contains(wanted))
            && caller.is_none_or(|caller| by_store && group.origin.sender == caller)
            && self.study_description.as_ref().is_none_or(described)
    }
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use crate::base::records::Tenant;
    use crate::network::intake::{GroupState, Origin};
    use serde_json::json;

    fn group(protocol: Protocol) -> IntakeGroup {
        IntakeGroup {
            id: "rcv_1".into(),
            sequence: 1,
            origin: Origin {
                tenant: Tenant::default(),
                protocol,
                sender: "CAMERA".into(),
                address: "10.0.0.1".into(),
            },
            study: "1.2".into(),
            series: "1.2.3".into(),
            instance: None,
            modality: Some("NM".into()),
            image_type: ["ORIGINAL", "PRIMARY", "RECON TOMO"].map(Into::into).into(),
            study_description: Some("Myocardial PERFUSION rest".into()),
            state: GroupState::Gathering,
            revision: 1,
            volume: None,
            job: None,
            failure: None,
            objects: 1,
            waiting_bytes: 1,
            created_at: 0,
            changed_at: 0,
        }
    }

    #[test]
    fn every_given_condition_must_hold() {
        let matches = |conditions: Value, protocol| {
            let mut rule = conditions;
            rule["kind"] = "segmentation".into();
            let rule: Rule = serde_json::from_value(rule).unwrap();
            rule.matches(&group(protocol))
        };
        let by_store = |conditions| matches(conditions, Protocol::CStore);
        assert!(by_store(json!({})));
        assert!(by_store(
            json!({"modality": "NM", "image_type": "RECON TOMO"})
        ));
        assert!(by_store(
            json!({"image_type": "PRIMARY", "calling_ae": "CAMERA"})
        ));
        assert!(by_store(json!({"study_description": "perfusion"})));
        assert!(!by_store(json!({"modality": "PT"})));
        assert!(!by_store(json!({"image_type": "RECON"})));
        assert!(!by_store(json!({"modality": "NM", "calling_ae": "OTHER"})));
        assert!(!by_store(json!({"study_description": "stress"})));
        assert!(!matches(json!({"calling_ae": "CAMERA"}), Protocol::StowRs));
    }
}
