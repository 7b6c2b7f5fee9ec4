//! The published document.

use crate::helpers::{TestApp, generated, text};
use serde_json::{Value, json};
use ventriform::parameters::{
    BEAT_SPECS, COMPARISON_SPECS, ComparisonParameters, FIT_SPECS, GatedParameters, MODEL_SPECS,
};
use ventriform_http::document_json;

/// Most paths and bytes of the document: a person reads it.
const MOST_PATHS: usize = 80;
const MOST_BYTES: usize = 900_000;

#[test]
fn the_committed_document_matches_the_code() {
    generated("openapi/ventriform.json", &document_json());
}

#[test]
fn the_document_stays_small() {
    let text = document_json();
    let document: Value = serde_json::from_str(&text).unwrap();
    let paths = document["paths"].as_object().unwrap().len();
    assert!(
        paths < MOST_PATHS && text.len() < MOST_BYTES,
        "{paths}, {}",
        text.len()
    );
}

/// What `value` refers to, or itself.
fn resolved<'d>(document: &'d Value, value: &'d Value) -> &'d Value {
    match value["$ref"].as_str() {
        Some(reference) => document.pointer(reference.trim_start_matches('#')).unwrap(),
        None => value,
    }
}

fn parameters<'d>(document: &'d Value, operation: &'d Value) -> impl Iterator<Item = &'d Value> {
    let parameters = operation["parameters"].as_array().into_iter().flatten();
    parameters.map(|parameter| resolved(document, parameter))
}

#[tokio::test]
async fn the_service_publishes_the_same_document() {
    let app = TestApp::start().await;
    let served = app.json("/openapi.json").await;
    let generated: Value = serde_json::from_str(&document_json()).unwrap();
    assert_eq!(served, generated);
    assert!(text(&served["openapi"]).starts_with("3.1"));
}

#[test]
fn every_parameter_of_a_job_is_documented_twice() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let fit: Vec<_> = FIT_SPECS.iter().map(|spec| spec.name).collect();
    let model: Vec<_> = MODEL_SPECS.iter().map(|spec| spec.name).collect();
    let beat: Vec<_> = GatedParameters::fit_specs()
        .map(|spec| spec.name)
        .chain(BEAT_SPECS.iter().map(|spec| spec.name))
        .collect();
    let comparison: Vec<_> = ComparisonParameters::fit_specs()
        .map(|spec| spec.name)
        .chain(COMPARISON_SPECS.iter().map(|spec| spec.name))
        .collect();
    for (path, schema, names) in [
        ("/v1/beats", "BeatParameters", beat),
        ("/v1/comparisons", "ComparisonParameters", comparison),
        ("/v1/models", "ModelParameters", model),
        ("/v1/segmentations", "SegmentationParameters", fit),
    ] {
        let query: Vec<_> = parameters(&document, &document["paths"][path]["post"]).collect();
        let schema = &document["components"]["schemas"][schema]["properties"];
        for name in names {
            assert!(query.iter().any(|p| p["name"] == name), "{name}");
            assert!(schema[name].is_object(), "{name}");
        }
    }
}

/// A generated client tells the parameters of one kind of job from those of another by `kind`, and fills in no others'
/// defaults.
#[test]
fn a_request_for_a_job_is_told_by_its_kind() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let schemas = &document["components"]["schemas"];
    let body = &document["paths"]["/v1/jobs"]["post"]["requestBody"]["content"]["application/json"];
    let request = document
        .pointer(text(&body["schema"]["$ref"]).trim_start_matches('#'))
        .unwrap();
    assert_eq!(request["discriminator"]["propertyName"], "kind");
    let mapping = request["discriminator"]["mapping"].as_object().unwrap();
    let one_of = request["oneOf"].as_array().unwrap();
    assert_eq!((mapping.len(), one_of.len()), (6, 6));
    for (kind, parameters) in [
        ("model", "ModelParameters"),
        ("segmentation", "SegmentationParameters"),
        ("beat", "BeatParameters"),
        ("comparison", "ComparisonParameters"),
        ("serial", "SerialParameters"),
        ("normals", "NormalsParameters"),
    ] {
        assert!(
            one_of.iter().any(|one| one["$ref"] == mapping[kind]),
            "{kind}"
        );
        let name = text(&mapping[kind]);
        let schema = &schemas[name.rsplit('/').next().unwrap()];
        let fields = &schema["properties"];
        assert_eq!(fields["kind"]["enum"], json!([kind]));
        let reference = format!("#/components/schemas/{parameters}");
        assert_eq!(fields["parameters"]["$ref"], reference, "{kind}");
        assert_eq!(schema["additionalProperties"], false, "{kind}");
        assert_eq!(schemas[parameters]["additionalProperties"], false, "{kind}");
        // The kind may be left out of a request for a model, and of no other.
        let required = schema["required"].as_array().cloned().unwrap_or_default();
        assert_eq!(required.contains(&json!("kind")), kind != "model", "{kind}");
        // A volume or else a source.
        assert!(fields["volume"].is_object() && fields["source"].is_object());
        assert_eq!(schema["not"]["required"], json!(["volume", "source"]));
        assert_eq!(schema["then"]["required"], json!(["source"]));
    }
    for of_any_kind in ["VolumeJobRequest", "SourceJobRequest"] {
        let discriminator = &schemas[of_any_kind]["discriminator"];
        assert_eq!(*discriminator, request["discriminator"], "{of_any_kind}");
    }
}

