//! Webhooks: signed, retried, kept across restarts, refused where they would reach this machine.

use crate::helpers::{Service, TestApp, fake_engine, problem, text, volume};
use crate::receiver::Receiver;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde_json::{Value, json};
use std::time::{Duration, Instant};
use ventriform_service::config::Settings;
use ventriform_service::network::hooks::SigningSecret;

const HOOK_SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw";

/// A service that may tell programs on this machine, and does not wait long before it tries again.
fn local(settings: &mut Settings) {
    settings.webhook_allow = "127.0.0.0/8".parse().unwrap();
    settings.webhook_backoff = "20ms".parse().unwrap();
    settings.webhook_timeout = "500ms".parse().unwrap();
}

async fn file(app: &TestApp, words: &str, webhook: Value) -> Value {
    let volume = app.volume(words).await;
    let job = json!({"kind": "model", "volume": volume, "webhook": webhook});
    let answer = app.post("/v1/jobs").json(&job).send().await.unwrap();
    assert_eq!(answer.status(), 202, "{}", answer.text().await.unwrap());
    answer.json().await.unwrap()
}

async fn deliveries(app: &TestApp, job: &Value) -> Vec<Value> {
    let path = format!("{}/deliveries", text(&job["links"]["self"]));
    let list = app.json(&path).await;
    list["deliveries"].as_array().unwrap().clone()
}

/// Waits until the job's only delivery is in that state; returns it.
async fn delivery_until(app: &TestApp, job: &Value, state: &str) -> Value {
    let deadline = Instant::now() + Duration::from_secs(30);
    loop {
        let found = deliveries(app, job).await;
        if let [only] = &found[..]
            && only["state"] == state
        {
            return only.clone();
        }
        assert!(Instant::now() < deadline, "not {state}: {found:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

#[tokio::test]
async fn ends_of_jobs_are_told_signed_and_once() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let url = format!("{}/hook?a=b", receiver.url);
    for (words, state) in [("sphere", "succeeded"), ("fail", "failed")] {
        let job = file(&app, words, json!({"url": url, "secret": HOOK_SECRET})).await;
        let told = delivery_until(&app, &job, "delivered").await;
        let request = receiver.received().last().unwrap().clone();
        assert_eq!(request.path, "/hook");
        assert_eq!(request.header("webhook-id"), text(&told["id"]));
        assert_eq!(request.header("content-type"), "application/json");
        let secret: SigningSecret = HOOK_SECRET.parse().unwrap();
        let seconds: i64 = request.header("webhook-timestamp").parse().unwrap();
        let body = String::from_utf8(request.body.to_vec()).unwrap();
        let signature = secret.sign(&text(&told["id"]), seconds, &body);
        assert_eq!(request.header("webhook-signature"), signature);
        let message = request.json();
        assert_eq!(message["type"], format!("job.{state}"));
        assert_eq!(message["data"]["job"], job["id"]);
        assert_eq!(message["data"]["state"], state);
        assert_eq!(message["data"]["links"]["self"], job["links"]["self"]);
        let ended = app.json(&text(&job["links"]["self"])).await;
        assert_eq!(
            message["data"].get("model"),
            ended.get("model").filter(|m| !m.is_null())
        );
        assert_eq!(message["timestamp"], ended["finished_at"]);
    }
    assert_eq!(receiver.received().len(), 2);
}

#[tokio::test]
async fn a_cancelled_job_and_chosen_events_are_told() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let webhook = json!({"url": receiver.url, "events": ["started", "job.cancelled"]});
    let job = file(&app, "slow", webhook).await;
    receiver.wait_for(1).await;
    let path = text(&job["links"]["self"]);
    app.delete(&path).send().await.unwrap();
    let told = receiver.wait_for(2).await;
    let kinds: Vec<String> = told.iter().map(|r| text(&r.json()["type"])).collect();
    assert_eq!(kinds, ["job.started", "job.cancelled"]);
    assert_eq!(told[0].json()["data"]["state"], "running");
    let uninterested = json!({"url": receiver.url, "events": ["failed"]});
    let job = file(&app, "sphere", uninterested).await;
    app.until(&job, &["succeeded"]).await;
    assert!(deliveries(&app, &job).await.is_empty());
}

#[tokio::test]
async fn what_fails_is_tried_again_under_the_same_id_and_time_is_given_as_asked() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::start(|number| match number {
        0 => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
        1 => (
            StatusCode::SERVICE_UNAVAILABLE,
            [(header::RETRY_AFTER, "1")],
        )
            .into_response(),
        2 => (StatusCode::FOUND, [(header::LOCATION, "/elsewhere")]).into_response(),
        _ => StatusCode::OK.into_response(),
    })
    .await;
    let started = Instant::now();
    let job = file(
        &app,
        "sphere",
        json!({"url": receiver.url, "secret": HOOK_SECRET}),
    )
    .await;
    let told = delivery_until(&app, &job, "delivered").await;
    assert!(started.elapsed() >= Duration::from_secs(1), "Retry-After");
    assert_eq!(told["attempts"], 4);
    assert_eq!(told["last_status"], 200);
    let requests = receiver.received();
    assert_eq!(requests.len(), 4);
    for request in &requests {
        assert_eq!(request.path, "/", "redirects are not followed");
        assert_eq!(request.header("webhook-id"), text(&told["id"]));
        assert_eq!(request.body, requests[0].body);
    }
}

