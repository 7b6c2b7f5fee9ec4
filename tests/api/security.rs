//! Credentials, scopes, quotas, the audit trail, and what browsers may do. `docs/log/security.md` lists
//! these tests beside the OWASP API Security Top 10 (2023).

use crate::helpers::{
    TestApp, closed, cutoff, fake_engine, key, operations, problem, text, volume,
};
use axum::Router;
use axum::routing::get;
use jsonwebtoken::{Algorithm, EncodingKey, Header, encode};
use rcgen::{KeyPair, PKCS_ECDSA_P256_SHA256, PKCS_ED25519};
use reqwest::header::{AUTHORIZATION, HOST, ORIGIN};
use reqwest::{Method, RequestBuilder, StatusCode};
use serde_json::{Value, json};
use std::net::TcpListener;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use ventriform_program::cli::advice::advised;
use ventriform_program::server::{ServeError, start};
use ventriform_service::base::records::{Clock, StoreError, SystemClock, Tenant, rfc3339};
use ventriform_service::callers::{
    AccessStore, Activity, Agent, AuditEvent, BrokenLink, Quota, Recorder, Scope, verify,
};
use ventriform_service::config::Settings;
use ventriform_service::network::hooks::{DeliveryStore, SigningSecret};
use ventriform_service::run::start::StartError;
use ventriform_store::{SqlStore, open_rows};

async fn plain_key(app: &TestApp, scope: Scope) -> String {
    key(app.data.path(), scope, "default", Quota::default())
        .await
        .1
}

async fn status(request: RequestBuilder) -> StatusCode {
    request.send().await.unwrap().status()
}

#[tokio::test]
async fn every_operation_needs_credentials_once_there_is_a_key() {
    let app = TestApp::with(|settings| settings.auth_failure_limit = 10_000).await;
    assert_eq!(
        status(app.get("/v1/volumes")).await,
        StatusCode::OK,
        "no key yet"
    );
    let read = plain_key(&app, Scope::Read).await;
    closed(&app).await;
    for (method, path, operation) in operations() {
        let path = path.replace("{id}", "vol_0");
        let url = format!("{}{path}", app.url);
        let send = |authorization: &str| {
            let request = app.client.request(method.clone(), &url);
            match authorization {
                "" => request,
                value => request.header(AUTHORIZATION, value),
            }
        };
        if operation["security"] == json!([]) {
            assert_eq!(status(send("Bearer wrong")).await, StatusCode::OK, "{path}");
            continue;
        }
        for wrong in [
            "",
            "Bearer wrong",
            "Basic dmY6",
            &format!("Bearer {read}x"),
            &read,
        ] {
            let answer = send(wrong).send().await.unwrap();
            let challenge = answer.headers()["www-authenticate"]
                .to_str()
                .unwrap()
                .to_owned();
            assert!(challenge.starts_with("Bearer "), "{challenge}");
            if method != Method::HEAD {
                problem(answer, 401, "unauthorized").await;
            }
        }
        assert!(operation["responses"]["401"].is_object(), "{method} {path}");
    }
    let metrics = app.get("/metrics").bearer_auth(&read);
    assert_eq!(status(metrics).await, StatusCode::OK);
    for page in ["/", "/docs/", "/openapi.json"] {
        assert_eq!(status(app.get(page)).await, StatusCode::OK, "{page}");
    }
    let unknown = app.get("/v1/nothing").send().await.unwrap();
    problem(unknown, 401, "unauthorized").await;
}

#[tokio::test]
async fn a_scope_allows_what_it_says_and_no_more() {
    let app = TestApp::start().await;
    let read = plain_key(&app, Scope::Read).await;
    let submit = plain_key(&app, Scope::Submit).await;
    let sign = plain_key(&app, Scope::Sign).await;
    let admin = plain_key(&app, Scope::Admin).await;
    closed(&app).await;
    for (method, path, operation) in operations() {
        let path = path.replace("{id}", "vol_0");
        if operation["security"] == json!([]) {
            continue;
        }
        let url = format!("{}{path}", app.url);
        let send = |key: &str| app.client.request(method.clone(), &url).bearer_auth(key);
        let begins = |with: &[&str]| with.iter().any(|start| path.starts_with(start));
        let for_admins = begins(&["/v1/keys", "/v1/audit", "/v1/webhooks", "/v1/intake"])
            || path.ends_with("/hold")
            || method == Method::DELETE && path == "/v1/volumes";
        // They name patients.
        let for_submitters = begins(&["/dicom-web/workitems"]) || path.ends_with("/identity");
        let for_signers = begins(&["/v1/readings"]) && !method.is_safe();
        let refused = [
            (&read, for_admins || for_submitters || !method.is_safe()),
            (&submit, for_admins || for_signers),
            (&sign, for_admins),
            (&admin, false),
        ];
        for (key, refused) in refused {
            let answer = send(key).send().await.unwrap();
            if refused {
                problem(answer, 403, "insufficient-scope").await;
            } else {
                let status = answer.status();
                let denied = [StatusCode::FORBIDDEN, StatusCode::UNAUTHORIZED];
                assert!(!denied.contains(&status), "{method} {path}: {status}");
            }
        }
    }
    let upload = app.post("/v1/volumes").bearer_auth(&submit);
    assert_eq!(
        status(upload.body(volume("sphere"))).await,
        StatusCode::CREATED
    );
}

