//! Objects that come by C-STORE and STOW-RS.

use crate::dicom::{JANE, Patient, nm_of};
use crate::helpers::{Service, TestApp, fake_engine, key, problem, rows_of, text};
use crate::scu::{
    CT_CLASS, NM_CLASS, Object, Scu, command, nuclear, one_gate, slice, slice_of_a_gate,
};
use dicom_ul::pdu::{PDataValueType, Pdu};
use reqwest::StatusCode;
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::Path;
use std::process::Command;
use std::sync::Arc;
use std::time::{Duration, Instant};
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::image::volume::{ReadLimits, Volume};
use ventriform_program::server::{ServeError, start};
use ventriform_service::callers::{AccessStore, Quota, Scope};
use ventriform_service::config::Settings;
use ventriform_service::run::start::StartError;
use ventriform_service::work::Engine;

const EVENT_PATIENCE: Duration = Duration::from_secs(20);

/// Reads volumes as the product does; computes as the fake does.
fn engine() -> Engine {
    Engine {
        reader: Engine::new(ReadLimits::default()).reader,
        ..fake_engine()
    }
}

fn listening(settings: &mut Settings) {
    settings.dicom_listen = "127.0.0.1:0".parse().unwrap();
    settings.series_quiet = "100ms".parse().unwrap();
    settings.series_patience = "400ms".parse().unwrap();
}

async fn service(change: impl FnOnce(&mut Settings)) -> (TestApp, SocketAddr) {
    let data = Arc::new(tempfile::tempdir().unwrap());
    on(data, change).await
}

async fn on(
    data: Arc<tempfile::TempDir>,
    change: impl FnOnce(&mut Settings),
) -> (TestApp, SocketAddr) {
    let app = TestApp::on(data, engine(), |settings| {
        listening(settings);
        change(settings);
    })
    .await;
    let address = app.running.as_ref().unwrap().dicom_address().unwrap();
    (app, address)
}

async fn intake(app: &TestApp) -> Vec<Value> {
    let list = app.json("/v1/intake").await;
    list["intake"].as_array().unwrap().clone()
}

