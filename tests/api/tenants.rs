//! Tenants: what belongs to one does not exist for another.
//!
//! The items of another tenant are made by handing those of the tenant `default` over to it in the
//! database; the caller is always `default`.

use crate::helpers::{TestApp, fake_engine, problem, text, volume};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use sqlx::ConnectOptions;
use std::path::Path;
use ventriform::jobs::{
    Catalogue, Filed, Idempotency, JobStore, NewJob, StoredVolume, Tags, Tenant,
};
use ventriform::store::Store;

#[tokio::test]
async fn an_idempotency_key_is_its_tenants_own() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path()).await.unwrap();
    let volume = StoredVolume {
        id: "vol_1".into(),
        sequence: 0,
        created_at: 0,
        bytes: 1,
        files: Vec::new(),
        facts: json!({}),
    };
    let order = |tenant: &str| NewJob {
        tenant: tenant.parse().unwrap(),
        tags: Tags::default(),
        kind: "model".into(),
        volume: "vol_1".into(),
        needs: Default::default(),
        parameters: Default::default(),
        idempotency: Some(Idempotency {
            key: "k".into(),
            fingerprint: "f".into(),
        }),
        webhook: None,
        trace_parent: None,
    };
    let file = async |tenant: &str| store.rows.file(&order(tenant), 10, 0).await.unwrap();
    let a: Tenant = "a".parse().unwrap();
    let b: Tenant = "b".parse().unwrap();
    let tags = Tags::default();
    assert!(store.rows.add_volume(&volume, &a, &tags).await.unwrap());
    let Filed::New(first) = file("a").await else {
        panic!("not filed");
    };
    let Filed::Same(again) = file("a").await else {
        panic!("not recognised");
    };
    assert_eq!(first.id, again.id);
    assert!(
        matches!(file("b").await, Filed::Missing { .. }),
        "b does not have the volume"
    );
    assert!(store.rows.add_volume(&volume, &b, &tags).await.unwrap());
    let Filed::New(other) = file("b").await else {
        panic!("another tenant's key was met");
    };
    assert_ne!(first.id, other.id);
    assert_eq!(other.tenant, b);
}

/// Gives everything that is stored to another tenant.
async fn hand_over(folder: &Path) {
    let options = sqlx::sqlite::SqliteConnectOptions::new()
        .filename(folder.join("ventriform.db"))
        .foreign_keys(false);
    let mut database = options.connect().await.unwrap();
    for statement in [
        "UPDATE holdings SET tenant = 'other'",
        "UPDATE sources SET tenant = 'other'",
        "UPDATE jobs SET tenant = 'other'",
        "UPDATE erased SET tenant = 'other'",
        "UPDATE erasures SET tenant = 'other'",
        "UPDATE label_index SET tenant = 'other'",
    ] {
        sqlx::query(statement).execute(&mut database).await.unwrap();
    }
}

/// The ids of one thing of each kind.
struct Ids {
    volume: String,
    model: String,
    segmentation: String,
    template: String,
    job: String,
    receipt: String,
}

async fn one_of_each(app: &TestApp) -> Ids {
    let erased = app.volume("sphere erased").await;
    let receipt = app
        .delete(&format!("/v1/volumes/{erased}"))
        .header("prefer", "return=representation")
        .send()
        .await
        .unwrap();
    assert_eq!(receipt.status(), StatusCode::OK);
    let receipt: Value = receipt.json().await.unwrap();
    let job = app.post("/v1/models").body(volume("sphere")).send();
    let job: Value = job.await.unwrap().json().await.unwrap();
    let job = app.until(&job, &["succeeded"]).await;
    let model = text(&job["model"]);
    let path = format!("/v1/segmentations?model={model}");
    let fit = app.post(&path).body(volume("sphere")).send();
    let fit: Value = fit.await.unwrap().json().await.unwrap();
    let fit = app.until(&fit, &["succeeded"]).await;
    let template = app
        .post(&format!("/v1/templates?model={model}&organ=generic"))
        .send();
    let template: Value = template.await.unwrap().json().await.unwrap();
    Ids {
        volume: text(&job["volume"]),
        model,
        segmentation: text(&fit["segmentation"]),
        template: text(&template["id"]),
        job: text(&job["id"]),
        receipt: text(&receipt["id"]),
    }
}

