//! Tenants: what belongs to one does not exist for another. Two of them, each with an API key, use
//! one service.

use crate::helpers::{TestApp, closed, key, operations, problem, rows_of, text, volume};
use crate::receiver::Receiver;
use crate::scu::nuclear;
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use ventriform_service::base::records::{
    Catalogue, Clock, Filed, Idempotency, JobStore, NewJob, StoredVolume, SystemClock, Tags, Tenant,
};
use ventriform_service::callers::{
    AccessStore, Activity, ApiKey, AuditEvent, KeyRequest, Maker, Quota, Scope,
};
use ventriform_service::config::Settings;
use ventriform_store::Store;

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
        volume: Some("vol_1".into()),
        needs: Default::default(),
        parameters: Default::default(),
        idempotency: Some(Idempotency {
            key: "k".into(),
            fingerprint: "f".into(),
        }),
        ..NewJob::default()
    };
    let file = async |tenant: &str| store.rows.file(&order(tenant), 10, 0).await.unwrap();
    let a: Tenant = "a".parse().unwrap();
    let b: Tenant = "b".parse().unwrap();
    let tags = Tags::default();
    assert!(
        store
            .rows
            .add_volume(&volume, &a, &tags, None)
            .await
            .unwrap()
    );
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
    assert!(
        store
            .rows
            .add_volume(&volume, &b, &tags, None)
            .await
            .unwrap()
    );
    let Filed::New(other) = file("b").await else {
        panic!("another tenant's key was met");
    };
    assert_ne!(first.id, other.id);
    assert_eq!(other.tenant, b);
}

/// The service as two tenants see it, each by a key of scope `admin`.
async fn two_tenants(app: &TestApp) -> [TestApp; 2] {
    let make = async |tenant: &str| {
        let made = key(app.data.path(), Scope::Admin, tenant, Quota::default());
        app.seen_with(&made.await.1)
    };
    let tenants = [make("a").await, make("b").await];
    closed(app).await;
    tenants
}

/// Makes a key of that tenant which a subject of the issuer owns, beside the service.
async fn key_of_subject(app: &TestApp, tenant: &str, owner: &str) {
    let now = SystemClock.now();
    let request = KeyRequest {
        name: format!("of {owner}"),
        tenant: tenant.parse().unwrap(),
        scope: Scope::Read,
        quota: Quota::default(),
        maker: Maker::Caller(None),
        owner: Some(owner.into()),
        expires_at: None,
    };
    let (key, _) = ApiKey::make(request, now).unwrap();
    let event = AuditEvent::new(now, Activity::KeyCreated, key.tenant.clone(), owner.into());
    let store = rows_of(app.data.path()).await;
    store.add_key(&key, &event.on(&key.id)).await.unwrap();
}

/// A tenant's ids: for each kind of path, the values that go into it.
struct Belongings {
    volume: Value,
    job: Value,
    ids: BTreeMap<&'static str, String>,
    delivery: String,
}

