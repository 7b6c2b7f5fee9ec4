//! A row of the trail as an AuditEvent of FHIR R4, in the form of IHE BALP (Basic Audit Log
//! Patterns): `rest` events with the interaction as the subtype, and codes of DICOM for security
//! events.

use super::event::{Activity, AuditRecord, Outcome};
use crate::base::records::{Resource, rfc3339};
use serde_json::{Value, json};

const EVENT_TYPE_SYSTEM: &str = "http://terminology.hl7.org/CodeSystem/audit-event-type";
const INTERACTION_SYSTEM: &str = "http://hl7.org/fhir/restful-interaction";
const DICOM_SYSTEM: &str = "http://dicom.nema.org/resources/ontology/DCM";
const OWN_SYSTEM: &str = "urn:ventriform:audit";
const SOURCE_TYPE_SYSTEM: &str = "http://terminology.hl7.org/CodeSystem/security-source-type";
const ENTITY_SYSTEM: &str = "http://terminology.hl7.org/CodeSystem/audit-entity-type";
const BALP_ENTITIES: &str = "https://profiles.ihe.net/ITI/BALP/CodeSystem/BasicAuditEntityType";
/// System of the identifiers of items and keys.
const ID_SYSTEM: &str = "urn:ventriform:id";
/// The extension that holds the row's hash.
const HASH_EXTENSION: &str = "urn:ventriform:audit-hash";

/// Type, subtype and action of an event.
struct Codes {
    kind: Value,
    subtype: Value,
    action: &'static str,
}

impl Codes {
    fn from_activity(activity: Activity) -> Self {
        let rest = || coding(EVENT_TYPE_SYSTEM, "rest", "RESTful Operation");
        let interaction = |code, action| Self {
            kind: rest(),
            subtype: coding(INTERACTION_SYSTEM, code, code),
            action,
        };
        let dicom = |kind: [&str; 2], subtype: [&str; 2], action| Self {
            kind: coding(DICOM_SYSTEM, kind[0], kind[1]),
            subtype: coding(DICOM_SYSTEM, subtype[0], subtype[1]),
            action,
        };
        let authentication = ["110114", "User Authentication"];
        let alert = ["110113", "Security Alert"];
        let attributes = ["110137", "User Security Attributes Changed"];
        let trail = ["110101", "Audit Log Used"];
        // DICOM has no codes for these.
        let own = |code, display| Self {
            kind: coding(DICOM_SYSTEM, alert[0], alert[1]),
            subtype: coding(OWN_SYSTEM, code, display),
            action: "E",
        };
        match activity {
            Activity::Create => interaction("create", "C"),
            Activity::Read => interaction("read", "R"),
            Activity::Search => interaction("search-type", "E"),
            Activity::Update => interaction("update", "U"),
            Activity::Delete => interaction("delete", "D"),
            Activity::Execute => interaction("operation", "E"),
            Activity::SignInRefused => dicom(authentication, ["110122", "Login"], "E"),
            Activity::AccessRefused => own("access-refused", "Access refused"),
            Activity::KeyCreated => dicom(alert, attributes, "C"),
            Activity::KeyRevoked => dicom(alert, attributes, "D"),
            Activity::AuditRead => dicom(trail, trail, "R"),
            Activity::AuditPruned => dicom(trail, trail, "D"),
            Activity::AuditGap => own("audit-gap", "Events are lost"),
            Activity::AccessOpened => own("access-opened", "Callers need no credentials"),
            Activity::RowsLost => own("rows-lost", "Rows of a table are lost"),
            Activity::Repaired => own("repaired", "An item was repaired"),
            Activity::TrailApplied => own("trail-applied", "A newer trail was applied"),
        }
    }
}

/// The AuditEvent of a row.
pub fn fhir(record: &AuditRecord) -> Value {
    let event = &record.event;
    let codes = Codes::from_activity(event.activity);
    let mut who = json!({"display": event.agent});
    if let Some(key) = &event.key {
        who["identifier"] = json!({"system": ID_SYSTEM, "value": key});
    }
    let mut client = json!({
        "type": {"coding": [coding(DICOM_SYSTEM, "110153", "Source Role ID")]},
        "who": who,
        "requestor": true,
    });
    if let Some(address) = &event.address {
        // 2 stands for an IP address.
        client["network"] = json!({"address": address, "type": "2"});
    }
    let service = json!({
        "type": {"coding": [coding(DICOM_SYSTEM, "110152", "Destination Role ID")]},
        "who": {"display": "ventriform"},
        "requestor": false,
    });
    let outcome = match event.outcome {
        Outcome::Success => "0",
        Outcome::Refused => "4",
    };
    json!({
        "resourceType": "AuditEvent",
        "id": record.sequence.to_string(),
        "extension": [{"url": HASH_EXTENSION, "valueString": record.hash}],
        "type": codes.kind,
        "subtype": [codes.subtype],
        "action": codes.action,
        "recorded": rfc3339(event.recorded),
        "outcome": outcome,
        "agent": [client, service],
        "source": {
            "site": event.tenant.as_str(),
            "observer": {"display": "ventriform"},
            "type": [coding(SOURCE_TYPE_SYSTEM, "4", "Application Server")],
        },
        "entity": entities(record),
    })
}

fn entities(record: &AuditRecord) -> Value {
    let event = &record.event;
    let mut entities = Vec::new();
    if let Some(object) = &event.object {
        let noun = Resource::from_id(object).map_or("item", Resource::noun);
        entities.push(json!({
            "what": {"identifier": {"system": ID_SYSTEM, "value": object}},
            // 2 stands for a system object.
            "type": coding(ENTITY_SYSTEM, "2", "System Object"),
            "description": noun,
        }));
    }
    if let Some(request) = &event.request {
        entities.push(json!({
            "what": {"identifier": {"value": request}},
            "type": coding(BALP_ENTITIES, "XrequestId", "X-Request-Id"),
        }));
    }
    if event.count > 1 {
        entities.push(json!({
            "name": "count",
            "type": coding(ENTITY_SYSTEM, "4", "Other"),
            "detail": [{"type": "count", "valueString": event.count.to_string()}],
        }));
    }
    Value::Array(entities)
}

fn coding(system: &str, code: &str, display: &str) -> Value {
    json!({"system": system, "code": code, "display": display})
}