#[tokio::test]
async fn what_is_given_up_is_shown_and_can_be_sent_again() {
    let app = TestApp::with(|settings| {
        local(settings);
        settings.webhook_attempts = 2;
    })
    .await;
    let receiver = Receiver::start(|number| match number {
        0 | 1 => StatusCode::BAD_REQUEST.into_response(),
        2 => StatusCode::GONE.into_response(),
        _ => StatusCode::OK.into_response(),
    })
    .await;
    let job = file(&app, "sphere", json!({"url": receiver.url})).await;
    let dead = delivery_until(&app, &job, "dead").await;
    assert_eq!(
        (&dead["attempts"], &dead["last_outcome"]),
        (&json!(2), &json!("rejected"))
    );
    let path = format!(
        "{}/deliveries/{}/redeliver",
        text(&job["links"]["self"]),
        text(&dead["id"])
    );
    let answer = app.post(&path).send().await.unwrap();
    assert_eq!(answer.status(), 202);
    receiver.wait_for(3).await;
    let gone = delivery_until(&app, &job, "dead").await;
    assert_eq!(gone["last_outcome"], "gone", "410 ends the attempts");
    assert_eq!(gone["attempts"], 1);
    app.post(&path).send().await.unwrap();
    delivery_until(&app, &job, "delivered").await;
    let unknown = path.replace(&text(&dead["id"]), "msg_0");
    problem(app.post(&unknown).send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn a_receiver_that_hangs_does_not_delay_another() {
    let app = TestApp::with(|settings| {
        local(settings);
        settings.webhook_timeout = "20s".parse().unwrap();
        settings.webhook_concurrency = 4;
        settings.webhook_destination_concurrency = 2;
    })
    .await;
    // It accepts connections and never answers.
    let hanging = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", hanging.local_addr().unwrap());
    for _ in 0..6 {
        file(&app, "sphere", json!({ "url": url })).await;
    }
    let receiver = Receiver::willing().await;
    let started = Instant::now();
    for _ in 0..3 {
        file(&app, "sphere", json!({"url": receiver.url})).await;
    }
    receiver.wait_for(3).await;
    assert!(started.elapsed() < Duration::from_secs(15));
    app.stop().await;
}

#[tokio::test]
async fn deliveries_survive_a_restart_and_erased_jobs() {
    let app = TestApp::with(local).await;
    let port = crate::helpers::quiet_port();
    let url = format!("http://127.0.0.1:{port}/hook");
    let job = file(&app, "sphere", json!({"url": url, "secret": HOOK_SECRET})).await;
    app.until(&job, &["succeeded"]).await;
    let erased = app
        .delete(&text(&job["links"]["self"]))
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), 204);
    let data = app.stop().await;
    let listener = tokio::net::TcpListener::bind(("127.0.0.1", port))
        .await
        .unwrap();
    let (arrived, mut arrival) = tokio::sync::mpsc::unbounded_channel();
    let router = axum::Router::new().fallback(move |body: String| {
        let _ = arrived.send(body);
        async {}
    });
    tokio::spawn(async move { axum::serve(listener, router).await });
    let app = TestApp::on(data, fake_engine(), local).await;
    let body = tokio::time::timeout(Duration::from_secs(20), arrival.recv()).await;
    let message: Value = serde_json::from_str(&body.unwrap().unwrap()).unwrap();
    assert_eq!(message["data"]["job"], job["id"]);
    app.stop().await;
}

