//! `/dicom-web/workitems`: Unified Procedure Steps.

use crate::helpers::{TestApp, closed, key, problem, text};
use reqwest::{Method, Response, StatusCode};
use serde_json::{Value, json};
use ventriform_service::callers::{Quota, Scope};

const ITEMS_PATH: &str = "/dicom-web/workitems";

fn scheduled() -> Value {
    json!([{
        "00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
        "00741200": {"vr": "CS", "Value": ["HIGH"]},
        "00741204": {"vr": "LO", "Value": ["Fit a ventricle"]},
        "00404005": {"vr": "DT", "Value": ["20261123101500"]},
        "00404041": {"vr": "CS", "Value": ["READY"]},
        "00100010": {"vr": "PN", "Value": [{"Alphabetic": "Doe^Jane"}]},
        "00081195": {"vr": "UI"},
        "00404021": {"vr": "SQ", "Value": [{
            "0020000D": {"vr": "UI", "Value": ["1.2.3"]},
            "0020000E": {"vr": "UI", "Value": ["1.2.3.4"]},
        }]},
    }])
}

fn performed() -> Value {
    json!([{"00741216": {"vr": "SQ", "Value": [{
        "00404028": {"vr": "SQ"},
        "00404050": {"vr": "DT", "Value": ["20261123101500"]},
        "00404019": {"vr": "SQ"},
        "00404051": {"vr": "DT", "Value": ["20261123101600"]},
        "00404033": {"vr": "SQ", "Value": [{"0020000D": {"vr": "UI", "Value": ["1.2.3"]}}]},
    }]}}])
}

fn state(name: &str, transaction: Option<&str>) -> Value {
    let mut set = json!({"00741000": {"vr": "CS", "Value": [name]}});
    if let Some(uid) = transaction {
        set["00081195"] = json!({"vr": "UI", "Value": [uid]});
    }
    json!([set])
}

async fn send(app: &TestApp, method: Method, path: &str, body: &Value) -> Response {
    let request = app.client.request(method, format!("{}{path}", app.url));
    let request = request.header("content-type", "application/dicom+json");
    request.body(body.to_string()).send().await.unwrap()
}

async fn created(app: &TestApp, uid: &str) -> String {
    let answer = send(
        app,
        Method::POST,
        &format!("{ITEMS_PATH}?workitem={uid}"),
        &scheduled(),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    answer.headers()["location"].to_str().unwrap().to_owned()
}

async fn item(app: &TestApp, path: &str) -> Value {
    let answer = app.get(path).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.headers()["content-type"], "application/dicom+json");
    let sets: Value = answer.json().await.unwrap();
    sets[0].clone()
}

