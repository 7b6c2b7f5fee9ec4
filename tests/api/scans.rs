//! Whose scan a volume is: shown, searched, stated, erased; and DICOM objects of results.

use crate::dicom::{JANE, Patient, contains, element, file, nm, nm_of, simulated};
use crate::gated::beating;
use crate::helpers::{Api, TestApp, closed, key, problem, scan, text};
use dicom_dictionary_std::{tags, uids};
use dicom_object::{DefaultDicomObject, InMemDicomObject, from_reader};
use reqwest::{Response, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::base::progress::Monitor;
use ventriform::image::volume::Provenance;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Volume, VolumeFile};
use ventriform_service::base::records::Tenant;
use ventriform_service::callers::{Quota, Scope};
use ventriform_service::work::Engine;
use ventriform_store::open_rows;

/// A service with the real computation.
async fn real() -> TestApp {
    let data = Arc::new(tempfile::tempdir().unwrap());
    TestApp::on(data, Engine::new(ReadLimits::default()), |_| {}).await
}

async fn upload(app: &Api, bytes: Vec<u8>) -> Value {
    let answer = app.post("/v1/volumes").body(bytes).send().await.unwrap();
    assert!(answer.status().is_success(), "{}", answer.status());
    answer.json().await.unwrap()
}

/// Runs a job and returns the path of its result.
async fn result(app: &TestApp, kind: &str, volume: &Value, parameters: Value) -> String {
    let order = json!({"kind": kind, "volume": volume["id"], "parameters": parameters});
    let filed = app.post("/v1/jobs").json(&order).send().await.unwrap();
    assert_eq!(filed.status(), StatusCode::ACCEPTED);
    let job: Value = filed.json().await.unwrap();
    let path = text(&job["links"]["self"]);
    let deadline = Instant::now() + Duration::from_secs(300);
    loop {
        let job = app.json(&path).await;
        match job["state"].as_str() {
            Some("succeeded") => return text(&job["links"][kind]),
            Some("failed") => panic!("{job}"),
            _ => assert!(Instant::now() < deadline, "still {job}"),
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

async fn get(app: &Api, path: &str) -> Response {
    app.get(path).send().await.unwrap()
}

async fn bytes(app: &Api, path: &str) -> Vec<u8> {
    let answer = get(app, path).await;
    assert_eq!(answer.status(), StatusCode::OK, "{path}");
    assert_eq!(answer.headers()["content-type"], "application/dicom");
    answer.bytes().await.unwrap().to_vec()
}

async fn with_scope(app: &TestApp, scope: Scope, tenant: &str) -> TestApp {
    let (_, text) = key(app.data.path(), scope, tenant, Quota::default()).await;
    closed(app).await;
    app.seen_with(&text)
}

const UNKNOWN_PATIENT: Patient = Patient {
    name: "Roe^Richard",
    id: "PAT-1",
    study: "1.2.840.99999.8",
    accession: "ACC-1",
};

/// The ids of a page.
fn ids(page: &Value, kind: &str) -> Vec<String> {
    let items = page[kind].as_array().unwrap();
    items.iter().map(|item| text(&item["id"])).collect()
}

#[tokio::test]
async fn a_scans_identity_is_shown_searched_and_erased() {
    let app = real().await;
    let volume = upload(&app, nm(&JANE, 1)).await;
    let dicom = &volume["dicom"];
    for (name, value) in [
        ("patient_name", JANE.name),
        ("patient_id", JANE.id),
        ("patient_birth_date", "19500102"),
        ("study_uid", JANE.study),
        ("series_uid", "1.2.840.99999.7.2"),
        ("sop_instance_uid", "1.2.840.99999.7.3"),
        ("frame_of_reference_uid", "1.2.840.99999.7.4"),
        ("accession_number", JANE.accession),
        ("acquisition_date", "20261102"),
        ("modality", "NM"),
        ("injected_dose", "740"),
        ("rest_or_stress", "stress"),
        ("manufacturer", "Maker"),
    ] {
        assert_eq!(dicom[name], value, "{name}: {dicom}");
    }
    let path = text(&volume["links"]["self"]);
    let identity = text(&volume["links"]["identity"]);
    assert_eq!(app.json(&path).await, volume);
    assert_eq!(app.json(&identity).await["patient_id"], JANE.id);
    let other = upload(&app, nm(&UNKNOWN_PATIENT, 1)).await;
    let plain = upload(&app, scan()).await;
    assert_eq!(plain["dicom"], Value::Null);
    assert_eq!(
        app.json(&text(&plain["links"]["identity"])).await,
        json!({})
    );

    let model = result(&app, "model", &volume, json!({"points": 50})).await;
    result(&app, "model", &other, json!({"points": 50})).await;
    let shown = app.json(&model).await;
    let uids = json!({"study_uid": JANE.study, "series_uid": "1.2.840.99999.7.2",
        "frame_of_reference_uid": "1.2.840.99999.7.4"});
    assert_eq!(shown["dicom"], uids);
    // The stored report is the same for equal voxels, so it names nobody.
    let report = app.json(&format!("{model}/report")).await;
    assert!(!report.to_string().contains(JANE.study));
    let gltf = app.json(&format!("{model}/mesh.gltf")).await;
    assert!(
        gltf.to_string().contains("1.2.840.99999.7.4"),
        "{}",
        gltf["asset"]
    );

    for (query, found) in [
        (format!("study={}", JANE.study), true),
        ("series=1.2.840.99999.7.2".into(), true),
        (format!("accession={}", JANE.accession), true),
        (
            format!("study={}&accession={}", JANE.study, JANE.accession),
            true,
        ),
        (format!("study={}&accession=x", JANE.study), false),
        ("study=1.2.3".into(), false),
    ] {
        for (kind, id) in [("volumes", &volume["id"]), ("models", &shown["id"])] {
            let page = app.json(&format!("/v1/{kind}?{query}")).await;
            let expected = if found { vec![text(id)] } else { vec![] };
            assert_eq!(ids(&page, kind), expected, "{kind}?{query}");
        }
        let jobs = app.json(&format!("/v1/jobs?{query}")).await;
        assert_eq!(ids(&jobs, "jobs").len(), usize::from(found), "{query}");
    }
    for query in ["study=", "study=1&study=2", "series=%00"] {
        let refused = get(&app, &format!("/v1/models?{query}")).await;
        assert_eq!(refused.status(), StatusCode::BAD_REQUEST, "{query}");
    }

    let hold = format!("{path}/hold");
    let held = app
        .client
        .put(format!("{}{hold}", app.url))
        .json(&json!({"reason": "case"}));
    assert!(held.send().await.unwrap().status().is_success());
    let refused = app.delete(&identity).send().await.unwrap();
    problem(refused, 409, "legal-hold").await;
    app.delete(&hold).send().await.unwrap();
    let erased = app.delete(&identity).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    assert_eq!(app.json(&path).await["dicom"], Value::Null);
    assert_eq!(app.json(&model).await["dicom"], Value::Null);
    let page = app.json(&format!("/v1/volumes?study={}", JANE.study)).await;
    assert_eq!(ids(&page, "volumes"), Vec::<String>::new());
    problem(
        get(&app, &format!("{model}/mesh.dcm")).await,
        409,
        "identity-needed",
    )
    .await;
    // Another upload of the same file ends the erasure.
    assert_eq!(upload(&app, nm(&JANE, 1)).await["dicom"], volume["dicom"]);
    // An erased volume takes whose scan it was with it.
    app.delete(&path).send().await.unwrap();
    assert_eq!(app.json(&model).await["dicom"], Value::Null);
    problem(
        get(&app, &format!("{model}/mesh.dcm")).await,
        409,
        "volume-erased",
    )
    .await;
    assert_eq!(upload(&app, nm(&JANE, 1)).await["dicom"], volume["dicom"]);
}

#[tokio::test]
async fn patients_are_named_to_those_who_may_submit_only() {
    let app = real().await;
    let submit = with_scope(&app, Scope::Submit, "clinic").await;
    let read = with_scope(&app, Scope::Read, "clinic").await;
    let stranger = with_scope(&app, Scope::Admin, "other").await;
    let volume = upload(&submit, nm(&JANE, 1)).await;
    let path = text(&volume["links"]["self"]);
    let model = result(&submit, "model", &volume, json!({"points": 50})).await;
    for _ in 0..2 {
        // Answers are kept for each kind of caller.
        assert_eq!(submit.json(&path).await["dicom"]["patient_name"], JANE.name);
        let seen = read.json(&path).await;
        assert_eq!(seen["dicom"]["study_uid"], JANE.study);
        assert_eq!(seen["dicom"]["manufacturer"], "Maker");
        let seen = seen.to_string();
        for hidden in [
            "Doe",
            JANE.id,
            JANE.accession,
            "19500102",
            "Referrer",
            "2026110",
        ] {
            assert!(!seen.contains(hidden), "{hidden}: {seen}");
        }
    }
    for forbidden in [
        format!("{path}/identity"),
        format!("{path}/content"),
        format!("{path}/files/volume.dcm"),
        format!("{model}/mesh.dcm"),
    ] {
        let refused = get(&read, &forbidden).await;
        problem(refused, 403, "insufficient-scope").await;
        assert_eq!(get(&submit, &forbidden).await.status(), StatusCode::OK);
        assert_eq!(
            get(&stranger, &forbidden).await.status(),
            StatusCode::NOT_FOUND
        );
    }
    let anonymous = bytes(&read, &format!("{model}/mesh.dcm?deidentify=true")).await;
    for hidden in ["Doe", JANE.id, JANE.study, JANE.accession] {
        assert!(!contains(&anonymous, hidden), "{hidden}");
    }
    // The same bytes are another tenant's volume, of which it knows by itself alone.
    let theirs = upload(&stranger, nm(&JANE, 1)).await;
    assert_eq!(theirs["dicom"]["patient_name"], JANE.name);
    let erased = submit
        .delete(&format!("{path}/identity"))
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    assert_eq!(submit.json(&path).await["dicom"], Value::Null);
    assert_eq!(
        stranger.json(&path).await["dicom"]["patient_name"],
        JANE.name
    );
    let admin = with_scope(&app, Scope::Admin, "clinic").await;
    let events = admin.json("/v1/audit?limit=100").await.to_string();
    assert!(
        events.contains("identity") || events.contains("\"D\""),
        "{events}"
    );
    assert!(!events.contains("Doe"));
}

/// The source, the voxels and the frame that readers find in an object.
fn read_back(bytes: &[u8]) -> (Provenance, Vec<f32>, nalgebra::Matrix4<f64>) {
    let files = [VolumeFile::in_memory("mask.dcm", bytes.to_vec())];
    let reading = volume::read(
        &files,
        &ReadOptions::default(),
        &ReadLimits::default(),
        &Monitor::silent(),
    );
    let reading = reading.unwrap();
    let matrix = reading.volume.frame.matrix();
    (reading.provenance.unwrap(), reading.volume.voxels, matrix)
}

#[tokio::test]
async fn a_segmentation_is_had_as_dicom_objects_of_the_scans_study() {
    let app = real().await;
    let volume = upload(&app, nm(&JANE, 2)).await;
    assert_eq!(volume["frames"], 2);
    let parameters = json!({"model": "auto", "frame": 1});
    let fit = result(&app, "segmentation", &volume, parameters).await;
    for name in [
        "mask",
        "contours",
        "mesh",
        "surface",
        "measurements",
        "polar",
        "page",
    ] {
        let path = format!("{fit}/{name}.dcm");
        let answer = get(&app, &path).await;
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let etag = answer.headers()["etag"].clone();
        let disposition = answer.headers()["content-disposition"]
            .to_str()
            .unwrap()
            .to_owned();
        assert!(disposition.starts_with("attachment") && !disposition.contains("Doe"));
        let object = answer.bytes().await.unwrap();
        for of_scan in [JANE.name, JANE.id, JANE.study, JANE.accession] {
            assert!(contains(&object, of_scan), "{name} lacks {of_scan}");
        }
        assert_eq!(object, bytes(&app, &path).await, "{name} differs");
        let again = app
            .get(&path)
            .header("if-none-match", &etag)
            .send()
            .await
            .unwrap();
        assert_eq!(again.status(), StatusCode::NOT_MODIFIED);
        let anonymous = bytes(&app, &format!("{path}?deidentify=true")).await;
        for hidden in [
            "Doe",
            JANE.id,
            JANE.study,
            JANE.accession,
            "19500102",
            "Referrer",
        ] {
            assert!(!contains(&anonymous, hidden), "{name} shows {hidden}");
        }
        assert_eq!(
            anonymous,
            bytes(&app, &format!("{path}?deidentify=true")).await
        );
    }
    let mask = bytes(&app, &format!("{fit}/mask.dcm")).await;
    let (of, voxels, matrix) = read_back(&mask);
    assert_eq!(of.study_uid.as_deref(), Some(JANE.study));
    assert_eq!(
        of.frame_of_reference_uid.as_deref(),
        Some("1.2.840.99999.7.4")
    );
    let apart = (matrix - simulated().volume.frame.matrix()).abs().max();
    assert!(apart < 1e-3, "the grids are the same: {apart}");
    let nifti = get(&app, &format!("{fit}/mask.nii.gz"))
        .await
        .bytes()
        .await
        .unwrap();
    let file = [VolumeFile::in_memory("mask.nii.gz", nifti.to_vec())];
    let stored = volume::read(
        &file,
        &ReadOptions::default(),
        &ReadLimits::default(),
        &Monitor::silent(),
    );
    // Segment 2 is the cavity.
    let wall: Vec<f32> = voxels
        .iter()
        .map(|v| f32::from(u8::from(*v == 1.0)))
        .collect();
    assert!(
        wall == stored.unwrap().volume.voxels,
        "segment 1 is the mask"
    );
    assert!(voxels.contains(&2.0));
    // Frames of the second gate are the source.
    assert!(contains(&mask, "65"), "frame 65 is the first of gate 1");
    let links = app.json(&fit).await["links"]["dicom"].clone();
    assert_eq!(links.as_array().unwrap().len(), 7, "{links}");
    // As an expert's mask, it is the wall alone.
    let expert = text(&upload(&app, mask.to_vec()).await["id"]);
    let again = json!({"model": "auto", "frame": 1, "expert": expert});
    let again = result(&app, "segmentation", &volume, again).await;
    let report = app.json(&format!("{again}/report")).await;
    assert_eq!(report["measures"]["dice"], 1.0, "{}", report["measures"]);
    let refused = get(&app, &format!("{fit}/mask.nii.gz?deidentify=true")).await;
    problem(refused, 400, "unknown-parameter").await;
    let refused = get(&app, &format!("{fit}/mask.dcm?deidentify=yes")).await;
    problem(refused, 400, "invalid-parameter").await;
}

/// Calls `visit` with the data set and every item in it.
fn every_item(set: &InMemDicomObject, visit: &mut dyn FnMut(&InMemDicomObject)) {
    visit(set);
    for item in set.iter().filter_map(|element| element.items()).flatten() {
        every_item(item, visit);
    }
}

/// The numbers of all frames that an object refers to, and the UIDs of all instances.
fn references(object: &InMemDicomObject) -> (BTreeSet<usize>, BTreeSet<String>) {
    let (mut frames, mut instances) = (BTreeSet::new(), BTreeSet::new());
    every_item(object, &mut |item| {
        if let Ok(frame) = item.element(tags::REFERENCED_FRAME_NUMBER) {
            frames.extend(frame.to_multi_int::<usize>().unwrap());
        }
        if let Ok(instance) = item.element(tags::REFERENCED_SOP_INSTANCE_UID) {
            instances.insert(instance.to_str().unwrap().into_owned());
        }
    });
    (frames, instances)
}

#[tokio::test]
async fn a_beat_is_had_as_dicom_objects_that_refer_to_the_gates_of_its_ends() {
    let app = real().await;
    let gates: Vec<&Volume> = beating().iter().collect();
    let volume = upload(&app, nm_of(&JANE, &gates)).await;
    let beat = result(&app, "beat", &volume, json!({})).await;
    let made = app.json(&beat).await;
    let links = ["mask_ed", "mask_es", "measurements"].map(|name| format!("{beat}/{name}.dcm"));
    assert_eq!(made["links"]["dicom"], json!(links));
    let report = app.json(&format!("{beat}/report")).await;
    let ends = ["end_diastole_gate", "end_systole_gate"];
    let ends = ends.map(|end| usize::try_from(report[end].as_u64().unwrap()).unwrap());
    for (end, gate) in ["end_diastole_gate", "end_systole_gate"]
        .into_iter()
        .zip(ends)
    {
        assert_eq!(made["summary"][end], gate);
        assert_eq!(report["gates"][gate - 1]["frame"], gate - 1);
    }
    let mut read: Vec<DefaultDicomObject> = Vec::new();
    for path in &links {
        let object = bytes(&app, path).await;
        assert_eq!(object, bytes(&app, path).await, "{path} differs");
        for of_scan in [JANE.name, JANE.id, JANE.study, JANE.accession] {
            assert!(contains(&object, of_scan), "{path} lacks {of_scan}");
        }
        let anonymous = bytes(&app, &format!("{path}?deidentify=true")).await;
        for hidden in ["Doe", JANE.id, JANE.study, JANE.accession, "19500102"] {
            assert!(!contains(&anonymous, hidden), "{path} shows {hidden}");
        }
        read.push(from_reader(&object[..]).unwrap());
    }
    let source = BTreeSet::from([format!("{}.3", JANE.study)]);
    let slices = gates[0].shape[2];
    for ((object, path), gate) in read.iter().zip(&links).zip(ends) {
        assert_eq!(
            object.meta().media_storage_sop_class_uid(),
            uids::SEGMENTATION_STORAGE
        );
        let (frames, instances) = references(object);
        let own: BTreeSet<usize> = (slices * (gate - 1) + 1..=slices * gate).collect();
        assert_eq!((&frames, &instances), (&own, &source), "{path}");
        // Segment 1 is the wall and segment 2 the cavity, as the labels of that gate are.
        let (of, voxels, _) = read_back(&bytes(&app, path).await);
        assert_eq!(of.study_uid.as_deref(), Some(JANE.study));
        let labels = format!("{beat}/labels_gate{gate:02}.nii.gz");
        let labels = get(&app, &labels).await.bytes().await.unwrap();
        let file = [VolumeFile::in_memory("labels.nii.gz", labels.to_vec())];
        let limits = ReadLimits::default();
        let stored = volume::read(&file, &ReadOptions::default(), &limits, &Monitor::silent());
        assert!(voxels == stored.unwrap().volume.voxels, "{path}");
        assert!(voxels.contains(&1.0) && voxels.contains(&2.0), "{path}");
    }
    let measurements = &read[2];
    assert_eq!(
        measurements.meta().media_storage_sop_class_uid(),
        uids::COMPREHENSIVE3_DSR_STORAGE
    );
    assert!(references(measurements).1.is_superset(&source));
    let mut numbers = BTreeSet::new();
    every_item(measurements, &mut |item| {
        if let Ok(number) = item.element(tags::NUMERIC_VALUE) {
            numbers.insert(number.to_str().unwrap().trim().to_owned());
        }
    });
    for figure in ["edv_ml", "esv_ml", "sv_ml", "ef_percent", "mass_g"] {
        let figure = report[figure].to_string();
        assert!(numbers.contains(&figure), "{figure} in {numbers:?}");
    }

    // They name the patient, which a key that may only read does not see.
    let reader = with_scope(&app, Scope::Read, "default").await;
    for path in &links {
        problem(get(&reader, path).await, 403, "insufficient-scope").await;
        bytes(&reader, &format!("{path}?deidentify=true")).await;
    }
}

#[tokio::test]
async fn a_scan_that_is_not_dicom_needs_a_stated_identity() {
    let app = real().await;
    let volume = upload(&app, scan()).await;
    let model = result(&app, "model", &volume, json!({"points": 50})).await;
    let refused = problem(
        get(&app, &format!("{model}/mesh.dcm")).await,
        409,
        "identity-needed",
    )
    .await;
    assert!(
        text(&refused["fix"]).contains("PUT /v1/volumes/vol_"),
        "{refused}"
    );
    let path = format!("{}{}", app.url, text(&volume["links"]["identity"]));
    let put = async |body: Value| app.client.put(&path).json(&body).send().await.unwrap();
    for (body, code) in [
        (json!({"patient_id": "1"}), "identity-needed"),
        (
            json!({"patient_id": "1", "study_uid": "x"}),
            "invalid-parameter",
        ),
        (json!({"patient_id": 1}), "invalid-field"),
        (json!({"patient": "1"}), "invalid-field"),
    ] {
        problem(put(body).await, 422, code).await;
    }
    let stated = json!({"patient_id": "P-1", "patient_name": "Roe^Jo", "study_uid": "1.2.3.4",
        "accession_number": "A1"});
    let answer = put(stated.clone()).await;
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.json::<Value>().await.unwrap(), stated);
    let found = app.json("/v1/models?study=1.2.3.4&accession=A1").await;
    assert_eq!(ids(&found, "models").len(), 1);
    for name in ["mesh", "surface", "contours", "mask"] {
        let object = bytes(&app, &format!("{model}/{name}.dcm")).await;
        assert!(
            contains(&object, "P-1") && contains(&object, "1.2.3.4"),
            "{name}"
        );
    }
    let polar = get(&app, &format!("{model}/polar.dcm")).await;
    problem(polar, 404, "not-found").await;

    // A DICOM file is not contradicted.
    let volume = upload(&app, nm(&JANE, 1)).await;
    let path = format!("{}{}", app.url, text(&volume["links"]["identity"]));
    let refused = app.client.put(&path).json(&stated).send().await.unwrap();
    let refused = problem(refused, 409, "identity-differs").await;
    assert_eq!(refused["field"], "patient_id");
    assert!(!refused.to_string().contains(JANE.id));
}

#[tokio::test]
async fn volumes_whose_scan_a_repair_has_lost_are_read_at_the_next_start() {
    let app = real().await;
    let volume = upload(&app, nm(&JANE, 1)).await;
    let data = app.stop().await;
    let database =
        sqlx::sqlite::SqliteConnectOptions::new().filename(data.path().join("ventriform.db"));
    let mut rows = sqlx::ConnectOptions::connect(&database).await.unwrap();
    sqlx::query("DELETE FROM scans")
        .execute(&mut rows)
        .await
        .unwrap();
    sqlx::Connection::close(rows).await.unwrap();
    let app = TestApp::on(data, Engine::new(ReadLimits::default()), |_| {}).await;
    let path = text(&volume["links"]["self"]);
    let deadline = Instant::now() + Duration::from_secs(20);
    while app.json(&path).await["dicom"] != volume["dicom"] {
        assert!(Instant::now() < deadline, "not read");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let data = app.stop().await;
    let rows = open_rows(data.path()).await.unwrap();
    use ventriform_service::base::records::Scans;
    let id = text(&volume["id"]);
    assert!(rows.scan(&Tenant::default(), &id).await.unwrap().is_some());
    assert!(rows.unread_scans(0, 10).await.unwrap().is_empty());
}

/// The slices of a CT series, each a file.
fn series() -> Vec<Vec<u8>> {
    let slice = |number: u16| {
        let (uid, place) = (
            format!("1.2.840.99999.6.{number}"),
            format!("0\\0\\{}", 5 * number),
        );
        let pixels: Vec<u8> = (0..64u16)
            .flat_map(|n| (n + number).to_le_bytes())
            .collect();
        let short = |n: u16| n.to_le_bytes();
        file(&[
            element(0x08, 0x08, "CS", b"ORIGINAL\\PRIMARY\\AXIAL"),
            element(0x08, 0x16, "UI", b"1.2.840.10008.5.1.4.1.1.2"),
            element(0x08, 0x18, "UI", uid.as_bytes()),
            element(0x08, 0x60, "CS", b"CT"),
            element(0x18, 0x50, "DS", b"5"),
            element(0x20, 0x0d, "UI", b"1.2.840.99999.6"),
            element(0x20, 0x0e, "UI", b"1.2.840.99999.6.0"),
            element(0x20, 0x32, "DS", place.as_bytes()),
            element(0x20, 0x37, "DS", b"1\\0\\0\\0\\1\\0"),
            element(0x28, 0x02, "US", &short(1)),
            element(0x28, 0x10, "US", &short(8)),
            element(0x28, 0x11, "US", &short(8)),
            element(0x28, 0x30, "DS", b"2\\2"),
            element(0x28, 0x100, "US", &short(16)),
            element(0x28, 0x101, "US", &short(16)),
            element(0x28, 0x102, "US", &short(15)),
            element(0x28, 0x103, "US", &short(0)),
            element(0x28, 0x1052, "DS", b"0"),
            element(0x28, 0x1053, "DS", b"1"),
            element(0x7fe0, 0x10, "OW", &pixels),
        ])
    };
    (1..=4).map(slice).collect()
}

#[tokio::test]
async fn dicomweb_parts_are_the_files_of_one_volume() {
    let app = real().await;
    let send = async |kind: &str, head: &str| {
        let mut body = Vec::new();
        for part in series() {
            body.extend(format!("--xyz\r\n{head}\r\n\r\n").as_bytes());
            body.extend(part);
            body.extend(b"\r\n");
        }
        body.extend(b"--xyz--\r\n");
        let request = app.post("/v1/volumes").header("content-type", kind);
        request.body(body).send().await.unwrap()
    };
    let head = "Content-Type: application/dicom";
    let kind = "multipart/related; type=\"application/dicom\"; boundary=xyz";
    let answer = send(kind, head).await;
    assert_eq!(answer.status(), StatusCode::CREATED);
    let volume: Value = answer.json().await.unwrap();
    assert_eq!(volume["files"], 4);
    assert_eq!(volume["shape"], json!([8, 8, 4]));
    assert_eq!(volume["dicom"]["study_uid"], "1.2.840.99999.6");
    assert_eq!(volume["dicom"]["instance_uids"], Value::Null);
    let whole = app.json(&text(&volume["links"]["identity"])).await;
    assert_eq!(whole["instance_uids"].as_array().unwrap().len(), 4);
    let again = send("Multipart/Related; boundary=\"xyz\"", "Content-Length: 1").await;
    assert_eq!(
        again.status(),
        StatusCode::OK,
        "parts need no type of their own"
    );
    let other = "multipart/related; type=\"application/dicom+json\"; boundary=xyz";
    problem(send(other, head).await, 415, "unsupported-media-type").await;
    let unbounded = send("multipart/related; type=\"application/dicom\"", head).await;
    problem(unbounded, 400, "malformed-form").await;
}

#[tokio::test]
async fn pages_name_the_scan_to_those_who_see_it() {
    let app = real().await;
    let submit = with_scope(&app, Scope::Submit, "clinic").await;
    let read = with_scope(&app, Scope::Read, "clinic").await;
    let volume = upload(&submit, nm(&JANE, 1)).await;
    let model = result(&submit, "model", &volume, json!({"points": 50})).await;
    let page = async |app: &Api, path: &str| {
        let answer = app
            .get(path)
            .header("accept", "text/html")
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let cached = text(&json!(answer.headers()["cache-control"].to_str().unwrap()));
        assert_eq!(cached, "private, no-cache");
        let etag = answer.headers()["etag"].to_str().unwrap().to_owned();
        (answer.text().await.unwrap(), etag)
    };
    let names = ["Doe, Jane", JANE.id, JANE.accession, "1950-01-02"];
    for path in [format!("{model}/report.html"), format!("{model}/report")] {
        let (whole, whole_tag) = page(&submit, &path).await;
        assert!(names.iter().all(|name| whole.contains(name)), "{path}");
        let (part, part_tag) = page(&read, &path).await;
        assert!(!names.iter().any(|name| part.contains(name)), "{path}");
        assert!(part.contains(JANE.study) && part_tag != whole_tag);
    }
    let nobody = format!("{model}/report.html?deidentify=true");
    let (none, _) = page(&submit, &nobody).await;
    assert!(
        !names
            .iter()
            .chain([&JANE.study, &JANE.name, &"19500102"])
            .any(|name| none.contains(name))
    );
    // Whose scan it is stays out of what is stored, and of pages after an erasure.
    let erased = submit
        .delete(&text(&volume["links"]["identity"]))
        .send()
        .await
        .unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    let (none, _) = page(&submit, &format!("{model}/report.html")).await;
    assert!(
        !names
            .iter()
            .chain([&JANE.study])
            .any(|name| none.contains(name))
    );
}

#[tokio::test]
async fn a_name_that_cannot_be_decoded_makes_no_object() {
    let app = real().await;
    let original = nm(&JANE, 1);
    let at = original
        .windows(8)
        .position(|w| w == JANE.name.as_bytes())
        .unwrap();
    for (name, code) in [(b"Doe^Jan\xe9", "byte"), (b"A\x1b[2J^B\n", "escape")] {
        let mut scan = original.clone();
        scan[at..at + 8].copy_from_slice(name);
        let volume = upload(&app, scan).await;
        assert_eq!(volume["dicom"]["patient_name"], Value::Null);
        assert_eq!(volume["dicom"]["undecoded"], json!(["patient_name"]));
        let warnings = volume["warnings"].to_string();
        assert!(
            warnings.contains("(0010,0010)") && warnings.contains(code),
            "{warnings}"
        );
        let model = result(&app, "model", &volume, json!({"points": 50})).await;
        let object = format!("{model}/mesh.dcm");
        let refused = problem(get(&app, &object).await, 409, "identity-needed").await;
        assert_eq!(refused["field"], "patient_name");
        let hidden = bytes(&app, &format!("{object}?deidentify=true")).await;
        assert!(!contains(&hidden, "Doe"));
        let path = format!("{}{}", app.url, text(&volume["links"]["identity"]));
        let put = async |name: &str| {
            let body = json!({"patient_name": name});
            app.client.put(&path).json(&body).send().await.unwrap()
        };
        for refused in [
            "A\u{1b}[2J^B",
            "A\u{202e}B",
            "A\u{9b}B",
            "A\u{2028}B",
            "A\\B",
        ] {
            problem(put(refused).await, 422, "invalid-parameter").await;
        }
        assert_eq!(put("Doe^Jané").await.status(), StatusCode::OK);
        assert!(contains(&bytes(&app, &object).await, "Doe^Jané"));
    }
}
