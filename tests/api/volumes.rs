//! `/v1/volumes`.

use crate::helpers::{TestApp, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::LOCATION;
use serde_json::Value;
use sha2::{Digest, Sha256};

#[tokio::test]
async fn a_volume_is_named_by_the_hash_of_its_bytes() {
    let app = TestApp::start().await;
    let bytes = volume("sphere");
    let answer = app
        .post("/v1/volumes")
        .body(bytes.clone())
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), StatusCode::CREATED);
    let hash: String = Sha256::digest(&bytes)[..16]
        .iter()
        .map(|b| format!("{b:02x}"))
        .collect();
    let id = format!("vol_{hash}");
    assert_eq!(answer.headers()[LOCATION], format!("/v1/volumes/{id}"));
    let stored: Value = answer.json().await.unwrap();
    assert_eq!(stored["id"], id);
    assert_eq!(stored["bytes"], bytes.len());
    assert_eq!(app.json(&format!("/v1/volumes/{id}")).await, stored);
}

#[tokio::test]
async fn uploading_the_same_bytes_again_gives_the_same_volume() {
    let app = TestApp::start().await;
    let first = app.volume("sphere").await;
    let again = app
        .post("/v1/volumes")
        .body(volume("sphere"))
        .send()
        .await
        .unwrap();
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.json::<Value>().await.unwrap()["id"], first);
    assert_eq!(app.stored(), [first]);
}

#[tokio::test]
async fn the_order_of_form_parts_does_not_change_the_volume() {
    let app = TestApp::start().await;
    let part = |name: &str, words: &str| {
        reqwest::multipart::Part::bytes(volume(words)).file_name(name.to_owned())
    };
    let mut ids = Vec::new();
    for order in [["a.hdr", "b.img"], ["b.img", "a.hdr"]] {
        let mut form = reqwest::multipart::Form::new();
        for name in order {
            form = form.part("file", part(name, name));
        }
        let answer = app
            .post("/v1/volumes")
            .multipart(form)
            .send()
            .await
            .unwrap();
        let stored: Value = answer.json().await.unwrap();
        assert_eq!(stored["files"], 2);
        assert_eq!(
            stored["warnings"],
            serde_json::json!(["volume.hdr", "volume.img"])
        );
        ids.push(text(&stored["id"]));
    }
    assert_eq!(ids[0], ids[1]);
}

#[tokio::test]
async fn a_file_that_is_not_a_volume_is_rejected_and_not_stored() {
    let app = TestApp::start().await;
    let answer = app
        .post("/v1/volumes")
        .body("nonsense")
        .send()
        .await
        .unwrap();
    let body = problem(answer, 422, "unrecognised-format").await;
    assert_eq!(body["fix"], "Send a volume.");
    assert!(app.stored().is_empty());
    assert_eq!(
        app.json("/v1/volumes").await["volumes"],
        serde_json::json!([])
    );
}

#[tokio::test]
async fn unacceptable_bodies_are_rejected_with_the_reason() {
    let app = TestApp::with(|s| s.body_limit = "1KiB".parse().unwrap()).await;
    let post = || app.post("/v1/volumes");
    problem(post().send().await.unwrap(), 400, "empty-body").await;
    let large = post().body(volume(&"x".repeat(2000))).send().await.unwrap();
    problem(large, 413, "body-too-large").await;
    let pieces = futures::stream::iter((0..100).map(|_| Ok::<_, std::io::Error>(vec![b'V'; 100])));
    let chunked = post()
        .body(reqwest::Body::wrap_stream(pieces))
        .send()
        .await
        .unwrap();
    problem(chunked, 413, "body-too-large").await;
    let image = post()
        .header("content-type", "image/png")
        .body("x")
        .send()
        .await
        .unwrap();
    problem(image, 415, "unsupported-media-type").await;
    let packed = post()
        .header("content-encoding", "gzip")
        .body("x")
        .send()
        .await
        .unwrap();
    problem(packed, 415, "unsupported-content-encoding").await;
    let unknown = app
        .post("/v1/volumes?colour=red")
        .body("x")
        .send()
        .await
        .unwrap();
    let body = problem(unknown, 400, "unknown-parameter").await;
    assert_eq!(body["field"], "colour");
    assert!(app.stored().is_empty());
}