impl Belongings {
    /// Stores one thing of each kind, and tells `receiver` about the job.
    async fn make(a: &TestApp, receiver: &Receiver) -> Self {
        let sent = async |request: RequestBuilder| -> Value {
            let answer = request.send().await.unwrap();
            assert!(answer.status().is_success(), "{}", answer.status());
            answer.json().await.unwrap()
        };
        let erased = a.volume("sphere erased").await;
        let erase = a.delete(&format!("/v1/volumes/{erased}"));
        let receipt = sent(erase.header("prefer", "return=representation")).await;
        let webhook = json!({"url": receiver.url});
        let webhook = sent(a.post("/v1/webhooks").json(&webhook)).await;
        let key = json!({"name": "reader", "scope": "read"});
        let key = sent(a.post("/v1/keys").json(&key)).await;
        let file = a
            .post("/v1/models?external_id=A17&labels=study:42")
            .header("idempotency-key", "k");
        let job = sent(file.body(volume("sphere"))).await;
        let job = a.until(&job, &["succeeded"]).await;
        let model = text(&job["model"]);
        let fit = a.post(&format!("/v1/segmentations?model={model}"));
        let fit = sent(fit.body(volume("sphere"))).await;
        let fit = a.until(&fit, &["succeeded"]).await;
        let beat = a.beat("sphere").await;
        let comparison = a.comparison("sphere stress", "sphere rest").await;
        let serial = a.serial(&["sphere before", "sphere after"]).await;
        let reading = crate::readings::stated(&text(&fit["segmentation"]));
        let reading = a.reading(reading).await;
        let normals = a.normals("sphere").await;
        let template = format!("/v1/templates?model={model}&organ=generic");
        let template = sent(a.post(&template)).await;
        let reader = a.post("/v1/readers").json(&crate::readers::profile(1.0));
        let reader = sent(reader).await;
        let object = a.post("/dicom-web/studies");
        let object = object.header("content-type", "application/dicom");
        sent(object.body(nuclear("1.2.3", 1, "STATIC").file())).await;
        let received = a.json("/v1/intake").await;
        receiver.wait_for(3).await;
        let id = text(&job["id"]);
        let told = a.json(&format!("/v1/jobs/{id}/deliveries")).await;
        let id_of = |value: &Value| text(&value["id"]);
        Self {
            volume: a.json(&text(&job["links"]["volume"])).await,
            delivery: id_of(&told["deliveries"][0]),
            ids: [
                ("volumes", text(&job["volume"])),
                ("models", model),
                ("segmentations", text(&fit["segmentation"])),
                ("beats", id_of(&beat)),
                ("comparisons", id_of(&comparison)),
                ("serials", id_of(&serial)),
                ("readings", id_of(&reading)),
                ("normals", id_of(&normals)),
                ("templates", id_of(&template)),
                ("readers", id_of(&reader)),
                ("jobs", id),
                ("erasures", id_of(&receipt)),
                ("webhooks", id_of(&webhook)),
                ("keys", id_of(&key)),
                ("intake", id_of(&received["intake"][0])),
            ]
            .into(),
            job,
        }
    }

    /// A path of the document with what the tenant has in it, and that id.
    fn fill(&self, path: &str) -> (String, &str) {
        let kind = path.split('/').nth(2).unwrap();
        let id = self.ids.get(kind).unwrap_or_else(|| {
            panic!("this test must know an id of another tenant for the new path {path}")
        });
        let file = text(&self.volume["originals"][0]["name"]);
        let filled = path
            .replace("{id}", id)
            .replace("{name}", &file)
            .replace("{delivery}", &self.delivery);
        assert!(!filled.contains('{'), "what stands for it in {path}?");
        (filled, id)
    }

    /// The ids that must not be seen by others. An idempotency key is no id.
    fn all(&self) -> impl Iterator<Item = &String> {
        self.ids.values().chain([&self.delivery])
    }
}

/// An id of the same form that nobody has.
fn nobodys(id: &str) -> String {
    let (prefix, digits) = id.split_at(id.find('_').map_or(0, |at| at + 1));
    let other = digits.chars().map(|digit| match digit {
        '0' => '1',
        _ => '0',
    });
    format!("{prefix}{}", other.collect::<String>())
}

fn local(settings: &mut Settings) {
    settings.webhook_allow = "127.0.0.0/8".parse().unwrap();
}

/// Files of every model, segmentation and template here.
const MESH_FILES: [&str; 4] = ["mesh.glb", "mesh.stl", "mesh.ply", "mesh.json"];

