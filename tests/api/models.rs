//! `/v1/models`.

use crate::helpers::{TestApp, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::{ACCEPT, LOCATION};
use serde_json::Value;

#[tokio::test]
async fn one_request_uploads_a_volume_and_waits_for_the_model() {
    let app = TestApp::start().await;
    let answer = app
        .post("/v1/models?points=150")
        .header("prefer", "wait=20")
        .header(ACCEPT, "model/gltf-binary")
        .body(volume("sphere"))
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), StatusCode::OK);
    let headers = answer.headers().clone();
    assert_eq!(headers["content-type"], "model/gltf-binary");
    assert_eq!(headers["preference-applied"], "wait=20");
    let mesh = answer.bytes().await.unwrap();
    assert!(mesh.starts_with(b"glTF"));
    let model = app.json(headers[LOCATION].to_str().unwrap()).await;
    assert_eq!(model["parameters"]["points"], 150);
    assert!(
        model["parameters"]["seed"].is_number(),
        "defaults are written out"
    );
    let file = app
        .get(headers["content-location"].to_str().unwrap())
        .send()
        .await
        .unwrap();
    assert_eq!(file.headers()["etag"], headers["etag"]);
    assert_eq!(file.bytes().await.unwrap(), mesh);
}

#[tokio::test]
async fn the_mesh_format_is_chosen_by_accept_or_by_extension() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let base = text(&model["links"]["self"]);
    for (extension, media_type, start) in [
        ("glb", "model/gltf-binary", b"glTF".as_slice()),
        ("gltf", "model/gltf+json", b"{"),
        ("stl", "model/stl", b""),
        ("ply", "application/x-ply", b"ply"),
        ("obj", "model/obj", b"#"),
        ("vtp", "application/x-vtp", b"<"),
        ("vtk", "application/x-vtk", b"# vtk DataFile Version 3.0\n"),
        ("json", "application/json", b"{"),
    ] {
        let by_name = app
            .get(&format!("{base}/mesh.{extension}"))
            .send()
            .await
            .unwrap();
        assert_eq!(by_name.headers()["content-type"], media_type);
        let by_accept = app.get(&format!("{base}/mesh")).header(ACCEPT, media_type);
        let by_accept = by_accept.send().await.unwrap().bytes().await.unwrap();
        assert_eq!(by_name.bytes().await.unwrap(), by_accept);
        assert!(by_accept.starts_with(start), "{extension}");
    }
    let anything = app.get(&format!("{base}/mesh")).send().await.unwrap();
    assert_eq!(anything.headers()["content-type"], "model/gltf-binary");
    let image = app.get(&format!("{base}/mesh")).header(ACCEPT, "image/png");
    problem(image.send().await.unwrap(), 406, "not-acceptable").await;
    let unknown = app.get(&format!("{base}/mesh.fbx")).send().await.unwrap();
    problem(unknown, 404, "not-found").await;
}

#[tokio::test]
async fn the_report_is_available_as_json_and_as_html() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let path = text(&model["links"]["report"]);
    assert_eq!(app.json(&path).await["mesh"]["vertices"], 42);
    let page = app
        .get(&path)
        .header(ACCEPT, "text/html,*/*;q=0.5")
        .send()
        .await
        .unwrap();
    assert!(page.text().await.unwrap().starts_with("<!doctype html>"));
    app.json(&format!("{path}.json")).await;
}

#[tokio::test]
async fn the_page_is_made_on_demand_and_served_like_a_file() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let names: Vec<String> = model["files"]
        .as_array()
        .unwrap()
        .iter()
        .map(|f| text(&f["name"]))
        .collect();
    assert!(!names.contains(&"report.html".into()), "{names:?}");
    let path = text(&model["links"]["page"]);
    let whole = app.get(&path).send().await.unwrap();
    let headers = whole.headers().clone();
    assert_eq!(headers["content-type"], "text/html; charset=utf-8");
    assert_eq!(headers["content-location"], path.as_str());
    let whole = whole.bytes().await.unwrap();
    assert_eq!(headers["content-length"], whole.len().to_string());
    let unchanged = app.get(&path).header("if-none-match", &headers["etag"]);
    assert_eq!(
        unchanged.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );
    let part = app
        .get(&path)
        .header("range", "bytes=2-8")
        .send()
        .await
        .unwrap();
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(part.bytes().await.unwrap(), whole[2..9]);
    let template = app
        .get("/v1/templates/tpl_0/report.html")
        .send()
        .await
        .unwrap();
    problem(template, 404, "not-found").await;
}

