//! Health checks, the start page, the documentation, and unknown paths.

use crate::helpers::{TestApp, problem, text};
use reqwest::StatusCode;
use reqwest::header::ACCEPT;

#[tokio::test]
async fn health_readiness_and_metrics_are_served() {
    let app = TestApp::start().await;
    assert_eq!(app.json("/healthz").await["status"], "ok");
    assert_eq!(app.json("/readyz").await["status"], "ok");
    app.finished("sphere").await;
    let metrics = app
        .get("/metrics")
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert!(
        metrics.contains("ventriform_jobs{state=\"queued\"} 0"),
        "{metrics}"
    );
}

#[tokio::test]
async fn the_start_page_is_html_for_browsers_and_text_for_curl() {
    let app = TestApp::start().await;
    let page = app
        .get("/")
        .header(ACCEPT, "text/html,application/xhtml+xml,*/*;q=0.8");
    let page = page.send().await.unwrap().text().await.unwrap();
    assert!(page.starts_with("<!doctype html>"));
    for elsewhere in ["http://", "https://"] {
        let links = page.replace("http://www.w3.org/2000/svg", "");
        assert!(
            !links.contains(elsewhere),
            "the page needs nothing from elsewhere"
        );
    }
    let text = app
        .get("/")
        .header(ACCEPT, "*/*")
        .send()
        .await
        .unwrap()
        .text()
        .await
        .unwrap();
    assert_eq!(
        text.lines()
            .filter(|line| line.contains("curl -fsS"))
            .count(),
        6
    );
    assert!(text.contains(&app.url));
}

#[tokio::test]
async fn the_documentation_needs_no_network() {
    let app = TestApp::start().await;
    let page = app.get("/docs/").send().await.unwrap();
    assert_eq!(page.status(), StatusCode::OK);
    let page = page.text().await.unwrap();
    assert!(
        page.contains("swagger-ui") && !page.contains("https://"),
        "{page}"
    );
}

#[tokio::test]
async fn unknown_paths_and_methods_are_answered_with_problems() {
    let app = TestApp::start().await;
    problem(
        app.get("/v2/models").send().await.unwrap(),
        404,
        "no-such-path",
    )
    .await;
    let wrong = app.delete("/v1/models").send().await.unwrap();
    let allow = wrong.headers()["allow"].to_str().unwrap().to_owned();
    assert!(allow.contains("GET") && allow.contains("POST"), "{allow}");
    problem(wrong, 405, "method-not-allowed").await;
}

#[tokio::test]
async fn request_ids_and_trace_headers_are_returned() {
    let app = TestApp::start().await;
    let parent = "00-0af7651916cd43dd8448eb211c80319c-b7ad6b7169203331-01";
    let answer = app
        .get("/healthz")
        .header("x-request-id", "mine")
        .header("traceparent", parent);
    let answer = answer.send().await.unwrap();
    assert_eq!(answer.headers()["x-request-id"], "mine");
    let trace = answer.headers()["traceparent"].to_str().unwrap();
    assert!(trace.starts_with(&parent[..36]) && trace != parent);
    let odd = app
        .get("/healthz")
        .header("traceparent", "00-é-")
        .send()
        .await
        .unwrap();
    assert!(!odd.headers().contains_key("traceparent"));
    assert!(!text(&odd.headers()["x-request-id"].to_str().unwrap().into()).is_empty());
}
