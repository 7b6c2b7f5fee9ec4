//! Limits are shared out, and count all that is stored; a key gets no more than its maker has.

use crate::helpers::{TestApp, closed, key, problem, text, volume};
use futures::StreamExt;
use reqwest::{RequestBuilder, Response, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::time::{Duration, Instant};
use ventriform::mesh::shapes::icosphere;
use ventriform_service::callers::{Quota, Scope};

const FORWARDED_HEADER: &str = "x-forwarded-for";

/// A sphere as a JSON mesh.
fn mesh_json(radius: f64) -> Vec<u8> {
    crate::helpers::mesh_json(&icosphere(radius, 1))
}

/// A service behind a proxy on this machine, which names the client of each request.
async fn behind_proxy(change: impl FnOnce(&mut ventriform_service::config::Settings)) -> TestApp {
    TestApp::with(|settings| {
        settings.trusted_proxies = "127.0.0.1".parse().unwrap();
        change(settings);
    })
    .await
}

fn job(app: &TestApp, key: &str, volume: &str, seed: u32) -> RequestBuilder {
    app.post("/v1/jobs").bearer_auth(key).json(
        &json!({"kind": "model", "volume": volume, "parameters": {"points": 150, "seed": seed}}),
    )
}

async fn upload(app: &TestApp, key: &str, words: &str) -> String {
    let sent = app
        .post("/v1/volumes")
        .bearer_auth(key)
        .body(volume(words))
        .send();
    let stored: Value = sent.await.unwrap().json().await.unwrap();
    text(&stored["id"])
}

async fn ended(app: &TestApp, key: &str, job: &Value) -> Value {
    let until = Instant::now() + Duration::from_secs(20);
    loop {
        let found = app.get(&text(&job["links"]["self"])).bearer_auth(key);
        let found: Value = found.send().await.unwrap().json().await.unwrap();
        if !matches!(found["state"].as_str(), Some("queued" | "running")) {
            return found;
        }
        assert!(Instant::now() < until, "{found}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn one_tenant_cannot_keep_another_out_of_the_queue() {
    let app = TestApp::with(|settings| settings.queue_limit = 6).await;
    let mut keys = Vec::new();
    for tenant in ["a", "b", "c"] {
        keys.push(
            key(app.data.path(), Scope::Submit, tenant, Quota::default())
                .await
                .1,
        );
    }
    closed(&app).await;
    let mut accepted = [0; 3];
    for (tenant, key) in keys.iter().enumerate() {
        let id = upload(&app, key, "slow").await;
        for seed in 0..12 {
            let answer = job(&app, key, &id, seed).send().await.unwrap();
            match answer.status() {
                StatusCode::ACCEPTED => accepted[tenant] += 1,
                _ => {
                    problem(answer, 429, "queue-full").await;
                    break;
                }
            }
        }
    }
    // Two jobs of the first run. Half of the queue for the second, a third for the last.
    assert!((6..=8).contains(&accepted[0]), "{accepted:?}");
    assert_eq!(accepted[1..], [3, 2], "{accepted:?}");
}

#[tokio::test]
async fn everything_that_is_stored_counts_and_nothing_exceeds_the_quota() {
    let app = TestApp::start().await;
    let quota = 40_000;
    let of = |bytes| Quota {
        bytes: Some(bytes),
        ..Quota::default()
    };
    let (_, small) = key(app.data.path(), Scope::Admin, "a", of(quota)).await;
    let (_, large) = key(app.data.path(), Scope::Admin, "a", of(10_000_000)).await;
    closed(&app).await;
    let stored = async || {
        // The quota at which nothing more fits says what is stored.
        let (_, none) = key(app.data.path(), Scope::Submit, "a", of(0)).await;
        let sent = app.post("/v1/volumes").bearer_auth(&none).body("x").send();
        let refused = problem(sent.await.unwrap(), 507, "storage-quota").await;
        let detail = text(&refused["detail"]);
        let number = detail.split(' ').find_map(|word| word.parse::<u64>().ok());
        number.unwrap()
    };
    let files = |item: &Value| -> u64 {
        let files = item["files"].as_array().unwrap().iter();
        files.map(|file| file["bytes"].as_u64().unwrap()).sum()
    };
    let mut expected = 0;
    let id = upload(&app, &small, "sphere").await;
    expected += volume("sphere").len() as u64;
    assert_eq!(stored().await, expected);
    // Results: one fits, and then no more do, whoever has filed them in time.
    let filed: Vec<Value> = futures::stream::iter(0..6)
        .filter_map(async |seed| {
            let answer = job(&app, &small, &id, seed).send().await.unwrap();
            match answer.status() {
                StatusCode::ACCEPTED => Some(answer.json().await.unwrap()),
                _ => None,
            }
        })
        .collect()
        .await;
    let mut models = BTreeSet::new();
    for filed in &filed {
        let ended = ended(&app, &small, filed).await;
        match ended["state"].as_str() {
            Some("succeeded") => drop(models.insert(text(&ended["model"]))),
            _ => assert_eq!(
                ended["error"]["type"], "urn:ventriform:problem:storage-quota",
                "{ended}"
            ),
        }
    }
    for model in &models {
        let model = app.get(&format!("/v1/models/{model}")).bearer_auth(&small);
        expected += files(&model.send().await.unwrap().json().await.unwrap());
    }
    // The records of the jobs, however they ended.
    let records = stored().await - expected;
    let each = records / filed.len() as u64;
    assert!((2048..3000).contains(&each), "{records} of {}", filed.len());
    expected += records;
    // A result may be stored while one more job is filed.
    assert!(expected <= quota + each, "{expected}");
    // Templates, readers and work items, with room enough and without.
    let template = |key: &str| {
        app.post("/v1/templates?name=t&organ=generic")
            .bearer_auth(key)
            .header("content-type", "application/json")
            .body(mesh_json(20.0))
            .send()
    };
    let (_, tight) = key(app.data.path(), Scope::Admin, "a", of(expected + 1000)).await;
    problem(template(&tight).await.unwrap(), 507, "storage-quota").await;
    assert_eq!(stored().await, expected);
    let made: Value = template(&large).await.unwrap().json().await.unwrap();
    expected += files(&made);
    assert_eq!(stored().await, expected);
    let item = |key: &str, label: usize| {
        let set = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
                          "00741204": {"vr": "LT", "Value": ["x".repeat(label)]}}]);
        app.post("/dicom-web/workitems?workitem=1.2.3")
            .bearer_auth(key)
            .json(&set)
            .send()
    };
    let (_, tight) = key(app.data.path(), Scope::Admin, "a", of(expected + 1000)).await;
    problem(item(&tight, 2000).await.unwrap(), 507, "storage-quota").await;
    assert_eq!(
        item(&large, 2000).await.unwrap().status(),
        StatusCode::CREATED
    );
    let now = stored().await;
    assert!((expected + 2000..expected + 3000).contains(&now), "{now}");
    // What is erased does not count any more.
    for path in [
        text(&made["links"]["self"]),
        format!("/v1/volumes/{id}?cascade=true"),
    ] {
        let erased = app.delete(&path).bearer_auth(&large).send().await.unwrap();
        assert!(erased.status().is_success(), "{path}");
    }
    assert!(stored().await < 3000);
}

