//! The records that a caller has of its items: names and their search, legal holds, receipts of
//! erasures, validators, originals.

use crate::helpers::{TestApp, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::{CACHE_CONTROL, ETAG, IF_NONE_MATCH, LOCATION};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use std::path::Path;

fn ids(list: &Value) -> Vec<String> {
    let items = list.as_array().unwrap().iter();
    items.map(|item| text(&item["id"])).collect()
}

#[tokio::test]
async fn volumes_and_jobs_are_found_by_the_callers_own_names() {
    let app = TestApp::start().await;
    let upload = async |query: &str, words: &str| {
        let path = format!("/v1/volumes?{query}");
        let answer = app.post(&path).body(volume(words)).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::CREATED, "{query}");
        answer.json::<Value>().await.unwrap()
    };
    let first = upload("external_id=A%201&labels=study:42&labels=arm:b", "sphere 1").await;
    let second = upload("labels=study:42", "sphere 2").await;
    let third = upload("", "sphere 3").await;
    assert_eq!(first["external_id"], "A 1");
    assert_eq!(first["labels"], json!({"arm": "b", "study": "42"}));
    assert_eq!(third["labels"], json!({}));
    let found = async |query: &str| {
        let list = app.json(&format!("/v1/volumes?{query}")).await;
        ids(&list["volumes"])
    };
    let (a, b) = (text(&first["id"]), text(&second["id"]));
    assert_eq!(found("external_id=A%201").await, [a.as_str()]);
    assert_eq!(found("labels=study:42").await, [b.clone(), a.clone()]);
    assert_eq!(found("labels=study:42&labels=arm:b").await, [a.as_str()]);
    assert!(found("labels=study:4").await.is_empty());
    let page = app.json("/v1/volumes?labels=study:42&limit=1").await;
    let cursor = text(&page["next_cursor"]);
    let rest = format!("labels=study:42&limit=1&cursor={cursor}");
    assert_eq!(found(&rest).await, [a.as_str()]);

    let patch = |path: String, body: Value| {
        let request = app.client.patch(format!("{}{path}", app.url));
        request.json(&body).send()
    };
    let body = json!({"external_id": null, "labels": {"arm": null, "site": "x"}});
    let changed = patch(format!("/v1/volumes/{a}"), body).await.unwrap();
    assert_eq!(changed.status(), StatusCode::OK);
    let changed: Value = changed.json().await.unwrap();
    assert_eq!(changed["external_id"], Value::Null);
    assert_eq!(changed["labels"], json!({"site": "x", "study": "42"}));
    assert!(found("labels=arm:b").await.is_empty());
    assert_eq!(found("labels=site:x").await, [a.as_str()]);
    assert!(found("external_id=A%201").await.is_empty());

    let order = json!({"volume": a, "external_id": "J1", "labels": {"run": "1"}});
    let job = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let job: Value = job.json().await.unwrap();
    let id = text(&job["id"]);
    assert_eq!(job["external_id"], "J1");
    for query in [
        "external_id=J1".to_owned(),
        "labels=run:1".to_owned(),
        format!("volume={a}&kind=model&created_after=2020-01-01T00:00:00Z"),
    ] {
        let list = app.json(&format!("/v1/jobs?{query}")).await;
        assert_eq!(ids(&list["jobs"]), [id.as_str()], "{query}");
    }
    for query in ["kind=segmentation", "created_after=2999-01-01T00:00:00Z"] {
        let list = app.json(&format!("/v1/jobs?{query}")).await;
        assert_eq!(list["jobs"], json!([]), "{query}");
    }
    let changed = patch(format!("/v1/jobs/{id}"), json!({"labels": {"run": "2"}}));
    let changed: Value = changed.await.unwrap().json().await.unwrap();
    assert_eq!(changed["labels"], json!({"run": "2"}));
    let wrong = patch(format!("/v1/jobs/{id}"), json!({"state": "failed"}));
    problem(wrong.await.unwrap(), 400, "unknown-parameter").await;
}

#[tokio::test]
async fn names_that_cannot_be_used_are_refused() {
    let app = TestApp::with(|settings| settings.label_limit = 2).await;
    let long = "x".repeat(129);
    for (query, status, code) in [
        ("labels=study", 422, "invalid-field"),
        ("labels=a%20b:c", 422, "invalid-field"),
        ("labels=a:", 422, "invalid-field"),
        ("labels=a:%07", 422, "invalid-field"),
        ("external_id=", 422, "invalid-field"),
        (&format!("external_id={long}"), 422, "invalid-field"),
        ("labels=a:1&labels=b:1&labels=c:1", 422, "invalid-field"),
        ("labels=a:1&labels=a:2", 400, "repeated-parameter"),
        ("external_id=a&external_id=b", 400, "repeated-parameter"),
    ] {
        let path = format!("/v1/volumes?{query}");
        let answer = app.post(&path).body(volume("sphere")).send();
        problem(answer.await.unwrap(), status, code).await;
        // Searches for them are, too.
        let code = code.replace("field", "parameter");
        problem(app.get(&path).send().await.unwrap(), 400, &code).await;
    }
    assert_eq!(app.json("/v1/volumes").await["volumes"], json!([]));
}