#[tokio::test]
async fn results_support_etags_and_byte_ranges() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let path = format!("{}/mesh.stl", text(&model["links"]["self"]));
    let whole = app.get(&path).send().await.unwrap();
    let etag = whole.headers()["etag"].clone();
    assert!(
        whole.headers()["cache-control"]
            .to_str()
            .unwrap()
            .contains("immutable")
    );
    let length = whole.headers()["content-length"]
        .to_str()
        .unwrap()
        .to_owned();
    let whole = whole.bytes().await.unwrap();

    let unchanged = app
        .get(&path)
        .header("if-none-match", &etag)
        .send()
        .await
        .unwrap();
    assert_eq!(unchanged.status(), StatusCode::NOT_MODIFIED);
    let head = app
        .client
        .head(format!("{}{path}", app.url))
        .send()
        .await
        .unwrap();
    assert_eq!(head.headers()["content-length"], length);
    let part = app
        .get(&path)
        .header("range", "bytes=80-83")
        .send()
        .await
        .unwrap();
    assert_eq!(part.status(), StatusCode::PARTIAL_CONTENT);
    assert_eq!(
        part.headers()["content-range"],
        format!("bytes 80-83/{length}")
    );
    assert_eq!(part.bytes().await.unwrap(), whole[80..84]);
    let stale = app
        .get(&path)
        .header("range", "bytes=0-1")
        .header("if-range", "\"old\"");
    assert_eq!(stale.send().await.unwrap().status(), StatusCode::OK);
    let outside = app
        .get(&path)
        .header("range", "bytes=99999999-")
        .send()
        .await
        .unwrap();
    assert_eq!(
        outside.headers()["content-range"],
        format!("bytes */{length}")
    );
    problem(outside, 416, "range-not-satisfiable").await;
}

#[tokio::test]
async fn the_same_volume_and_parameters_make_the_same_model() {
    let app = TestApp::start().await;
    let first = app.model("sphere").await;
    let again = app.model("sphere").await;
    assert_eq!(first, again);
    let models = app.json("/v1/models").await;
    assert_eq!(models["models"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_deleted_model_is_gone_until_it_is_made_again() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let path = text(&model["links"]["self"]);
    assert_eq!(
        app.delete(&path).send().await.unwrap().status(),
        StatusCode::NO_CONTENT
    );
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    problem(
        app.get(&format!("{path}/mesh")).send().await.unwrap(),
        410,
        "gone",
    )
    .await;
    assert_eq!(app.stored(), [text(&model["volume"])]);
    app.model("sphere").await;
    app.json(&path).await;
}

#[tokio::test]
async fn invalid_parameters_are_rejected_before_the_body_is_read() {
    let app = TestApp::start().await;
    for (query, field, hint) in [
        ("point=150", "point", "`points`"),
        ("points=0", "points", "whole number"),
        ("points=many", "points", "whole number"),
        ("points=150&points=150", "points", ""),
        ("iso=half", "iso", ""),
    ] {
        let answer = app
            .post(&format!("/v1/models?{query}"))
            .body(volume("sphere"));
        let body = problem(answer.send().await.unwrap(), 422, "invalid-parameter").await;
        assert_eq!(body["field"], field);
        assert!(text(&body["fix"]).contains(hint), "{body}");
    }
    assert!(app.stored().is_empty());
    let unacceptable = app
        .post("/v1/models")
        .header("prefer", "wait=5")
        .header(ACCEPT, "image/png")
        .body(volume("sphere"));
    problem(unacceptable.send().await.unwrap(), 406, "not-acceptable").await;
}

#[tokio::test]
async fn a_form_can_carry_volume_and_parameters() {
    let app = TestApp::start().await;
    let part = reqwest::multipart::Part::bytes(volume("sphere")).file_name("spect.nii.gz");
    let form = reqwest::multipart::Form::new()
        .text("points", "67")
        .part("file", part);
    let answer = app
        .post("/v1/models?seed=3")
        .multipart(form)
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), StatusCode::ACCEPTED);
    let job: Value = answer.json().await.unwrap();
    assert_eq!(job["parameters"]["points"], 67);
    assert_eq!(job["parameters"]["seed"], 3);
}

#[tokio::test]
async fn a_waiting_request_is_answered_with_the_reason_of_the_failure() {
    let app = TestApp::start().await;
    let wait = |words: &str| {
        app.post("/v1/models")
            .header("prefer", super::helpers::UNTIL_DONE)
            .body(volume(words))
            .send()
    };
    let failed = wait("fail").await.unwrap();
    assert!(
        failed.headers()[LOCATION]
            .to_str()
            .unwrap()
            .starts_with("/v1/jobs/job_")
    );
    let body = problem(failed, 422, "no-surface").await;
    assert_eq!(body["field"], "iso");
    assert!(text(&body["job"]).starts_with("job_"));
    problem(wait("panic").await.unwrap(), 500, "internal").await;
}

#[tokio::test]
async fn a_wait_that_times_out_is_answered_with_the_job() {
    let app = TestApp::with(|s| s.wait_limit = "100ms".parse().unwrap()).await;
    let answer = app
        .post("/v1/models")
        .header("prefer", "wait=60")
        .body(volume("slow"));
    let answer = answer.send().await.unwrap();
    assert_eq!(answer.status(), StatusCode::ACCEPTED);
    assert!(answer.headers().contains_key("retry-after"));
}

#[tokio::test]
async fn a_mesh_that_is_no_wall_has_no_parts() {
    let app = TestApp::start().await;
    let model = app.model("sphere").await;
    let base = text(&model["links"]["self"]);
    for path in ["mesh?part=base", "mesh.vtk?part=endocardium"] {
        let answer = app.get(&format!("{base}/{path}")).send().await.unwrap();
        let body = problem(answer, 404, "not-found").await;
        assert_eq!(body["field"], "part");
    }
    let wrong = app.get(&format!("{base}/mesh?part=wall"));
    problem(wrong.send().await.unwrap(), 400, "invalid-parameter").await;
    let twice = app.get(&format!("{base}/mesh?part=base&part=base"));
    problem(twice.send().await.unwrap(), 400, "repeated-parameter").await;
}