#[tokio::test]
async fn a_work_item_is_created_claimed_changed_and_completed() {
    let app = TestApp::start().await;
    let path = created(&app, "1.2.840.1").await;
    assert_eq!(path, format!("{ITEMS_PATH}/1.2.840.1"));
    let again = send(
        &app,
        Method::POST,
        &format!("{ITEMS_PATH}?1.2.840.1"),
        &scheduled(),
    )
    .await;
    problem(again, 409, "workitem-exists").await;
    let shown = item(&app, &path).await;
    assert_eq!(shown["00741204"]["Value"][0], "Fit a ventricle");
    assert_eq!(shown["00080018"]["Value"][0], "1.2.840.1");

    let to = format!("{path}/state");
    let without = send(&app, Method::PUT, &to, &state("IN PROGRESS", None)).await;
    assert_eq!(
        without.headers()["warning"],
        "299 ventriform: The Transaction UID is missing."
    );
    problem(without, 409, "transaction-uid").await;
    let early = send(&app, Method::PUT, &to, &state("COMPLETED", Some("9.9"))).await;
    problem(early, 409, "workitem-state").await;
    let claim = send(&app, Method::PUT, &to, &state("IN PROGRESS", Some("9.9"))).await;
    assert_eq!(claim.status(), StatusCode::OK);
    let second = send(&app, Method::PUT, &to, &state("IN PROGRESS", Some("9.8"))).await;
    problem(second, 409, "workitem-state").await;
    let shown = item(&app, &path).await;
    assert_eq!(shown["00741000"]["Value"][0], "IN PROGRESS");
    assert!(!shown.to_string().contains("9.9"), "{shown}");

    // Each form in which clients send the Transaction UID.
    let progress = |percent: u8| {
        let item = json!({"00741004": {"vr": "DS", "Value": [percent]}});
        json!([{"00741002": {"vr": "SQ", "Value": [item]}}])
    };
    for (query, percent) in [
        ("transaction-uid=9.9", 10),
        ("transaction=9.9", 20),
        ("9.9", 30),
    ] {
        let done = send(
            &app,
            Method::POST,
            &format!("{path}?{query}"),
            &progress(percent),
        )
        .await;
        assert_eq!(done.status(), StatusCode::OK, "{query}");
        let shown = item(&app, &path).await;
        assert_eq!(
            shown["00741002"]["Value"][0]["00741004"]["Value"][0],
            percent
        );
    }
    for name in ["Transaction-uid", "Transaction-UID"] {
        let request = app.post(&path).header(name, "9.9").json(&performed());
        assert_eq!(
            request.send().await.unwrap().status(),
            StatusCode::OK,
            "{name}"
        );
    }
    let mut in_body = progress(50);
    in_body[0]["00081195"] = json!({"vr": "UI", "Value": ["9.9"]});
    assert_eq!(
        send(&app, Method::POST, &path, &in_body).await.status(),
        StatusCode::OK
    );
    let other = send(
        &app,
        Method::POST,
        &format!("{path}?transaction-uid=9.8"),
        &progress(1),
    )
    .await;
    problem(other, 409, "transaction-uid").await;
    problem(
        send(&app, Method::POST, &path, &progress(1)).await,
        409,
        "transaction-uid",
    )
    .await;

    let done = send(&app, Method::PUT, &to, &state("COMPLETED", Some("9.9"))).await;
    assert_eq!(done.status(), StatusCode::OK);
    let again = send(&app, Method::PUT, &to, &state("COMPLETED", Some("9.9"))).await;
    assert_eq!(again.status(), StatusCode::OK);
    assert!(
        again.headers()["warning"]
            .to_str()
            .unwrap()
            .contains("already")
    );
    let late = send(&app, Method::POST, &format!("{path}?9.9"), &progress(99)).await;
    problem(late, 409, "workitem-state").await;
    let cancel = send(
        &app,
        Method::POST,
        &format!("{path}/cancelrequest"),
        &json!([{}]),
    )
    .await;
    problem(cancel, 409, "workitem-state").await;

    // It survives a restart.
    let shown = item(&app, &path).await;
    let data = app.stop().await;
    let app = TestApp::on(data, crate::helpers::fake_engine(), |_| {}).await;
    assert_eq!(item(&app, &path).await, shown);
}

#[tokio::test]
async fn a_cancellation_is_carried_out_or_passed_on() {
    let app = TestApp::start().await;
    let waits = created(&app, "1.2.840.2").await;
    let asked = app
        .post(&format!("{waits}/cancelrequest"))
        .send()
        .await
        .unwrap();
    assert_eq!(asked.status(), StatusCode::ACCEPTED);
    assert_eq!(item(&app, &waits).await["00741000"]["Value"][0], "CANCELED");
    let works = created(&app, "1.2.840.3").await;
    let to = format!("{works}/state");
    send(&app, Method::PUT, &to, &state("IN PROGRESS", Some("9.9"))).await;
    let reason = json!([{"00741238": {"vr": "LT", "Value": ["wrong patient"]}}]);
    let asked = send(
        &app,
        Method::POST,
        &format!("{works}/cancelrequest"),
        &reason,
    )
    .await;
    assert_eq!(asked.status(), StatusCode::ACCEPTED);
    let shown = item(&app, &works).await;
    assert_eq!(shown["00741000"]["Value"][0], "IN PROGRESS");
    assert_eq!(
        shown["00741002"]["Value"][0]["00741238"]["Value"][0],
        "wrong patient"
    );
    let unfinished = send(&app, Method::PUT, &to, &state("COMPLETED", Some("9.9"))).await;
    problem(unfinished, 409, "workitem-unfinished").await;
    let given_up = send(&app, Method::PUT, &to, &state("CANCELED", Some("9.9"))).await;
    assert_eq!(given_up.status(), StatusCode::OK);
}

#[tokio::test(flavor = "multi_thread")]
async fn changes_at_the_same_time_are_made_or_put_off() {
    let app = TestApp::start().await;
    let path = created(&app, "1.2.840.7").await;
    let changes = (0..30).map(|number| {
        let label = format!("Fit {number}");
        let body = json!([{"00741204": {"vr": "LO", "Value": [label]}}]);
        let (app, path) = (&app, &path);
        async move { send(app, Method::POST, path, &body).await }
    });
    let answers = futures::future::join_all(changes).await;
    assert!(answers.iter().any(|answer| answer.status().is_success()));
    for answer in answers {
        if !answer.status().is_success() {
            assert_eq!(answer.headers()["retry-after"], "1");
            problem(answer, 503, "busy").await;
        }
    }
}