#[tokio::test]
async fn a_key_that_another_process_revokes_is_refused_within_a_second() {
    let app = TestApp::start().await;
    let (id, text) = key(app.data.path(), Scope::Read, "default", Quota::default()).await;
    closed(&app).await;
    let list = || app.get("/v1/volumes").bearer_auth(&text);
    assert_eq!(status(list()).await, StatusCode::OK);
    let store = open_rows(app.data.path()).await.unwrap();
    let now = SystemClock.now();
    let event = AuditEvent::new(now, Activity::KeyRevoked, Tenant::default(), "test".into());
    assert!(store.revoke_key(&id, now, &event).await.unwrap());
    tokio::time::sleep(Duration::from_secs(1)).await;
    let answer = list().send().await.unwrap();
    let body = problem(answer, 401, "unauthorized").await;
    assert!(crate::helpers::text(&body["detail"]).contains("revoked"));
    // The service does not open again because its only key is gone, nor after a restart.
    assert_eq!(
        status(app.get("/v1/volumes")).await,
        StatusCode::UNAUTHORIZED
    );
    let data = app.stop().await;
    let app = TestApp::on(data, fake_engine(), |_| {}).await;
    assert_eq!(
        status(app.get("/v1/volumes")).await,
        StatusCode::UNAUTHORIZED
    );
}

#[tokio::test]
async fn keys_are_managed_over_http_within_one_tenant() {
    let app = TestApp::start().await;
    let (foreign, _) = key(app.data.path(), Scope::Read, "other", Quota::default()).await;
    let admin = plain_key(&app, Scope::Admin).await;
    closed(&app).await;
    let make = |body: Value| app.post("/v1/keys").bearer_auth(&admin).json(&body);
    let expires = json!({"name": "x", "scope": "read", "expires_at": "2020-01-01T00:00:00Z"});
    for (wrong, field) in [
        (json!({"scope": "read"}), "name"),
        (json!({"name": "x"}), "scope"),
        (json!({"name": "", "scope": "read"}), "name"),
        (json!({"name": "x", "scope": "root"}), "scope"),
        (
            json!({"name": "x", "scope": "read", "stored_bytes": -1}),
            "stored_bytes",
        ),
        (
            json!({"name": "x", "scope": "read", "queued_jobs": 1_u64 << 63}),
            "queued_jobs",
        ),
        (expires, "expires_at"),
    ] {
        let answer = make(wrong).send().await.unwrap();
        assert_eq!(problem(answer, 422, "invalid-field").await["field"], field);
    }
    let tenant = make(json!({"name": "x", "scope": "read", "tenant": "other"}));
    problem(tenant.send().await.unwrap(), 400, "unknown-parameter").await;
    let made = make(json!({"name": "scanner", "scope": "read", "requests_per_minute": 9}));
    let made = made.send().await.unwrap();
    assert_eq!(made.status(), StatusCode::CREATED);
    let path = made.headers()["location"].to_str().unwrap().to_owned();
    let made: Value = made.json().await.unwrap();
    let secret = text(&made["key"]);
    assert_eq!(
        status(app.get("/v1/jobs").bearer_auth(&secret)).await,
        StatusCode::OK
    );
    let list = app
        .get("/v1/keys")
        .bearer_auth(&admin)
        .send()
        .await
        .unwrap();
    let list = list.text().await.unwrap();
    assert!(list.contains(&text(&made["id"])) && !list.contains(&foreign));
    assert!(!list.contains(&secret[20..]), "secrets are shown once");
    let other = app
        .delete(&format!("/v1/keys/{foreign}"))
        .bearer_auth(&admin);
    problem(other.send().await.unwrap(), 404, "not-found").await;
    let gone = app.delete(&path).bearer_auth(&admin);
    assert_eq!(status(gone).await, StatusCode::NO_CONTENT);
    let refused = app.get("/v1/jobs").bearer_auth(&secret);
    assert_eq!(status(refused).await, StatusCode::UNAUTHORIZED, "at once");
}

#[tokio::test]
async fn a_key_does_not_outlive_the_keys_that_made_it() {
    let app = TestApp::start().await;
    let admin = plain_key(&app, Scope::Admin).await;
    closed(&app).await;
    let make = |by: &str, scope: &str| {
        let wanted = json!({"name": "made", "scope": scope});
        let request = app.post("/v1/keys").bearer_auth(by).json(&wanted);
        async move {
            let made = request.send().await.unwrap();
            let path = made.headers()["location"].to_str().unwrap().to_owned();
            let made: Value = made.json().await.unwrap();
            (path, text(&made["key"]))
        }
    };
    let (first_path, first) = make(&admin, "admin").await;
    let (_, second) = make(&first, "admin").await;
    let (_, third) = make(&second, "read").await;
    let seen = |key: &str| status(app.get("/v1/jobs").bearer_auth(key));
    for key in [&first, &second, &third] {
        assert_eq!(seen(key).await, StatusCode::OK);
    }
    let gone = app.delete(&first_path).bearer_auth(&admin);
    assert_eq!(status(gone).await, StatusCode::NO_CONTENT);
    for key in [&first, &second, &third] {
        assert_eq!(seen(key).await, StatusCode::UNAUTHORIZED);
    }
    assert_eq!(seen(&admin).await, StatusCode::OK);
}

