//! Erasing all volumes of a patient, a study, a series or an accession: `DELETE /v1/volumes`. What selects which
//! volumes, on both engines, is in `contract.rs`.

use crate::helpers::{TestApp, closed, key, problem, text};
use reqwest::StatusCode;
use serde_json::{Value, json};
use ventriform_service::callers::{Quota, Scope};

/// The ids of a list.
fn ids(list: &Value) -> Vec<String> {
    let items = list.as_array().unwrap().iter();
    items
        .map(|item| text(item.get("id").unwrap_or(item)))
        .collect()
}

/// A stored volume of that patient and study.
async fn volume_of(app: &TestApp, words: &str, patient: &str, study: &str) -> String {
    let id = app.volume(words).await;
    let identity = format!("{}/v1/volumes/{id}/identity", app.url);
    let stated = json!({"patient_id": patient, "study_uid": study, "patient_name": "Doe^Jane"});
    let answer = app.client.put(identity).json(&stated).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    id
}

async fn status(app: &TestApp, path: &str) -> StatusCode {
    app.get(path).send().await.unwrap().status()
}

#[tokio::test]
async fn a_patient_is_erased_with_one_receipt_that_does_not_name_him() {
    let app = TestApp::start().await;
    let first = volume_of(&app, "sphere 1", "PAT-1", "1.2.1").await;
    let second = volume_of(&app, "sphere 2", "PAT-1", "1.2.2").await;
    let other = volume_of(&app, "sphere 3", "PAT-2", "1.2.3").await;
    let order = json!({"kind": "model", "volume": first});
    let job = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let job = app.until(&job.json().await.unwrap(), &["succeeded"]).await;
    let model = text(&job["model"]);

    let dry = app
        .delete("/v1/volumes?patient=PAT-1&dry_run=true")
        .send()
        .await
        .unwrap();
    assert_eq!(dry.status(), StatusCode::OK);
    let plan: Value = dry.json().await.unwrap();
    let mut volumes = vec![first.clone(), second.clone()];
    volumes.sort();
    assert_eq!(ids(&plan["volumes"]), volumes);
    let mut all = volumes.clone();
    all.push(model.clone());
    assert_eq!(ids(&plan["items"]), all);
    assert_eq!(ids(&plan["jobs"]), [text(&job["id"])]);
    assert!(plan["items"][0]["bytes"].as_u64() > Some(0), "{plan}");
    for clear in ["legal_holds", "unfinished_jobs", "pinned"] {
        assert_eq!(plan[clear], json!([]), "{clear}");
    }
    assert_eq!(plan["unread_volumes"], 0);
    assert_eq!(plan["stays"], json!([]));
    // Without what was made of them, the plan says what would be left.
    let few = app.delete("/v1/volumes?patient=PAT-1&dry_run=true&cascade=false");
    let few: Value = few.send().await.unwrap().json().await.unwrap();
    assert_eq!(ids(&few["items"]), volumes);
    assert_eq!(ids(&few["stays"]), std::slice::from_ref(&model));
    assert_eq!(few["jobs"], json!([]));

    // A volume more, and the plan is another one.
    let third = volume_of(&app, "sphere 4", "PAT-1", "1.2.4").await;
    let path = format!("/v1/volumes?patient=PAT-1&plan={}", text(&plan["plan"]));
    let refused = app.delete(&path).send().await.unwrap();
    problem(refused, 409, "plan-changed").await;
    for id in &all {
        let kind = if *id == model { "models" } else { "volumes" };
        assert_eq!(status(&app, &format!("/v1/{kind}/{id}")).await, 200, "{id}");
    }

    let erased = app
        .delete("/v1/volumes?patient=PAT-1")
        .header("prefer", "return=representation")
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), StatusCode::OK);
    let location = erased.headers()["location"].to_str().unwrap().to_owned();
    let receipt: Value = erased.json().await.unwrap();
    assert_eq!(app.json(&location).await, receipt);
    assert_eq!(receipt["item"], "volumes");
    assert_eq!(receipt["selected_by"], json!(["patient"]));
    volumes.push(third);
    volumes.sort();
    all = volumes.clone();
    all.push(model.clone());
    assert_eq!(ids(&receipt["items"]), all);
    for id in &all {
        let kind = if *id == model { "models" } else { "volumes" };
        assert_eq!(status(&app, &format!("/v1/{kind}/{id}")).await, 410, "{id}");
        let page = app.json(&format!("/v1/erasures?item={id}")).await;
        assert_eq!(ids(&page["erasures"]), [text(&receipt["id"])], "{id}");
    }
    let stored = app.stored();
    assert!(
        stored
            .iter()
            .all(|path| !all.iter().any(|id| path.contains(id))),
        "{stored:?}"
    );
    assert_eq!(status(&app, &format!("/v1/volumes/{other}")).await, 200);
    for written in [receipt.to_string(), app.json("/v1/audit").await.to_string()] {
        assert!(
            !written.contains("PAT-1") && !written.contains("Doe"),
            "{written}"
        );
    }
    // Nothing is left, so a second request erases nothing and says so.
    let again = app
        .delete("/v1/volumes?patient=PAT-1")
        .send()
        .await
        .unwrap();
    problem(again, 404, "no-volumes").await;
}

