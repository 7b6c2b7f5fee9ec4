//! The published document.

use crate::helpers::{TestApp, text};
use serde_json::Value;
use std::path::Path;
use ventriform::http::document_json;
use ventriform::parameters::{FIT_SPECS, SPECS};

/// If set, the test writes the document instead of comparing it.
const UPDATE: &str = "UPDATE_OPENAPI";

#[test]
fn the_committed_document_matches_the_code() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/ventriform.json");
    let generated = document_json();
    if std::env::var_os(UPDATE).is_some() {
        std::fs::write(&path, generated).unwrap();
        return;
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == generated,
        "openapi/ventriform.json is out of date; write it anew with {UPDATE}=1 cargo test --test api"
    );
}

#[tokio::test]
async fn the_service_publishes_the_same_document() {
    let app = TestApp::start().await;
    let served = app.json("/openapi.json").await;
    let generated: Value = serde_json::from_str(&document_json()).unwrap();
    assert_eq!(served, generated);
    assert!(text(&served["openapi"]).starts_with("3.1"));
}

#[test]
fn every_parameter_of_a_job_is_documented_twice() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let fit: Vec<_> = FIT_SPECS.iter().map(|spec| spec.name).collect();
    let model: Vec<_> = SPECS.iter().map(|spec| spec.name).collect();
    for (path, schema, names) in [
        ("/v1/models", "ModelParameters", model),
        ("/v1/segmentations", "SegmentationParameters", fit),
    ] {
        let query = &document["paths"][path]["post"]["parameters"];
        let schema = &document["components"]["schemas"][schema]["properties"];
        for name in names {
            let query = query.as_array().unwrap();
            assert!(query.iter().any(|p| p["name"] == name), "{name}");
            assert!(schema[name].is_object(), "{name}");
        }
    }
}

#[test]
fn every_reference_resolves() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let mut open = vec![&document];
    while let Some(value) = open.pop() {
        match value {
            Value::Object(object) => {
                if let Some(Value::String(reference)) = object.get("$ref") {
                    let target = document.pointer(reference.trim_start_matches('#'));
                    assert!(target.is_some(), "{reference}");
                }
                open.extend(object.values());
            }
            Value::Array(list) => open.extend(list),
            _ => {}
        }
    }
}