/// Otherwise an answer with which the process ends would be asked for again after every start.
#[tokio::test]
async fn an_attempt_during_which_the_service_ended_counts() {
    let once = |settings: &mut Settings| {
        local(settings);
        settings.webhook_attempts = 1;
        settings.webhook_timeout = "60s".parse().unwrap();
        settings.shutdown_grace = "50ms".parse().unwrap();
    };
    let receiver = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let url = format!("http://{}/", receiver.local_addr().unwrap());
    let app = TestApp::with(once).await;
    let job = file(&app, "sphere", json!({"url": url})).await;
    // It takes the message and never answers.
    let arrived = tokio::time::timeout(Duration::from_secs(30), receiver.accept()).await;
    let (silent, _) = arrived.unwrap().unwrap();
    let data = app.stop().await;
    drop(silent);
    let app = TestApp::on(data, fake_engine(), once).await;
    let told = delivery_until(&app, &job, "dead").await;
    assert_eq!(told["attempts"], 1);
    assert_eq!(told["last_outcome"], "interrupted");
    let again = tokio::time::timeout(Duration::from_millis(300), receiver.accept()).await;
    assert!(again.is_err(), "it was sent again");
}

#[tokio::test]
async fn ends_told_by_a_killed_service_are_told_by_the_next() {
    let data = tempfile::tempdir().unwrap();
    let settings = [
        "--webhook-allow",
        "127.0.0.0/8",
        "--webhook-backoff",
        "50ms",
        "--workers",
        "1",
    ];
    let receiver = Receiver::start(|number| match number {
        // The first service is killed before one of its deliveries is taken.
        0..4 => StatusCode::SERVICE_UNAVAILABLE.into_response(),
        _ => StatusCode::OK.into_response(),
    })
    .await;
    let service = Service::start(data.path(), &settings).await;
    let mut jobs = Vec::new();
    let scan = crate::helpers::scan();
    for points in [100, 110, 120] {
        let path = format!("/v1/models?points={points}&webhook={}", receiver.url);
        let answer = service.post(&path).body(scan.clone()).send().await.unwrap();
        assert_eq!(answer.status(), 202, "{}", answer.text().await.unwrap());
        let job: Value = answer.json().await.unwrap();
        jobs.push(text(&job["id"]));
    }
    receiver.wait_for(1).await;
    service.kill();
    let service = Service::start(data.path(), &settings).await;
    for job in &jobs {
        service.ended(job).await;
    }
    let deadline = Instant::now() + Duration::from_secs(30);
    for job in &jobs {
        loop {
            let path = format!("/v1/jobs/{job}/deliveries");
            let list: Value = service
                .get(&path)
                .send()
                .await
                .unwrap()
                .json()
                .await
                .unwrap();
            let list = list["deliveries"].as_array().unwrap();
            assert_eq!(list.len(), 1, "one end, one delivery");
            if list[0]["state"] == "delivered" {
                break;
            }
            assert!(Instant::now() < deadline, "{list:?}");
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

#[tokio::test]
async fn urls_that_reach_this_machine_are_refused_with_the_field() {
    let app = TestApp::start().await;
    let volume_id = app.volume("sphere").await;
    for url in [
        "https://127.0.0.1/",
        "http://example.org/",
        "https://169.254.169.254/latest",
        "https://[::ffff:10.0.0.1]/",
        "https://user@8.8.8.8/",
        "hook",
    ] {
        let job = json!({"volume": volume_id, "webhook": {"url": url}});
        let answer = app.post("/v1/jobs").json(&job).send().await.unwrap();
        let refusal = problem(answer, 422, "invalid-field").await;
        assert_eq!(refusal["field"], "webhook.url", "{url}");
        let path = format!("/v1/models?webhook={url}");
        let answer = app.post(&path).body(volume("sphere")).send().await.unwrap();
        let refusal = problem(answer, 422, "invalid-field").await;
        assert_eq!(refusal["field"], "webhook.url", "{url}");
    }
    for (webhook, field) in [
        (json!({}), "webhook.url"),
        (
            json!({"url": "https://8.8.8.8/", "events": ["ended"]}),
            "webhook.events",
        ),
        (
            json!({"url": "https://8.8.8.8/", "events": []}),
            "webhook.events",
        ),
        (
            json!({"url": "https://8.8.8.8/", "secret": "short"}),
            "webhook.secret",
        ),
        (json!("https://8.8.8.8/"), "webhook"),
    ] {
        let job = json!({"volume": volume_id, "webhook": webhook});
        let answer = app.post("/v1/jobs").json(&job).send().await.unwrap();
        let refusal = problem(answer, 422, "invalid-field").await;
        assert_eq!(refusal["field"], field);
    }
    let unknown = json!({"volume": volume_id, "webhook": {"uri": "https://8.8.8.8/"}});
    let answer = app.post("/v1/jobs").json(&unknown).send().await.unwrap();
    problem(answer, 400, "unknown-parameter").await;
}

#[tokio::test]
async fn an_address_that_is_no_longer_allowed_is_not_told() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let job = file(&app, "slow", json!({"url": receiver.url})).await;
    app.until(&job, &["running"]).await;
    let data = app.stop().await;
    let app = TestApp::on(data, fake_engine(), |settings| {
        local(settings);
        settings.webhook_allow = "10.0.0.0/8".parse().unwrap();
        settings.webhook_attempts = 1;
    })
    .await;
    app.delete(&text(&job["links"]["self"]))
        .send()
        .await
        .unwrap();
    let dead = delivery_until(&app, &job, "dead").await;
    assert_eq!(dead["last_outcome"], "refused");
    assert!(receiver.received().is_empty());
}

#[tokio::test]
async fn registered_webhooks_are_told_about_every_job_and_show_their_secret_once() {
    let app = TestApp::with(|settings| {
        local(settings);
        settings.webhook_endpoint_limit = 1;
    })
    .await;
    let receiver = Receiver::start(|number| match number {
        0 => StatusCode::OK.into_response(),
        _ => StatusCode::GONE.into_response(),
    })
    .await;
    let endpoint = json!({"url": receiver.url, "events": ["succeeded"]});
    let made = app
        .post("/v1/webhooks")
        .json(&endpoint)
        .send()
        .await
        .unwrap();
    assert_eq!(made.status(), 201);
    let path = made.headers()["location"].to_str().unwrap().to_owned();
    let made: Value = made.json().await.unwrap();
    assert_eq!(path, format!("/v1/webhooks/{}", text(&made["id"])));
    let secret: SigningSecret = text(&made["secret"]).parse().unwrap();
    let second = app
        .post("/v1/webhooks")
        .json(&endpoint)
        .send()
        .await
        .unwrap();
    problem(second, 422, "too-many-webhooks").await;

    let job = app.file("sphere").await;
    let told = delivery_until(&app, &job, "delivered").await;
    assert_eq!(told["webhook"], made["id"]);
    let request = receiver.received()[0].clone();
    let body = String::from_utf8(request.body.to_vec()).unwrap();
    let seconds: i64 = request.header("webhook-timestamp").parse().unwrap();
    let signature = secret.sign(&text(&told["id"]), seconds, &body);
    assert_eq!(request.header("webhook-signature"), signature);

    let job = app.file("sphere").await;
    assert_eq!(
        delivery_until(&app, &job, "dead").await["last_outcome"],
        "gone"
    );
    let list = app.json("/v1/webhooks").await;
    assert!(list["webhooks"][0]["gone_at"].is_string());
    assert!(!list.to_string().contains("whsec_"));
    let job = app.finished("sphere").await;
    assert!(
        deliveries(&app, &job).await.is_empty(),
        "410 ends the telling"
    );

    let path = format!("/v1/webhooks/{}", text(&made["id"]));
    assert_eq!(app.delete(&path).send().await.unwrap().status(), 204);
    problem(app.delete(&path).send().await.unwrap(), 404, "not-found").await;
}

#[tokio::test]
async fn the_tenants_secret_signs_what_has_none_and_is_replaced_without_a_gap() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let mut secrets = Vec::new();
    for _ in 0..2 {
        let made = app.post("/v1/webhooks/secret").send().await.unwrap();
        let made: Value = made.json().await.unwrap();
        secrets.push(text(&made["secret"]).parse::<SigningSecret>().unwrap());
    }
    let job = file(&app, "sphere", json!({"url": receiver.url})).await;
    let told = delivery_until(&app, &job, "delivered").await;
    let request = receiver.received()[0].clone();
    let body = String::from_utf8(request.body.to_vec()).unwrap();
    let seconds: i64 = request.header("webhook-timestamp").parse().unwrap();
    let signatures = request.header("webhook-signature");
    let signatures: Vec<&str> = signatures.split(' ').collect();
    let id = text(&told["id"]);
    let expected = [&secrets[1], &secrets[0]].map(|secret| secret.sign(&id, seconds, &body));
    assert_eq!(signatures, expected);
}

#[tokio::test]
async fn another_webhook_under_the_same_idempotency_key_is_another_request() {
    let app = TestApp::with(local).await;
    let receiver = Receiver::willing().await;
    let volume = app.volume("sphere").await;
    let send = async |path: &str| {
        let job = json!({"volume": volume, "webhook": {"url": format!("{}{path}", receiver.url)}});
        let request = app
            .post("/v1/jobs")
            .header("Idempotency-Key", "k")
            .json(&job);
        request.send().await.unwrap()
    };
    assert_eq!(send("/a").await.status(), 202);
    assert_eq!(send("/a").await.status(), 202);
    problem(send("/b").await, 422, "idempotency-key-reused").await;
}