#[test]
fn every_reference_resolves() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let mut open = vec![&document];
    while let Some(value) = open.pop() {
        match value {
            Value::Object(object) => {
                if let Some(Value::String(reference)) = object.get("$ref") {
                    let target = document.pointer(reference.trim_start_matches('#'));
                    assert!(target.is_some(), "{reference}");
                }
                open.extend(object.values());
            }
            Value::Array(list) => open.extend(list),
            _ => {}
        }
    }
}

/// Path, method and content of every operation.
fn operations(document: &Value) -> Vec<(&str, &str, &Value)> {
    let paths = document["paths"].as_object().unwrap().iter();
    paths
        .flat_map(|(path, item)| {
            let methods = item.as_object().unwrap().iter();
            methods.map(|(method, operation)| (path.as_str(), method.as_str(), operation))
        })
        .collect()
}

#[test]
fn every_operation_has_an_id_of_its_own_and_examples() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let mut ids = std::collections::BTreeSet::new();
    for (path, method, operation) in operations(&document) {
        let what = format!("{method} {path}");
        assert!(ids.insert(text(&operation["operationId"])), "{what}");
        let sample = text(&operation["x-codeSamples"][0]["source"]);
        assert!(sample.starts_with("curl "), "{what}: {sample}");
        let (_, address) = sample.rsplit_once("\"$U").unwrap();
        assert!(!address.contains('{'), "{what}: {sample}");
        for parameter in parameters(&document, operation) {
            if parameter["in"] == "query" && parameter["required"] == true {
                let given = format!("{}=", text(&parameter["name"]));
                assert!(sample.contains(&given), "{what}: {sample}");
            }
        }
        // What is erased by a filter is named, and looked at first.
        let erases_all = method == "delete" && path == "/v1/volumes";
        assert!(!erases_all || sample.contains("dry_run=true"), "{sample}");
        for (status, answer) in operation["responses"].as_object().unwrap() {
            let answer = resolved(&document, answer);
            let contents = answer.get("content").and_then(Value::as_object);
            for (media_type, content) in contents.into_iter().flatten() {
                let example = &content["example"];
                let shared = content["examples"].is_object();
                let json = ["application/json", "application/problem+json"];
                assert!(
                    !json.contains(&media_type.as_str()) || shared || !example.is_null(),
                    "{what} {status}: record its examples: scripts/generate.sh"
                );
            }
        }
    }
    assert!(ids.contains("get_model_file") && ids.contains("list_volumes"));
}

#[test]
fn no_name_means_two_parameters_of_an_operation() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    for (path, method, operation) in operations(&document) {
        let mut names = std::collections::BTreeSet::new();
        for parameter in parameters(&document, operation) {
            let name = (text(&parameter["in"]), text(&parameter["name"]));
            assert!(names.insert(name), "{method} {path}: {parameter}");
        }
    }
}

/// Queries that an operation refuses, the parameter at fault, and the code of the problem.
fn wrong_queries(document: &Value, operation: &Value) -> Vec<(String, String, &'static str)> {
    let name = "no_such_parameter".to_owned();
    let mut wrong = vec![(format!("{name}=1"), name, "unknown-parameter")];
    let parameters = parameters(document, operation);
    for parameter in parameters.filter(|parameter| parameter["in"] == "query") {
        let name = text(&parameter["name"]);
        let schema = resolved(document, &parameter["schema"]);
        if schema["type"] != "array" {
            let twice = format!("{name}=1&{name}=1");
            wrong.push((twice, name.clone(), "repeated-parameter"));
        }
        let listed = schema["enum"].is_array() || schema["format"] == "date-time";
        let kind = schema["type"].as_str().unwrap_or_default();
        if listed || ["boolean", "integer", "number"].contains(&kind) {
            wrong.push((format!("{name}=wrong"), name, "invalid-"));
        }
    }
    wrong
}

/// A file of the operation that takes the query parameter `name`.
fn taking<'d>(operation: &'d Value, name: &str) -> Option<&'d str> {
    let mut files = operation["x-files"].as_object()?.iter();
    let taking = files.find(|(_, facts)| {
        let taken = facts["parameters"].as_array().into_iter().flatten();
        taken.into_iter().any(|one| one == name)
    });
    Some(taking?.0)
}