#[tokio::test]
async fn beyond_loopback_nobody_is_served_without_credentials() {
    let data = tempfile::tempdir().unwrap();
    let settings = |allow_anonymous| Settings {
        data_dir: data.path().to_owned(),
        allow_anonymous,
        ..Settings::default()
    };
    let everywhere = || TcpListener::bind("0.0.0.0:0").unwrap();
    let refused = start(settings(false), fake_engine(), everywhere()).await;
    let Err(refused @ ServeError::Start(StartError::OpenHttp(_))) = refused.map(|_| ()) else {
        panic!("it must not start");
    };
    assert!(advised(&refused.into()).contains("--allow-anonymous"));
    let open = start(settings(true), fake_engine(), everywhere())
        .await
        .unwrap();
    let url = format!("http://127.0.0.1:{}", open.address().port());
    let client = reqwest::Client::new();
    assert_eq!(
        status(client.get(format!("{url}/v1/jobs"))).await,
        StatusCode::OK
    );
    // Strangers may use it, but not manage it.
    let keys = client.get(format!("{url}/v1/keys")).send().await.unwrap();
    problem(keys, 403, "insufficient-scope").await;
    open.stop().await.unwrap();
    let (_, text) = key(data.path(), Scope::Read, "default", Quota::default()).await;
    let keyed = start(settings(false), fake_engine(), everywhere())
        .await
        .unwrap();
    let url = format!("http://127.0.0.1:{}/v1/jobs", keyed.address().port());
    assert_eq!(status(client.get(&url)).await, StatusCode::UNAUTHORIZED);
    let named = client.get(&url).header(HOST, "heart.example");
    assert_eq!(status(named.bearer_auth(&text)).await, StatusCode::OK);
    keyed.stop().await.unwrap();
}

#[tokio::test]
async fn other_names_and_pages_of_other_sites_are_refused() {
    let app = TestApp::with(|settings| settings.hosts = "heart.example".parse().unwrap()).await;
    for path in ["/v1/volumes", "/", "/healthz", "/docs/", "/openapi.json"] {
        let rebound = app.get(path).header(HOST, "evil.example");
        problem(rebound.send().await.unwrap(), 421, "unknown-host").await;
        let known = app.get(path).header(HOST, "heart.example");
        assert_eq!(status(known).await, StatusCode::OK, "{path}");
    }
    let upload = || app.post("/v1/volumes").body(volume("sphere"));
    for (name, value) in [
        ("origin", "http://evil.example"),
        ("origin", "null"),
        ("sec-fetch-site", "cross-site"),
    ] {
        let answer = upload().header(name, value).send().await.unwrap();
        problem(answer, 403, "cross-site").await;
    }
    assert_eq!(
        status(upload().header(ORIGIN, &app.url)).await,
        StatusCode::CREATED
    );
}

#[tokio::test]
async fn other_sites_may_use_the_service_only_if_the_operator_says_so() {
    let site = "https://viewer.example";
    let preflight = |app: &TestApp| {
        app.client
            .request(Method::OPTIONS, format!("{}/v1/volumes", app.url))
            .header(ORIGIN, site)
            .header("access-control-request-method", "POST")
            .header("access-control-request-headers", "authorization")
    };
    let closed = TestApp::start().await;
    let answer = preflight(&closed).send().await.unwrap();
    assert!(!answer.headers().contains_key("access-control-allow-origin"));
    let open = TestApp::with(|settings| settings.cors_origins = site.parse().unwrap()).await;
    let answer = preflight(&open).send().await.unwrap();
    assert_eq!(answer.headers()["access-control-allow-origin"], site);
    let upload = open.post("/v1/volumes").header(ORIGIN, site);
    let upload = upload.body(volume("sphere")).send().await.unwrap();
    assert_eq!(upload.status(), StatusCode::CREATED);
    assert_eq!(upload.headers()["access-control-allow-origin"], site);
    let other = open
        .get("/v1/volumes")
        .header(ORIGIN, "https://evil.example");
    let other = other.send().await.unwrap();
    assert!(!other.headers().contains_key("access-control-allow-origin"));
}

#[tokio::test]
async fn pages_and_data_carry_the_headers_that_browsers_need() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let report = format!("{}.html", text(&model["links"]["report"]));
    let missing = "/v1/volumes/vol_0";
    for path in ["/", "/docs/", "/v1/volumes", &report, missing] {
        let answer = app.get(path).header("accept", "text/html, */*");
        let answer = answer.send().await.unwrap();
        let header = |name: &str| answer.headers()[name].to_str().unwrap().to_owned();
        assert!(
            header("content-security-policy").contains("frame-ancestors 'none'"),
            "{path}"
        );
        assert_eq!(header("x-content-type-options"), "nosniff", "{path}");
        assert_eq!(header("referrer-policy"), "no-referrer", "{path}");
        assert!(!answer.headers().contains_key("strict-transport-security"));
        if path == "/" {
            let policy = header("content-security-policy");
            assert!(!policy.contains("unsafe"), "{policy}");
        }
    }
}

#[tokio::test]
async fn requests_beyond_the_quota_are_refused_and_every_answer_says_what_is_left() {
    let app = TestApp::start().await;
    let quota = Quota {
        requests: Some(3),
        ..Quota::default()
    };
    let (_, limited) = key(app.data.path(), Scope::Read, "default", quota).await;
    let other = plain_key(&app, Scope::Read).await;
    closed(&app).await;
    let send = |key: &str| app.get("/v1/jobs").bearer_auth(key).send();
    for left in [2, 1, 0] {
        let answer = send(&limited).await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK);
        assert_eq!(
            answer.headers()["ratelimit-policy"],
            "\"requests\";q=3;w=60"
        );
        let rest = answer.headers()["ratelimit"].to_str().unwrap().to_owned();
        assert!(
            rest.starts_with(&format!("\"requests\";r={left};t=")),
            "{rest}"
        );
    }
    let refused = send(&limited).await.unwrap();
    let wait: u64 = refused.headers()["retry-after"]
        .to_str()
        .unwrap()
        .parse()
        .unwrap();
    assert!((1..=60).contains(&wait));
    problem(refused, 429, "too-many-requests").await;
    assert_eq!(send(&other).await.unwrap().status(), StatusCode::OK);
}

