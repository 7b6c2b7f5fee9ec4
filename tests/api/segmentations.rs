//! `/v1/segmentations`, with the fake computation.

use crate::helpers::{TestApp, mesh_json, problem, text, volume};
use reqwest::StatusCode;
use reqwest::header::{ACCEPT, LOCATION};
use reqwest::multipart::{Form, Part};
use serde_json::{Value, json};
use ventriform::mesh::shapes;

fn part(words: &str) -> Part {
    Part::bytes(volume(words)).file_name("volume.nii.gz")
}

impl TestApp {
    /// Makes a segmentation; returns it.
    pub async fn segmentation(&self, words: &str) -> Value {
        let answer = self
            .post("/v1/segmentations")
            .body(volume(words))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::ACCEPTED);
        let job = self
            .until(&answer.json().await.unwrap(), &["succeeded"])
            .await;
        assert_eq!(job["kind"], "segmentation");
        assert!(job["model"].is_null());
        let segmentation = self.json(&text(&job["links"]["segmentation"])).await;
        assert_eq!(segmentation["id"], job["segmentation"]);
        assert_eq!(segmentation["links"]["mask"], job["links"]["mask"]);
        segmentation
    }
}

#[tokio::test]
async fn a_waiting_request_is_answered_in_the_format_of_accept() {
    let app = TestApp::start().await;
    for (accept, media_type, start) in [
        ("*/*", "application/gzip", b"\x1f\x8b".as_slice()),
        ("application/x-nifti", "application/x-nifti", b"\x1f\x8b"),
        ("model/gltf-binary", "model/gltf-binary", b"glTF"),
        ("model/stl", "model/stl", b""),
        ("application/json", "application/json", b"{\"mesh\""),
    ] {
        let answer = app
            .post("/v1/segmentations?model=auto&margin=1.5")
            .header("prefer", super::helpers::UNTIL_DONE)
            .header(ACCEPT, accept)
            .body(volume("sphere"))
            .send()
            .await
            .unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{accept}");
        let headers = answer.headers().clone();
        assert_eq!(headers["content-type"], media_type);
        assert!(answer.bytes().await.unwrap().starts_with(start), "{accept}");
        let made = app.json(headers[LOCATION].to_str().unwrap()).await;
        assert_eq!(made["parameters"]["margin"], 1.5);
        assert_eq!(made["parameters"]["blur"], 3.0, "defaults are written out");
    }
    let picture = app
        .post("/v1/segmentations")
        .header("prefer", super::helpers::UNTIL_DONE)
        .header(ACCEPT, "text/plain")
        .body(volume("sphere"));
    problem(picture.send().await.unwrap(), 406, "not-acceptable").await;
}

#[tokio::test]
async fn segmentations_are_listed_downloaded_and_deleted_like_models() {
    let app = TestApp::start().await;
    let made = app.segmentation("sphere").await;
    let path = text(&made["links"]["self"]);
    let list = app.json("/v1/segmentations?limit=1").await;
    assert_eq!(list["segmentations"][0], made);
    assert_eq!(app.json("/v1/models").await["models"], json!([]));

    let mask = format!("{path}/mask.nii.gz");
    let whole = app.get(&mask).send().await.unwrap();
    assert_eq!(whole.headers()["content-type"], "application/gzip");
    let etag = whole.headers()["etag"].clone();
    let unchanged = app.get(&mask).header("if-none-match", &etag);
    assert_eq!(
        unchanged.send().await.unwrap().status(),
        StatusCode::NOT_MODIFIED
    );
    let head = app.client.head(format!("{}{mask}", app.url));
    assert_eq!(head.send().await.unwrap().headers()["etag"], etag);
    let part = app.get(&mask).header("range", "bytes=0-1");
    assert_eq!(part.send().await.unwrap().bytes().await.unwrap().len(), 2);
    assert_eq!(
        app.json(&format!("{path}/report")).await["mesh"]["vertices"],
        42
    );
    let mesh = app.get(&format!("{path}/mesh")).header(ACCEPT, "model/stl");
    assert_eq!(
        mesh.send().await.unwrap().headers()["content-type"],
        "model/stl"
    );
    let unknown = app.get(&format!("{path}/mask.nrrd")).send().await.unwrap();
    problem(unknown, 404, "not-found").await;
    let as_model = text(&made["id"]);
    let as_model = app.get(&format!("/v1/models/{as_model}")).send().await;
    problem(as_model.unwrap(), 404, "not-found").await;

    assert_eq!(
        app.delete(&path).send().await.unwrap().status(),
        StatusCode::NO_CONTENT
    );
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
    problem(app.get(&mask).send().await.unwrap(), 410, "gone").await;
    assert_eq!(app.stored(), [text(&made["volume"])]);
    assert_eq!(app.segmentation("sphere").await["id"], made["id"]);
}