#[tokio::test]
async fn a_legal_hold_keeps_a_volume_and_what_was_made_of_it() {
    let app = TestApp::with(|settings| {
        settings.volume_retention = "30d".parse().unwrap();
        settings.result_retention = "off".parse().unwrap();
    })
    .await;
    let job = app.post("/v1/models").body(volume("sphere")).send();
    let job: Value = job.await.unwrap().json().await.unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    let itself = format!("/v1/volumes/{}", text(&job["volume"]));
    let model = format!("/v1/models/{}", text(&job["model"]));
    assert!(app.json(&itself).await["expires_at"].is_string());
    assert!(app.json(&model).await["expires_at"].is_null());
    let hold = format!("{}{itself}/hold", app.url);
    let put = |body: Value| app.client.put(&hold).json(&body).send();
    problem(put(json!({})).await.unwrap(), 422, "invalid-field").await;
    let held = put(json!({"reason": "case 17"})).await.unwrap();
    assert_eq!(held.status(), StatusCode::OK);
    let shown = app.json(&itself).await;
    assert_eq!(shown["legal_hold"]["reason"], "case 17");
    assert!(shown["expires_at"].is_null(), "it is kept");
    for path in [&itself, &format!("{itself}?cascade=true"), &model] {
        let refused = app.delete(path).send().await.unwrap();
        problem(refused, 409, "legal-hold").await;
    }
    let lifted = app.client.delete(&hold).send().await.unwrap();
    assert_eq!(lifted.status(), StatusCode::NO_CONTENT);
    for path in [&model, &itself] {
        let erased = app.delete(path).send().await.unwrap();
        assert_eq!(erased.status(), StatusCode::NO_CONTENT, "{path}");
    }
}

/// The files below a folder that contain some bytes.
fn files_with(folder: &Path, bytes: &[u8]) -> Vec<String> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files_with(&path, bytes));
        } else if let Ok(content) = std::fs::read(&path)
            && content.windows(bytes.len()).any(|window| window == bytes)
        {
            found.push(path.display().to_string());
        }
    }
    found
}

#[tokio::test]
async fn an_erased_volume_leaves_a_receipt_and_nothing_else() {
    let app = TestApp::start().await;
    let canary = "KANARIENVOGEL";
    let query = format!("external_id={canary}-1&labels=name:{canary}-2");
    let path = format!("/v1/models?{query}");
    let content = volume(&format!("sphere {canary}-3"));
    let job = app.post(&path).body(content.clone()).send().await.unwrap();
    let job: Value = job.json().await.unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    let (id, model) = (text(&job["volume"]), text(&job["model"]));
    // Copies that were set aside when the files of the volume were damaged.
    for name in [id.clone(), format!("{id}.019a")] {
        let aside = app.data.path().join("quarantine/2026-01-02").join(name);
        std::fs::create_dir_all(&aside).unwrap();
        std::fs::write(aside.join("volume.nii"), &content[1..]).unwrap();
    }
    assert!(!files_with(app.data.path(), canary.as_bytes()).is_empty());
    let itself = format!("/v1/volumes/{id}");
    let wrong = app.delete(&format!("{itself}?cascade=yes")).send();
    problem(wrong.await.unwrap(), 400, "invalid-parameter").await;
    let answer = app
        .delete(&format!("{itself}?cascade=true"))
        .header("prefer", "return=representation")
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let location = answer.headers()[LOCATION].to_str().unwrap().to_owned();
    let receipt: Value = answer.json().await.unwrap();
    assert_eq!(receipt["item"], id);
    assert_eq!(receipt["jobs"], json!([job["id"]]));
    let erased = ids(&receipt["items"]);
    assert_eq!(erased, [id.clone(), model.clone()]);
    let digest = Sha256::digest(&content);
    let digest: String = digest.iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(receipt["items"][0]["files"][0]["sha256"], digest);
    assert_eq!(receipt["items"][0]["files_erased"], true);
    assert_eq!(app.json(&location).await, receipt);
    let trail = app
        .json(&format!("/v1/audit?object={id}"))
        .await
        .to_string();
    let row = format!("\"id\":\"{}\"", text(&receipt["audit_event"]["id"]));
    let hash = text(&receipt["audit_event"]["hash"]);
    assert!(trail.contains(&row) && trail.contains(&hash), "{trail}");
    assert_eq!(trail.matches("\"action\":\"D\"").count(), 1, "{trail}");
    let list = app.json(&format!("/v1/erasures?item={id}")).await;
    assert_eq!(list["erasures"], json!([receipt]));
    for path in [
        itself,
        format!("/v1/models/{model}"),
        format!("/v1/jobs/{}", text(&job["id"])),
    ] {
        problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    }
    let left = files_with(app.data.path(), canary.as_bytes());
    assert_eq!(left, Vec::<String>::new());
    let unknown = app.get("/v1/erasures/ers_none").send().await.unwrap();
    problem(unknown, 404, "not-found").await;
}