/// An upload whose length is not announced.
async fn chunked(app: &TestApp, key: &str, length: usize) -> Response {
    let mut bytes = volume("sphere");
    bytes.resize(length, b' ');
    let pieces: Vec<_> = bytes
        .chunks(700)
        .map(|piece| Ok::<_, std::io::Error>(piece.to_vec()))
        .collect();
    let body = reqwest::Body::wrap_stream(futures::stream::iter(pieces));
    let sent = app.post("/v1/volumes").bearer_auth(key).body(body);
    sent.send().await.unwrap()
}

#[tokio::test]
async fn an_upload_of_unknown_length_has_room_under_any_quota_that_it_fits() {
    let app = TestApp::start().await;
    let quota = Quota {
        bytes: Some(10_000),
        ..Quota::default()
    };
    let (_, key) = key(app.data.path(), Scope::Submit, "a", quota).await;
    closed(&app).await;
    assert_eq!(
        chunked(&app, &key, 4000).await.status(),
        StatusCode::CREATED
    );
    problem(chunked(&app, &key, 6001).await, 507, "storage-quota").await;
    assert_eq!(
        chunked(&app, &key, 6000).await.status(),
        StatusCode::CREATED
    );
    problem(chunked(&app, &key, 100).await, 507, "storage-quota").await;
    // Several at once do not exceed it together.
    let app = TestApp::start().await;
    let (_, key) = self::key(app.data.path(), Scope::Submit, "a", quota).await;
    closed(&app).await;
    let sent = (0..8).map(|n| chunked(&app, &key, 3000 + n));
    let answers = futures::future::join_all(sent).await;
    let stored = answers.iter().filter(|answer| answer.status() == 201);
    let stored = stored.count();
    assert!((1..=3).contains(&stored), "{stored}");
}

