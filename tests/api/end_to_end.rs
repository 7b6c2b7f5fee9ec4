//! The real work in the real program, from file to mesh.

use crate::helpers::{Service, problem, scan, text};
use serde_json::Value;

#[tokio::test]
async fn a_scan_becomes_a_closed_mesh_of_exactly_the_points_asked_for() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let answer = service
        .post("/v1/models?points=110&seed=2")
        .header("prefer", "wait=60")
        .header("accept", "application/json")
        .body(scan())
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), 200);
    let model = answer.headers()["location"].to_str().unwrap().to_owned();
    let mesh: Value = answer.json().await.unwrap();
    assert_eq!(mesh["vertices"].as_array().unwrap().len(), 110);
    assert_eq!(mesh["triangles"].as_array().unwrap().len(), 2 * 110 - 4);
    let report = service
        .get(&format!("{model}/report"))
        .send()
        .await
        .unwrap();
    let report: Value = report.json().await.unwrap();
    assert_eq!(report["mesh"]["vertices"], 110);
    assert_eq!(report["mesh"]["euler_characteristic"], 2);
    assert!(report["fitness"]["gain_percent"].as_f64().unwrap() > 0.0);
    let facts: Value = service
        .get("/v1/volumes")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    assert_eq!(facts["volumes"][0]["format"], "NIfTI-1");
    let preview = text(&facts["volumes"][0]["links"]["preview"]);
    let preview = service
        .get(&preview)
        .send()
        .await
        .unwrap()
        .bytes()
        .await
        .unwrap();
    assert!(preview.starts_with(b"\x89PNG"));
}

#[tokio::test]
async fn what_is_wrong_with_a_file_or_a_wish_is_said() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let scan = scan();
    let post = |path: &str, body: Vec<u8>| {
        service
            .post(path)
            .header("prefer", "wait=60")
            .body(body)
            .send()
    };
    let cut = post("/v1/models", scan[..scan.len() / 2].to_vec())
        .await
        .unwrap();
    assert_eq!(cut.status(), 422);
    let text_file = post("/v1/models", b"not a volume at all".to_vec())
        .await
        .unwrap();
    problem(text_file, 422, "unrecognised-format").await;
    let beyond = post("/v1/models?iso=absolute:1e9", scan.clone())
        .await
        .unwrap();
    let body = problem(beyond, 422, "no-surface").await;
    assert_eq!(body["field"], "iso");
    assert!(body["fix"].is_string());
}

/// Uploads are streamed to the disk: what the service holds does not grow with them.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn an_upload_takes_no_memory() {
    const MIB: usize = 1 << 20;
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    service.get("/healthz").send().await.unwrap();
    let before = service.peak_memory_kib();
    let pieces = futures::stream::iter((0..256).map(|_| Ok::<_, std::io::Error>(vec![1u8; MIB])));
    let body = reqwest::Body::wrap_stream(pieces);
    let answer = service.post("/v1/volumes").body(body).send().await.unwrap();
    assert_eq!(answer.status(), 422);
    let grown = service.peak_memory_kib() - before;
    assert!(grown < 32 << 10, "{grown} KiB for 256 MiB");
}