#[tokio::test]
async fn a_form_can_carry_an_experts_mask_beside_the_volume() {
    let app = TestApp::start().await;
    let form = Form::new()
        .part("expert", part("mask"))
        .part("volume", part("sphere"))
        .text("roll", "10");
    let answer = app.post("/v1/segmentations").multipart(form);
    let job: Value = answer.send().await.unwrap().json().await.unwrap();
    let expert = text(&job["parameters"]["expert"]);
    assert_ne!(job["volume"], expert.as_str());
    assert_eq!(job["parameters"]["roll"], 10.0);
    let done = app.until(&job, &["succeeded"]).await;
    let made = app.json(&text(&done["links"]["segmentation"])).await;
    assert_eq!(made["summary"]["seen"]["things"], json!(["expert"]));

    let empty = Form::new()
        .part("volume", part("sphere"))
        .part("expert", Part::bytes(Vec::new()).file_name("mask.nii"));
    let empty = app.post("/v1/segmentations").multipart(empty);
    let refused = problem(empty.send().await.unwrap(), 400, "empty-body").await;
    assert_eq!(refused["field"], "expert");
    let none = Form::new().part("volume", part("sphere")).part(
        "expert",
        Part::bytes(b"text".to_vec()).file_name("mask.nii"),
    );
    let none = app.post("/v1/segmentations").multipart(none);
    let refused = problem(none.send().await.unwrap(), 422, "unrecognised-format").await;
    assert_eq!(refused["field"], "expert");
    let twice = Form::new()
        .part("volume", part("sphere"))
        .part("expert", part("mask"));
    let twice = app
        .post(&format!("/v1/segmentations?expert={expert}"))
        .multipart(twice);
    let refused = problem(twice.send().await.unwrap(), 422, "invalid-parameter").await;
    assert_eq!(refused["field"], "expert");
}

#[tokio::test]
async fn items_that_a_job_needs_must_exist_and_cannot_be_deleted() {
    let app = TestApp::with(|s| s.workers = "1".parse().unwrap()).await;
    let model = app.model("sphere").await;
    let (model_id, model_path) = (text(&model["id"]), text(&model["links"]["self"]));
    let (scan, expert) = (app.volume("sphere").await, app.volume("mask").await);
    for (parameters, field, word) in [
        (json!({"model": "mdl_00"}), "model", "no model"),
        (json!({"model": "tpl_00"}), "model", "no template"),
        (json!({"expert": "vol_00"}), "expert", "no volume"),
    ] {
        let order = json!({"kind": "segmentation", "volume": scan, "parameters": parameters});
        let refused = app.post("/v1/jobs").json(&order).send().await.unwrap();
        let refused = problem(refused, 422, "invalid-field").await;
        assert_eq!(refused["field"], field);
        assert!(text(&refused["detail"]).contains(word), "{refused}");
        let query = parameters[field].as_str().unwrap();
        let early = app
            .post(&format!("/v1/segmentations?{field}={query}"))
            .body("not even a volume");
        let refused = problem(early.send().await.unwrap(), 422, "invalid-field").await;
        assert_eq!(refused["field"], field);
    }
    let busy = app.file("slow").await;
    app.until(&busy, &["running"]).await;
    let order = json!({"kind": "segmentation", "volume": scan,
        "parameters": {"model": model_id, "expert": expert}});
    let job = app.post("/v1/jobs").json(&order).send().await.unwrap();
    assert_eq!(job.status(), StatusCode::ACCEPTED);
    let job: Value = job.json().await.unwrap();
    for path in [model_path.clone(), format!("/v1/volumes/{expert}")] {
        problem(app.delete(&path).send().await.unwrap(), 409, "in-use").await;
    }
    app.delete(&text(&busy["links"]["self"]))
        .send()
        .await
        .unwrap();
    let done = app.until(&job, &["succeeded"]).await;
    let made = app.json(&text(&done["links"]["segmentation"])).await;
    assert_eq!(
        made["summary"]["seen"]["things"],
        json!(["expert", "model"])
    );

    let erased = app.delete(&model_path).send().await.unwrap();
    assert_eq!(erased.status(), StatusCode::NO_CONTENT);
    let refused = app.post("/v1/jobs").json(&order).send().await.unwrap();
    let refused = problem(refused, 422, "invalid-field").await;
    assert!(text(&refused["detail"]).contains("erased"), "{refused}");
}