#[tokio::test]
async fn a_key_gets_no_more_than_its_maker_and_the_operator_allow() {
    let app = TestApp::with(|settings| settings.quota_jobs = "7".parse().unwrap()).await;
    let own = Quota {
        requests: Some(500),
        bytes: Some(1000),
        jobs: None,
    };
    let (_, maker) = key(app.data.path(), Scope::Admin, "a", own).await;
    let (_, free) = key(app.data.path(), Scope::Admin, "a", Quota::default()).await;
    closed(&app).await;
    let make = |maker: &str, fields: Value| {
        let mut body = json!({"name": "k", "scope": "submit"});
        body.as_object_mut()
            .unwrap()
            .extend(fields.as_object().unwrap().clone());
        app.post("/v1/keys").bearer_auth(maker).json(&body).send()
    };
    for (field, most) in [
        ("requests_per_minute", 500),
        ("stored_bytes", 1000),
        ("queued_jobs", 7),
    ] {
        let refused = make(&maker, json!({field: most + 1})).await.unwrap();
        let refused = problem(refused, 422, "invalid-field").await;
        assert_eq!(refused["field"], field);
        let made: Value = make(&maker, json!({field: most}))
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        assert_eq!(made[field], most);
        // What is left out is the maker's.
        assert_eq!(made["stored_bytes"], 1000);
        assert_eq!(made["requests_per_minute"], 500);
    }
    // The operator's limits hold for a maker that has none of its own.
    problem(
        make(&free, json!({"queued_jobs": 8})).await.unwrap(),
        422,
        "invalid-field",
    )
    .await;
    let made: Value = make(&free, json!({"stored_bytes": 5}))
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(made["stored_bytes"], 5);
    // A key does not outlive its maker.
    let mortal = json!({"scope": "admin", "expires_at": "2100-01-01T00:00:00Z"});
    let mortal: Value = make(&free, mortal).await.unwrap().json().await.unwrap();
    let mortal = text(&mortal["key"]);
    let child: Value = make(&mortal, json!({}))
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert!(text(&child["expires_at"]).starts_with("2100-01-01T00:00:00"));
    let later = json!({"expires_at": "2100-01-01T00:00:01Z"});
    problem(make(&mortal, later).await.unwrap(), 422, "invalid-field").await;
}