#[tokio::test]
async fn guesses_are_slowed_down_and_valid_keys_still_work() {
    let app = TestApp::with(|settings| settings.auth_failure_limit = 3).await;
    let good = plain_key(&app, Scope::Read).await;
    closed(&app).await;
    let mut answers = Vec::new();
    for guess in 0..5 {
        let answer = app.get("/v1/jobs").bearer_auth(format!("guess{guess}"));
        answers.push(status(answer).await.as_u16());
    }
    assert_eq!(answers, [401, 401, 401, 429, 429]);
    assert_eq!(
        status(app.get("/v1/jobs").bearer_auth(&good)).await,
        StatusCode::OK
    );
}

#[tokio::test]
async fn a_tenant_cannot_store_or_queue_beyond_its_quota() {
    let app = TestApp::start().await;
    let id = app.volume("slow").await;
    let quota = Quota {
        bytes: Some(100_000),
        jobs: Some(1),
        ..Quota::default()
    };
    let (_, key) = key(app.data.path(), Scope::Submit, "default", quota).await;
    closed(&app).await;
    let large = app
        .post("/v1/volumes")
        .bearer_auth(&key)
        .body(vec![0; 100_001]);
    problem(large.send().await.unwrap(), 507, "storage-quota").await;
    let file = |name: &str| {
        app.post("/v1/jobs")
            .bearer_auth(&key)
            .header("idempotency-key", name)
            .json(&json!({"kind": "model", "volume": id, "parameters": {"points": 150}}))
    };
    // Two workers take the first two jobs; a third waits, and the tenant may have one that waits.
    let mut accepted = Vec::new();
    let refused = loop {
        let name = format!("job-{}", accepted.len());
        let answer = file(&name).send().await.unwrap();
        match answer.status() {
            StatusCode::ACCEPTED => accepted.push(name),
            _ => break answer,
        }
        assert!(accepted.len() < 20, "the quota does not apply");
    };
    problem(refused, 429, "job-quota").await;
    let retry = file(accepted.last().unwrap()).send().await.unwrap();
    assert_eq!(
        retry.status(),
        StatusCode::ACCEPTED,
        "a retry files nothing"
    );
}

/// The events that an admin sees, newest first.
async fn events(app: &TestApp, admin: &str, query: &str) -> Vec<Value> {
    let answer = app
        .get(&format!("/v1/audit?limit=100{query}"))
        .bearer_auth(admin);
    let answer: Value = answer.send().await.unwrap().json().await.unwrap();
    answer["events"].as_array().unwrap().clone()
}

fn object(event: &Value) -> String {
    text(&event["entity"][0]["what"]["identifier"]["value"])
}

#[tokio::test]
async fn the_trail_says_who_did_what_to_which_item() {
    let app = TestApp::start().await;
    let admin = plain_key(&app, Scope::Admin).await;
    let read = plain_key(&app, Scope::Read).await;
    let (_, other) = key(app.data.path(), Scope::Admin, "other", Quota::default()).await;
    closed(&app).await;
    let made = app
        .post("/v1/volumes")
        .bearer_auth(&admin)
        .body(volume("sphere"));
    let made: Value = made.send().await.unwrap().json().await.unwrap();
    let id = text(&made["id"]);
    for _ in 0..3 {
        let preview = app.get(&format!("/v1/volumes/{id}")).bearer_auth(&read);
        assert_eq!(status(preview).await, StatusCode::OK);
    }
    let denied = app.delete(&format!("/v1/volumes/{id}")).bearer_auth(&read);
    assert_eq!(status(denied).await, StatusCode::FORBIDDEN);
    status(app.get("/v1/volumes").bearer_auth("wrong")).await;
    let erased = app.delete(&format!("/v1/volumes/{id}")).bearer_auth(&admin);
    assert!(status(erased).await.is_success());

    let found = events(&app, &admin, &format!("&object={id}")).await;
    let short: Vec<_> = found
        .iter()
        .map(|event| {
            assert_eq!(event["resourceType"], "AuditEvent");
            assert_eq!(object(event), id);
            let agent = &event["agent"][0];
            assert_eq!(agent["network"]["address"], "127.0.0.1");
            (
                text(&event["action"]),
                text(&event["outcome"]),
                text(&agent["who"]["display"]),
            )
        })
        .collect();
    let row = |action: &str, outcome: &str, agent: &str| {
        (action.to_owned(), outcome.to_owned(), agent.to_owned())
    };
    assert!(
        short.contains(&row("C", "0", "admin of default")),
        "{short:?}"
    );
    assert!(
        short.contains(&row("D", "0", "admin of default")),
        "{short:?}"
    );
    assert!(
        short.contains(&row("E", "4", "read of default")),
        "{short:?}"
    );
    let reads = found.iter().filter(|event| event["action"] == "R");
    let count = |event: &Value| {
        let entities = event["entity"].as_array().unwrap().iter();
        let mut counts = entities.filter(|entity| entity["name"] == "count");
        counts.next().map_or(1, |entity| {
            text(&entity["detail"][0]["valueString"])
                .parse::<u64>()
                .unwrap()
        })
    };
    assert_eq!(reads.map(count).sum::<u64>(), 3);

    let all = events(&app, &admin, "").await;
    let login = all
        .iter()
        .find(|event| event["type"]["code"] == "110114")
        .unwrap();
    assert_eq!(
        (
            text(&login["outcome"]).as_str(),
            login["subtype"][0]["code"].as_str()
        ),
        ("4", Some("110122"))
    );
    let foreign = events(&app, &other, "").await;
    assert!(!serde_json::to_string(&foreign).unwrap().contains(&id));
    for wrong in ["&since=yesterday", "&until=1"] {
        let answer = app
            .get(&format!("/v1/audit?limit=1{wrong}"))
            .bearer_auth(&admin);
        problem(answer.send().await.unwrap(), 400, "invalid-parameter").await;
    }
}