#[tokio::test]
async fn no_route_shows_or_changes_what_another_tenant_has() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let [a, b] = two_tenants(&app).await;
    let theirs = Belongings::make(&a, &receiver).await;
    let request = |who: &TestApp, method: &Method, path: &str| {
        let request = who
            .client
            .request(method.clone(), format!("{}{path}", app.url));
        match *method {
            Method::PATCH if path.contains("templates") => request.json(&json!({"library": true})),
            Method::PATCH => request.json(&json!({"external_id": "x"})),
            Method::PUT => request.json(&json!({"reason": "x"})),
            _ => request,
        }
    };
    let seen = async |who: &TestApp, method: &Method, path: &str| {
        let answer = request(who, method, path).send().await.unwrap();
        let status = answer.status();
        (status, answer.bytes().await.unwrap())
    };
    let (mut tried, mut lists) = (0, 0);
    for (method, path, _) in operations() {
        if !path.starts_with("/v1/") {
            continue;
        }
        if path.contains('{') {
            let (filled, id) = theirs.fill(&path);
            if method == Method::GET {
                // The owner is served, so there is something to be refused to others. The engine
                // of the tests does not make every file of a result.
                let (status, _) = seen(&a, &method, &filled).await;
                let file = path.rsplit('/').next().unwrap();
                let renamed = ["/v1/beats/", "/v1/comparisons/", "/v1/serials/"];
                let renamed = renamed.iter().any(|other| path.starts_with(other));
                let made = MESH_FILES.contains(&file) && !renamed;
                let unmade = file.contains('.') && !made;
                assert!(
                    unmade || status == StatusCode::OK,
                    "{path} for its owner: {status}"
                );
            }
            let (status, body) = seen(&b, &method, &filled).await;
            let body = String::from_utf8_lossy(&body).into_owned();
            assert_eq!(status, StatusCode::NOT_FOUND, "{method} {path}: {body}");
            // It says no more than about an id that never was.
            let never = nobodys(id);
            let (status, unknown) = seen(&b, &method, &filled.replace(id, &never)).await;
            assert_eq!(status, StatusCode::NOT_FOUND, "{method} {path}");
            let told = |body: &str| {
                let body: Value = serde_json::from_str(body).unwrap();
                [&body["type"], &body["title"], &body["detail"], &body["fix"]].map(Value::clone)
            };
            let unknown = String::from_utf8_lossy(&unknown).replace(&never, id);
            assert_eq!(told(&body), told(&unknown), "{method} {path}");
            tried += 1;
        } else if method == Method::GET {
            let kind = path.rsplit('/').next().unwrap();
            let (status, own) = seen(&a, &method, &path).await;
            assert_eq!(status, StatusCode::OK, "{path}");
            let own = String::from_utf8_lossy(&own).into_owned();
            if let Some(id) = theirs.ids.get(kind) {
                assert!(own.contains(id.as_str()), "{path}: {own}");
            }
            let volume = &theirs.ids["volumes"];
            for query in [
                String::new(),
                "?external_id=A17".into(),
                "?labels=study:42".into(),
                format!("?volume={volume}"),
                format!("?item={volume}"),
                format!("?object={volume}"),
                "?limit=100".into(),
            ] {
                let (status, body) = seen(&b, &method, &format!("{path}{query}")).await;
                if status == StatusCode::BAD_REQUEST && !query.is_empty() {
                    continue;
                }
                let body = String::from_utf8_lossy(&body).into_owned();
                assert_eq!(status, StatusCode::OK, "{path}{query}: {body}");
                for id in theirs.all() {
                    assert!(!body.contains(id.as_str()), "{path}{query}: {body}");
                }
                lists += 1;
            }
        } else {
            // What makes something names others' things in its body or query only; see below.
            let known = [
                "volumes",
                "models",
                "segmentations",
                "beats",
                "comparisons",
                "serials",
                "readings",
                "normals",
                "templates",
                "readers",
                "jobs",
            ];
            let known = known
                .into_iter()
                .chain(["keys", "webhooks", "webhooks/secret"]);
            let known: Vec<String> = known.map(|kind| format!("/v1/{kind}")).collect();
            // By what a caller's own volumes are scans of: `scan_erasures.rs`.
            let by_scans = method == Method::DELETE && path == "/v1/volumes";
            // By who owns the caller's own keys; see below.
            let by_owner = method == Method::DELETE && path == "/v1/keys";
            assert!(
                method == Method::POST && known.contains(&path) || by_scans || by_owner,
                "this test must know what {method} {path} can name"
            );
        }
    }
    assert!(tried > 200, "only {tried} operations were tried");
    assert!(lists > 20, "only {lists} lists were read");

    let order = |job: &str, volume: &str, parameters: Value| {
        let body = json!({"kind": job, "volume": volume, "parameters": parameters});
        b.post("/v1/jobs").json(&body).send()
    };
    for job in ["segmentation", "beat"] {
        let foreign = order(job, &theirs.ids["volumes"], json!({})).await.unwrap();
        let refused = problem(foreign, 422, "invalid-field").await;
        assert_eq!(refused["field"], "volume");
    }
    let mine = b.volume("sphere mine").await;
    for (job, field, kind) in [
        ("segmentation", "model", "models"),
        ("segmentation", "model", "segmentations"),
        ("segmentation", "model", "templates"),
        ("segmentation", "reader", "readers"),
        ("segmentation", "expert", "volumes"),
        ("beat", "model", "models"),
        ("beat", "model", "segmentations"),
        ("beat", "model", "templates"),
    ] {
        let foreign = json!({field: theirs.ids[kind]});
        let foreign = order(job, &mine, foreign).await.unwrap();
        let refused = problem(foreign, 422, "invalid-field").await;
        assert_eq!(refused["field"], field);
        assert!(!text(&refused["detail"]).contains("erased"), "{refused}");
        let path = format!("/v1/{job}s?{field}={}", theirs.ids[kind]);
        let upload = b.post(&path).body(volume("sphere mine")).send();
        problem(upload.await.unwrap(), 422, "invalid-field").await;
    }
    // A scan of another tenant is one that never was.
    for (path, field) in [
        ("/v1/comparisons", "stress"),
        ("/v1/serials", "scans[0]"),
        ("/v1/serials", "scans[1]"),
    ] {
        let named = async |id: &str| {
            let order = match field {
                "stress" => json!({"stress": id, "rest": mine}),
                "scans[0]" => json!({"scans": [id, mine]}),
                _ => json!({"scans": [mine, id]}),
            };
            let refused = b.post(path).json(&order).send().await.unwrap();
            let mut told = problem(refused, 422, "invalid-field").await;
            assert_eq!(told["field"], field, "{told}");
            told["detail"] = text(&told["detail"]).replace(id, "the scan").into();
            told["detail"].clone()
        };
        let foreign = &theirs.ids["volumes"];
        assert_eq!(named(foreign).await, named(&nobodys(foreign)).await);
    }
    let signed = crate::readings::stated(&theirs.ids["segmentations"]);
    let signed = b.post("/v1/readings").json(&signed).send().await.unwrap();
    let refused = problem(signed, 422, "invalid-field").await;
    assert_eq!(refused["field"], "result");
    for kind in ["models", "segmentations"] {
        let copied = b.post(&format!("/v1/templates?model={}", theirs.ids[kind]));
        problem(copied.send().await.unwrap(), 422, "invalid-field").await;
    }

    // A subject may have keys of both tenants.
    key_of_subject(&app, "a", "dr-who").await;
    let (status, revoked) = seen(&b, &Method::DELETE, "/v1/keys?owner=dr-who").await;
    assert_eq!(status, StatusCode::OK);
    let revoked: Value = serde_json::from_slice(&revoked).unwrap();
    assert_eq!(revoked, json!({"revoked": []}));

    // Work items are named by their makers.
    let scheduled = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}}]);
    let made = a.post("/dicom-web/workitems?workitem=1.2.840.7");
    let made = made.header("content-type", "application/dicom+json");
    let made = made.body(scheduled.to_string()).send().await.unwrap();
    assert_eq!(made.status(), StatusCode::CREATED);
    let item = "/dicom-web/workitems/1.2.840.7";
    for method in [Method::GET, Method::DELETE] {
        let (status, _) = seen(&b, &method, item).await;
        assert_eq!(status, StatusCode::NOT_FOUND, "{method} {item}");
    }
    assert_eq!(seen(&a, &Method::GET, item).await.0, StatusCode::OK);

    // Nothing of all that has changed anything for the owner.
    for (kind, shown) in [("volume", &theirs.volume), ("self", &theirs.job)] {
        let now = a.json(&text(&theirs.job["links"][kind])).await;
        assert_eq!(now, *shown, "{kind}");
    }
    for kind in [
        "models",
        "segmentations",
        "templates",
        "readers",
        "erasures",
    ] {
        a.json(&format!("/v1/{kind}/{}", theirs.ids[kind])).await;
    }
    let text_of = async |path: &str| a.get(path).send().await.unwrap().text().await.unwrap();
    for kind in ["keys", "webhooks"] {
        let list = text_of(&format!("/v1/{kind}")).await;
        assert!(list.contains(&theirs.ids[kind]), "{list}");
    }
    assert!(!text_of("/v1/keys").await.contains("revoked_at\":\""));
}