/// Waits until `number` groups were received and none of them is unfinished; returns them.
async fn settled(app: &TestApp, number: usize) -> Vec<Value> {
    let deadline = Instant::now() + EVENT_PATIENCE;
    loop {
        let groups = intake(app).await;
        let ended =
            |group: &Value| ["stored", "failed"].contains(&group["state"].as_str().unwrap());
        if groups.len() == number && groups.iter().all(ended) {
            return groups;
        }
        assert!(Instant::now() < deadline, "still {groups:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

/// Waits until that many received files are kept: those of a volume are deleted after it is shown.
async fn kept(data: &Path, number: usize) {
    let deadline = Instant::now() + EVENT_PATIENCE;
    loop {
        let files = std::fs::read_dir(data.join("received")).unwrap();
        let names: Vec<_> = files.map(|file| file.unwrap().file_name()).collect();
        if names.len() == number {
            return;
        }
        assert!(Instant::now() < deadline, "still {names:?}");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

async fn volumes(app: &TestApp) -> Vec<Value> {
    let list = app.json("/v1/volumes").await;
    list["volumes"].as_array().unwrap().clone()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_multi_frame_image_is_a_volume_at_once_and_stored_once() {
    let (app, address) = service(|_| {}).await;
    let object = nuclear("1.2.3", 1, "RECON TOMO");
    let mut scu = Scu::open(address);
    assert_eq!(scu.echo(), 0);
    assert_eq!(scu.store(&object), 0);
    // While the association is still open.
    let groups = settled(&app, 1).await;
    assert_eq!(groups[0]["state"], "stored", "{groups:?}");
    assert_eq!(groups[0]["sender"], "CAMERA");
    assert_eq!(groups[0]["job"], Value::Null);
    let volume = app.json(&text(&groups[0]["links"]["volume"])).await;
    assert_eq!(volume["format"], "DICOM NM");
    assert_eq!(volume["shape"], json!([4, 4, 3]));
    kept(app.data.path(), 0).await;

    // The same again: the same answer, and nothing new.
    assert_eq!(scu.store(&object), 0);
    let mut other = nuclear("1.2.3", 2, "RECON TOMO");
    (other.instance, other.set) = (object.instance.clone(), {
        let mut set = other.set.clone();
        set.put(
            object
                .set
                .element_by_name("SOPInstanceUID")
                .unwrap()
                .clone(),
        );
        set
    });
    assert_eq!(
        scu.store(&other),
        0x0111,
        "another object with the same UID"
    );
    let mut wrong = object.clone();
    wrong.instance = "1.2.3.99".into();
    assert_eq!(scu.store(&wrong), 0xA900, "not the announced object");
    scu.release();
    assert_eq!(settled(&app, 1).await[0]["volume"], groups[0]["volume"]);
    assert_eq!(volumes(&app).await.len(), 1);
    kept(app.data.path(), 0).await;

    // Once the volume is erased, nothing is known of the object: it is stored again.
    let erased = app
        .delete(&text(&groups[0]["links"]["volume"]))
        .send()
        .await;
    assert!(erased.unwrap().status().is_success());
    assert!(intake(&app).await.is_empty());
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&other), 0);
    scu.release();
    assert_eq!(settled(&app, 1).await[0]["state"], "stored");
    let made = app.json("/v1/audit?agent=intake:CAMERA").await.to_string();
    assert!(made.contains(&text(&groups[0]["volume"])), "{made}");
    let audit = app.json("/v1/audit?agent=CAMERA").await;
    assert!(!audit["events"].as_array().unwrap().is_empty());
    assert!(!audit.to_string().contains("CANARY"));
}

#[tokio::test(flavor = "multi_thread")]
async fn an_object_is_acknowledged_when_its_row_of_the_trail_is_on_disk() {
    let (app, address) = service(|_| {}).await;
    let rows = rows_of(app.data.path()).await;
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&nuclear("1.2.3", 1, "RECON TOMO")), 0);
    // What is only noted is written within a second.
    let trail = rows.links(0, 1000).await.unwrap();
    scu.release();
    let group = text(&settled(&app, 1).await[0]["id"]);
    let row = |event: &str| event.contains(&group) && event.contains("\"CAMERA\"");
    assert!(trail.iter().any(|link| row(&link.event)), "{trail:?}");
}

#[tokio::test]
async fn a_request_that_breaks_off_leaves_a_row_for_what_it_has_stored() {
    let (app, _) = service(|_| {}).await;
    let mut body = related(&[nuclear("1.2.3", 1, "RECON TOMO").file()]);
    // The next object begins and does not end.
    body.truncate(body.len() - b"--b--\r\n".len());
    body.extend_from_slice(b"--b\r\nContent-Type: application/dicom\r\n\r\nhalf");
    let address = app.url.trim_start_matches("http://").parse().unwrap();
    let mut stream = connect(address);
    let head = format!(
        "POST /dicom-web/studies HTTP/1.1\r\nHost: {address}\r\nContent-Type: {RELATED_TYPE}\r\n\
         Content-Length: {}\r\n\r\n",
        body.len() + 1000
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(&body).unwrap();
    let deadline = Instant::now() + EVENT_PATIENCE;
    while intake(&app).await.is_empty() {
        assert!(Instant::now() < deadline, "nothing is stored");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    drop(stream);
    let group = text(&intake(&app).await[0]["id"]);
    loop {
        let rows = app.json(&format!("/v1/audit?object={group}")).await;
        if rows["events"][0]["action"] == "C" {
            return;
        }
        assert!(Instant::now() < deadline, "{rows}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn each_context_is_accepted_or_rejected_by_itself() {
    let (_app, address) = service(|_| {}).await;
    let mut scu = Scu::open(address);
    assert_eq!(scu.contexts(), [1, 3, 5, 11]);
    // C-FIND, and C-STORE of another class than the context's.
    scu.send(
        PDataValueType::Command,
        3,
        command(0x0020, NM_CLASS, None),
        true,
    );
    assert_eq!(scu.status(), 0x0211);
    scu.send(
        PDataValueType::Command,
        3,
        command(0x0001, CT_CLASS, Some("1.2")),
        true,
    );
    scu.send(PDataValueType::Data, 3, vec![1, 2], true);
    assert_eq!(scu.status(), 0x0122);
    scu.send(
        PDataValueType::Command,
        3,
        command(0x0001, NM_CLASS, Some("1.2")),
        true,
    );
    scu.send(PDataValueType::Data, 3, vec![7; 99], true);
    assert_eq!(scu.status(), 0xC000, "no data set");
    assert_eq!(scu.echo(), 0);
    scu.release();
}

#[tokio::test(flavor = "multi_thread")]
async fn slices_are_gathered_and_late_ones_are_added() {
    let (app, address) = service(|settings| {
        settings.rules = r#"[{ modality = "CT", kind = "model" }]"#.parse().unwrap();
    })
    .await;
    let mut scu = Scu::open(address);
    for number in [3, 1, 2] {
        assert_eq!(scu.store(&slice("1.2.4", number)), 0);
    }
    assert_eq!(intake(&app).await[0]["state"], "gathering");
    scu.release();
    let first = settled(&app, 1).await.remove(0);
    assert_eq!(first["objects"], 3);
    let volume = app.json(&text(&first["links"]["volume"])).await;
    assert_eq!(volume["shape"], json!([4, 4, 3]));
    assert!(first["job"].is_string(), "{first}");

    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&slice("1.2.4", 4)), 0);
    assert_eq!(scu.store(&slice("1.2.4", 1)), 0, "known");
    scu.abort();
    let second = settled(&app, 1).await.remove(0);
    assert_ne!(second["volume"], first["volume"]);
    assert_ne!(second["job"], first["job"]);
    let volume = app.json(&text(&second["links"]["volume"])).await;
    assert_eq!(volume["shape"], json!([4, 4, 4]));
    kept(app.data.path(), 0).await;
}

/// In whatever order they come.
#[tokio::test(flavor = "multi_thread")]
async fn images_of_one_gate_each_are_gathered_to_one_gated_volume() {
    let (app, address) = service(|_| {}).await;
    let mut scu = Scu::open(address);
    for gate in [3, 8, 1, 2, 7, 5, 6, 4] {
        assert_eq!(scu.store(&one_gate("1.2.5", gate)), 0);
    }
    assert_eq!(intake(&app).await[0]["state"], "gathering");
    scu.release();
    let group = settled(&app, 1).await.remove(0);
    assert_eq!(
        (&group["state"], &group["objects"]),
        (&json!("stored"), &json!(8))
    );
    let volume = app.json(&text(&group["links"]["volume"])).await;
    assert_eq!(volume["shape"], json!([4, 4, 3]));
    assert_eq!(volume["frames"], 8, "{volume}");
    assert_eq!(volume["gates"]["number"], 8);
    // Its numbers grow from gate to gate.
    assert_eq!(volume["intensity"]["min"], 1.0);
    assert_eq!(volume["intensity"]["max"], 55.0);
}

/// As the library groups a folder: gates of one acquisition are one volume, although each is a series of its own.
#[tokio::test(flavor = "multi_thread")]
async fn gates_of_a_series_each_are_gathered_to_one_gated_volume() {
    let slices: Vec<Object> = [3, 8, 1, 2, 7, 5, 6, 4]
        .into_iter()
        .flat_map(|gate| (1..4).map(move |number| slice_of_a_gate("1.2.6", gate, number)))
        .collect();
    let images: Vec<Object> = [3, 8, 1, 2, 7, 5, 6, 4]
        .into_iter()
        .map(|gate| one_gate("1.2.5", gate).of_study("1.2.5", &format!("1.2.5.9.{gate}")))
        .collect();
    for objects in [slices, images] {
        for over_http in [false, true] {
            let (app, address) =
                service(|settings| settings.series_patience = "5s".parse().unwrap()).await;
            if over_http {
                let files: Vec<_> = objects.iter().map(Object::file).collect();
                let answer = stow(&app, "/dicom-web/studies", RELATED_TYPE, related(&files)).await;
                assert_eq!(answer.status(), StatusCode::OK);
            } else {
                let mut scu = Scu::open(address);
                for object in &objects {
                    assert_eq!(scu.store(object), 0);
                }
                // Sent again, they are known.
                assert_eq!(scu.store(&objects[objects.len() - 1]), 0);
                scu.release();
            }
            let group = settled(&app, 1).await.remove(0);
            assert_eq!(group["state"], "stored", "{group}");
            assert_eq!(group["objects"], objects.len());
            let volume = app.json(&text(&group["links"]["volume"])).await;
            assert_eq!(volume["shape"], json!([4, 4, 3]));
            assert_eq!(volume["frames"], 8, "{volume}");
            assert_eq!(volume["gates"]["number"], 8);
        }
    }
}

/// Acquisitions stay apart: gates at rest and under stress, and reconstructions of the same counts.
#[tokio::test(flavor = "multi_thread")]
async fn gates_of_several_acquisitions_are_several_volumes() {
    let (app, address) = service(|_| {}).await;
    let mut scu = Scu::open(address);
    for (number, description) in [(1, "Rest"), (2, "Stress")] {
        for gate in 1..9 {
            for slice in 1..4 {
                let mut object = slice_of_a_gate("1.2.6", gate, slice)
                    .described(&format!("{description} gated, gate {gate}"))
                    .of_study("1.2.6", &format!("1.2.6.{number}.{gate}"));
                object.rename(&format!("1.2.6.{number}.{gate}.{slice}"));
                assert_eq!(scu.store(&object), 0);
            }
        }
    }
    scu.release();
    for group in settled(&app, 2).await {
        assert_eq!(
            (&group["state"], &group["objects"]),
            (&json!("stored"), &json!(24)),
            "{group}"
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rule_starts_its_job_once_whatever_is_sent_again() {
    let rules = r#"[{ image_type = "RECON TOMO", kind = "model", parameters = { points = 170 } },
                    { kind = "segmentation" }]"#
        .replace('\n', " ");
    let rules = move |settings: &mut Settings| settings.rules = rules.parse().unwrap();
    let (app, address) = service(rules.clone()).await;
    let object = nuclear("1.2.3", 1, "RECON TOMO");
    let send = |address, object: &Object| {
        let mut scu = Scu::open(address);
        assert_eq!(scu.store(object), 0);
        scu.release();
    };
    send(address, &object);
    let job = settled(&app, 1).await[0]["job"].clone();
    let filed = app.json("/v1/audit?agent=rule:1").await;
    assert!(filed.to_string().contains(&text(&job)), "{filed}");
    send(address, &object);
    let data = app.stop().await;
    let (app, address) = on(data, rules).await;
    send(address, &object);
    assert_eq!(settled(&app, 1).await[0]["job"], job);
    let jobs = app.json("/v1/jobs").await;
    let jobs = jobs["jobs"].as_array().unwrap();
    assert_eq!(jobs.len(), 1);
    assert_eq!((&jobs[0]["id"], &jobs[0]["kind"]), (&job, &json!("model")));
    assert_eq!(jobs[0]["parameters"]["points"], 170);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_rule_makes_a_beat_of_a_gated_series_and_a_segmentation_of_another() {
    let rules =
        r#"[{ image_type = "RECON GATED TOMO", kind = "beat", parameters = { mass_g = 130 } },
                    { modality = "NM", kind = "segmentation" }]"#
            .replace('\n', " ");
    let (app, address) = service(|settings| settings.rules = rules.parse().unwrap()).await;
    let shape = [4, 4, 3];
    let volume = Volume {
        shape,
        voxels: (0..48u8).map(f32::from).collect(),
        frame: VoxelToPatient::centred(shape, [4.0; 3], Vec3::zeros()).unwrap(),
        integral: true,
    };
    let other = Patient {
        study: "1.2.840.99999.8",
        ..JANE
    };
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&Object::of_nm(&nm_of(&JANE, &[&volume; 8]))), 0);
    assert_eq!(scu.store(&Object::of_nm(&nm_of(&other, &[&volume]))), 0);
    scu.release();
    let groups = settled(&app, 2).await;
    for (study, kind, parameter) in [
        (JANE.study, "beat", json!({"mass_g": 130.0, "gated": false})),
        (
            other.study,
            "segmentation",
            json!({"organ": "left_ventricle"}),
        ),
    ] {
        let group = groups.iter().find(|group| group["study"] == study);
        let group = group.unwrap_or_else(|| panic!("{study} in {groups:?}"));
        let job = app.json(&text(&group["links"]["job"])).await;
        assert_eq!(
            (&job["kind"], &job["volume"]),
            (&json!(kind), &group["volume"])
        );
        for (name, value) in parameter.as_object().unwrap() {
            assert_eq!(&job["parameters"][name], value, "{job}");
        }
    }
}

/// Whichever comes first; of several scans at rest the one that was made as that at stress.
#[tokio::test(flavor = "multi_thread")]
async fn two_series_of_a_study_one_at_stress_and_one_at_rest_become_one_comparison() {
    let rules = r#"[{ modality = "NM", kind = "comparison", stress = "belastet", rest = "vorher", parameters = { gated = false } }]"#;
    let shape = [4, 4, 3];
    let volume = Volume {
        shape,
        voxels: (0..48u8).map(f32::from).collect(),
        frame: VoxelToPatient::centred(shape, [4.0; 3], Vec3::zeros()).unwrap(),
        integral: true,
    };
    let single = || Object::of_nm(&nm_of(&JANE, &[&volume]));
    let gated = || Object::of_nm(&nm_of(&JANE, &[&volume; 8]));
    let stress = || single().in_series(1, "TOMO belastet");
    let rest = || single().in_series(2, "TOMO vorher");
    for order in [[stress(), rest()], [rest(), stress()]] {
        let (app, address) = service(|settings| settings.rules = rules.parse().unwrap()).await;
        // By their headers alone; a gated one, and one of which nothing says what it is, are no partner.
        let others = [
            gated().in_series(3, "GATED vorher"),
            single().in_series(4, "TOMO"),
        ];
        for object in others {
            let mut scu = Scu::open(address);
            assert_eq!(scu.store(&object), 0);
            scu.release();
        }
        let groups = settled(&app, 2).await;
        assert!(groups.iter().all(|group| group["job"].is_null()));
        let unknown: Vec<&Value> =
            (groups.iter().filter(|group| !group["error"].is_null())).collect();
        assert_eq!(unknown.len(), 1, "{groups:?}");
        assert!(text(&unknown[0]["error"]["type"]).ends_with("rest-or-stress"));
        for (object, known) in order.iter().zip([3, 4]) {
            let mut scu = Scu::open(address);
            assert_eq!(scu.store(object), 0);
            scu.release();
            settled(&app, known).await;
        }
        let groups = settled(&app, 4).await;
        let of = |object: &Object| {
            let series = object.set.element_by_name("SeriesInstanceUID").unwrap();
            let series = series.to_str().unwrap().into_owned();
            let mut groups = groups.iter();
            groups
                .find(|group| group["series"] == series.as_str())
                .unwrap()
        };
        let jobs = app.json("/v1/jobs?kind=comparison").await;
        let jobs = jobs["jobs"].as_array().unwrap().clone();
        let pair = |job: &&Value| {
            job["volume"] == of(&stress())["volume"]
                && job["parameters"]["rest"] == of(&rest())["volume"]
        };
        assert_eq!(jobs.iter().filter(pair).count(), 1, "{jobs:?}");
    }
    for (rules, wrong) in [
        (r#"[{ kind = "beat", rest = "r" }]"#, "its kind is `beat`"),
        (r#"[{ kind = "normals" }]"#, "cases"),
    ] {
        let data = tempfile::tempdir().unwrap();
        let run = Command::new(env!("CARGO_BIN_EXE_ventriform"))
            .args([
                "serve",
                "--listen",
                "127.0.0.1:0",
                "--rules",
                rules,
                "--data-dir",
            ])
            .arg(data.path())
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert!(!run.status.success() && said.contains(wrong), "{said}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_makes_no_volume_is_shown_with_the_reason_until_it_is_forgotten() {
    let (app, address) = service(|_| {}).await;
    let object = nuclear("1.2.3", 1, "STATIC");
    for _ in 0..2 {
        let mut scu = Scu::open(address);
        assert_eq!(
            scu.store(&object),
            0,
            "it is stored, though it is no volume"
        );
        scu.release();
        let group = settled(&app, 1).await.remove(0);
        assert_eq!(group["state"], "failed");
        let error = &group["error"];
        assert!(text(&error["detail"]).contains("planar"), "{error}");
        assert!(text(&error["fix"]).contains("RECON TOMO"), "{error}");
        kept(app.data.path(), 1).await;
    }
    let failed = app.json("/v1/intake?state=failed").await;
    let path = text(&failed["intake"][0]["links"]["self"]);
    assert_eq!(
        app.json("/v1/intake?state=stored").await["intake"],
        json!([])
    );
    let answer = app.get("/v1/intake?state=lost").send().await.unwrap();
    problem(answer, 400, "invalid-parameter").await;
    let forgotten = app.delete(&path).send().await.unwrap();
    assert_eq!(forgotten.status(), StatusCode::NO_CONTENT);
    assert!(intake(&app).await.is_empty());
    kept(app.data.path(), 0).await;
    problem(app.delete(&path).send().await.unwrap(), 404, "not-found").await;
    let metrics = app.metrics().await;
    for line in [
        "ventriform_received_objects_total{outcome=\"stored\",protocol=\"c-store\"} 2",
        "ventriform_received_volumes_total{outcome=\"failed\"} 2",
        "ventriform_dicom_connections_total{end=\"released\"} 2",
        "ventriform_dicom_associations 0",
    ] {
        assert!(metrics.contains(line), "{line} in {metrics}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn only_listed_systems_may_send_and_each_for_its_tenant() {
    let (app, address) = service(|settings| {
        settings.senders =
            r#"[{ ae_title = "CAMERA", addresses = ["127.0.0.0/8"], tenant = "nuclear" },
            { ae_title = "PACS", addresses = ["192.0.2.1"] }]"#
                .replace('\n', " ")
                .parse()
                .unwrap();
    })
    .await;
    for (calling, called, reason) in [
        ("STRANGER", "VENTRIFORM", "CallingAETitleNotRecognized"),
        ("PACS", "VENTRIFORM", "CallingAETitleNotRecognized"),
        ("CAMERA", "ORTHANC", "CalledAETitleNotRecognized"),
    ] {
        let refused = Scu::call(address, calling, called).err().unwrap();
        assert!(refused.contains(reason), "{refused}");
    }
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&nuclear("1.2.3", 1, "RECON TOMO")), 0);
    scu.release();
    assert!(intake(&app).await.is_empty(), "it is another tenant's");
    let (_, admin) = key(app.data.path(), Scope::Admin, "nuclear", Quota::default()).await;
    let nuclear = app.seen_with(&admin);
    assert_eq!(settled(&nuclear, 1).await[0]["state"], "stored");
    let (_, reader) = key(app.data.path(), Scope::Submit, "nuclear", Quota::default()).await;
    let answer = app
        .seen_with(&reader)
        .get("/v1/intake")
        .send()
        .await
        .unwrap();
    assert_eq!(answer.status(), StatusCode::FORBIDDEN);
}

#[tokio::test]
async fn strangers_cannot_send_from_other_machines_unless_told_so() {
    let data = tempfile::tempdir().unwrap();
    let settings = |change: fn(&mut Settings)| {
        let mut settings = Settings {
            data_dir: data.path().to_owned(),
            dicom_listen: "0.0.0.0:0".parse().unwrap(),
            ..Settings::default()
        };
        change(&mut settings);
        settings
    };
    let begin = async |change| {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        start(settings(change), engine(), listener).await
    };
    assert!(matches!(
        begin(|_| {}).await,
        Err(ServeError::Start(StartError::OpenDicom(_)))
    ));
    let open = begin(|settings| settings.allow_anonymous = true).await;
    open.unwrap().stop().await.unwrap();
    let listed = begin(|settings| settings.senders = r#"[{ ae_title = "A" }]"#.parse().unwrap());
    listed.await.unwrap().stop().await.unwrap();
    let rules = begin(|settings| {
        settings.dicom_listen = "off".parse().unwrap();
        settings.rules = r#"[{ kind = "cup" }]"#.parse().unwrap();
    });
    assert!(
        matches!(rules.await, Err(ServeError::Start(StartError::Rules(why))) if why.contains("rule 1"))
    );
    let to = begin(|settings| {
        settings.dicom_listen = "off".parse().unwrap();
        let rule = r#"[{ kind = "segmentation", send = ["mask.dcm"], to = "pacs" }]"#;
        settings.rules = rule.parse().unwrap();
    });
    assert!(
        matches!(to.await, Err(ServeError::Start(StartError::Rules(why))) if why.contains("pacs"))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn limits_refuse_and_leave_room_for_others() {
    let (app, address) = service(|settings| {
        settings.client_association_limit = 2;
        settings.object_limit = "4KiB".parse().unwrap();
        settings.intake_objects = 2;
        settings.series_quiet = "1h".parse().unwrap();
    })
    .await;
    let (mut first, _second) = (Scu::open(address), Scu::open(address));
    let refused = Scu::call(address, "CAMERA", "VENTRIFORM").err().unwrap();
    assert!(refused.contains("LocalLimitExceeded"), "{refused}");
    let mut large = slice("1.2.5", 1);
    let name = large
        .set
        .element_by_name("PatientName")
        .unwrap()
        .header()
        .tag;
    let text = dicom_core::PrimitiveValue::from("x".repeat(5000));
    large
        .set
        .put(dicom_core::DataElement::new(name, dicom_core::VR::UT, text));
    assert_eq!(first.store(&large), 0xA700);
    assert_eq!(first.store(&slice("1.2.5", 1)), 0);
    assert_eq!(first.store(&slice("1.2.5", 2)), 0);
    assert_eq!(first.store(&slice("1.2.5", 3)), 0xA700, "two may wait");
    assert_eq!(first.store(&slice("1.2.5", 2)), 0, "it is there already");
    assert_eq!(intake(&app).await[0]["objects"], 2);
    kept(app.data.path(), 2).await;
    assert_eq!(first.echo(), 0);
}

/// Bytes of a generator, the same in every run.
fn noise(seed: u64, length: usize) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let next = || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state as u8
    };
    std::iter::repeat_with(next).take(length).collect()
}

fn connect(address: SocketAddr) -> TcpStream {
    let stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(EVENT_PATIENCE)).unwrap();
    stream
}

/// The bytes that the service sends before it closes the connection.
fn answer(mut stream: TcpStream) -> Vec<u8> {
    let mut answer = Vec::new();
    // The connection may be reset.
    let _ = stream.read_to_end(&mut answer);
    answer
}

#[tokio::test(flavor = "multi_thread")]
async fn garbage_harms_nobody() {
    let (app, address) = service(|settings| {
        settings.association_idle = "300ms".parse().unwrap();
    })
    .await;
    let mut good = Scu::open(address);
    // PDUs of 4 GB, of unknown types, of wrong lengths; requests that are cut off.
    for kind in 0..=255_u8 {
        let mut stream = connect(address);
        let length: u32 = if kind % 2 == 0 { u32::MAX } else { 70 };
        let header = [&[kind, 0][..], &length.to_be_bytes()].concat();
        let _ = stream.write_all(&[header, noise(u64::from(kind), 70)].concat());
        let _ = stream.shutdown(std::net::Shutdown::Write);
        let told = answer(stream);
        assert!(told.is_empty() || told[0] == 7, "{kind}: {told:?}");
    }
    for seed in 0..100 {
        let mut stream = connect(address);
        let _ = stream.write_all(&noise(seed, 1 + 37 * seed as usize));
    }
    // Garbage within an association: half a command, commands without end, data without command.
    for (value_type, context, data, last) in [
        (PDataValueType::Command, 1, noise(1, 40), true),
        (PDataValueType::Command, 1, noise(2, 20_000), false),
        (PDataValueType::Data, 3, noise(3, 40), true),
        (PDataValueType::Command, 99, noise(4, 40), true),
        (PDataValueType::Command, 7, noise(5, 40), true),
    ] {
        let mut scu = Scu::open(address);
        scu.send(value_type, context, data, last);
        assert!(matches!(scu.receive(), Ok(Pdu::AbortRQ { .. }) | Err(_)));
    }
    // An object that does not go on, and one whose sender goes away.
    let mut stopped = Scu::open(address);
    stopped.send(
        PDataValueType::Command,
        3,
        command(1, NM_CLASS, Some("1.2.3.1")),
        true,
    );
    stopped.send(PDataValueType::Data, 3, vec![8; 1000], false);
    assert!(matches!(stopped.receive(), Ok(Pdu::AbortRQ { .. })));
    // Many connections that say nothing keep nobody out.
    let silent: Vec<TcpStream> = (0..300).map(|_| connect(address)).collect();
    let mut late = Scu::open(address);
    assert_eq!(late.store(&nuclear("1.2.3", 1, "RECON TOMO")), 0);
    late.release();
    drop(silent);
    // It was idle all the while.
    assert!(matches!(good.receive(), Ok(Pdu::AbortRQ { .. }) | Err(_)));
    assert_eq!(settled(&app, 1).await[0]["state"], "stored");
    kept(app.data.path(), 0).await;
    let staged = std::fs::read_dir(app.data.path().join("staging")).unwrap();
    assert_eq!(staged.count(), 0);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_shutdown_aborts_associations_and_keeps_what_was_acknowledged() {
    let (app, address) = service(|_| {}).await;
    let mut scu = Scu::open(address);
    assert_eq!(scu.store(&slice("1.2.4", 1)), 0);
    assert_eq!(scu.store(&slice("1.2.4", 2)), 0);
    let told = std::thread::spawn(move || scu.receive());
    let data = app.stop().await;
    assert!(matches!(told.join().unwrap(), Ok(Pdu::AbortRQ { .. })));
    let (app, _) = on(data, |_| {}).await;
    let group = settled(&app, 1).await.remove(0);
    assert_eq!(
        (&group["state"], &group["objects"]),
        (&json!("stored"), &json!(2))
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_acknowledged_survives_kills() {
    let data = tempfile::tempdir().unwrap();
    let flags = [
        "--dicom-listen",
        "127.0.0.1:0",
        "--series-quiet",
        "200ms",
        "--series-patience",
        "5s",
    ];
    for round in 0..4_u16 {
        let service = Service::start(data.path(), &flags).await;
        let mut scu = Scu::open(service.dicom.unwrap());
        for number in 0..3 {
            assert_eq!(scu.store(&slice("1.2.4", 3 * round + number)), 0);
        }
        // The next one is under way.
        let next = slice("1.2.4", 3 * round + 3);
        scu.send(
            PDataValueType::Command,
            5,
            command(1, CT_CLASS, Some(&next.instance)),
            true,
        );
        scu.send(PDataValueType::Data, 5, vec![8; 100], false);
        service.kill();
    }
    let service = Service::start(data.path(), &flags).await;
    let deadline = Instant::now() + EVENT_PATIENCE;
    let group = loop {
        let list = service.get("/v1/intake").send().await.unwrap();
        let list: Value = list.json().await.unwrap();
        let group = list["intake"][0].clone();
        if group["state"] == "stored" {
            break group;
        }
        assert!(Instant::now() < deadline, "still {list}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    assert_eq!(group["objects"], 12);
    let volume = service
        .get(&text(&group["links"]["volume"]))
        .send()
        .await
        .unwrap();
    let volume: Value = volume.json().await.unwrap();
    assert_eq!(volume["shape"], json!([4, 4, 12]));
    kept(data.path(), 0).await;
}

/// A `multipart/related` body.
fn related(parts: &[Vec<u8>]) -> Vec<u8> {
    let mut body = Vec::new();
    for part in parts {
        body.extend_from_slice(b"--b\r\nContent-Type: application/dicom\r\n\r\n");
        body.extend_from_slice(part);
        body.extend_from_slice(b"\r\n");
    }
    body.extend_from_slice(b"--b--\r\n");
    body
}

const RELATED_TYPE: &str = "multipart/related; type=\"application/dicom\"; boundary=b";

async fn stow(app: &TestApp, path: &str, kind: &str, body: Vec<u8>) -> reqwest::Response {
    let request = app.post(path).header("content-type", kind).body(body);
    request.send().await.unwrap()
}

#[tokio::test]
async fn objects_are_stored_over_http() {
    // A machine that stands still for a moment is no sender that does.
    let (app, _) = service(|settings| settings.series_patience = "5s".parse().unwrap()).await;
    let files: Vec<_> = (1..4).map(|number| slice("1.2.4", number).file()).collect();
    let answer = stow(&app, "/dicom-web/studies", RELATED_TYPE, related(&files)).await;
    assert_eq!(answer.status(), StatusCode::OK);
    assert_eq!(answer.headers()["content-type"], "application/dicom+json");
    let module: Value = answer.json().await.unwrap();
    assert_eq!(module["00081199"]["Value"].as_array().unwrap().len(), 3);
    assert_eq!(
        module["00081199"]["Value"][0]["00081150"]["Value"][0],
        CT_CLASS
    );
    let groups = settled(&app, 1).await;
    let volume = app.json(&text(&groups[0]["links"]["volume"])).await;
    assert_eq!(volume["shape"], json!([4, 4, 3]));
    assert_eq!(groups[0]["protocol"], "stow-rs");

    // One object alone; again; of another study; and one that is none.
    let object = nuclear("1.2.3", 1, "RECON TOMO");
    for _ in 0..2 {
        let answer = stow(
            &app,
            "/dicom-web/studies/1.2.3.1",
            "application/dicom",
            object.file(),
        );
        assert_eq!(answer.await.status(), StatusCode::OK);
    }
    let answer = stow(
        &app,
        "/dicom-web/studies/1.2.9",
        "application/dicom",
        object.file(),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::CONFLICT);
    let module: Value = answer.json().await.unwrap();
    let failed = &module["00081198"]["Value"][0];
    assert_eq!(failed["00081197"]["Value"][0], 0xA900);
    assert_eq!(failed["00081155"]["Value"][0], object.instance);
    let mixed = related(&[
        b"no object".to_vec(),
        nuclear("1.2.3", 2, "RECON TOMO").file(),
    ]);
    let answer = stow(&app, "/dicom-web/studies", RELATED_TYPE, mixed).await;
    assert_eq!(answer.status(), StatusCode::ACCEPTED);
    let module: Value = answer.json().await.unwrap();
    assert_eq!(
        module["0008119A"]["Value"][0]["00081197"]["Value"][0],
        0xC000
    );
    assert_eq!(settled(&app, 3).await.len(), 3);
    assert_eq!(volumes(&app).await.len(), 3);
    kept(app.data.path(), 0).await;
}

#[tokio::test]
async fn bodies_that_are_not_stow_are_refused() {
    let (app, _) = service(|_| {}).await;
    let path = "/dicom-web/studies";
    let file = || slice("1.2.4", 1).file();
    let xml = app.post(path).header("accept", "application/dicom+xml");
    let xml = xml
        .header("content-type", RELATED_TYPE)
        .body(related(&[file()]));
    problem(xml.send().await.unwrap(), 406, "not-acceptable").await;
    let code = "unsupported-media-type";
    problem(
        stow(&app, path, "multipart/form-data; boundary=b", vec![]).await,
        415,
        code,
    )
    .await;
    let code = "malformed-parts";
    problem(
        stow(&app, path, RELATED_TYPE, related(&[])).await,
        400,
        code,
    )
    .await;
    problem(
        stow(&app, path, RELATED_TYPE, b"--b\r\nA: ".to_vec()).await,
        400,
        code,
    )
    .await;
    let endless = [b"--b\r\nA: ".to_vec(), vec![b'a'; 2 << 20]].concat();
    problem(stow(&app, path, RELATED_TYPE, endless).await, 400, code).await;
    // The body breaks off after the first object, which is stored.
    let mut cut = related(&[file(), slice("1.2.4", 2).file()]);
    cut.truncate(cut.len() - 200);
    problem(stow(&app, path, RELATED_TYPE, cut).await, 400, code).await;
    assert_eq!(settled(&app, 1).await[0]["objects"], 1);
    let (_, reader) = key(app.data.path(), Scope::Read, "default", Quota::default()).await;
    let answer = stow(
        &app.seen_with(&reader),
        path,
        RELATED_TYPE,
        related(&[file()]),
    )
    .await;
    assert_eq!(answer.status(), StatusCode::FORBIDDEN);
}
