//! `/v1/readers`, and segmentations that name one.

use crate::helpers::{TestApp, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::LOCATION;
use serde_json::{Value, json};

/// A profile with this distance of the endocardium.
pub fn profile(endocardium: f64) -> Value {
    let offset = |value: f64| json!({"value": value, "mean": value, "spread": 0.0});
    json!({
        "format": "ventriform-reader-profile",
        "version": 2,
        "kind": "edge",
        "edge": "apparent",
        "masks": 1,
        "offsets_mm": {
            "endocardium": offset(endocardium), "epicardium": offset(-0.5), "rim": offset(2.0),
        },
        "learnt_on": [{"scan": "a".repeat(64), "mask": "b".repeat(64)}],
    })
}

#[tokio::test]
async fn a_profile_is_stored_once_listed_used_and_erased() {
    let app = TestApp::with(|s| s.reader_limit = 2).await;
    let post = |query: &str, body: &Value| {
        let body = body.clone();
        app.post(&format!("/v1/readers{query}")).json(&body).send()
    };
    let added = post("?name=anna", &profile(1.25)).await.unwrap();
    assert_eq!(added.status(), StatusCode::CREATED);
    let path = added.headers()[LOCATION].to_str().unwrap().to_owned();
    let reader: Value = added.json().await.unwrap();
    assert_eq!(reader["name"], "anna");
    assert_eq!(reader["summary"]["offsets_mm"]["endocardium"], 1.25);
    assert_eq!(reader["summary"]["masks"], 1);
    assert_eq!(reader["summary"]["kind"], "edge");
    assert_eq!(reader["summary"]["level"], Value::Null);
    assert_eq!(app.json(&path).await, reader);
    let again = post("", &profile(1.25)).await.unwrap();
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.json::<Value>().await.unwrap(), reader);
    let stored = app.json(&text(&reader["links"]["profile"])).await;
    assert_eq!(stored, profile(1.25));
    let other = post("?name=b", &profile(0.5)).await.unwrap();
    assert_eq!(other.status(), StatusCode::CREATED);
    let list = app.json("/v1/readers").await;
    assert_eq!(list["readers"].as_array().unwrap().len(), 2);
    let full = post("", &profile(0.75)).await.unwrap();
    problem(full, 409, "library-full").await;

    let id = text(&reader["id"]);
    let fit = app.post(&format!("/v1/segmentations?reader={id}"));
    let job: Value = fit
        .body(volume("sphere"))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    let made = app.json(&text(&job["links"]["segmentation"])).await;
    assert_eq!(made["parameters"]["reader"], id.as_str());
    assert_eq!(made["summary"]["seen"]["things"], json!(["reader"]));

    let erased = app.delete(&path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    let refused = app.post(&format!("/v1/segmentations?reader={id}"));
    let refused = refused.body(volume("sphere")).send().await.unwrap();
    let refused = problem(refused, 422, "invalid-field").await;
    assert_eq!(refused["field"], "reader");
}

#[tokio::test]
async fn what_is_no_profile_is_refused_with_its_field() {
    let app = TestApp::start().await;
    let changed = |pointer: &str, value: Value| {
        let mut body = profile(1.0);
        *body.pointer_mut(pointer).unwrap() = value;
        body
    };
    for (body, field) in [
        (json!({}), Value::Null),
        (json!([1]), Value::Null),
        (changed("/version", json!(3)), json!("version")),
        (changed("/kind", json!("level")), json!("offsets_mm")),
        (changed("/kind", json!("both")), json!("kind")),
        (changed("/edge", json!("both")), json!("edge")),
        (changed("/masks", json!(7)), json!("masks")),
        (
            changed("/learnt_on/0/scan", json!("Doe, Jane")),
            json!("learnt_on"),
        ),
        (
            changed("/offsets_mm/rim/value", json!(50)),
            json!("offsets_mm.rim"),
        ),
    ] {
        let refused = app.post("/v1/readers").json(&body).send().await.unwrap();
        let refused = problem(refused, 422, "unusable-profile").await;
        assert_eq!(refused["field"], field, "{refused}");
    }
    let named = app.post("/v1/readers?name=").json(&profile(1.0)).send();
    problem(named.await.unwrap(), 422, "invalid-field").await;
    let unknown = app
        .post("/v1/readers?organ=liver")
        .json(&profile(1.0))
        .send();
    assert_eq!(unknown.await.unwrap().status(), StatusCode::BAD_REQUEST);
    let wrong = app
        .post("/v1/segmentations?reader=tpl_00")
        .body(volume("sphere"));
    assert_eq!(
        wrong.send().await.unwrap().status(),
        StatusCode::UNPROCESSABLE_ENTITY
    );
}
