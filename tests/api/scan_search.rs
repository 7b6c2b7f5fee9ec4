//! The list of volumes over HTTP: searched, filtered, ordered, and asked whether it has changed.

use crate::helpers::{TestApp, closed, key, problem, text};
use reqwest::StatusCode;
use serde_json::{Value, json};
use ventriform_service::callers::{Quota, Scope};

/// Uploads a volume and states whose scan it is.
async fn scan_of(app: &TestApp, words: &str, name: &str, day: &str) -> String {
    let id = app.volume(words).await;
    let path = format!("{}/v1/volumes/{id}/identity", app.url);
    let stated = json!({"patient_name": name, "patient_id": format!("ID {words}"),
        "study_uid": "1.2.3.4", "study_date": day});
    let answer = app.client.put(&path).json(&stated).send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::OK, "{name}");
    id
}

async fn ids(app: &TestApp, query: &str) -> Vec<String> {
    let page = app.json(&format!("/v1/volumes?{query}")).await;
    let items = page["volumes"].as_array().unwrap();
    items.iter().map(|item| text(&item["id"])).collect()
}

async fn refused(app: &TestApp, query: &str, status: u16, code: &str) -> Value {
    let answer = app.get(&format!("/v1/volumes?{query}")).send().await;
    problem(answer.unwrap(), status, code).await
}

#[tokio::test]
async fn volumes_are_searched_filtered_and_ordered() {
    let app = TestApp::start().await;
    let b = scan_of(&app, "one", "Doe^Bert", "20260105").await;
    let a = scan_of(&app, "two", "Doe^Anna", "20260301").await;
    let c = scan_of(&app, "three", "Roe^Carl", "20260201").await;
    let plain = app.volume("four").await;
    for (query, found) in [
        ("search=doe", vec![&a, &b]),
        ("search=DOE+anna", vec![&a]),
        ("search=2026-02-01", vec![&c]),
        ("search=ID+two", vec![&a]),
        ("search=nobody", vec![]),
        ("order=patient", vec![&a, &b, &c, &plain]),
        ("order=study_date", vec![&a, &c, &b, &plain]),
        ("order=study_date&study_date_to=2026-02-28", vec![&c, &b]),
        ("study_date_from=2026-02-01&search=doe", vec![&a]),
        ("patient=ID+one", vec![&b]),
        ("patient=ID+on", vec![]),
        ("made=nothing&study=1.2.3.4&order=patient", vec![&a, &b, &c]),
        ("made=model", vec![]),
        ("job=failed", vec![]),
        ("created_after=2020-01-01T00:00:00Z&search=roe", vec![&c]),
        ("created_before=2020-01-01T00:00:00Z", vec![]),
    ] {
        let found: Vec<String> = found.into_iter().cloned().collect();
        assert_eq!(ids(&app, query).await, found, "{query}");
    }
    assert_eq!(
        ids(&app, &format!("search={}", &c[4..20])).await,
        std::slice::from_ref(&c)
    );

    // Pages of an order, and what is wrong with a page whose begin nothing tells any more.
    let first = app.json("/v1/volumes?order=patient&limit=2").await;
    let cursor = text(&first["next_cursor"]);
    let second = format!("order=patient&limit=2&cursor={cursor}");
    assert_eq!(ids(&app, &second).await, [c.clone(), plain.clone()]);
    let gone = app
        .delete(&format!("/v1/volumes/{b}"))
        .send()
        .await
        .unwrap();
    assert_eq!(gone.status(), StatusCode::NO_CONTENT);
    let told = refused(&app, &second, 400, "invalid-parameter").await;
    assert_eq!(told["field"], "cursor");
    assert_eq!(
        ids(&app, &format!("limit=2&cursor={cursor}")).await,
        Vec::<String>::new()
    );

    for (query, field, value) in [
        ("order=age", "order", "age"),
        ("made=mesh", "made", "mesh"),
        ("job=done", "job", "done"),
        ("rest_or_stress=both", "rest_or_stress", "both"),
        ("study_date_from=20260101", "study_date_from", "20260101"),
        ("study_date_to=2026-13-01", "study_date_to", "2026-13-01"),
        ("created_after=today", "created_after", "today"),
        ("search=", "search", ""),
        ("search=a+b+c+d+e+f+g+h+i", "search", "a b c"),
    ] {
        let told = refused(&app, query, 400, "invalid-parameter").await;
        assert_eq!(told["field"], field, "{query}");
        assert!(text(&told["detail"]).contains(value), "{told}");
    }
    // Other lists have none of it.
    let other = app.get("/v1/models?order=name").send().await.unwrap();
    problem(other, 400, "unknown-parameter").await;
}

#[tokio::test]
async fn who_does_not_see_patients_cannot_find_them_by_trial() {
    let app = TestApp::start().await;
    let id = scan_of(&app, "one", "Doe^Bert", "20260105").await;
    let (_, secret) = key(app.data.path(), Scope::Read, "default", Quota::default()).await;
    let (_, own) = key(app.data.path(), Scope::Submit, "default", Quota::default()).await;
    closed(&app).await;
    let (reader, owner) = (app.seen_with(&secret), app.seen_with(&own));
    for query in [
        "search=doe",
        "search=bert",
        "search=ID",
        "search=2026-01-05",
    ] {
        assert_eq!(
            ids(&owner, query).await,
            std::slice::from_ref(&id),
            "{query}"
        );
        assert!(ids(&reader, query).await.is_empty(), "{query}");
    }
    let own = format!("search={id}");
    assert_eq!(ids(&reader, &own).await, std::slice::from_ref(&id));
    assert_eq!(ids(&reader, "order=largest").await, [id]);
    for query in [
        "order=patient",
        "order=name",
        "order=study_date",
        "patient=ID+one",
        "study_date_from=2026-01-01",
        "study_date_to=2026-01-01",
    ] {
        let told = refused(&reader, query, 403, "insufficient-scope").await;
        assert_eq!(told["field"], query.split('=').next().unwrap());
    }
}

#[tokio::test]
async fn a_list_says_whether_it_has_changed() {
    let app = TestApp::start().await;
    let id = app.volume("one").await;
    for path in ["/v1/volumes?limit=5", "/v1/volumes?order=largest"] {
        let answer = app.get(path).send().await.unwrap();
        let etag = answer.headers()["etag"].to_str().unwrap().to_owned();
        assert!(answer.headers().contains_key("upload-limit"));
        let again = app.get(path).header("if-none-match", &etag);
        assert_eq!(
            again.send().await.unwrap().status(),
            StatusCode::NOT_MODIFIED
        );
        let other = app.volume(path).await;
        let again = app.get(path).header("if-none-match", &etag);
        assert_eq!(again.send().await.unwrap().status(), StatusCode::OK);
        let erased = app
            .delete(&format!("/v1/volumes/{other}"))
            .send()
            .await
            .unwrap();
        assert_eq!(erased.status(), StatusCode::NO_CONTENT);
        let again = app.get(path).header("if-none-match", &etag);
        assert_eq!(
            again.send().await.unwrap().status(),
            StatusCode::NOT_MODIFIED
        );
    }
    let nothing = json!({"series": 0, "objects": 0, "bytes": 0});
    assert_eq!(app.json("/v1/receiving").await, nothing);
    assert_eq!(ids(&app, "order=largest").await, [id]);
}