#[tokio::test]
async fn a_uid_that_is_none_is_refused_by_the_name_under_which_it_came() {
    let app = TestApp::start().await;
    let mut named = scheduled();
    named[0]["00080018"] = json!({"vr": "UI", "Value": ["1.2.x"]});
    let in_query = format!("{ITEMS_PATH}?workitem=1.2.x");
    for (path, body, field) in [
        (ITEMS_PATH, &named, "00080018"),
        (in_query.as_str(), &scheduled(), "workitem"),
    ] {
        let refused = send(&app, Method::POST, path, body).await;
        assert_eq!(refused.status(), StatusCode::BAD_REQUEST);
        let refused: Value = refused.json().await.unwrap();
        assert_eq!(refused["field"], field, "{refused}");
    }
}

#[tokio::test]
async fn work_items_are_searched_and_belong_to_a_tenant() {
    let app = TestApp::start().await;
    for number in 0..5 {
        created(&app, &format!("1.2.840.4.{number}")).await;
    }
    let claimed = format!("{ITEMS_PATH}/1.2.840.4.0/state");
    send(
        &app,
        Method::PUT,
        &claimed,
        &state("IN PROGRESS", Some("9.9")),
    )
    .await;
    for (query, count) in [
        ("", 5),
        ("?ProcedureStepState=SCHEDULED", 4),
        ("?00741000=IN%20PROGRESS", 1),
        ("?PatientName=doe*&includefield=all", 5),
        ("?InputInformationSequence.StudyInstanceUID=1.2.3", 5),
        ("?00404021.0020000D=9", 0),
        ("?limit=2&offset=4", 1),
        ("?limit=3", 3),
    ] {
        let answer = app
            .get(&format!("{ITEMS_PATH}{query}"))
            .send()
            .await
            .unwrap();
        if count == 0 {
            assert_eq!(answer.status(), StatusCode::NO_CONTENT, "{query}");
            continue;
        }
        let found: Value = answer.json().await.unwrap();
        assert_eq!(found.as_array().unwrap().len(), count, "{query}");
    }
    let unknown = app
        .get(&format!("{ITEMS_PATH}?Nonsense=1"))
        .send()
        .await
        .unwrap();
    problem(unknown, 400, "unknown-parameter").await;
    let nameless = send(&app, Method::POST, ITEMS_PATH, &scheduled()).await;
    let location = nameless.headers()["location"].to_str().unwrap();
    assert!(
        location.starts_with("/dicom-web/workitems/2.25."),
        "{location}"
    );
    let bare = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}}]);
    let bare = send(&app, Method::POST, ITEMS_PATH, &bare).await;
    assert_eq!(bare.status(), StatusCode::CREATED);
    assert!(bare.headers().contains_key("warning"));
    for (body, code) in [
        (json!({"1": 2}), "malformed-dicom-json"),
        (json!([]), "malformed-json"),
        (state("IN PROGRESS", None), "invalid-field"),
    ] {
        problem(send(&app, Method::POST, ITEMS_PATH, &body).await, 400, code).await;
    }

    let path = format!("{ITEMS_PATH}/1.2.840.4.1");
    let (_, reader) = key(app.data.path(), Scope::Read, "default", Quota::default()).await;
    let (_, other) = key(app.data.path(), Scope::Admin, "other", Quota::default()).await;
    closed(&app).await;
    let (reader, other) = (app.seen_with(&reader), app.seen_with(&other));
    problem(
        reader.get(&path).send().await.unwrap(),
        403,
        "insufficient-scope",
    )
    .await;
    problem(other.get(&path).send().await.unwrap(), 404, "not-found").await;
    let none = other.get(ITEMS_PATH).send().await.unwrap();
    assert_eq!(none.status(), StatusCode::NO_CONTENT);
    let (to, claim) = (format!("{path}/state"), state("IN PROGRESS", Some("9.9")));
    let foreign = send(&other, Method::PUT, &to, &claim).await;
    let refused = problem(foreign, 404, "not-found").await;
    assert!(!text(&refused["detail"]).contains("Doe"));
}
