//! Text of headers and of callers: who does not see whose scan a volume is sees none of it, by no way, of no kind of
//! product, and nobody does once the identity is erased.
//!
//! A mark in every attribute of the dictionary that holds text, in every text of a NIfTI header and a mesh, and in
//! every free text of a caller; then every GET of the OpenAPI document.

use crate::comparisons::person;
use crate::dicom::{JANE, Patient, nm_of};
use crate::helpers::{Api, TestApp, closed, heart, key, operations, scan, text};
use crate::readers::profile;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_core::{DataElement, PrimitiveValue, Tag, VR};
use dicom_dictionary_std::StandardDataDictionary;
use dicom_object::from_reader;
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::io::{Read, Write};
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::image::volume::ReadLimits;
use ventriform_service::callers::{Quota, Scope};
use ventriform_service::work::Engine;

/// The beginning of every mark.
const MARK: &str = "QZXVKJ";

/// Attributes whose values decide how the file is read.
const NEEDED: [Tag; 8] = [
    Tag(0x0008, 0x0005),
    Tag(0x0008, 0x0008),
    Tag(0x0008, 0x0016),
    Tag(0x0008, 0x0018),
    Tag(0x0008, 0x0060),
    Tag(0x0018, 0x5100),
    Tag(0x0020, 0x000d),
    Tag(0x0020, 0x000e),
];

/// What `read` sees of a scan (docs/security.md): manufacturer, model, software, reconstruction, and what UIDs, Image
/// Type and the tracer are in.
const SHOWN: [&str; 6] = [
    "QZXVKJ00080070",
    "QZXVKJ00081090",
    "QZXVKJ00181020",
    "QZXVKJ00541103",
    "QZXVKJ00201040",
    "QZXVKJ00180031",
];

fn mark(tag: Tag) -> String {
    format!("{MARK}{:04X}{:04X}", tag.0, tag.1)
}

/// A scan of a heart of its own, for each number, with a mark in every attribute that can hold text, and their number.
fn marked_dicom(series: u64) -> (Vec<u8>, usize) {
    let patient = Patient {
        study: ["1.2.840.99999.7", "1.2.840.99999.7.20"][(series % 2) as usize],
        ..JANE
    };
    let heart = nm_of(&patient, &[&person(100 + series, &[])]);
    let mut object = from_reader(&heart[..]).unwrap();
    let holds_text = [
        VR::PN,
        VR::LO,
        VR::SH,
        VR::ST,
        VR::LT,
        VR::UT,
        VR::UC,
        VR::AE,
        VR::CS,
        VR::UR,
    ];
    let mut marked = 0;
    for group in (0x0008..0x0080).step_by(2).filter(|group| *group != 0x0028) {
        for number in 0..=u16::MAX {
            let tag = Tag(group, number);
            let Some(entry) = StandardDataDictionary.by_tag(tag) else {
                continue;
            };
            let vr = entry.vr().relaxed();
            if !holds_text.contains(&vr)
                || NEEDED.contains(&tag)
                || entry.tag_range().inner() != tag
            {
                continue;
            }
            object.put(DataElement::new(tag, vr, PrimitiveValue::from(mark(tag))));
            marked += 1;
        }
    }
    // A number that is a text, and a character set that DICOM does not define.
    object.put(DataElement::new(
        Tag(0x0054, 0x0081),
        VR::US,
        PrimitiveValue::from(52_u16),
    ));
    object.put(DataElement::new(
        Tag(0x0008, 0x0005),
        VR::CS,
        PrimitiveValue::from("QZXVKJ CHARSET"),
    ));
    object.put(DataElement::new(
        Tag(0x0008, 0x103e),
        VR::LO,
        PrimitiveValue::from(format!("{} {series}", mark(Tag(0x0008, 0x103e)))),
    ));
    let mut bytes = Vec::new();
    object.write_all(&mut bytes).unwrap();
    (bytes, marked)
}