#[tokio::test]
async fn invalid_fit_parameters_are_rejected_with_the_field() {
    let app = TestApp::start().await;
    for (query, field, hint) in [
        ("modle=auto", "modle", "`model`"),
        ("model=lv.json", "model", "mdl_"),
        ("center=1,2", "center", "3 finite numbers"),
        ("center=nan,0,0", "center", "3 finite numbers"),
        ("axis=0,0,0", "axis", "3 finite numbers"),
        ("margin=inf", "margin", "-5 to 5"),
        ("blur=-1", "blur", "0 to 10"),
        ("organ=heart", "organ", "left_ventricle"),
        ("box=5,5,5,1,1,1", "box", "whole numbers"),
        ("center=1,2,3&seed_point=1,2,3", "seed_point", "not both"),
        ("seed=1,2,3", "seed", "`seed_point`"),
        ("template=auto&model=auto", "model", ""),
        ("expert=auto", "expert", "vol_"),
    ] {
        let answer = app
            .post(&format!("/v1/segmentations?{query}"))
            .body(volume("sphere"));
        let body = problem(answer.send().await.unwrap(), 422, "invalid-parameter").await;
        assert_eq!(body["field"], field, "{query}");
        assert!(text(&body["fix"]).contains(hint), "{body}");
    }
    let volume = app.volume("sphere").await;
    let infinite =
        format!(r#"{{"kind":"segmentation","volume":"{volume}","parameters":{{"margin":1e999}}}}"#);
    let infinite = app
        .post("/v1/jobs")
        .header("content-type", "application/json")
        .body(infinite);
    problem(infinite.send().await.unwrap(), 400, "malformed-json").await;
}

#[tokio::test]
async fn idempotency_keys_and_cancelling_work_as_for_models() {
    let app = TestApp::start().await;
    let post = |query: &str| {
        app.post(&format!("/v1/segmentations?{query}"))
            .header("idempotency-key", "k")
            .body(volume("slow"))
            .send()
    };
    let first: Value = post("roll=1").await.unwrap().json().await.unwrap();
    let again: Value = post("roll=1").await.unwrap().json().await.unwrap();
    assert_eq!(first["id"], again["id"]);
    let other = post("roll=2").await.unwrap();
    problem(other, 422, "idempotency-key-reused").await;
    app.until(&first, &["running"]).await;
    let path = text(&first["links"]["self"]);
    assert_eq!(
        app.delete(&path).send().await.unwrap().status(),
        StatusCode::ACCEPTED
    );
    app.until(&first, &["cancelled"]).await;
}

#[tokio::test]
async fn auto_gets_the_flagged_templates_and_those_that_are_named() {
    let app = TestApp::with(|s| s.template_limit = 2).await;
    let post = |query: &str, body: Vec<u8>| {
        app.post(&format!("/v1/templates{query}"))
            .header("content-type", "application/json")
            .body(body)
            .send()
    };
    let cup = mesh_json(&shapes::cup(70.0, 31.0, 13.0, 12));
    let added = post("?name=cup", cup.clone()).await.unwrap();
    assert_eq!(added.status(), StatusCode::CREATED);
    let path = added.headers()[LOCATION].to_str().unwrap().to_owned();
    let template: Value = added.json().await.unwrap();
    assert_eq!(template["name"], "cup");
    assert_eq!(template["organ"], "left_ventricle");
    assert_eq!(app.json(&path).await, template);
    let again = post("?name=other", cup).await.unwrap();
    assert_eq!(again.status(), StatusCode::OK);
    assert_eq!(again.json::<Value>().await.unwrap(), template);
    let mesh = app.json(&format!("{path}/mesh.json")).await;
    assert!(mesh["vertices"].is_array());

    let model = text(&app.model("sphere").await["id"]);
    let copied = post(&format!("?model={model}&organ=generic"), Vec::new());
    assert_eq!(copied.await.unwrap().status(), StatusCode::CREATED);
    let list = app.json("/v1/templates").await;
    assert_eq!(list["templates"].as_array().unwrap().len(), 2);
    let seen = async |query: &str| {
        let answer = app
            .post(&format!("/v1/segmentations{query}"))
            .header("prefer", super::helpers::UNTIL_DONE)
            .header(ACCEPT, "application/json")
            .body(volume("sphere"))
            .send();
        let answer = answer.await.unwrap();
        assert_eq!(answer.status(), StatusCode::OK, "{query}");
        let made = app.json(answer.headers()[LOCATION].to_str().unwrap()).await;
        made["summary"]["seen"].clone()
    };
    assert_eq!(template["library"], false);
    assert_eq!(seen("?roll=1").await, json!({"things": [], "library": 0}));
    let patch = async |path: &str, body: Value| {
        let patch = app.client.patch(format!("{}{path}", app.url)).json(&body);
        patch.send().await.unwrap()
    };
    let flagged = patch(&path, json!({"library": true})).await;
    assert_eq!(flagged.status(), StatusCode::OK);
    assert_eq!(flagged.json::<Value>().await.unwrap()["library"], true);
    assert_eq!(app.json(&path).await["library"], true);
    assert_eq!(seen("?roll=2").await, json!({"things": [], "library": 1}));
    // A model that is named is fitted alone, or beside the others.
    let alone = seen(&format!("?model={}", text(&template["id"]))).await;
    assert_eq!(alone, json!({"things": ["model"], "library": 0}));
    let beside = format!("?model=auto,{model},{}", text(&template["id"]));
    let expected = json!({"things": ["model[0]", "model[1]"], "library": 1});
    assert_eq!(seen(&beside).await, expected);
    let cleared = patch(&path, json!({"library": null})).await;
    assert_eq!(cleared.json::<Value>().await.unwrap()["library"], false);
    assert_eq!(seen("?roll=3").await["library"], 0);
    for (body, code, field) in [
        (json!({"library": "yes"}), 422, "library"),
        (json!({"name": "other"}), 400, "name"),
    ] {
        let refused = patch(&path, body).await;
        assert_eq!(refused.status().as_u16(), code);
        assert_eq!(refused.json::<Value>().await.unwrap()["field"], field);
    }
    let volume = text(&list["templates"][0]["id"]).replace("tpl_", "vol_");
    problem(
        patch(&format!("/v1/templates/{volume}"), json!({})).await,
        404,
        "not-found",
    )
    .await;
    for query in [
        "model=auto,auto",
        "model=auto,",
        "model=mdl_1,mdl_2",
        "model=auto,mdl_1,mdl_1",
    ] {
        let refused = app
            .post(&format!("/v1/segmentations?{query}"))
            .body(self::volume("sphere"));
        let refused = problem(refused.send().await.unwrap(), 422, "invalid-parameter").await;
        assert_eq!(refused["field"], "model", "{query}");
    }
    let gone = app
        .post("/v1/segmentations?model=auto,mdl_00")
        .body(self::volume("sphere"));
    let gone = problem(gone.send().await.unwrap(), 422, "invalid-field").await;
    assert_eq!(gone["field"], "model[0]");
    let full = post("?organ=liver", mesh_json(&shapes::icosphere(50.0, 2)));
    problem(full.await.unwrap(), 409, "library-full").await;

    assert_eq!(
        app.delete(&path).send().await.unwrap().status(),
        StatusCode::NO_CONTENT
    );
    problem(app.get(&path).send().await.unwrap(), 410, "gone").await;
}

#[tokio::test]
async fn a_mesh_that_cannot_be_fitted_is_rejected_as_template() {
    let app = TestApp::start().await;
    let post = |query: &str, body: Vec<u8>| {
        app.post(&format!("/v1/templates{query}"))
            .header("content-type", "application/json")
            .body(body)
            .send()
    };
    let sphere = shapes::icosphere(40.0, 2);
    let mut open = sphere.clone();
    open.triangles.pop();
    let ball = post("", mesh_json(&sphere)).await.unwrap();
    let ball = problem(ball, 422, "unsuitable-model").await;
    assert!(text(&ball["detail"]).contains("no ventricle"), "{ball}");
    for body in [
        mesh_json(&open),
        br#"{"vertices":[],"triangles":[]}"#.to_vec(),
        br#"{"vertices":[[0,0,0]],"triangles":[[0,1,2]]}"#.to_vec(),
        br#"{"frame":"RAS","vertices":[],"triangles":[]}"#.to_vec(),
        b"solid stl".to_vec(),
        Vec::new(),
    ] {
        let refused = post("?organ=generic", body).await.unwrap();
        problem(refused, 422, "unsuitable-model").await;
    }
    for (query, status, code, field) in [
        ("?organ=spleen", 400, "invalid-parameter", "organ"),
        ("?name=", 422, "invalid-field", "name"),
    ] {
        let refused = post(query, mesh_json(&sphere)).await.unwrap();
        assert_eq!(problem(refused, status, code).await["field"], field);
    }
    let unknown = post("?model=mdl_00", Vec::new()).await.unwrap();
    assert_eq!(
        problem(unknown, 422, "invalid-field").await["field"],
        "model"
    );
    let both = post("?model=mdl_00", mesh_json(&sphere)).await.unwrap();
    problem(both, 400, "contradiction").await;
    let large = post("", vec![b' '; 5 << 20]).await.unwrap();
    problem(large, 413, "body-too-large").await;
    assert!(app.stored().is_empty());
}
