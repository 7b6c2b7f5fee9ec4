//! Nothing that a file or a client says about a patient leaves the service by its log, metrics,
//! traces, webhooks or headers.

use crate::dicom::{Patient, contains, element, file, nm};
use crate::receiver::Receiver;
use axum::http::StatusCode;
use axum::response::IntoResponse;
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use ventriform_http::install_cryptography;

/// The patient.
const CANARY_NAME: &str = "Zzyzx^Kanarienvogel";
/// Part of it that remains recognisable in any encoding of the rest.
const TRACE_OF_IT: &str = "kanarienvogel";

struct Killed(Child);

impl Drop for Killed {
    fn drop(&mut self) {
        // The process may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A DICOM file that names the patient and has no picture.
fn unusable() -> Vec<u8> {
    file(&[
        element(8, 0x16, "UI", b"1.2.840.10008.5.1.4.1.1.20"),
        element(8, 0x60, "CS", b"NM"),
        element(0x10, 0x10, "PN", CANARY_NAME.as_bytes()),
        element(0x10, 0x20, "LO", CANARY_NAME.as_bytes()),
        element(0x10, 0x4000, "LT", CANARY_NAME.as_bytes()),
    ])
}

/// A DICOM scan of the patient.
fn scan() -> Vec<u8> {
    let patient = Patient {
        name: CANARY_NAME,
        id: CANARY_NAME,
        study: "1.2.840.99999.5",
        accession: "Kanarienvogel",
    };
    nm(&patient, 1)
}

/// A scan whose header's description names the patient.
fn nifti() -> Vec<u8> {
    use std::io::{Read, Write};
    let mut bytes = Vec::new();
    let packed = crate::helpers::scan();
    flate2::read::GzDecoder::new(&packed[..])
        .read_to_end(&mut bytes)
        .unwrap();
    bytes[148..148 + CANARY_NAME.len()].copy_from_slice(CANARY_NAME.as_bytes());
    let mut file = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    file.write_all(&bytes).unwrap();
    file.finish().unwrap()
}

async fn ended(client: &reqwest::Client, url: &str, job: &Value) -> Value {
    let deadline = Instant::now() + Duration::from_secs(120);
    let path = format!("{url}/v1/jobs/{}", job["id"].as_str().unwrap());
    loop {
        let job: Value = client
            .get(&path)
            .send()
            .await
            .unwrap()
            .json()
            .await
            .unwrap();
        if job["finished_at"].is_string() {
            return job;
        }
        assert!(Instant::now() < deadline, "still {job}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test]
async fn no_patient_is_named_in_logs_metrics_traces_or_webhooks() {
    install_cryptography();
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.txt");
    let collector = Receiver::willing().await;
    let receiver = Receiver::start(|number| match number {
        0 => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
        _ => StatusCode::OK.into_response(),
    })
    .await;
    let mut process = Command::new(env!("CARGO_BIN_EXE_ventriform"))
        .args(["serve", "--listen", "127.0.0.1:0", "--data-dir"])
        .arg(folder.path().join("data"))
        .args(["--log", "trace", "--webhook-backoff", "50ms"])
        .args([
            "--webhook-allow",
            "127.0.0.0/8",
            "--otlp-endpoint",
            &collector.url,
        ])
        .stdout(Stdio::piped())
        .stderr(std::fs::File::create(&log).unwrap())
        .spawn()
        .map(Killed)
        .unwrap();
    let mut line = String::new();
    let stdout = process.0.stdout.take().unwrap();
    BufReader::new(stdout).read_line(&mut line).unwrap();
    let url = line
        .split_whitespace()
        .find(|word| word.starts_with("http://"))
        .unwrap();
    let client = reqwest::Client::new();

    let mut heads = String::new();
    let file_name = format!("{CANARY_NAME}.nii.gz");
    let form =
        |bytes: Vec<u8>| Form::new().part("file", Part::bytes(bytes).file_name(file_name.clone()));
    let mut volumes = Vec::new();
    for (bytes, status) in [
        (nifti(), 201),
        (scan(), 201),
        (unusable(), 422),
        (CANARY_NAME.as_bytes().to_vec(), 422),
    ] {
        let answer = client
            .post(format!("{url}/v1/volumes"))
            .multipart(form(bytes));
        let answer = answer.send().await.unwrap();
        heads += &format!("{:?}", answer.headers());
        assert_eq!(answer.status().as_u16(), status);
        let body: Value = answer.json().await.unwrap();
        volumes.push(body["id"].clone());
    }
    // One job that succeeds, one that fails, and requests that are refused.
    for parameters in [json!({"points": 100}), json!({"iso": 1e30})] {
        let job = json!({"volume": volumes[0], "parameters": parameters,
            "webhook": {"url": format!("{}/hook", receiver.url), "events": ["started", "succeeded", "failed"]}});
        let answer = client
            .post(format!("{url}/v1/jobs"))
            .json(&job)
            .send()
            .await
            .unwrap();
        heads += &format!("{:?}", answer.headers());
        if answer.status() == 202 {
            let job = answer.json().await.unwrap();
            ended(&client, url, &job).await;
        }
    }
    // Whose scan it is: shown, stated, searched, written into DICOM objects, erased.
    let of_nifti = format!("{url}/v1/volumes/{}/identity", volumes[0].as_str().unwrap());
    let stated =
        json!({"patient_id": CANARY_NAME, "patient_name": CANARY_NAME, "study_uid": "1.2.3"});
    for body in [
        stated,
        json!({"patient_id": CANARY_NAME, "study_uid": CANARY_NAME}),
        json!({CANARY_NAME: 1}),
    ] {
        let answer = client.put(&of_nifti).json(&body).send().await.unwrap();
        heads += &format!("{:?}", answer.headers());
    }
    let models = client.get(format!("{url}/v1/models?accession={CANARY_NAME}"));
    assert_eq!(models.send().await.unwrap().status(), 200);
    let models = client
        .get(format!("{url}/v1/models?study=1.2.3"))
        .send()
        .await
        .unwrap();
    let models: Value = models.json().await.unwrap();
    let model = models["models"][0]["id"].as_str().unwrap();
    let object = client.get(format!("{url}/v1/models/{model}/mesh.dcm"));
    let object = object.send().await.unwrap();
    heads += &format!("{:?}", object.headers());
    assert!(contains(&object.bytes().await.unwrap(), CANARY_NAME));
    let of_dicom = format!("{url}/v1/volumes/{}", volumes[1].as_str().unwrap());
    let shown = client.get(&of_dicom).send().await.unwrap();
    heads += &format!("{:?}", shown.headers());
    assert!(shown.text().await.unwrap().contains(CANARY_NAME));
    let erased = client
        .delete(format!("{of_dicom}/identity"))
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), 204);
    for path in [
        format!("/v1/volumes/{CANARY_NAME}"),
        format!("/v1/jobs?state={CANARY_NAME}"),
        format!("/v1/models?{CANARY_NAME}=1"),
        format!("/{CANARY_NAME}"),
    ] {
        client.get(format!("{url}{path}")).send().await.unwrap();
    }
    let labelled = json!({"volume": volumes[0], "external_id": CANARY_NAME, "labels": {"patient": CANARY_NAME}});
    let answer = client
        .post(format!("{url}/v1/jobs"))
        .json(&labelled)
        .send()
        .await
        .unwrap();
    if answer.status() == 202 {
        let job = answer.json().await.unwrap();
        ended(&client, url, &job).await;
    }
    let told = receiver.wait_for(3).await;
    let metrics = client.get(format!("{url}/metrics")).send().await.unwrap();
    let metrics = metrics.text().await.unwrap();
    collector.wait_for(1).await;

    let log = std::fs::read_to_string(&log).unwrap();
    assert!(
        log.contains("TRACE") && log.contains("job started"),
        "the log is complete"
    );
    let mut seen = vec![
        ("the log", log),
        ("the metrics", metrics),
        ("the headers", heads),
    ];
    for (what, requests) in [("a webhook", told), ("a trace", collector.received())] {
        for request in requests {
            let body = String::from_utf8_lossy(&request.body);
            seen.push((
                what,
                format!("{} {:?} {body}", request.path, request.headers),
            ));
        }
    }
    for (what, text) in seen {
        let lines = text.lines();
        let found: Vec<&str> = lines
            .filter(|line| line.to_lowercase().contains(TRACE_OF_IT))
            .collect();
        assert!(found.is_empty(), "{what}: {found:#?}");
    }
}