#[tokio::test]
async fn every_operation_refuses_unknown_repeated_and_malformed_parameters() {
    let app = TestApp::start().await;
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    let mut refused = std::collections::BTreeMap::new();
    for (path, method, operation) in operations(&document) {
        let method: reqwest::Method = method.to_uppercase().parse().unwrap();
        for (query, name, code) in wrong_queries(&document, operation) {
            // Not every file takes every parameter.
            let file = taking(operation, &name).unwrap_or("file");
            let filled = path.replace("{file}", file).replace(['{', '}'], "");
            let url = format!("{}{filled}?{query}", app.url);
            let answer = app
                .client
                .request(method.clone(), url)
                .send()
                .await
                .unwrap();
            let status = answer.status().as_u16();
            let problem: Value = answer.json().await.unwrap_or_default();
            let what = format!("{method} {path}?{query}: {status} {problem}");
            // The parameters of a job are checked by its work, for JSON and forms alike.
            let with_parameters = [
                "/v1/models",
                "/v1/segmentations",
                "/v1/beats",
                "/v1/comparisons",
            ];
            let of_job = with_parameters.contains(&path) && status == 422;
            assert!(
                of_job || status == 400 && text(&problem["type"]).contains(code),
                "{what}"
            );
            assert_eq!(problem["field"], json!(name), "{what}");
            assert!(problem["fix"].is_string(), "{what}");
            *refused.entry(code).or_insert(0) += 1;
        }
    }
    assert!(
        refused["unknown-parameter"] > 80 && refused["invalid-"] > 150,
        "{refused:?}"
    );
}

#[test]
fn bytes_are_binary_and_reports_are_typed() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    for (path, _, operation) in operations(&document) {
        let uploads = &operation["requestBody"]["content"]["application/octet-stream"];
        if !uploads.is_null() {
            assert_eq!(uploads["schema"]["format"], "binary", "{path}");
        }
    }
    for (path, name) in [
        ("/v1/models/{id}/report", "ModelReport"),
        ("/v1/segmentations/{id}/report", "SegmentationReport"),
        ("/v1/beats/{id}/report", "BeatReport"),
        ("/v1/comparisons/{id}/report", "ComparisonReport"),
        ("/v1/serials/{id}/report", "SerialReport"),
    ] {
        let answer = &document["paths"][path]["get"]["responses"]["200"];
        let reference = text(&answer["content"]["application/json"]["schema"]["$ref"]);
        assert_eq!(reference, format!("#/components/schemas/{name}"));
    }
}

#[test]
fn every_file_has_its_media_type_and_schema() {
    let document: Value = serde_json::from_str(&document_json()).unwrap();
    for (path, file, media_type, schema) in [
        ("models", "mesh.glb", "model/gltf-binary", None),
        (
            "models",
            "report.json",
            "application/json",
            Some("ModelReport"),
        ),
        (
            "models",
            "distance.json",
            "application/json",
            Some("Closeness"),
        ),
        ("segmentations", "mask.nii.gz", "application/gzip", None),
        (
            "segmentations",
            "polar.json",
            "application/json",
            Some("PolarMap"),
        ),
        ("segmentations", "mask.dcm", "application/dicom", None),
        ("beats", "beat.json", "application/json", Some("BeatReport")),
        (
            "beats",
            "mesh_gateNN.json",
            "application/json",
            Some("MeshDocument"),
        ),
        ("beats", "labels_gateNN.nii.gz", "application/gzip", None),
        (
            "comparisons",
            "comparison.json",
            "application/json",
            Some("ComparisonReport"),
        ),
        (
            "comparisons",
            "polar_rest.json",
            "application/json",
            Some("PolarMap"),
        ),
        (
            "comparisons",
            "polar_z_rest.json",
            "application/json",
            Some("PolarFigure"),
        ),
        (
            "normals",
            "normals.json",
            "application/json",
            Some("NormalLimits"),
        ),
        (
            "readers",
            "profile.json",
            "application/json",
            Some("ReaderProfile"),
        ),
        ("templates", "mesh.stl", "model/stl", None),
    ] {
        let operation = &document["paths"][format!("/v1/{path}/{{id}}/{{file}}")]["get"];
        let facts = &operation["x-files"][file];
        assert_eq!(facts["mediaType"], media_type, "{path}: {file}");
        match schema {
            Some(name) => {
                let reference = text(&facts["schema"]["$ref"]);
                assert_eq!(reference, format!("#/components/schemas/{name}"));
            }
            None => assert_eq!(facts["schema"]["format"], "binary", "{path}: {file}"),
        }
    }
    let mut files = 0;
    for (path, _, operation) in operations(&document) {
        let content = &operation["responses"]["200"]["content"];
        let table = operation["x-files"].as_object().into_iter().flatten();
        for (name, facts) in table {
            files += 1;
            // The answer has the media type, and the schema alone or among others.
            let schema = &content[text(&facts["mediaType"])]["schema"];
            let among = schema["anyOf"].as_array().into_iter().flatten();
            let mut schemas = among.chain([schema]);
            assert!(schemas.any(|one| *one == facts["schema"]), "{path}: {name}");
        }
        // Generators read by the first media type: where there are bytes, all is read as bytes.
        let mut schemas = content.as_object().into_iter().flatten();
        let first = schemas
            .next()
            .map(|(_, content)| &content["schema"]["format"]);
        if operation["x-files"].is_object() && schemas.next().is_some() {
            assert_eq!(first.unwrap(), "binary", "{path}");
        }
    }
    assert!(files > 160, "{files}");
}
