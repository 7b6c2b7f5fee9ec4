//! `/v1/jobs`.

use crate::helpers::{TestApp, fake_engine, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::LOCATION;
use serde_json::{Value, json};
use std::time::{Duration, Instant};

#[tokio::test]
async fn a_job_goes_from_accepted_to_succeeded() {
    let app = TestApp::start().await;
    let volume = app.volume("sphere").await;
    let order = json!({"kind": "model", "volume": volume, "parameters": {"points": 67}});
    let answer = app.post("/v1/jobs").json(&order).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::ACCEPTED);
    assert!(answer.headers().contains_key("retry-after"));
    let location = answer.headers()[LOCATION].to_str().unwrap().to_owned();
    let job: Value = answer.json().await.unwrap();
    assert_eq!(text(&job["links"]["self"]), location);
    let done = app.until(&job, &["succeeded"]).await;
    assert_eq!(done["progress"], 1.0);
    assert_eq!(done["attempts"], 1);
    assert_eq!(done["parameters"]["points"], 67);
    let model = app.json(&text(&done["links"]["model"])).await;
    assert_eq!(model["volume"], volume);
}

#[tokio::test]
async fn invalid_job_requests_are_rejected_with_the_field() {
    let app = TestApp::start().await;
    let volume = app.volume("sphere").await;
    for (order, status, code, field) in [
        (
            json!({"volume": volume, "parameter": {}}),
            400,
            "unknown-parameter",
            "parameter",
        ),
        (
            json!({"kind": "poem", "volume": volume}),
            422,
            "invalid-field",
            "kind",
        ),
        (
            json!({"kind": 7, "volume": volume}),
            422,
            "invalid-field",
            "kind",
        ),
        (json!({"kind": "model"}), 422, "invalid-field", "volume"),
        (json!({"volume": "vol_0"}), 422, "invalid-field", "volume"),
        (
            json!({"volume": volume, "parameters": []}),
            422,
            "invalid-field",
            "parameters",
        ),
        (
            json!({"volume": volume, "parameters": {"pionts": 5}}),
            422,
            "invalid-parameter",
            "pionts",
        ),
        (
            json!({"volume": volume, "parameters": {"points": "150"}}),
            422,
            "invalid-parameter",
            "points",
        ),
    ] {
        let answer = app.post("/v1/jobs").json(&order).send().await.unwrap();
        let body = problem(answer, status, code).await;
        assert_eq!(body["field"], field, "{order}");
        assert!(body["fix"].is_string(), "{order}");
    }
}

#[tokio::test]
async fn malformed_or_oversized_json_is_rejected() {
    let app = TestApp::start().await;
    let post = |body: String| {
        app.post("/v1/jobs")
            .header("content-type", "application/json")
            .body(body)
            .send()
    };
    problem(post("{".into()).await.unwrap(), 400, "malformed-json").await;
    problem(post("[]".into()).await.unwrap(), 400, "malformed-json").await;
    let deep = format!("{}1{}", "{\"a\":".repeat(5000), "}".repeat(5000));
    problem(post(deep).await.unwrap(), 400, "malformed-json").await;
    let large = format!("{{\"a\":\"{}\"}}", "x".repeat(300_000));
    problem(post(large).await.unwrap(), 413, "body-too-large").await;
    let form = app
        .post("/v1/jobs")
        .header("content-type", "text/plain")
        .body("{}")
        .send();
    problem(form.await.unwrap(), 415, "unsupported-media-type").await;
}

#[tokio::test]
async fn a_repeated_request_with_an_idempotency_key_is_the_same_job() {
    let app = TestApp::start().await;
    let post = |words: &str, key: &str| {
        app.post("/v1/models")
            .header("idempotency-key", key)
            .body(volume(words))
            .send()
    };
    let first: Value = post("sphere", "\"k1\"")
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let again: Value = post("sphere", "\"k1\"")
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(first["id"], again["id"]);
    problem(
        post("brief", "\"k1\"").await.unwrap(),
        422,
        "idempotency-key-reused",
    )
    .await;
    let other: Value = post("sphere", "k2").await.unwrap().json().await.unwrap();
    assert_ne!(first["id"], other["id"]);
    problem(
        post("sphere", "").await.unwrap(),
        400,
        "invalid-idempotency-key",
    )
    .await;
    let concurrent = futures::future::join_all((0..8).map(|_| post("sphere", "k3"))).await;
    let mut ids = Vec::new();
    for answer in concurrent {
        ids.push(text(&answer.unwrap().json::<Value>().await.unwrap()["id"]));
    }
    ids.dedup();
    assert_eq!(ids.len(), 1);
}