#[tokio::test]
async fn without_a_filter_nothing_is_erased() {
    let app = TestApp::start().await;
    let id = volume_of(&app, "sphere", "PAT-1", "1.2.1").await;
    for query in [
        "",
        "?",
        "?cascade=true",
        "?dry_run=true",
        "?dry_run=false",
        "?patient=",
        "?patient=%20",
        "?patient=&study=",
        "?study=1.2.1&patient=",
        "?series=%00",
        "?plan=00000000000000000000000000000000",
    ] {
        let refused = app.delete(&format!("/v1/volumes{query}")).send().await;
        let refused = refused.unwrap();
        assert_eq!(refused.status(), 422, "{query}");
        let said: Value = refused.json().await.unwrap();
        assert!(
            said.to_string().contains("othing was erased"),
            "{query}: {said}"
        );
    }
    for query in [
        "stduy=1.2.1",
        "patient=PAT-1&study=1&study=2",
        "study=1.2.1&cascade=maybe",
    ] {
        let refused = app.delete(&format!("/v1/volumes?{query}")).send().await;
        assert_eq!(refused.unwrap().status(), 400, "{query}");
    }
    for query in [
        "patient=PAT",
        "patient=pat-1",
        "patient=*",
        "study=1.2.1&patient=PAT-2",
    ] {
        let none = app.delete(&format!("/v1/volumes?{query}")).send().await;
        problem(none.unwrap(), 404, "no-volumes").await;
        let plan = app.delete(&format!("/v1/volumes?{query}&dry_run=true"));
        let plan: Value = plan.send().await.unwrap().json().await.unwrap();
        assert_eq!(plan["volumes"], json!([]), "{query}");
    }
    assert_eq!(status(&app, &format!("/v1/volumes/{id}")).await, 200);
}

#[tokio::test]
async fn what_must_stay_keeps_all_and_is_named() {
    let app = TestApp::start().await;
    let free = volume_of(&app, "sphere 1", "PAT-1", "1.2.1").await;
    let held = volume_of(&app, "slow 2", "PAT-1", "1.2.2").await;
    let hold = format!("/v1/volumes/{held}/hold");
    let reason = json!({"reason": "a trial"});
    let set = app.client.put(format!("{}{hold}", app.url)).json(&reason);
    assert!(set.send().await.unwrap().status().is_success());
    let refused = app
        .delete("/v1/volumes?patient=PAT-1")
        .send()
        .await
        .unwrap();
    let said = problem(refused, 409, "legal-hold").await;
    assert!(said["detail"].to_string().contains(&held), "{said}");
    app.delete(&hold).send().await.unwrap();

    let order = json!({"kind": "model", "volume": held});
    let job: Value = app
        .post("/v1/jobs")
        .json(&order)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let id = text(&job["id"]);
    let refused = app
        .delete("/v1/volumes?patient=PAT-1")
        .send()
        .await
        .unwrap();
    let said = problem(refused, 409, "in-use").await;
    assert!(said["detail"].to_string().contains(&id), "{said}");
    let plan = app.delete("/v1/volumes?patient=PAT-1&dry_run=true");
    let plan: Value = plan.send().await.unwrap().json().await.unwrap();
    assert_eq!(ids(&plan["unfinished_jobs"]), std::slice::from_ref(&id));
    for kept in [&free, &held] {
        assert_eq!(status(&app, &format!("/v1/volumes/{kept}")).await, 200);
    }
    // A pin of a request.
    app.delete(&format!("/v1/jobs/{id}")).send().await.unwrap();
    app.until(&job, &["cancelled"]).await;
    // Alone, the other study goes; what was made of it stays where that is asked for.
    let model = text(&app.finished("sphere 1").await["model"]);
    let path = "/v1/volumes?study=1.2.1&cascade=false";
    assert_eq!(
        app.delete(path).send().await.unwrap().status(),
        StatusCode::NO_CONTENT
    );
    assert_eq!(status(&app, &format!("/v1/volumes/{free}")).await, 410);
    assert_eq!(status(&app, &format!("/v1/models/{model}")).await, 200);
    assert_eq!(status(&app, &format!("/v1/volumes/{held}")).await, 200);
}

#[tokio::test]
async fn it_needs_the_scope_admin_and_ends_at_the_tenant() {
    let app = TestApp::start().await;
    let mut callers = Vec::new();
    for (scope, tenant) in [
        (Scope::Admin, "clinic"),
        (Scope::Submit, "clinic"),
        (Scope::Read, "clinic"),
        (Scope::Admin, "other"),
    ] {
        let (_, text) = key(app.data.path(), scope, tenant, Quota::default()).await;
        callers.push(app.seen_with(&text));
    }
    closed(&app).await;
    let [admin, submit, read, stranger] = &callers[..] else {
        panic!("four callers")
    };
    let id = volume_of(submit, "sphere", "PAT-1", "1.2.1").await;
    for path in [
        "/v1/volumes?study=1.2.1",
        "/v1/volumes?study=1.2.1&dry_run=true",
        "/v1/volumes",
    ] {
        for caller in [submit, read] {
            let refused = caller.delete(path).send().await.unwrap();
            problem(refused, 403, "insufficient-scope").await;
        }
    }
    let none = stranger.delete("/v1/volumes?study=1.2.1").send().await;
    problem(none.unwrap(), 404, "no-volumes").await;
    assert_eq!(status(read, &format!("/v1/volumes/{id}")).await, 200);
    let erased = admin
        .delete("/v1/volumes?study=1.2.1")
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    assert_eq!(status(read, &format!("/v1/volumes/{id}")).await, 410);
}