#[tokio::test]
async fn the_trail_holds_no_secret_and_no_text_of_a_client() {
    let app = TestApp::start().await;
    let admin = plain_key(&app, Scope::Admin).await;
    closed(&app).await;
    let name = "Doe^Jane";
    for request in [
        app.get(&format!("/v1/volumes/{name}")),
        app.get(&format!("/v1/volumes?{name}={name}")),
        app.delete(&format!("/v1/volumes/{name}")),
    ] {
        status(request.bearer_auth(&admin)).await;
    }
    status(app.get("/v1/volumes").bearer_auth(name)).await;
    let named = app.get("/v1/volumes").header("x-request-id", name);
    status(named.bearer_auth(&admin)).await;
    events(&app, &admin, "").await;
    let store = open_rows(app.data.path()).await.unwrap();
    for link in store.links(0, 1000).await.unwrap() {
        for secret in [name, "Doe", &admin[25..]] {
            assert!(!link.event.contains(secret), "{}", link.event);
        }
    }
}

/// The job is filed before the answer is known, and the answer is a problem.
#[tokio::test]
async fn what_a_request_that_fails_has_changed_is_in_the_trail() {
    let app = TestApp::start().await;
    let request = app
        .post("/v1/models")
        .header("prefer", super::helpers::UNTIL_DONE);
    let failed = status(request.body(volume("fail"))).await;
    assert!(!failed.is_success(), "{failed}");
    let jobs = app.json("/v1/jobs").await;
    let job = &jobs["jobs"][0];
    let trail = app.json("/v1/audit?limit=100").await;
    let trail = trail["events"].as_array().unwrap();
    for (item, action) in [(&job["volume"], "C"), (&job["id"], "E")] {
        let item = text(item);
        let mut rows = trail
            .iter()
            .filter(|row| object(row) == item && row["action"] == action);
        assert!(rows.next().is_some(), "{action} {item}: {trail:?}");
        assert!(rows.next().is_none(), "twice: {action} {item}: {trail:?}");
    }
}