#[tokio::test]
async fn a_full_queue_rejects_new_jobs_and_loses_none() {
    let app = TestApp::with(|s| {
        s.queue_limit = 2;
        s.workers = "1".parse().unwrap();
    })
    .await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    let waiting = [app.file("sphere a").await, app.file("sphere b").await];
    let refused = app
        .post("/v1/models")
        .body(volume("sphere c"))
        .send()
        .await
        .unwrap();
    assert!(refused.headers().contains_key("retry-after"));
    problem(refused, 429, "queue-full").await;
    assert_eq!(
        app.json(&text(&waiting[1]["links"]["self"])).await["queue_position"],
        2
    );
    app.delete(&text(&running["links"]["self"]))
        .send()
        .await
        .unwrap();
    for job in &waiting {
        app.until(job, &["succeeded"]).await;
    }
}

#[tokio::test]
async fn a_running_job_stops_computing_within_100_ms() {
    let app = TestApp::start().await;
    let job = app.file("slow").await;
    app.until(&job, &["running"]).await;
    let path = text(&job["links"]["self"]);
    let asked = Instant::now();
    let answer = app.delete(&path).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::ACCEPTED);
    let done = app.until(&job, &["cancelled"]).await;
    // The margin is for a busy machine; the worker stops at its next check of the token, and not after the 30 s
    // that the work takes.
    assert!(asked.elapsed() < Duration::from_secs(15));
    assert!(done["model"].is_null());
}

#[tokio::test]
async fn deleting_cancels_a_waiting_job_and_erases_an_ended_one() {
    let app = TestApp::with(|s| s.workers = "2".parse().unwrap()).await;
    let other = app.file("slow").await;
    app.until(&other, &["running"]).await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    let waiting = app.file("sphere").await;
    let path = text(&waiting["links"]["self"]);
    let answer = app.delete(&path).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.json::<Value>().await.unwrap()["state"], "cancelled");
    let again = app.delete(&path).send().await.unwrap();
    assert_eq!(again.status(), StatusCode::OK, "a retry loses nothing");
    assert_eq!(again.json::<Value>().await.unwrap()["state"], "cancelled");
    let running = text(&running["links"]["self"]);
    let early = app.delete(&format!("{running}?erase=true")).send();
    problem(early.await.unwrap(), 409, "not-finished").await;
    let unclear = app.delete(&format!("{path}?erase=perhaps")).send();
    problem(unclear.await.unwrap(), 400, "invalid-parameter").await;
    let erased = app.delete(&format!("{path}?erase=true")).send();
    assert_eq!(erased.await.unwrap().status(), StatusCode::NO_CONTENT);
    app.delete(&text(&other["links"]["self"]))
        .send()
        .await
        .unwrap();
    let ended = app.finished("fail").await;
    let ended = app.delete(&text(&ended["links"]["self"])).send();
    assert_eq!(ended.await.unwrap().status(), StatusCode::NO_CONTENT);
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    problem(
        app.delete("/v1/jobs/job_0").send().await.unwrap(),
        404,
        "not-found",
    )
    .await;
}

#[tokio::test]
async fn an_ended_job_has_a_validator_that_follows_its_changes() {
    let app = TestApp::start().await;
    let slow = app.file("slow").await;
    app.until(&slow, &["running"]).await;
    let path = text(&slow["links"]["self"]);
    let running = app.get(&path).send().await.unwrap();
    assert!(!running.headers().contains_key("etag"));
    assert_eq!(running.headers()["cache-control"], "no-store");
    assert_eq!(running.headers()["retry-after"], "1");
    app.delete(&path).send().await.unwrap();
    app.until(&slow, &["cancelled"]).await;

    let asked = async |etag: &str| app.get(&path).header("if-none-match", etag).send().await;
    let ended = asked("").await.unwrap();
    assert_eq!(ended.status(), StatusCode::OK);
    let first = text(&ended.headers()["etag"].to_str().unwrap().into());
    let unchanged = asked(&first).await.unwrap();
    assert_eq!(unchanged.status(), StatusCode::NOT_MODIFIED);
    let change = app.client.patch(format!("{}{path}", app.url));
    let change = change.json(&json!({"external_id": "mine"}));
    assert_eq!(change.send().await.unwrap().status(), StatusCode::OK);
    let changed = asked(&first).await.unwrap();
    assert_eq!(changed.status(), StatusCode::OK);
    assert_ne!(changed.headers()["etag"], first.as_str());
    assert_eq!(
        changed.json::<Value>().await.unwrap()["external_id"],
        "mine"
    );
}