#[tokio::test]
async fn all_keys_that_a_key_makes_have_together_what_it_has() {
    let app = TestApp::start().await;
    let of = |requests| Quota {
        requests,
        ..Quota::default()
    };
    let (_, maker) = key(app.data.path(), Scope::Admin, "a", of(Some(20))).await;
    let (_, free) = key(app.data.path(), Scope::Admin, "a", of(None)).await;
    closed(&app).await;
    let make = async |maker: &str, scope: &str| {
        let body = json!({"name": "k", "scope": scope});
        let sent = app.post("/v1/keys").bearer_auth(maker).json(&body);
        let made: Value = sent.send().await.unwrap().json().await.unwrap();
        (text(&made["key"]), made)
    };
    // Three requests of the maker's, and one more by a key that one of its keys makes.
    let (first, made) = make(&maker, "admin").await;
    assert_eq!(made["requests_per_minute"], 20);
    let (second, _) = make(&maker, "read").await;
    let (third, of_first) = make(&first, "read").await;
    assert_eq!(of_first["made_by"], made["id"]);
    let ask = async |key: &str| {
        let answer = app.get("/v1/jobs").bearer_auth(key).send().await.unwrap();
        let left = answer.headers().get("ratelimit").cloned();
        (answer.status().as_u16(), left)
    };
    let mut sent = 3;
    for key in [&first, &second, &third, &maker]
        .into_iter()
        .cycle()
        .take(17)
    {
        let (status, left) = ask(key).await;
        sent += 1;
        assert_eq!(status, 200, "request {sent}");
        // What is left to a key is what is left to all of them.
        let left = left.unwrap().to_str().unwrap().to_owned();
        let expected = format!("\"requests\";r={};t=", 20 - sent);
        assert!(left.starts_with(&expected), "{left} after {sent}");
    }
    for key in [&first, &second, &third, &maker] {
        assert_eq!(ask(key).await.0, 429);
    }
    // Nobody else's.
    assert_eq!(ask(&free).await.0, 200);
    let (other, made) = make(&free, "read").await;
    assert!(made["requests_per_minute"].is_null());
    assert_eq!(ask(&other).await.0, 200);
    // Keys that make keys that make keys end somewhere.
    let mut last = make(&free, "admin").await.0;
    for _ in 0..6 {
        last = make(&last, "admin").await.0;
    }
    let body = json!({"name": "k", "scope": "admin"});
    let refused = app.post("/v1/keys").bearer_auth(&last).json(&body);
    problem(refused.send().await.unwrap(), 422, "invalid-field").await;
    assert_eq!(ask(&make(&last, "submit").await.0).await.0, 200);
}

#[tokio::test]
async fn the_records_of_jobs_count_for_their_tenant() {
    let app = TestApp::start().await;
    let quota = Quota {
        bytes: Some(100_000),
        ..Quota::default()
    };
    let (_, key) = key(app.data.path(), Scope::Submit, "a", quota).await;
    closed(&app).await;
    let id = upload(&app, &key, "sphere").await;
    // Jobs that fail leave nothing but their records.
    let mut filed = 0;
    let refused = loop {
        let body = json!({"kind": "model", "volume": id, "parameters": {"points": 150, "seed": filed},
                          "labels": {"note": "x".repeat(200)}});
        let sent = app.post("/v1/jobs").bearer_auth(&key).json(&body);
        let answer = sent.send().await.unwrap();
        match answer.status() {
            StatusCode::ACCEPTED => {
                let job: Value = answer.json().await.unwrap();
                let cancelled = app.delete(&text(&job["links"]["self"])).bearer_auth(&key);
                cancelled.send().await.unwrap();
                filed += 1;
            }
            _ => break answer,
        }
        assert!(filed < 100, "the records of {filed} jobs are stored");
    };
    problem(refused, 507, "storage-quota").await;
    assert!(filed >= 5, "{filed}");
}