#[tokio::test]
async fn a_form_over_the_limit_is_too_large_and_a_broken_one_is_malformed() {
    let app = TestApp::with(|s| s.body_limit = "100KiB".parse().unwrap()).await;
    let form = |body: Vec<u8>| {
        let pieces = futures::stream::iter(
            body.chunks(4096)
                .map(|c| Ok::<_, std::io::Error>(c.to_vec()))
                .collect::<Vec<_>>(),
        );
        app.post("/v1/volumes")
            .header("content-type", "multipart/form-data; boundary=B")
            .body(reqwest::Body::wrap_stream(pieces))
            .send()
    };
    let head = b"--B\r\ncontent-disposition: form-data; name=\"file\"; filename=\"x\"\r\n\r\n";
    let large = [head.as_slice(), &[b'x'; 300_000]].concat();
    problem(form(large).await.unwrap(), 413, "body-too-large").await;
    // Clients can know before they send.
    let list = app.get("/v1/volumes").send().await.unwrap();
    assert_eq!(list.headers()["upload-limit"], "max-size=102400");
    problem(form(head.to_vec()).await.unwrap(), 400, "malformed-form").await;
    problem(
        form(b"--C\r\n".to_vec()).await.unwrap(),
        400,
        "malformed-form",
    )
    .await;
    assert!(app.stored().is_empty());
}

#[tokio::test]
async fn lists_continue_at_the_cursor() {
    let app = TestApp::start().await;
    let mut all = Vec::new();
    for number in 0..5 {
        all.push(app.volume(&format!("sphere {number}")).await);
    }
    all.reverse();
    let mut seen = Vec::new();
    let mut path = "/v1/volumes?limit=2".to_owned();
    loop {
        let page = app.json(&path).await;
        let items = page["volumes"].as_array().unwrap();
        assert!(items.len() <= 2);
        seen.extend(items.iter().map(|v| text(&v["id"])));
        match page["next_cursor"].as_str() {
            Some(cursor) => path = format!("/v1/volumes?limit=2&cursor={cursor}"),
            None => break,
        }
    }
    assert_eq!(seen, all);
    for query in [
        "limit=0",
        "limit=101",
        "limit=x",
        "cursor=x",
        "limit=1&limit=2",
        "limits=1",
    ] {
        let answer = app
            .get(&format!("/v1/volumes?{query}"))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::BAD_REQUEST, "{query}");
    }
}

#[tokio::test]
async fn a_deleted_volume_is_gone_until_it_is_uploaded_again() {
    let app = TestApp::start().await;
    let path = format!("/v1/volumes/{}", app.volume("sphere").await);
    let erased = app.delete(&path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    assert!(app.stored().is_empty());
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    problem(app.delete(&path).send().await.unwrap(), 410, "gone").await;
    app.volume("sphere").await;
    app.json(&path).await;
    problem(
        app.get("/v1/volumes/vol_0").send().await.unwrap(),
        404,
        "not-found",
    )
    .await;
}

#[tokio::test]
async fn a_volume_that_a_job_needs_cannot_be_deleted() {
    let app = TestApp::start().await;
    let job = app.file("slow").await;
    let path = text(&job["links"]["volume"]);
    problem(app.delete(&path).send().await.unwrap(), 409, "in-use").await;
    app.delete(&text(&job["links"]["self"]))
        .send()
        .await
        .unwrap();
    app.until(&job, &["cancelled"]).await;
    assert_eq!(
        app.delete(&path).send().await.unwrap().status(),
        StatusCode::NO_CONTENT
    );
}

#[tokio::test]
async fn a_volume_has_a_preview() {
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    let answer = app
        .get(&format!("/v1/volumes/{id}/preview.png"))
        .send()
        .await
        .unwrap();
    assert_eq!(answer.headers()["content-type"], "image/png");
    assert!(answer.bytes().await.unwrap().starts_with(b"\x89PNG"));
}

#[tokio::test]
async fn the_voxels_of_a_volume_can_be_read_in_one_format() {
    let app = TestApp::start().await;
    let id = app.volume("sphere").await;
    let path = format!("/v1/volumes/{id}/voxels.nii.gz");
    let answer = app.get(&path).send().await.unwrap();
    assert_eq!(answer.headers()["content-type"], "application/gzip");
    let etag = answer.headers()["etag"].clone();
    assert!(answer.bytes().await.unwrap().starts_with(b"\x1f\x8b"));
    let again = app.get(&path).header("if-none-match", etag.clone());
    assert_eq!(
        again.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );
    let first = app.get(&format!("{path}?frame=0")).send().await.unwrap();
    assert_ne!(first.headers()["etag"], etag);
    for (query, status, code) in [
        ("frame=7", 422, "frame-out-of-range"),
        ("frame=x", 400, "invalid-parameter"),
    ] {
        let answer = app.get(&format!("{path}?{query}")).send().await.unwrap();
        let body = problem(answer, status, code).await;
        assert_eq!(body["field"], "frame");
    }
}
