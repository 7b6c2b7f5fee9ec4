//! A key that may only read gets nothing of a NIfTI file that may name a patient, whatever it asks for: the whole
//! program, every route of its document, every place in which such a file can hold a text.

use crate::helpers::{Service, heart, key, operations, text};
use reqwest::Method;
use reqwest::multipart::{Form, Part};
use serde_json::Value;
use std::io::{Cursor, Read, Write};
use std::time::{Duration, Instant};
use ventriform_service::callers::{Quota, Scope};

/// The patient, short enough for every field of text.
const PATIENT_NAME: &str = "Kanarienvogel";

/// Bytes of a NIfTI-1 header, and where its voxels begin without extensions.
const HEADER_BYTES: usize = 348;
const VOXEL_OFFSET_BYTES: usize = 352;

fn unpacked(bytes: &[u8]) -> Vec<u8> {
    let mut all = Vec::new();
    match flate2::read::GzDecoder::new(bytes).read_to_end(&mut all) {
        Ok(_) => all,
        Err(_) => bytes.to_vec(),
    }
}

/// The scan with an extension of that code (2 is a DICOM header, 6 a comment).
fn extended(plain: &[u8], code: i32) -> Vec<u8> {
    let mut extension = Vec::new();
    extension.extend_from_slice(&64_i32.to_le_bytes());
    extension.extend_from_slice(&code.to_le_bytes());
    extension.extend_from_slice(PATIENT_NAME.as_bytes());
    extension.resize(64, 0);
    let mut file = plain[..HEADER_BYTES].to_vec();
    let offset = (VOXEL_OFFSET_BYTES + extension.len()) as f32;
    file[108..112].copy_from_slice(&offset.to_le_bytes());
    file.extend_from_slice(&[1, 0, 0, 0]);
    file.extend_from_slice(&extension);
    file.extend_from_slice(&plain[VOXEL_OFFSET_BYTES..]);
    file
}

/// The scan with the name at a place of its header.
fn written(plain: &[u8], at: usize) -> Vec<u8> {
    let mut file = plain.to_vec();
    file[at..at + PATIENT_NAME.len()].copy_from_slice(PATIENT_NAME.as_bytes());
    file
}

fn packed(plain: &[u8], name: Option<&str>) -> Vec<u8> {
    let builder = flate2::GzBuilder::new();
    let builder = match name {
        Some(name) => builder.filename(name),
        None => builder,
    };
    let mut file = builder.write(Vec::new(), flate2::Compression::fast());
    file.write_all(plain).unwrap();
    file.finish().unwrap()
}

fn zipped(name: &str, bytes: &[u8]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    archive.start_file(name, options).unwrap();
    archive.write_all(bytes).unwrap();
    archive.finish().unwrap().into_inner()
}

/// Files of the same scan that name the patient.
fn naming() -> Vec<(&'static str, Vec<u8>)> {
    let plain = unpacked(&heart().0);
    let mut longer = plain.clone();
    longer.extend_from_slice(PATIENT_NAME.as_bytes());
    let mut after = packed(&plain, None);
    after.extend_from_slice(PATIENT_NAME.as_bytes());
    let dicom = extended(&plain, 2);
    vec![
        ("a packed DICOM extension", packed(&dicom, None)),
        ("a DICOM extension", dicom.clone()),
        ("a comment", extended(&plain, 6)),
        ("db_name", written(&plain, 14)),
        ("descrip", written(&plain, 148)),
        ("aux_file", written(&plain, 228)),
        ("intent_name", written(&plain, 328)),
        ("bytes after the voxels", longer),
        (
            "the name of the packed file",
            packed(&plain, Some(PATIENT_NAME)),
        ),
        ("bytes after the packed data", after),
        (
            "a name in an archive",
            zipped(&format!("{PATIENT_NAME}.nii"), &plain),
        ),
        ("an archive", zipped("a.nii", &dicom)),
    ]
}

fn names(bytes: &[u8]) -> bool {
    let holds = |bytes: &[u8]| {
        bytes
            .windows(PATIENT_NAME.len())
            .any(|part| part == PATIENT_NAME.as_bytes())
    };
    holds(bytes) || holds(&unpacked(bytes))
}

/// The status of an answer, and whether it names the patient.
async fn told(request: reqwest::RequestBuilder) -> (u16, bool) {
    let answer = request.send().await.unwrap();
    let head = format!("{:?}", answer.headers());
    let status = answer.status().as_u16();
    let body = answer.bytes().await.unwrap();
    (status, names(head.as_bytes()) || names(&body))
}