#[tokio::test]
async fn a_key_that_reads_gets_no_upload_that_may_name_a_patient() {
    let app = TestApp::start().await;
    let (_, submit) = key(app.data.path(), Scope::Submit, "a", Quota::default()).await;
    let (_, read) = key(app.data.path(), Scope::Read, "a", Quota::default()).await;
    closed(&app).await;
    let bare = upload(&app, &submit, "sphere").await;
    let named = upload(&app, &submit, "sphere of a patient").await;
    for (id, allowed) in [(&bare, true), (&named, false)] {
        let about: Value = app
            .get(&format!("/v1/volumes/{id}"))
            .bearer_auth(&read)
            .send()
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        for path in [
            text(&about["links"]["content"]),
            text(&about["originals"][0]["href"]),
        ] {
            let own = app.get(&path).bearer_auth(&submit).send().await.unwrap();
            assert_eq!(own.status(), 200);
            let answer = app.get(&path).bearer_auth(&read).send().await.unwrap();
            if allowed {
                assert_eq!(answer.status(), 200, "{path}")
            } else {
                drop(problem(answer, 403, "insufficient-scope").await)
            }
        }
    }
}

#[tokio::test]
async fn every_row_of_the_trail_names_its_item() {
    let app = TestApp::start().await;
    let (_, admin) = key(app.data.path(), Scope::Admin, "a", Quota::default()).await;
    closed(&app).await;
    let id = upload(&app, &admin, "sphere").await;
    let filed: Value = job(&app, &admin, &id, 1)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let model = text(&ended(&app, &admin, &filed).await["model"]);
    let uid = "1.2.840.99.1";
    let item = format!("/dicom-web/workitems/{uid}");
    let scheduled = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]}}]);
    let claim = json!([{"00741000": {"vr": "CS", "Value": ["IN PROGRESS"]},
                        "00081195": {"vr": "UI", "Value": ["1.9"]}}]);
    let label = json!([{"00741204": {"vr": "LO", "Value": ["x"]},
                        "00081195": {"vr": "UI", "Value": ["1.9"]}}]);
    let client = &app.client;
    let url = |path: &str| format!("{}{path}", app.url);
    let hook = json!({"url": "https://example.org/x"});
    let requests = [
        client
            .post(url(&format!("/dicom-web/workitems?workitem={uid}")))
            .json(&scheduled),
        client.get(url(&item)),
        client.put(url(&format!("{item}/state"))).json(&claim),
        client.post(url(&item)).json(&label),
        client.post(url(&format!("{item}/cancelrequest"))),
        client.get(url("/dicom-web/workitems")),
        client.get(url(&format!("/v1/volumes/{id}"))),
        client
            .patch(url(&format!("/v1/volumes/{id}")))
            .json(&json!({"external_id": "e"})),
        client.post(url(&format!(
            "/v1/templates?name=t&organ=generic&model={model}"
        ))),
        client.post(url("/v1/webhooks")).json(&hook),
        client.post(url("/v1/webhooks/secret")),
        client.get(url("/v1/keys")),
    ];
    for request in requests {
        let answer = request.bearer_auth(&admin).send().await.unwrap();
        assert!(
            answer.status().is_success() || answer.status() == 422,
            "{answer:?}"
        );
    }
    let until = Instant::now() + Duration::from_secs(10);
    loop {
        let trail = app
            .get("/v1/audit?limit=100")
            .bearer_auth(&admin)
            .send()
            .await
            .unwrap();
        let trail: Value = trail.json().await.unwrap();
        let events = trail["events"].as_array().unwrap();
        let objects: Vec<&str> = events
            .iter()
            .map(|event| {
                let object = &event["entity"][0]["what"]["identifier"]["value"];
                object.as_str().unwrap_or_else(|| panic!("{event}"))
            })
            .collect();
        let of_item = objects.iter().filter(|object| **object == uid).count();
        if of_item >= 5 && objects.contains(&"workitems") {
            assert!(objects.contains(&"webhooks/secret"));
            return;
        }
        assert!(Instant::now() < until, "{objects:?}");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
}