#[tokio::test]
async fn a_panic_fails_only_its_job() {
    let app = TestApp::with(|s| s.workers = "1".parse().unwrap()).await;
    let job = app.finished("panic").await;
    assert_eq!(job["state"], "failed");
    assert_eq!(job["error"]["type"], "urn:ventriform:problem:internal");
    assert!(!job["error"].to_string().contains("as told"));
    assert_eq!(app.finished("sphere").await["state"], "succeeded");
}

#[tokio::test]
async fn a_job_that_takes_too_long_fails_with_the_time_limit() {
    let app = TestApp::with(|s| s.job_time_limit = "200ms".parse().unwrap()).await;
    let job = app.finished("slow").await;
    assert_eq!(job["state"], "failed");
    assert_eq!(
        job["error"]["type"],
        "urn:ventriform:problem:job-time-limit"
    );
}

#[tokio::test]
async fn jobs_are_listed_by_state() {
    let app = TestApp::start().await;
    app.finished("sphere").await;
    app.finished("fail").await;
    let failed = app.json("/v1/jobs?state=failed").await;
    assert_eq!(failed["jobs"].as_array().unwrap().len(), 1);
    assert_eq!(
        failed["jobs"][0]["error"]["fix"],
        "Choose another iso-value."
    );
    assert_eq!(
        app.json("/v1/jobs").await["jobs"].as_array().unwrap().len(),
        2
    );
    let answer = app.get("/v1/jobs?state=lost").send().await.unwrap();
    assert_eq!(
        problem(answer, 400, "invalid-parameter").await["field"],
        "state"
    );
}

#[tokio::test]
async fn a_job_whose_lease_expired_is_claimed_again() {
    // A copy of the data folder looks like one whose service died while the job was running.
    let app = TestApp::start().await;
    let job = app.file("slow").await;
    app.until(&job, &["running"]).await;
    let data = app.data.clone();
    let copy = std::sync::Arc::new(tempfile::tempdir().unwrap());
    copy_folder(data.path(), copy.path());
    // A copy may be from before the first key, so it is closed until the operator opens it.
    crate::doctor::open(copy.path());
    let heir = TestApp::on(copy, fake_engine(), |_| {}).await;
    let again = heir.until(&job, &["running"]).await;
    assert_eq!(again["attempts"], 2);
}