/// A request whose connection is reset is dropped wherever it waits.
#[tokio::test]
async fn a_change_and_its_row_go_on_without_the_request() {
    let (_folder, store) = trail(1).await;
    let recorder = Arc::new(Recorder::start(store.clone(), Arc::new(SystemClock)));
    let agent = Agent::new(recorder, Arc::new(SystemClock), Tenant::default(), "x");
    let (go, gone) = tokio::sync::oneshot::channel::<()>();
    let hooks = store.clone();
    let change = async move {
        gone.await.unwrap();
        let secret = SigningSecret::random();
        hooks.replace_secret(&Tenant::default(), &secret, 0).await
    };
    tokio::select! {
        biased;
        _ = agent.change(change) => panic!("it waits"),
        () = std::future::ready(()) => {}
    }
    assert!(!agent.has_acted());
    go.send(()).unwrap();
    let until = Instant::now() + Duration::from_secs(60);
    let links = loop {
        let links = store.links(1, 10).await.unwrap();
        if !links.is_empty() {
            break links;
        }
        assert!(Instant::now() < until);
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    assert!(agent.has_acted());
    let [link] = &links[..] else {
        panic!("{links:?}")
    };
    assert!(link.event.contains("webhooks/secret"), "{}", link.event);
    // What changes nothing leaves no row.
    let nothing = agent.change(async { Ok::<_, StoreError>(()) });
    nothing.await.unwrap();
    assert_eq!(store.links(1, 10).await.unwrap().len(), 1);
}

fn event(at: i64) -> AuditEvent {
    AuditEvent::new(at, Activity::Read, Tenant::default(), "x".into()).on(format!("vol_{at}"))
}

/// Runs SQL on the database of a folder, as somebody who can write to the file.
async fn tamper(folder: &Path, sql: &'static str) -> Result<(), sqlx::Error> {
    use sqlx::{ConnectOptions, Connection};
    let options = sqlx::sqlite::SqliteConnectOptions::new().filename(folder.join("ventriform.db"));
    let mut connection = options.connect().await?;
    sqlx::raw_sql(sql).execute(&mut connection).await?;
    connection.close().await
}

async fn trail(rows: i64) -> (tempfile::TempDir, Arc<SqlStore>) {
    let folder = tempfile::tempdir().unwrap();
    let store = open_rows(folder.path()).await.unwrap();
    let events: Vec<_> = (1..=rows).map(event).collect();
    store.append(&events).await.unwrap();
    (folder, store)
}

#[tokio::test]
async fn the_trail_cannot_be_changed_unseen() {
    let attacks: [(&'static str, BrokenLink); 3] = [
        (
            "DROP TRIGGER audit_is_never_changed;
             UPDATE audit SET event = replace(event, 'vol_3', 'vol_9') WHERE sequence = 3;",
            BrokenLink::Changed(3),
        ),
        (
            "DROP TRIGGER audit_is_removed_up_to_an_anchor;
             DELETE FROM audit WHERE sequence IN (2, 3);",
            BrokenLink::Missing { first: 2, last: 3 },
        ),
        (
            "DROP TRIGGER audit_is_removed_up_to_an_anchor;
             DELETE FROM audit WHERE sequence = 5;",
            BrokenLink::Missing { first: 5, last: 5 },
        ),
    ];
    for (attack, broken) in attacks {
        let (folder, store) = trail(5).await;
        let report = verify(&*store).await.unwrap();
        assert_eq!((report.rows, report.broken), (5, None));
        tamper(folder.path(), attack).await.unwrap();
        assert_eq!(verify(&*store).await.unwrap().broken, Some(broken));
    }
    let (folder, _store) = trail(2).await;
    for forbidden in [
        "UPDATE audit SET event = '{}'",
        "DELETE FROM audit",
        "INSERT INTO audit_anchors (sequence, hash, pruned_at) VALUES (1, 'x', 0)",
    ] {
        assert!(
            tamper(folder.path(), forbidden).await.is_err(),
            "{forbidden}"
        );
    }
}

#[tokio::test]
async fn old_rows_are_removed_without_breaking_the_chain() {
    let (folder, store) = trail(5).await;
    assert_eq!(store.prune(cutoff(4), 10).await.unwrap(), 3);
    let report = verify(&*store).await.unwrap();
    assert_eq!((report.rows, report.newest, report.broken), (3, 6, None));
    assert_eq!(store.prune(cutoff(100), 200).await.unwrap(), 3);
    store.append(&[event(300)]).await.unwrap();
    let report = verify(&*store).await.unwrap();
    assert_eq!((report.rows, report.broken), (2, None));
    // Rows that are removed with an anchor but without the event that says so are missed.
    tamper(
        folder.path(),
        "INSERT INTO audit_anchors SELECT sequence, hash, 0 FROM audit WHERE sequence = 7;
         DELETE FROM audit WHERE sequence <= 7;",
    )
    .await
    .unwrap();
    let broken = verify(&*store).await.unwrap().broken;
    assert_eq!(broken, Some(BrokenLink::UnrecordedRemoval(7)));
}

/// An issuer with a key for each algorithm. Counts how often its keys are read.
struct TestIssuer {
    url: String,
    reads: Arc<AtomicU64>,
    ec: KeyPair,
    ed: KeyPair,
}

impl TestIssuer {
    async fn start() -> Self {
        let ec = KeyPair::generate_for(&PKCS_ECDSA_P256_SHA256).unwrap();
        let ed = KeyPair::generate_for(&PKCS_ED25519).unwrap();
        let base64 = |bytes: &[u8]| {
            use base64::Engine;
            base64::prelude::BASE64_URL_SAFE_NO_PAD.encode(bytes)
        };
        // 4 stands for an uncompressed point, then x and y follow.
        let point = &ec.public_key_raw()[1..];
        let keys = json!({"keys": [
            {"kty": "oct", "kid": "shared", "k": "c2VjcmV0"},
            {"kty": "EC", "crv": "P-256", "kid": "ec", "use": "sig", "alg": "ES256",
             "x": base64(&point[..32]), "y": base64(&point[32..])},
            {"kty": "OKP", "crv": "Ed25519", "kid": "ed", "x": base64(ed.public_key_raw())},
        ]});
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
        let url = format!("http://{}", listener.local_addr().unwrap());
        let discovery = json!({"issuer": url, "jwks_uri": format!("{url}/keys")});
        let reads = Arc::new(AtomicU64::new(0));
        let counted = reads.clone();
        let router = Router::new()
            .route(
                "/.well-known/openid-configuration",
                get(move || async move { axum::Json(discovery) }),
            )
            .route(
                "/keys",
                get(move || async move {
                    counted.fetch_add(1, Ordering::Relaxed);
                    axum::Json(keys)
                }),
            );
        tokio::spawn(async move { axum::serve(listener, router).await });
        Self { url, reads, ec, ed }
    }

    /// A token with this header and this payload, signed by the key `ec`.
    fn sign_head(&self, header: &Value, payload: &str) -> String {
        use base64::Engine;
        let header = base64::prelude::BASE64_URL_SAFE_NO_PAD.encode(header.to_string());
        let message = format!("{header}.{payload}");
        let key = EncodingKey::from_ec_der(self.ec.serialized_der());
        let signature =
            jsonwebtoken::crypto::sign(message.as_bytes(), &key, Algorithm::ES256).unwrap();
        format!("{message}.{signature}")
    }

    fn claims(&self) -> Value {
        let expires = SystemClock.now() / 1000 + 300;
        json!({"iss": self.url, "aud": ["other", "ventriform"], "sub": "dr-who", "exp": expires,
               "tenant": "clinic", "scope": "openid submit"})
    }

    fn sign(&self, algorithm: Algorithm, kid: &str, claims: &Value) -> String {
        let key = match algorithm {
            Algorithm::ES256 => EncodingKey::from_ec_der(self.ec.serialized_der()),
            Algorithm::EdDSA => EncodingKey::from_ed_der(self.ed.serialized_der()),
            // What an attacker has: the public key, used as a shared secret.
            _ => EncodingKey::from_secret(self.ec.public_key_raw()),
        };
        let mut header = Header::new(algorithm);
        header.kid = Some(kid.to_owned());
        encode(&header, claims, &key).unwrap()
    }
}

#[tokio::test]
async fn tokens_of_the_issuer_open_the_service_and_forged_ones_do_not() {
    let issuer = TestIssuer::start().await;
    let url = issuer.url.clone();
    let app = TestApp::with(move |settings| {
        settings.oidc_issuer = url;
        settings.auth_failure_limit = 1000;
    })
    .await;
    assert_eq!(status(app.get("/v1/jobs")).await, StatusCode::UNAUTHORIZED);
    let list = |token: &str| app.get("/v1/jobs").bearer_auth(token).send();
    for (algorithm, kid) in [(Algorithm::ES256, "ec"), (Algorithm::EdDSA, "ed")] {
        let token = issuer.sign(algorithm, kid, &issuer.claims());
        let answer = list(&token).await.unwrap();
        assert_eq!(
            answer.status(),
            StatusCode::OK,
            "{}",
            answer.text().await.unwrap()
        );
    }
    let upload = |claims: &Value| {
        let token = issuer.sign(Algorithm::EdDSA, "ed", claims);
        let upload = app.post("/v1/volumes").bearer_auth(token);
        status(upload.body(volume("sphere")))
    };
    assert_eq!(upload(&issuer.claims()).await, StatusCode::CREATED);
    let with = |name: &str, value: Value| {
        let mut claims = issuer.claims();
        claims[name] = value;
        claims
    };
    assert_eq!(
        upload(&with("scope", json!(["ventriform:read"]))).await,
        StatusCode::FORBIDDEN
    );
    let past = SystemClock.now() / 1000 - 120;
    for wrong in [
        with("exp", json!(past)),
        with("exp", Value::Null),
        with("nbf", json!(past + 600)),
        with("iss", json!("https://evil.example")),
        with("aud", json!("other")),
        with("scope", json!("openid")),
        with("tenant", json!("No Tenant")),
    ] {
        let token = issuer.sign(Algorithm::EdDSA, "ed", &wrong);
        problem(list(&token).await.unwrap(), 401, "unauthorized").await;
    }
    let good = issuer.sign(Algorithm::ES256, "ec", &issuer.claims());
    let [head, body, signature] = good.split('.').collect::<Vec<_>>()[..] else {
        panic!("{good}");
    };
    let none = "eyJhbGciOiJub25lIn0";
    let other = issuer.sign(Algorithm::EdDSA, "ec", &issuer.claims());
    let admin = issuer.sign(Algorithm::ES256, "ec", &with("scope", json!("admin")));
    let stolen = admin.split('.').nth(1).unwrap();
    for forged in [
        format!("{none}.{body}."),
        format!("{none}.{body}.{signature}"),
        format!("{head}.{stolen}.{signature}"),
        issuer.sign(Algorithm::HS256, "ec", &issuer.claims()),
        issuer.sign(Algorithm::HS256, "shared", &issuer.claims()),
        other,
    ] {
        problem(list(&forged).await.unwrap(), 401, "unauthorized").await;
    }
    // A header that demands what nobody knows, well signed.
    let plain = issuer.sign(Algorithm::ES256, "ec", &issuer.claims());
    let header = json!({"alg": "ES256", "kid": "ec", "typ": "JWT", "crit": ["exp2"], "exp2": 1});
    let signed = issuer.sign_head(&header, plain.split('.').nth(1).unwrap());
    let said = problem(list(&signed).await.unwrap(), 401, "unauthorized").await;
    assert!(text(&said["detail"]).contains("crit"), "{said}");
    // Unknown keys make the service ask the issuer once in a while, not each time.
    for kid in 0..5 {
        let token = issuer.sign(Algorithm::EdDSA, &format!("new-{kid}"), &issuer.claims());
        problem(list(&token).await.unwrap(), 401, "unauthorized").await;
    }
    assert!(issuer.reads.load(Ordering::Relaxed) <= 2);
}

/// Makes a key by those credentials.
async fn made_by(app: &TestApp, credentials: &str, wanted: Value) -> reqwest::Response {
    let make = app.post("/v1/keys").bearer_auth(credentials);
    make.json(&wanted).send().await.unwrap()
}

#[tokio::test]
async fn a_key_that_a_token_makes_ends_with_it_unless_more_is_asked_and_allowed() {
    let issuer = TestIssuer::start().await;
    for (life, allowed) in [("0s", false), ("10m", true)] {
        let url = issuer.url.clone();
        let app = TestApp::with(move |settings| {
            settings.oidc_issuer = url;
            settings.oidc_leeway = "0s".parse().unwrap();
            settings.oidc_key_life = life.parse().unwrap();
        })
        .await;
        let mut claims = issuer.claims();
        claims["scope"] = json!("admin");
        let ends = SystemClock.now() / 1000 + 3;
        claims["exp"] = json!(ends);
        let token = issuer.sign(Algorithm::ES256, "ec", &claims);
        let unasked = made_by(&app, &token, json!({"name": "stays", "scope": "admin"})).await;
        let unasked: Value = unasked.json().await.unwrap();
        assert_eq!(unasked["owner"], "dr-who");
        assert_eq!(unasked["expires_at"], rfc3339(ends * 1000));
        let later = rfc3339((ends + 60) * 1000);
        let asked = made_by(
            &app,
            &token,
            json!({"name": "asked", "scope": "admin", "expires_at": later}),
        )
        .await;
        assert_eq!(asked.status().is_success(), allowed, "{life}");
        let secret = text(&unasked["key"]);
        let child = made_by(&app, &secret, json!({"name": "child", "scope": "read"})).await;
        let child: Value = child.json().await.unwrap();
        assert_eq!(child["owner"], "dr-who");
        assert_eq!(child["expires_at"], unasked["expires_at"]);
        tokio::time::sleep(Duration::from_secs(4)).await;
        for ended in [&token, &secret, &text(&child["key"])] {
            let answer = app.get("/v1/volumes").bearer_auth(ended).send().await;
            problem(answer.unwrap(), 401, "unauthorized").await;
        }
        if allowed {
            let asked: Value = asked.json().await.unwrap();
            let list = app.get("/v1/keys").bearer_auth(text(&asked["key"]));
            assert_eq!(status(list).await, StatusCode::OK);
            // It is revoked with its owner.
            let revoke = app.delete("/v1/keys?owner=dr-who");
            let revoke = revoke
                .bearer_auth(text(&asked["key"]))
                .send()
                .await
                .unwrap();
            let revoked: Value = revoke.json().await.unwrap();
            assert_eq!(revoked["revoked"].as_array().unwrap().len(), 3, "{revoked}");
            let list = app.get("/v1/keys").bearer_auth(text(&asked["key"]));
            assert_eq!(status(list).await, StatusCode::UNAUTHORIZED);
        }
    }
}

/// Longest time from the end of credentials to that of what they have opened, with room for a busy machine.
const ENDS_WITHIN: Duration = Duration::from_secs(15);

#[tokio::test]
async fn streams_and_waits_end_soon_after_their_credentials() {
    let issuer = TestIssuer::start().await;
    let url = issuer.url.clone();
    let app = TestApp::with(move |settings| {
        settings.oidc_issuer = url;
        settings.oidc_tenant_claim = String::new();
        settings.wait_limit = "60s".parse().unwrap();
    })
    .await;
    let quota = Quota::default();
    let (_, admin) = key(app.data.path(), Scope::Admin, "default", quota).await;
    let file = app.post("/v1/models").bearer_auth(&admin);
    let job: Value = file
        .body(volume("slow"))
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let events = format!("/v1/jobs/{}/events", text(&job["id"]));
    // Revoked keys, keys of a revoked maker, and tokens whose time is over.
    let (id, own) = key(app.data.path(), Scope::Admin, "default", quota).await;
    let child = made_by(&app, &own, json!({"name": "child", "scope": "submit"})).await;
    let child: Value = child.json().await.unwrap();
    let mut claims = issuer.claims();
    claims["exp"] = json!(SystemClock.now() / 1000 + 8);
    let token = issuer.sign(Algorithm::ES256, "ec", &claims);
    #[expect(
        clippy::async_yields_async,
        reason = "the stream is read to its end later"
    )]
    let open = async |credentials: &str| {
        let stream = app.get(&events).bearer_auth(credentials).send();
        let stream = stream.await.unwrap();
        assert_eq!(stream.status(), StatusCode::OK);
        stream.text()
    };
    let kept = open(&admin).await;
    let streams = [
        open(&own).await,
        open(&text(&child["key"])).await,
        open(&token).await,
    ];
    let wait = app
        .post("/v1/models")
        .bearer_auth(&own)
        .header("prefer", "wait=60")
        .body(volume("slow"))
        .send();
    let begun = Instant::now();
    let revoke = async {
        tokio::time::sleep(Duration::from_secs(2)).await;
        let revoke = app.delete(&format!("/v1/keys/{id}")).bearer_auth(&admin);
        assert_eq!(status(revoke).await, StatusCode::NO_CONTENT);
    };
    let ended = futures::future::join_all(streams);
    let (_, waited, ended) = tokio::join!(revoke, wait, ended);
    assert!(begun.elapsed() < Duration::from_secs(8) + ENDS_WITHIN);
    assert!(ended.iter().all(Result::is_err), "they are broken off");
    let waited = waited.unwrap();
    assert_eq!(waited.status(), StatusCode::ACCEPTED, "the job was filed");
    let early = tokio::time::timeout(Duration::from_secs(1), kept).await;
    assert!(early.is_err(), "a valid key's stream goes on");
}