/// A NIfTI file with marks in each text of its header.
fn marked_nifti() -> Vec<u8> {
    let mut bytes = Vec::new();
    let packed = scan();
    flate2::read::GzDecoder::new(&packed[..])
        .read_to_end(&mut bytes)
        .unwrap();
    // data_type, db_name, descrip, aux_file, intent_name.
    for (at, mark) in [
        (4, "QZXVKJTYPE"),
        (14, "QZXVKJDBNAME"),
        (148, "QZXVKJDESCRIP"),
        (228, "QZXVKJAUX"),
        (328, "QZXVKJINTENT"),
    ] {
        bytes[at..at + mark.len()].copy_from_slice(mark.as_bytes());
    }
    // An extension of the kind comment, before the voxels.
    let (size, mut extension) = (48_u16, b"QZXVKJEXTENSION".to_vec());
    extension.resize(usize::from(size) - 8, 0);
    let offset = f32::from_le_bytes(bytes[108..112].try_into().unwrap());
    assert_eq!(offset, 352.0, "a file of its own, without extensions");
    bytes[108..112].copy_from_slice(&(offset + f32::from(size)).to_le_bytes());
    bytes[348] = 1;
    let head = [u32::from(size), 6].map(u32::to_le_bytes).concat();
    bytes.splice(352..352, head.into_iter().chain(extension));
    let mut file = flate2::GzBuilder::new()
        .filename("QZXVKJGZNAME.nii")
        .comment("QZXVKJGZCOMMENT")
        .write(Vec::new(), flate2::Compression::fast());
    file.write_all(&bytes).unwrap();
    file.finish().unwrap()
}

/// The meshes of a product in each format that has comments, with a mark in every place where a text can be.
async fn marked_meshes(app: &Api, product: &str) -> Vec<(&'static str, Vec<u8>)> {
    let mut meshes = Vec::new();
    for format in ["stl", "ply", "obj", "vtk", "gltf"] {
        let path = format!("{product}/mesh.{format}");
        let answer = app.get(&path).send().await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{path}");
        let mut bytes = answer.bytes().await.unwrap().to_vec();
        let after = |bytes: &[u8], word: &[u8]| {
            let at = bytes.windows(word.len()).position(|part| part == word);
            at.unwrap_or_else(|| panic!("{path} has no {word:?}")) + word.len()
        };
        match format {
            "stl" => bytes[64..73].copy_from_slice(b"QZXVKJSTL"),
            "ply" => {
                let end = after(&bytes, b"1.0\n");
                bytes.splice(end..end, *b"comment QZXVKJPLY\nobj_info QZXVKJINFO\n");
            }
            "obj" => {
                bytes.splice(
                    0..0,
                    *b"# QZXVKJOBJ\nmtllib QZXVKJMTL.mtl\no QZXVKJNAME\ng QZXVKJGROUP\n",
                );
            }
            "vtk" => {
                let end = after(&bytes, b"Version 3.0\n");
                bytes.splice(end..end, *b"QZXVKJVTK ");
            }
            _ => {
                let mut scene: Value = serde_json::from_slice(&bytes).unwrap();
                scene["asset"]["copyright"] = json!("QZXVKJCOPYRIGHT");
                scene["asset"]["extras"] = json!({"patient": "QZXVKJEXTRAS"});
                for named in ["nodes", "meshes"] {
                    scene[named][0]["name"] = json!("QZXVKJNODE");
                }
                bytes = serde_json::to_vec(&scene).unwrap();
            }
        }
        meshes.push((format, bytes));
    }
    meshes
}