#[tokio::test]
async fn one_client_that_holds_memory_keeps_no_other_waiting() {
    let app = behind_proxy(|settings| settings.request_memory = "1MiB".parse().unwrap()).await;
    let half = |client: &'static str| {
        // Begins a body of JSON and leaves the rest.
        let begin = futures::stream::iter([Ok::<_, std::io::Error>(vec![b' '; 100_000])]);
        let body = begin.chain(futures::stream::pending());
        let sent = app
            .post("/v1/templates?name=t&organ=generic")
            .header(FORWARDED_HEADER, client)
            .header("content-type", "application/json")
            .body(reqwest::Body::wrap_stream(body))
            .send();
        tokio::spawn(sent)
    };
    let greedy: Vec<_> = (0..12).map(|_| half("192.0.2.1")).collect();
    tokio::time::sleep(Duration::from_millis(500)).await;
    let list = |client: &'static str| {
        let list = app
            .get("/v1/volumes?limit=3")
            .header(FORWARDED_HEADER, client);
        list.send()
    };
    let began = Instant::now();
    for client in ["192.0.2.2", "192.0.2.3", "192.0.2.2"] {
        assert_eq!(list(client).await.unwrap().status(), 200, "{client}");
    }
    assert!(began.elapsed() < Duration::from_secs(2));
    // The one that holds it is told so, and the others of its requests too.
    problem(list("192.0.2.1").await.unwrap(), 503, "busy").await;
    let ended = greedy.iter().filter(|sent| sent.is_finished()).count();
    assert!(ended > 0, "not all of them can be held");
    for sent in &greedy {
        sent.abort();
    }
    drop(greedy);
    let until = Instant::now() + Duration::from_secs(10);
    while list("192.0.2.1").await.unwrap().status() != 200 {
        assert!(Instant::now() < until, "what was held is not given back");
    }
}

#[tokio::test]
async fn one_large_row_is_charged_before_it_is_read() {
    let app = behind_proxy(|settings| settings.request_memory = "4MiB".parse().unwrap()).await;
    for (uid, size) in [("1.2.1", 60_000), ("1.2.2", 100)] {
        let set = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
                          "00741204": {"vr": "LT", "Value": ["x".repeat(size)]}}]);
        let created = app
            .post(&format!("/dicom-web/workitems?workitem={uid}"))
            .json(&set)
            .send();
        assert_eq!(created.await.unwrap().status(), 201);
    }
    let half = || {
        // Begins a body of JSON and leaves the rest.
        let begin = futures::stream::iter([Ok::<_, std::io::Error>(vec![b' '; 100_000])]);
        let body = begin.chain(futures::stream::pending());
        let sent = app
            .post("/v1/templates?name=t&organ=generic")
            .header(FORWARDED_HEADER, "192.0.2.1")
            .header("content-type", "application/json")
            .body(reqwest::Body::wrap_stream(body))
            .send();
        tokio::spawn(sent)
    };
    let greedy: Vec<_> = (0..12).map(|_| half()).collect();
    tokio::time::sleep(Duration::from_millis(500)).await;
    let item = async |client: &str, uid: &str| {
        let item = app
            .get(&format!("/dicom-web/workitems/{uid}"))
            .header(FORWARDED_HEADER, client);
        item.send().await.unwrap()
    };
    assert_eq!(
        item("192.0.2.1", "1.2.2").await.status(),
        200,
        "a small one"
    );
    problem(item("192.0.2.1", "1.2.1").await, 503, "busy").await;
    // Another client has its share.
    assert_eq!(item("192.0.2.2", "1.2.1").await.status(), 200);
    for sent in &greedy {
        sent.abort();
    }
    // What was charged is given back, however often it is read.
    for _ in 0..20 {
        assert_eq!(item("192.0.2.3", "1.2.1").await.status(), 200);
    }
}