#[tokio::test]
async fn no_route_shows_or_changes_what_another_tenant_has() {
    let app = TestApp::start().await;
    let ids = one_of_each(&app).await;
    let data = app.stop().await;
    hand_over(data.path()).await;
    let app = TestApp::on(data, fake_engine(), |_| {}).await;
    let document = app.json("/openapi.json").await;
    let mut tried = 0;
    for (path, operations) in document["paths"].as_object().unwrap() {
        let id = match path.split('/').nth(2) {
            Some("volumes") => &ids.volume,
            Some("models") => &ids.model,
            Some("segmentations") => &ids.segmentation,
            Some("templates") => &ids.template,
            Some("jobs") => &ids.job,
            Some("erasures") => &ids.receipt,
            _ => continue,
        };
        let filled = path
            .replace("{id}", id)
            .replace("{file}", "mesh.stl")
            .replace("{name}", "volume.nii");
        for method in operations.as_object().unwrap().keys() {
            let verb: Method = method.to_uppercase().parse().unwrap();
            if filled == *path {
                if verb == Method::GET {
                    let list = app.json(&filled).await;
                    let kind = path.rsplit('/').next().unwrap();
                    assert_eq!(list[kind], json!([]), "{path}");
                    tried += 1;
                }
                continue;
            }
            let request = app
                .client
                .request(verb.clone(), format!("{}{filled}", app.url));
            let request = match verb {
                Method::PATCH => request.json(&json!({"external_id": "x"})),
                Method::PUT => request.json(&json!({"reason": "x"})),
                _ => request,
            };
            let answer = request.send().await.unwrap();
            let status = answer.status();
            let body = answer.text().await.unwrap();
            assert_eq!(status, StatusCode::NOT_FOUND, "{method} {path}: {body}");
            let shown = body.replace(id, "");
            assert!(!shown.contains("_0"), "{method} {path}: {body}");
            tried += 1;
        }
    }
    assert!(tried > 25, "only {tried} operations were tried");

    let order = |volume: &str, parameters: Value| {
        let body = json!({"kind": "segmentation", "volume": volume, "parameters": parameters});
        app.post("/v1/jobs").json(&body).send()
    };
    let foreign = order(&ids.volume, json!({})).await.unwrap();
    let refused = problem(foreign, 422, "invalid-field").await;
    assert_eq!(refused["field"], "volume");
    let mine = app.volume("sphere mine").await;
    for (field, id) in [("model", &ids.model), ("expert", &ids.volume)] {
        let foreign = order(&mine, json!({field: id})).await.unwrap();
        let refused = problem(foreign, 422, "invalid-field").await;
        assert_eq!(refused["field"], field);
        assert!(!text(&refused["detail"]).contains("erased"), "{refused}");
    }
    let copied = app.post(&format!("/v1/templates?model={}", ids.model));
    problem(copied.send().await.unwrap(), 422, "invalid-field").await;
    let listed = app.json(&format!("/v1/jobs?volume={}", ids.volume)).await;
    assert_eq!(listed["jobs"], json!([]));
}

#[tokio::test]
async fn content_stays_until_the_last_tenant_has_erased_it() {
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    let data = app.stop().await;
    hand_over(data.path()).await;
    let app = TestApp::on(data, fake_engine(), |_| {}).await;
    let path = format!("/v1/volumes/{id}");
    let upload = || app.post("/v1/volumes").body(volume("sphere")).send();
    let first = upload().await.unwrap();
    assert_eq!(first.status(), StatusCode::CREATED, "new for this tenant");
    assert_eq!(upload().await.unwrap().status(), StatusCode::OK);
    let receipt = app
        .delete(&path)
        .header("prefer", "return=representation")
        .send()
        .await
        .unwrap();
    let receipt: Value = receipt.json().await.unwrap();
    assert_eq!(receipt["items"][0]["files_erased"], false);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    let files = app.data.path().join("volumes").join(&id);
    assert!(files.exists(), "the other tenant still has it");
    assert_eq!(upload().await.unwrap().status(), StatusCode::CREATED);
    let data = app.stop().await;
    let options =
        sqlx::sqlite::SqliteConnectOptions::new().filename(data.path().join("ventriform.db"));
    let mut database = options.connect().await.unwrap();
    sqlx::query("DELETE FROM holdings WHERE tenant = 'other'")
        .execute(&mut database)
        .await
        .unwrap();
    let app = TestApp::on(data, fake_engine(), |_| {}).await;
    let gone = app.delete(&path).send().await.unwrap();
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    assert!(!files.exists());
}