async fn ended(app: &Api, path: &str, order: &Value) -> Value {
    let filed = app.post(path).json(order).send().await.unwrap();
    let status = filed.status();
    let job: Value = filed.json().await.unwrap();
    assert_eq!(status, StatusCode::ACCEPTED, "{job}");
    let path = text(&job["links"]["self"]);
    let deadline = Instant::now() + Duration::from_secs(300);
    loop {
        let job: Value = app.get(&path).send().await.unwrap().json().await.unwrap();
        if job["finished_at"].is_string() {
            return job;
        }
        assert!(Instant::now() < deadline, "still {job}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

/// All strings of a document that are paths of this service.
fn paths_in(value: &Value, found: &mut BTreeSet<String>) {
    match value {
        Value::String(text) if text.starts_with("/v1/") => {
            found.insert(text.clone());
        }
        Value::Array(values) => values.iter().for_each(|value| paths_in(value, found)),
        Value::Object(object) => object.values().for_each(|value| paths_in(value, found)),
        _ => {}
    }
}

/// Every path that a GET of the document has for the ids, and every path that an answer names.
async fn all_paths(app: &Api) -> BTreeSet<String> {
    let gets = operations().into_iter();
    let gets = gets.filter(|(method, ..)| method == Method::GET);
    let gets: Vec<String> = gets.map(|(_, path, _)| path).collect();
    let mut found = BTreeSet::new();
    for path in gets.iter().filter(|path| !path.contains('{')) {
        found.insert(path.clone());
        let answer = app.get(path).send().await.unwrap();
        if let Ok(page) = answer.json::<Value>().await {
            paths_in(&page, &mut found);
        }
    }
    let items: Vec<String> = found
        .iter()
        .filter(|path| path.matches('/').count() == 3)
        .cloned()
        .collect();
    for item in &items {
        let kind = item.split('/').nth(2).unwrap();
        for path in gets
            .iter()
            .filter(|path| path.starts_with(&format!("/v1/{kind}/{{id}}")))
        {
            let named = path.replacen("{id}", item.rsplit('/').next().unwrap(), 1);
            if !named.contains('{') {
                found.insert(named);
            }
        }
        for made_on_request in [
            "report.html",
            "measurements.dcm",
            "page.dcm",
            "mesh.dcm",
            "seg.dcm",
            "polar_stress.dcm",
        ] {
            found.insert(format!("{item}/{made_on_request}"));
        }
    }
    found.retain(|path| !path.ends_with("/events"));
    found
}

/// The marks in what `app` is answered on each path, but those `allowed`.
async fn seen(app: &Api, paths: &BTreeSet<String>, query: &str, allowed: &[&str]) -> Vec<String> {
    let mut seen = Vec::new();
    let mut answered = 0;
    for path in paths {
        let answer = app.get(&format!("{path}{query}")).send().await.unwrap();
        let status = answer.status();
        assert!(status.as_u16() < 500, "{path}{query}: {status}");
        let head = format!("{:?}", answer.headers());
        let body = answer.bytes().await.unwrap();
        answered += u32::from(status.is_success());
        let mut body = String::from_utf8_lossy(&body).into_owned() + &head;
        for allowed in allowed {
            body = body.replace(allowed, "");
        }
        if let Some(at) = body.find(MARK) {
            let begin = body.floor_char_boundary(at.saturating_sub(80));
            let end = body.floor_char_boundary(at + 40);
            seen.push(format!("{path}{query} {status}: {}", &body[begin..end]));
        }
    }
    assert!(answered > 20, "{answered} answers");
    seen
}

#[tokio::test]
async fn no_text_of_a_header_or_a_caller_is_shown_to_who_sees_no_patients() {
    let data = Arc::new(tempfile::tempdir().unwrap());
    let owner = TestApp::on(data, Engine::new(ReadLimits::default()), |_| {}).await;
    let (_, admin) = key(owner.data.path(), Scope::Admin, "default", Quota::default()).await;
    let (_, read) = key(owner.data.path(), Scope::Read, "default", Quota::default()).await;
    closed(&owner).await;
    let app = owner.seen_with(&admin);
    let reader = owner.seen_with(&read);
    let mut volumes = Vec::new();
    let ((stress, marked), (rest, _)) = (marked_dicom(1), marked_dicom(2));
    assert!(marked > 500, "{marked} attributes");
    for bytes in [stress, rest, marked_nifti(), heart().0] {
        let path = "/v1/volumes?external_id=QZXVKJEXTERNAL&labels=name:QZXVKJLABEL.dcm";
        let answer = app.post(path).body(bytes).send().await.unwrap();
        let status = answer.status();
        let volume: Value = answer.json().await.unwrap();
        assert!(status.is_success(), "{volume}");
        volumes.push(text(&volume["id"]));
    }
    let hold = app
        .client
        .put(format!("{}/v1/volumes/{}/hold", app.url, volumes[3]));
    let hold = hold
        .json(&json!({"reason": "QZXVKJREASON"}))
        .send()
        .await
        .unwrap();
    assert_eq!(hold.status(), StatusCode::OK);
    let named = json!({"external_id": "QZXVKJJOB", "labels": {"who": "QZXVKJWHO"}});
    let order = |kind: &str, volume: &str, more: Value| {
        let mut order = named.clone();
        for (name, value) in [("kind", json!(kind)), ("volume", json!(volume))] {
            order[name] = value;
        }
        for (name, value) in more.as_object().unwrap() {
            order[name] = value.clone();
        }
        order
    };
    let few = json!({"parameters": {"points": 100}});
    for (kind, volume, more) in [
        ("model", &volumes[2], few.clone()),
        ("segmentation", &volumes[0], json!({})),
        (
            "comparison",
            &volumes[0],
            json!({"parameters": {"rest": volumes[1]}}),
        ),
        (
            "model",
            &volumes[0],
            json!({"parameters": {"iso": "absolute:1e30"}}),
        ),
        ("beat", &volumes[0], json!({})),
    ] {
        let job = ended(&app, "/v1/jobs", &order(kind, volume, more)).await;
        println!("{kind} {} {}", job["state"], job["error"]);
    }
    let models: Value = app
        .get("/v1/models")
        .send()
        .await
        .unwrap()
        .json()
        .await
        .unwrap();
    let model = text(&models["models"][0]["links"]["self"]);
    // Meshes as templates and as volumes; also one that cannot be read.
    let mut meshes = marked_meshes(&app, &model).await;
    meshes.push((
        "ply",
        b"ply\nformat ascii 1.0\ncomment QZXVKJBAD\nelement QZXVKJELEMENT x\nend_header\n".into(),
    ));
    for (format, bytes) in meshes {
        let path = format!("/v1/templates?name={format}&organ=generic");
        let answer = app.post(&path).body(bytes.clone()).send().await.unwrap();
        println!("template {format}: {}", answer.status());
        let answer = app.post("/v1/volumes").body(bytes).send().await.unwrap();
        println!("volume {format}: {}", answer.status());
    }
    // Limits of so few people are refused, with a reason.
    let cases: Vec<Value> = (volumes[..2].iter().zip(["one", "two"]))
        .map(|(volume, case)| {
            json!({"case": case, "volume": volume, "sex": "F", "protocol": "rest", "tracer": "Tc-99m",
                "attenuation_corrected": false})
        })
        .collect();
    let order = json!({"name": "few", "cases": cases});
    let job = ended(&app, "/v1/normals", &order).await;
    println!("normals {} {}", job["state"], job["error"]);
    let profile = app
        .post("/v1/readers?name=anna")
        .json(&profile(1.25))
        .send()
        .await;
    assert_eq!(profile.unwrap().status(), StatusCode::CREATED);
    let paths = all_paths(&app).await;
    for kind in [
        "volumes",
        "models",
        "segmentations",
        "comparisons",
        "readers",
        "templates",
        "jobs",
    ] {
        assert!(
            paths
                .iter()
                .any(|path| path.starts_with(&format!("/v1/{kind}/"))),
            "{kind}"
        );
    }
    assert!(
        !seen(&app, &paths, "", &[]).await.is_empty(),
        "the owner sees whose scans they are"
    );
    let mut found = seen(&reader, &paths, "", &SHOWN).await;
    let pages: BTreeSet<String> = (paths.iter())
        .filter(|path| path.ends_with(".dcm") || path.ends_with(".html"))
        .cloned()
        .collect();
    let with_reports: BTreeSet<String> = (paths.iter())
        .filter(|path| path.ends_with("report.html"))
        .cloned()
        .collect();
    assert!(!with_reports.is_empty());
    for caller in [&app, &reader] {
        for path in &with_reports {
            let page = caller
                .get(&format!("{path}?deidentify=true"))
                .send()
                .await
                .unwrap();
            let page = page.text().await.unwrap();
            if page.contains(MARK) {
                found.push(format!("{path}?deidentify=true"));
            }
        }
    }
    for path in &pages {
        // Manufacturer and model stay in objects without identity (PS3.15, table E.1-1).
        let object = app
            .get(&format!("{path}?deidentify=true"))
            .send()
            .await
            .unwrap();
        let bytes = object.bytes().await.unwrap();
        let mut told = String::from_utf8_lossy(&bytes).into_owned();
        for shown in SHOWN {
            told = told.replace(shown, "");
        }
        if let Some(at) = told.find(MARK) {
            let end = told.floor_char_boundary(at + 30);
            found.push(format!("{path}?deidentify=true {}", &told[at..end]));
        }
    }
    assert!(found.is_empty(), "{found:#?}");
    // After the identity was erased, nobody sees any of it, but for the uploads and what callers wrote.
    for volume in &volumes[..2] {
        let path = format!("/v1/volumes/{volume}/identity");
        assert_eq!(
            app.delete(&path).send().await.unwrap().status(),
            StatusCode::NO_CONTENT
        );
    }
    let kept: BTreeSet<String> = (paths.iter())
        .filter(|path| !path.ends_with("/content") && !path.contains("/files/"))
        .cloned()
        .collect();
    let callers = [
        "QZXVKJEXTERNAL",
        "QZXVKJLABEL",
        "QZXVKJREASON",
        "QZXVKJJOB",
        "QZXVKJWHO",
    ];
    let found = seen(&app, &kept, "", &callers).await;
    assert!(found.is_empty(), "{found:#?}");
    let found = seen(&reader, &paths, "", &[]).await;
    assert!(found.is_empty(), "{found:#?}");
}