#[tokio::test]
async fn a_tenant_gets_results_and_answers_of_its_own() {
    let app = TestApp::start().await;
    let [a, b] = two_tenants(&app).await;
    let file = async |who: &TestApp, query: &str| {
        let request = who.post(&format!("/v1/models{query}"));
        let request = request.header("idempotency-key", "the same");
        let job = request.body(volume("sphere")).send().await.unwrap();
        assert_eq!(job.status(), StatusCode::ACCEPTED);
        let job: Value = job.json().await.unwrap();
        who.until(&job, &["succeeded"]).await
    };
    let first = file(&a, "?external_id=A17&labels=name:doe").await;
    let shown = a.json(&text(&first["links"]["volume"])).await;
    assert_eq!(shown["external_id"], "A17");
    let second = file(&b, "").await;
    assert_ne!(
        first["id"], second["id"],
        "an idempotency key is its tenant's"
    );
    assert_eq!(first["volume"], second["volume"], "the same bytes");
    assert_ne!(
        first["model"], second["model"],
        "reports say when they were made"
    );
    // Read by one right after the other, who has it too.
    for _ in 0..3 {
        let mine = b.json(&text(&second["links"]["volume"])).await;
        assert_eq!(mine["external_id"], Value::Null, "{mine}");
        assert_eq!(mine["labels"], json!({}));
        let theirs = a.json(&text(&first["links"]["volume"])).await;
        assert_eq!(theirs, shown);
    }
    let again = file(&a, "?external_id=A17&labels=name:doe").await;
    assert_eq!(again["id"], first["id"]);
}

