//! The body of a delivery.

use super::DueDelivery;
use crate::base::records::{Resource, rfc3339};
use serde_json::{Map, Value, json};

/// The body of a delivery, the same in every attempt: `type`, `timestamp`, and `data` with the
/// job's id, kind, state and paths, which begin with `base_path`. It holds no figures and no texts of errors: whoever
/// may see them reads them from the API.
pub fn message_body(delivery: &DueDelivery, base_path: &str) -> String {
    let path = |id: &str| {
        Resource::from_id(id).map(|kind| format!("{base_path}/v1/{}/{id}", kind.plural()))
    };
    let mut links = Map::new();
    let mut data = Map::new();
    data.insert("job".into(), json!(delivery.job));
    data.insert("kind".into(), json!(delivery.kind));
    data.insert("state".into(), json!(delivery.event.state().as_str()));
    data.insert("attempts".into(), json!(delivery.run));
    links.insert("self".into(), json!(path(&delivery.job)));
    if let Some(result) = &delivery.result
        && let (Some(kind), Some(itself)) = (Resource::from_id(result), path(result))
    {
        data.insert(kind.noun().into(), json!(result));
        links.insert("mesh".into(), json!(format!("{itself}/mesh")));
        links.insert("report".into(), json!(format!("{itself}/report")));
        links.insert(kind.noun().into(), json!(itself));
    }
    if let Some(cause) = &delivery.cause {
        let kind = format!("urn:ventriform:problem:{cause}");
        data.insert("error".into(), json!({ "type": kind }));
    }
    data.insert("links".into(), Value::Object(links));
    let message = json!({
        "type": format!("job.{}", delivery.event.as_str()),
        "timestamp": rfc3339(delivery.occurred_at),
        "data": data,
    });
    message.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::hooks::HookEvent;

    #[test]
    fn a_body_names_the_job_its_state_and_its_result() {
        let delivery = DueDelivery {
            id: "msg_1".into(),
            tenant: crate::base::records::Tenant::default(),
            job: "job_1".into(),
            url: "https://example.org/".into(),
            secrets: Vec::new(),
            event: HookEvent::Succeeded,
            kind: "model".into(),
            result: Some("mdl_1".into()),
            cause: None,
            run: 2,
            occurred_at: 1_700_000_000_123,
            attempts: 0,
            since: 0,
        };
        let body: Value = serde_json::from_str(&message_body(&delivery, "")).unwrap();
        let links = json!({"self": "/v1/jobs/job_1", "mesh": "/v1/models/mdl_1/mesh",
            "report": "/v1/models/mdl_1/report", "model": "/v1/models/mdl_1"});
        assert_eq!(
            body,
            json!({"type": "job.succeeded", "timestamp": "2023-11-14T22:13:20.123Z", "data": {
                "job": "job_1", "kind": "model", "state": "succeeded", "attempts": 2,
                "model": "mdl_1", "links": links}})
        );
        let failed = DueDelivery {
            event: HookEvent::Failed,
            result: None,
            cause: Some("no-surface".into()),
            ..delivery
        };
        let body: Value = serde_json::from_str(&message_body(&failed, "/heart")).unwrap();
        assert_eq!(
            body["data"]["error"]["type"],
            "urn:ventriform:problem:no-surface"
        );
        assert_eq!(
            body["data"]["links"],
            json!({"self": "/heart/v1/jobs/job_1"})
        );
    }
}