#[tokio::test]
async fn roles_of_a_token_are_found_by_a_path() {
    let issuer = TestIssuer::start().await;
    let url = issuer.url.clone();
    let app = TestApp::with(move |settings| {
        settings.oidc_issuer = url;
        settings.oidc_scope_claim = "realm_access.roles".into();
        settings.oidc_tenant_claim = "organisation.name".into();
    })
    .await;
    let mut claims = issuer.claims();
    claims["scope"] = json!("admin");
    claims["realm_access"] = json!({"roles": ["offline_access", "submit"]});
    claims["organisation"] = json!({"name": "clinic"});
    let token = issuer.sign(Algorithm::ES256, "ec", &claims);
    let upload = app.post("/v1/volumes").bearer_auth(&token);
    assert_eq!(
        status(upload.body(volume("sphere"))).await,
        StatusCode::CREATED
    );
    let keys = app.get("/v1/keys").bearer_auth(&token);
    assert_eq!(status(keys).await, StatusCode::FORBIDDEN);
    claims["realm_access"] = json!(["submit"]);
    let token = issuer.sign(Algorithm::ES256, "ec", &claims);
    let refused = app.get("/v1/jobs").bearer_auth(&token).send().await;
    problem(refused.unwrap(), 401, "unauthorized").await;
}