#[tokio::test]
async fn no_answer_to_a_key_that_reads_holds_what_a_nifti_file_says_of_a_patient() {
    let data = tempfile::tempdir().unwrap();
    let service = Service::start(data.path(), &[]).await;
    let (_, submit) = key(data.path(), Scope::Submit, "a", Quota::default()).await;
    let (_, read) = key(data.path(), Scope::Read, "a", Quota::default()).await;
    let deadline = Instant::now() + Duration::from_secs(20);
    while service.get("/v1/jobs").send().await.unwrap().status() != 401 {
        assert!(Instant::now() < deadline, "the service does not close");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let get = |path: &str, key: &str| service.get(path).bearer_auth(key);
    let json = async |path: &str| -> Value {
        let answer = get(path, &submit).send().await.unwrap();
        answer.error_for_status().unwrap().json().await.unwrap()
    };

    let mut volumes = Vec::new();
    for (how, bytes) in naming() {
        assert!(how == "an archive" || names(&bytes), "{how}");
        let form = Form::new().part(
            "file",
            Part::bytes(bytes).file_name(format!("{PATIENT_NAME}.nii")),
        );
        let sent = service.post("/v1/volumes").bearer_auth(&submit);
        let sent = sent.multipart(form).send().await.unwrap();
        let status = sent.status();
        let volume: Value = sent.json().await.unwrap();
        assert_eq!(status, 201, "{how}: {volume}");
        volumes.push((how, text(&volume["id"])));
    }
    // Whoever may read no more than voxels gets those of a file that holds nothing else.
    let bare = service.post("/v1/volumes").bearer_auth(&submit);
    let bare: Value = bare
        .body(heart().0)
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let content = get(&text(&bare["links"]["content"]), &read);
    assert_eq!(content.send().await.unwrap().status(), 200);

    // A model and a segmentation of the first one, whose files are made of it.
    let first = volumes[0].1.clone();
    for kind in ["models?points=100", "segmentations"] {
        let body = unpacked(&naming()[0].1);
        let made = service.post(&format!("/v1/{kind}")).bearer_auth(&submit);
        let made = made
            .header("prefer", super::helpers::UNTIL_DONE)
            .body(body)
            .send()
            .await;
        let made = made.unwrap();
        let status = made.status();
        assert!(
            status.is_success(),
            "{kind}: {}",
            made.text().await.unwrap()
        );
    }
    let listed = async |kind: &str| -> Vec<String> {
        let list = json(&format!("/v1/{kind}")).await;
        let items = list[kind].as_array().unwrap().iter();
        items.map(|item| text(&item["id"])).collect()
    };
    let models = listed("models").await;
    let segmentations = listed("segmentations").await;
    let jobs = listed("jobs").await;
    assert!(!models.is_empty() && !segmentations.is_empty() && !jobs.is_empty());

    // Every route that reads, of every item, by every way of asking.
    let mut asked = 0;
    let mut given = 0;
    for (method, path, _) in operations() {
        if method != Method::GET || path.starts_with("/v1/jobs/{id}/events") {
            continue;
        }
        let ids: Vec<(&str, String)> = match path.split('/').nth(2) {
            Some("volumes") if path.contains("{id}") => volumes.clone(),
            Some("models") => models.iter().map(|id| ("", id.clone())).collect(),
            Some("segmentations") => segmentations.iter().map(|id| ("", id.clone())).collect(),
            Some("jobs") => jobs.iter().map(|id| ("", id.clone())).collect(),
            _ => vec![("", first.clone())],
        };
        for (how, id) in ids {
            let mut paths = vec![path.replace("{id}", &id).replace("{uid}", "1.2.3")];
            if path.contains("{name}") {
                let volume = json(&format!("/v1/volumes/{id}")).await;
                let files = volume["originals"].as_array().unwrap();
                paths = files.iter().map(|file| text(&file["href"])).collect();
            }
            for path in paths {
                for query in ["", "?deidentify=true", "?deidentify=false"] {
                    let path = format!("{path}{query}");
                    let headers = [
                        ("accept", "*/*"),
                        ("accept", "text/html"),
                        ("range", "bytes=0-1048576"),
                    ];
                    // The other ways of asking only without a query.
                    let ways = if query.is_empty() { 3 } else { 1 };
                    for (header, value) in &headers[..ways] {
                        let (status, named) = told(get(&path, &read).header(*header, *value)).await;
                        assert!(status < 500, "{path}: {status}");
                        assert!(!named, "{path} of {how}, {header}: {value}");
                        asked += 1;
                        given += usize::from(status < 300);
                        let original = path.ends_with("content") || path.contains("/files/");
                        if original && !path.contains('?') {
                            assert_eq!(status, 403, "{path} of {how}");
                        }
                    }
                }
            }
        }
    }
    assert!(asked > 500 && given > 80, "{given} of {asked}");
    // Whoever may send them reads them.
    for (how, id) in &volumes {
        let (status, named) = told(get(&format!("/v1/volumes/{id}/content"), &submit)).await;
        assert_eq!(status, 200);
        assert!(*how == "an archive" || named, "{how}");
    }
}