#[tokio::test]
async fn json_and_previews_carry_strong_validators() {
    let app = TestApp::start().await;
    let job = app.post("/v1/models").body(volume("sphere")).send();
    let job: Value = job.await.unwrap().json().await.unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    let itself = format!("/v1/volumes/{}", text(&job["volume"]));
    for path in [
        itself.clone(),
        format!("{itself}/preview.png"),
        format!("/v1/models/{}", text(&job["model"])),
    ] {
        let first = app.get(&path).send().await.unwrap();
        assert_eq!(first.status(), StatusCode::OK, "{path}");
        let etag = first.headers()[ETAG].clone();
        assert!(etag.to_str().unwrap().starts_with('"'), "strong: {etag:?}");
        let cache = first.headers()[CACHE_CONTROL].to_str().unwrap().to_owned();
        assert!(cache.starts_with("private"), "{path}: {cache}");
        let again = app.get(&path).header(IF_NONE_MATCH, etag.clone());
        let again = again.send().await.unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED, "{path}");
        assert_eq!(again.headers()[ETAG], etag);
        assert!(again.bytes().await.unwrap().is_empty());
        let head = app.client.head(format!("{}{path}", app.url)).send();
        assert_eq!(head.await.unwrap().headers()[ETAG], etag, "HEAD {path}");
        let other = app.get(&path).header(IF_NONE_MATCH, "\"other\"");
        assert_eq!(other.send().await.unwrap().status(), StatusCode::OK);
    }
    let before = app.get(&itself).send().await.unwrap().headers()[ETAG].clone();
    let patch = app.client.patch(format!("{}{itself}", app.url));
    let patched = patch.json(&json!({"external_id": "x"})).send().await;
    assert_eq!(patched.unwrap().status(), StatusCode::OK);
    let after = app.get(&itself).send().await.unwrap().headers()[ETAG].clone();
    assert_ne!(before, after, "the representation has changed");
}

#[tokio::test]
async fn the_original_upload_comes_back_byte_for_byte() {
    let app = TestApp::start().await;
    let content = volume("sphere 42");
    let sent = app.post("/v1/volumes").body(content.clone()).send();
    let shown: Value = sent.await.unwrap().json().await.unwrap();
    let path = text(&shown["links"]["content"]);
    let answer = app.get(&path).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let etag = answer.headers()[ETAG].to_str().unwrap().to_owned();
    assert_eq!(
        etag,
        format!("\"{}\"", text(&shown["originals"][0]["sha256"]))
    );
    let disposition = answer.headers()["content-disposition"].to_str().unwrap();
    assert!(disposition.starts_with("attachment"), "{disposition}");
    assert_eq!(answer.bytes().await.unwrap(), content);
    let part = app.get(&path).header("range", "bytes=3-9").send();
    let part = part.await.unwrap();
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(part.bytes().await.unwrap(), content[3..10]);
    let file = text(&shown["originals"][0]["href"]);
    let file = app.get(&file).send().await.unwrap();
    assert_eq!(file.bytes().await.unwrap(), content);
    let missing = format!("/v1/volumes/{}/files/other.nii", text(&shown["id"]));
    problem(app.get(&missing).send().await.unwrap(), 404, "not-found").await;
}

/// The patches are read, merged and written at the same time; each is of a label of its own.
#[tokio::test]
async fn patches_of_different_labels_are_all_kept() {
    let app = TestApp::start().await;
    let volume = app.volume("sphere").await;
    let order = json!({"kind": "model", "volume": volume, "parameters": {"points": 67}});
    let job = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let job: Value = job.json().await.unwrap();
    for path in [format!("/v1/volumes/{volume}"), text(&job["links"]["self"])] {
        let patches = (0..16).map(|number| {
            let patch = app.client.patch(format!("{}{path}", app.url));
            let name = format!("label-{number}");
            patch.json(&json!({"labels": {name: "x"}})).send()
        });
        for answer in futures::future::join_all(patches).await {
            assert_eq!(answer.unwrap().status(), StatusCode::OK);
        }
        let labels = app.json(&path).await["labels"].clone();
        assert_eq!(labels.as_object().unwrap().len(), 16, "{labels}");
    }
}