fn copy_folder(from: &std::path::Path, to: &std::path::Path) {
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            std::fs::create_dir_all(&target).unwrap();
            copy_folder(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

#[tokio::test]
async fn a_retry_of_an_accepted_request_gets_its_job_although_the_queue_is_full() {
    let app = TestApp::with(|s| {
        s.queue_limit = 2;
        s.workers = "1".parse().unwrap();
    })
    .await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    let stored = app.volume("sphere c").await;
    let post = |path: &str, words: &str, key: &str| {
        let request = app.post(path).header("idempotency-key", key);
        match path {
            "/v1/jobs" => request.json(&json!({"volume": stored})),
            _ => request.body(volume(words)),
        }
    };
    let paths = ["/v1/models", "/v1/segmentations", "/v1/jobs"];
    for path in paths {
        let first = post(path, "sphere a", "key").send().await.unwrap();
        assert_eq!(first.status(), StatusCode::ACCEPTED, "{path}");
        let first: Value = first.json().await.unwrap();
        let filler = app.file("sphere b").await;
        let full = post(path, "sphere a", "new").send().await.unwrap();
        problem(full, 429, "queue-full").await;
        let again = post(path, "sphere a", "key").send().await.unwrap();
        assert_eq!(again.status(), StatusCode::ACCEPTED, "{path}");
        assert_eq!(again.json::<Value>().await.unwrap()["id"], first["id"]);
        if path != "/v1/jobs" {
            let other = post(path, "sphere d", "key").send().await.unwrap();
            problem(other, 422, "idempotency-key-reused").await;
        }
        for job in [&first, &filler] {
            let path = text(&job["links"]["self"]);
            app.delete(&path).send().await.unwrap();
            let erased = app.delete(&format!("{path}?erase=true")).send().await;
            assert_eq!(erased.unwrap().status(), StatusCode::NO_CONTENT);
        }
    }
    let volumes = app.json("/v1/volumes").await;
    let count = volumes["volumes"].as_array().unwrap().len();
    assert_eq!(count, 4, "a refused or repeated request stores nothing");
}

#[tokio::test]
async fn a_list_shows_each_waiting_job_its_place() {
    let app = TestApp::with(|s| s.workers = "1".parse().unwrap()).await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    let mut waiting = Vec::new();
    for number in 0..5 {
        waiting.push(app.file(&format!("sphere {number}")).await);
    }
    app.delete(&text(&waiting[2]["links"]["self"]))
        .send()
        .await
        .unwrap();
    let places = |list: &Value| -> Vec<Value> {
        let jobs = list["jobs"].as_array().unwrap().iter();
        jobs.map(|job| job["queue_position"].clone()).collect()
    };
    let all = app.json("/v1/jobs").await;
    assert_eq!(json!(places(&all)), json!([4, 3, null, 2, 1, null]));
    let page = app.json("/v1/jobs?state=queued&limit=2").await;
    assert_eq!(json!(places(&page)), json!([4, 3]));
    let cursor = text(&page["next_cursor"]);
    let next = app
        .json(&format!("/v1/jobs?state=queued&cursor={cursor}"))
        .await;
    assert_eq!(json!(places(&next)), json!([2, 1]));
}

#[tokio::test]
async fn a_commit_that_takes_longer_than_the_lease_is_not_a_second_attempt() {
    let app = TestApp::with(|s| {
        s.lease = "200ms".parse().unwrap();
    })
    .await;
    let job = app.file("brief").await;
    app.until(&job, &["running"]).await;
    let options =
        sqlx::sqlite::SqliteConnectOptions::new().filename(app.data.path().join("ventriform.db"));
    let mut database: sqlx::SqliteConnection =
        sqlx::ConnectOptions::connect(&options).await.unwrap();
    sqlx::query("BEGIN IMMEDIATE")
        .execute(&mut database)
        .await
        .unwrap();
    // The computation takes 0.3 s; then its commit fails for longer than the lease.
    tokio::time::sleep(Duration::from_millis(1800)).await;
    sqlx::query("ROLLBACK")
        .execute(&mut database)
        .await
        .unwrap();
    let done = app.until(&job, &["succeeded", "failed"]).await;
    assert_eq!(done["state"], "succeeded", "{done}");
    assert_eq!(done["attempts"], 1);
}

#[tokio::test]
async fn urgent_jobs_start_before_routine_ones_and_these_before_bulk() {
    let app = TestApp::with(|settings| settings.workers = "1".parse().unwrap()).await;
    let running = app.file("slow").await;
    app.until(&running, &["running"]).await;
    let volume_id = app.volume("sphere").await;
    let upload = |priority: &str| app.post(&format!("/v1/models?priority={priority}"));
    let bulk = upload("bulk").body(volume("sphere 1")).send().await;
    let bulk: Value = bulk.unwrap().json().await.unwrap();
    let routine = app.file("sphere 2").await;
    let order = json!({"volume": volume_id, "priority": "urgent"});
    let urgent = app.post("/v1/jobs").json(&order).send().await;
    let urgent: Value = urgent.unwrap().json().await.unwrap();
    for (place, (job, priority)) in [(&urgent, "urgent"), (&routine, "routine"), (&bulk, "bulk")]
        .into_iter()
        .enumerate()
    {
        let shown = app.json(&text(&job["links"]["self"])).await;
        assert_eq!(
            (&shown["priority"], &shown["queue_position"]),
            (&json!(priority), &json!(place + 1))
        );
        let found = app
            .json(&format!("/v1/jobs?priority={priority}&state=queued"))
            .await;
        assert_eq!(found["jobs"].as_array().unwrap().len(), 1);
        assert_eq!(found["jobs"][0]["id"], job["id"]);
    }
    let wrong = upload("soon").body(volume("sphere 1")).send().await;
    problem(wrong.unwrap(), 422, "invalid-field").await;
    for value in [json!("URGENT"), json!(1)] {
        let order = json!({"volume": volume_id, "priority": value});
        let wrong = app.post("/v1/jobs").json(&order).send().await;
        let said = problem(wrong.unwrap(), 422, "invalid-field").await;
        assert_eq!(said["field"], "priority");
    }
    let wrong = app.get("/v1/jobs?priority=soon").send().await.unwrap();
    assert_eq!(wrong.status(), StatusCode::BAD_REQUEST);
    let cancelled = app.delete(&text(&running["links"]["self"])).send().await;
    assert!(cancelled.unwrap().status().is_success());
    let mut starts = Vec::new();
    for job in [&urgent, &routine, &bulk] {
        let done = app.until(job, &["succeeded"]).await;
        starts.push(text(&done["started_at"]));
    }
    assert!(starts.is_sorted(), "{starts:?}");
}