#[tokio::test]
async fn work_items_are_bounded_one_by_one_and_in_pages() {
    let app = TestApp::start().await;
    let create = |n: usize, size: usize| {
        let set = json!([{"00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
                          "00741204": {"vr": "LT", "Value": ["x".repeat(size)]}}]);
        app.post(&format!("/dicom-web/workitems?workitem=1.2.{n}"))
            .json(&set)
            .send()
    };
    const ITEM_COUNT: usize = 15;
    for n in 0..ITEM_COUNT {
        assert_eq!(create(n, 200_000).await.unwrap().status(), 201);
    }
    // An item does not grow beyond the largest body.
    let grow = json!([{"00741202": {"vr": "LT", "Value": ["x".repeat(100_000)]}}]);
    let grown = app.post("/dicom-web/workitems/1.2.1").json(&grow).send();
    problem(grown.await.unwrap(), 413, "body-too-large").await;
    // A search answers with as many as fit, says that there are more, and gives each once.
    let mut seen = BTreeSet::new();
    let mut pages = 0;
    while seen.len() < ITEM_COUNT {
        let path = format!("/dicom-web/workitems?limit=1000&offset={}", seen.len());
        let page = app.get(&path).send().await.unwrap();
        assert_eq!(page.status(), 200);
        let warned = page.headers().contains_key("warning");
        let page = page.bytes().await.unwrap();
        assert!(page.len() < 3 << 20, "{}", page.len());
        let page: Vec<Value> = serde_json::from_slice(&page).unwrap();
        for item in &page {
            assert!(seen.insert(text(&item["00080018"]["Value"][0])));
        }
        assert_eq!(warned, seen.len() < ITEM_COUNT);
        pages += 1;
    }
    assert!(pages > 1);
    let found = app
        .get("/dicom-web/workitems?ProcedureStepLabel=x*&limit=2")
        .send();
    let found: Vec<Value> = found.await.unwrap().json().await.unwrap();
    assert_eq!(found.len(), 2);
    let terms: String = (0..30).map(|_| "&PatientID=*").collect();
    let broad = app
        .get(&format!("/dicom-web/workitems?limit=1{terms}"))
        .send();
    problem(broad.await.unwrap(), 400, "unknown-parameter").await;
}

#[tokio::test]
async fn templates_have_the_same_limits_whichever_way_they_come() {
    let data = tempfile::tempdir().unwrap();
    let folder = tempfile::tempdir().unwrap();
    let import = |name: &str, radius: f64| {
        let path = folder.path().join(format!("{name}.json"));
        std::fs::write(&path, mesh_json(radius)).unwrap();
        let program = env!("CARGO_BIN_EXE_ventriform");
        let run = std::process::Command::new(program)
            .args(["templates", "import", "--organ", "generic", "--data-dir"])
            .arg(data.path())
            .arg(&path)
            .env("VENTRIFORM_TEMPLATE_LIMIT", "2")
            .output();
        let run = run.unwrap();
        (
            run.status.success(),
            String::from_utf8_lossy(&run.stderr).into_owned(),
        )
    };
    assert!(import("first", 20.0).0);
    let (done, said) = import(&"n".repeat(81), 21.0);
    assert!(!done && said.contains("80 printable characters"), "{said}");
    assert!(import(&"n".repeat(80), 21.0).0);
    let (done, said) = import("third", 22.0);
    assert!(!done && said.contains("2 templates already"), "{said}");
    assert!(import("again", 20.0).0, "one that is there already");
    let path = folder.path().join("large.json");
    std::fs::write(&path, vec![b' '; (4 << 20) + 1]).unwrap();
    let (done, said) = {
        let run = std::process::Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args(["templates", "import", "--data-dir"])
            .arg(data.path())
            .arg(&path)
            .output()
            .unwrap();
        (
            run.status.success(),
            String::from_utf8_lossy(&run.stderr).into_owned(),
        )
    };
    assert!(!done && said.contains("4194304 bytes"), "{said}");
}
