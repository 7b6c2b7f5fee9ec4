//! `/v1/serials`: with the fake computation, and with the real one.

use crate::helpers::{Service, TestApp, problem, text};
use reqwest::StatusCode;
use reqwest::header::ACCEPT;
use serde_json::{Value, json};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::nifti::{self, StoredType};
use ventriform::image::volume::phantom::{PhantomParameters, phantom};

impl TestApp {
    /// Compares the volumes of these words; returns the serial comparison.
    pub async fn serial(&self, said: &[&str]) -> Value {
        let mut scans = Vec::new();
        for words in said {
            scans.push(self.volume(words).await);
        }
        let request = self.post("/v1/serials").json(&json!({ "scans": scans }));
        let answer = request.send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = self
            .until(&answer.json().await.unwrap(), &["succeeded"])
            .await;
        assert_eq!(job["kind"], "serial");
        assert_eq!(job["volume"], scans[0].as_str());
        let made = self.json(&text(&job["links"]["serial"])).await;
        assert_eq!(made["id"], job["serial"]);
        assert_eq!(made["parameters"]["others"], scans[1..].join(","));
        made
    }
}

/// Erasing any of its scans erases a serial comparison.
#[tokio::test]
async fn serials_are_listed_downloaded_and_go_with_any_of_their_scans() {
    let app = TestApp::start().await;
    let said = ["sphere one", "sphere two", "sphere three"];
    for erased in 0..3 {
        let made = app.serial(&said).await;
        let path = text(&made["links"]["self"]);
        assert_eq!(app.json("/v1/serials?limit=1").await["serials"][0], made);
        let volumes = made["links"]["volumes"].as_array().unwrap().clone();
        assert_eq!(volumes.len(), 3);
        let report = app.json(&format!("{path}/report")).await;
        assert_eq!(report, app.json(&format!("{path}/serial.json")).await);
        let mesh = app.get(&format!("{path}/mesh")).header(ACCEPT, "model/stl");
        let mesh = mesh.send().await.unwrap();
        let place = mesh.headers()["content-location"].to_str().unwrap();
        assert_eq!(place, format!("{path}/mesh_scan01.stl"));
        for name in ["mesh_scan07.stl", "mask.nii.gz", "polar_change_01_02.svg"] {
            let missing = app.get(&format!("{path}/{name}")).send().await.unwrap();
            problem(missing, 404, "not-found").await;
        }
        let volume = text(&volumes[erased]);
        let gone = app.delete(&format!("{volume}?cascade=true"));
        assert!(gone.send().await.unwrap().status().is_success());
        problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    }
}

#[tokio::test]
async fn what_is_no_series_is_refused_by_field() {
    let app = TestApp::start().await;
    let (one, two) = (
        app.volume("sphere one").await,
        app.volume("sphere two").await,
    );
    for (order, field) in [
        (json!({}), "scans"),
        (json!({"scans": [one]}), "scans"),
        (json!({"scans": [one, one]}), "scans[1]"),
        (json!({"scans": [one, "mdl_12"]}), "scans[1]"),
        (json!({"scans": [one, two], "rest": two}), "rest"),
        (
            json!({"scans": [one, two], "parameters": {"center": [1, 2, 3]}}),
            "center",
        ),
        (
            json!({"scans": [one, two], "parameters": {"others": two}}),
            "others",
        ),
    ] {
        let answer = app.post("/v1/serials").json(&order).send().await.unwrap();
        let status = answer.status().as_u16();
        let told: Value = answer.json().await.unwrap();
        assert!((400..500).contains(&status), "{order}: {told}");
        assert_eq!(told["field"], field, "{order}: {told}");
        assert!(told["fix"].is_string(), "{told}");
    }
    let missing = json!({"scans": [one, "vol_00000000000000000000000000000000"]});
    let answer = app.post("/v1/serials").json(&missing).send().await.unwrap();
    assert!(answer.status().is_client_error());
}

/// Two scans of one simulated heart, by the service: report, page and maps.
#[tokio::test]
async fn two_scans_of_one_heart_are_compared() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let mut scans = Vec::new();
    for seed in [1, 2] {
        let parameters = PhantomParameters {
            shape: [52; 3],
            spacing_mm: [5.0; 3],
            pose_spread_deg: 0.0,
            pose_spread_mm: 0.0,
            seed,
            ..PhantomParameters::default()
        };
        let made = phantom(&parameters, &Monitor::silent()).unwrap();
        let bytes = nifti::write(&made.volume, StoredType::Int16, false).unwrap();
        let answer = service
            .post("/v1/volumes")
            .body(bytes)
            .send()
            .await
            .unwrap();
        let volume: Value = answer.json().await.unwrap();
        scans.push(text(&volume["id"]));
    }
    let waited = service
        .post("/v1/serials")
        .header("prefer", super::helpers::UNTIL_DONE)
        .header(ACCEPT, "application/json")
        .json(&json!({ "scans": scans }));
    let waited = waited.send().await.unwrap();
    assert_eq!(waited.status(), StatusCode::OK);
    let report: Value = waited.json().await.unwrap();
    assert_eq!(report["pairs"].as_array().unwrap().len(), 1);
    let listed: Value = service
        .get("/v1/serials")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let made = &listed["serials"][0];
    let path = text(&made["links"]["self"]);
    assert_eq!(made["summary"]["scans"], 2);
    assert_eq!(made["summary"]["worse_verdict"], "no");
    for name in [
        "trend.svg",
        "polar_scan02.svg",
        "polar_change_01_02.png",
        "mesh_scan02.glb",
    ] {
        let file = service.get(&format!("{path}/{name}")).send().await.unwrap();
        assert_eq!(file.status(), StatusCode::OK, "{name}");
    }
    let page = service
        .get(&format!("{path}/report.html"))
        .send()
        .await
        .unwrap();
    let page = page.text().await.unwrap();
    assert!(page.contains("Left ventricle over the years") && page.contains("Scan 1 less scan 2"));
}