#[tokio::test]
async fn an_answer_is_never_older_than_the_last_change() {
    let app = TestApp::start().await;
    let job = app.finished("sphere").await;
    let path = text(&job["links"]["volume"]);
    for round in 0..20 {
        let name = format!("round {round}");
        let patch = app.client.patch(format!("{}{path}", app.url));
        let patched = patch.json(&json!({"external_id": name})).send();
        assert_eq!(patched.await.unwrap().status(), StatusCode::OK);
        let reads = (0..4).map(|_| app.json(&path));
        for shown in futures::future::join_all(reads).await {
            assert_eq!(shown["external_id"], name);
        }
    }
    let model = text(&job["links"]["model"]);
    app.json(&model).await;
    let hold = format!("{}{path}/hold", app.url);
    let held = app.client.put(&hold).json(&json!({"reason": "x"})).send();
    assert_eq!(held.await.unwrap().status(), StatusCode::OK);
    assert!(app.json(&path).await["legal_hold"].is_object());
    let lifted = app.client.delete(&hold).send().await.unwrap();
    assert_eq!(lifted.status(), StatusCode::NO_CONTENT);
    assert!(app.json(&path).await["legal_hold"].is_null());
    for path in [&model, &path] {
        app.json(path).await;
        let erased = app.delete(path).send().await.unwrap();
        assert_eq!(erased.status(), StatusCode::NO_CONTENT);
        problem(app.get(path).send().await.unwrap(), 410, "gone").await;
    }
}

#[tokio::test]
async fn content_stays_until_the_last_tenant_has_erased_it() {
    let app = TestApp::start().await;
    let [a, b] = two_tenants(&app).await;
    let id = a.volume("sphere").await;
    let path = format!("/v1/volumes/{id}");
    let upload = || b.post("/v1/volumes").body(volume("sphere")).send();
    let first = upload().await.unwrap();
    assert_eq!(first.status(), StatusCode::CREATED, "new for this tenant");
    assert_eq!(upload().await.unwrap().status(), StatusCode::OK);
    let erase = async |who: &TestApp| {
        let request = who.delete(&path).header("prefer", "return=representation");
        let receipt: Value = request.send().await.unwrap().json().await.unwrap();
        receipt["items"][0]["files_erased"].clone()
    };
    assert_eq!(erase(&b).await, false);
    problem(b.get(&path).send().await.unwrap(), 410, "gone").await;
    let files = app.data.path().join("volumes").join(&id);
    assert!(files.exists(), "the other tenant still has it");
    a.json(&path).await;
    assert_eq!(upload().await.unwrap().status(), StatusCode::CREATED);
    assert_eq!(erase(&a).await, false);
    assert_eq!(erase(&b).await, true);
    assert!(!files.exists());
}
