//! The last steps on the collected document. They work on its JSON, because they touch every
//! operation alike.
//!
//! 1. A struct that serde flattens into another one is described by the fields of the other. Whole numbers have
//!    64 bits.
//! 2. A request for a job has a volume or a source: JSON Schema says so in words that utoipa does not have. They leave
//!    the fields in one object, as generators of clients want them.
//! 3. A path `.../{file}` becomes one path per file, so that each file has one media type and one
//!    schema. Generators of clients choose how to read an answer by its first media type. The path itself stays for
//!    names of a form: the meshes and labels of the gates of a beat.
//! 4. Bytes become `type: string, format: binary`. OpenAPI 3.1 would express them by a schema
//!    without a type, which generators read as "anything".
//! 5. Every operation gets examples: those of `examples.json`, recorded from a running service by
//!    `scripts/check/contract.py`, and a command line for curl.
//! 6. Every operation takes `X-Request-Id`.

use super::answers::media_type_of;
use super::bodies::{SourceJobRequest, VolumeJobRequest, job_discriminator, job_requests};
use crate::resources::files::REPORT_PAGE;
use crate::wire::problem::MEDIA_TYPE;
use serde_json::{Map, Value, json};
use utoipa::ToSchema;
use ventriform::results::export::Format;
use ventriform::results::export::dicom::DicomObject;

/// Requests and answers as a running service gave them.
const RECORDED_EXAMPLES: &str = include_str!("examples.json");

/// Completes `document`.
pub fn finish(document: &mut Value) {
    flatten(&mut document["components"]["schemas"]);
    with_width(&mut document["components"]["schemas"]);
    require_input(&mut document["components"]["schemas"]);
    one_path_per_file(document);
    let recorded = serde_json::from_str(RECORDED_EXAMPLES).expect("examples.json is an object");
    let problems = problem_examples(&recorded);
    for (path, method, operation) in operations(document) {
        bytes_as_binary(operation);
        if let Some(request) = operation
            .get_mut("requestBody")
            .and_then(Value::as_object_mut)
        {
            // utoipa leaves it out where a body may have several media types.
            request.entry("required").or_insert(true.into());
            add_upload_types(request);
        }
        type_report(path, operation);
        add_examples(operation, &recorded);
        add_request_id(operation);
        let sample = command_line(path, method, operation, &recorded);
        operation["x-codeSamples"] = json!([{"lang": "Shell", "label": "curl", "source": sample}]);
    }
    document["components"]["examples"] = problems;
    document["components"]["parameters"] = json!({"RequestId": {
        "name": "X-Request-Id",
        "in": "header",
        "required": false,
        "description": "Names the request in the log; the answer repeats it",
        "schema": {"type": "string"},
    }});
}

/// The media types of uploaded volumes that the document names beside `application/octet-stream`, which stands for all of
/// [`VOLUME_TYPES`](crate::wire::upload::media_types::VOLUME_TYPES), and forms.
const UPLOAD_TYPES: [&str; 5] = [
    "application/gzip",
    "application/zip",
    "application/dicom",
    "application/nifti",
    "multipart/related",
];

/// Adds [`UPLOAD_TYPES`] to a request whose body is a volume or a form with one.
fn add_upload_types(request: &mut Map<String, Value>) {
    let Some(content) = request.get_mut("content").and_then(Value::as_object_mut) else {
        return;
    };
    let bytes = content.get("application/octet-stream").cloned();
    if let (Some(bytes), true) = (bytes, content.contains_key("multipart/form-data")) {
        for media_type in UPLOAD_TYPES {
            content.insert(media_type.to_owned(), bytes.clone());
        }
    }
}

/// Documents with a part that serde flattens. utoipa describes them as `allOf`, of which generators of clients make
/// several types.
const FLATTENED_SCHEMAS: [&str; 2] = ["MeshFacts", "PolarMap"];

/// Joins the parts of the [`FLATTENED_SCHEMAS`] schemas, and drops parts that nothing else names.
fn flatten(schemas: &mut Value) {
    for name in FLATTENED_SCHEMAS {
        let mut whole = json!({
            "type": "object",
            "description": schemas[name]["description"],
            "required": [],
            "properties": {},
        });
        let parts = schemas[name]["allOf"].as_array().cloned();
        let mut named = Vec::new();
        for part in parts.iter().flatten() {
            let path = part["$ref"]
                .as_str()
                .and_then(|path| path.rsplit('/').next());
            join(&mut whole, path.map_or(part, |name| &schemas[name]));
            named.extend(path);
        }
        schemas[name] = whole;
        let text = schemas.to_string();
        if let Some(all) = schemas.as_object_mut() {
            all.retain(|name, _| {
                !named.contains(&name.as_str())
                    || text.contains(&format!("#/components/schemas/{name}\""))
            });
        }
    }
}

/// Adds the fields of `part` to those of `whole`.
fn join(whole: &mut Value, part: &Value) {
    for (name, field) in part["properties"].as_object().into_iter().flatten() {
        whole["properties"][name] = field.clone();
    }
    let required = part["required"].as_array().into_iter().flatten();
    if let Some(all) = whole["required"].as_array_mut() {
        all.extend(required.cloned());
    }
}

/// Says of every whole number without a width that it has 64 bits: utoipa does not say it of `usize`. Parameters
/// have ranges instead.
fn with_width(schema: &mut Value) {
    match schema {
        Value::Object(fields) => {
            let kind = fields.get("type");
            let whole = kind.is_some_and(|kind| {
                kind == "integer"
                    || kind
                        .as_array()
                        .is_some_and(|all| all.contains(&json!("integer")))
            });
            let bounded = fields.contains_key("maximum") || fields.contains_key("default");
            if whole && !bounded && fields.contains_key("minimum") {
                fields.entry("format").or_insert("int64".into());
            }
            fields.values_mut().for_each(with_width);
        }
        Value::Array(items) => items.iter_mut().for_each(with_width),
        _ => {}
    }
}

/// Says of requests for jobs that they have a volume or a source, and how those of any kind are told.
fn require_input(schemas: &mut Value) {
    for name in job_requests() {
        let request = &mut schemas[name];
        request["not"] = json!({"required": ["volume", "source"]});
        request["if"] = json!({"not": {"required": ["volume"]}});
        request["then"] = json!({"required": ["source"]});
    }
    for request in [VolumeJobRequest::name(), SourceJobRequest::name()] {
        schemas[&*request]["discriminator"] = json!(job_discriminator());
    }
}

/// Path, method and content of every operation.
fn operations(document: &mut Value) -> impl Iterator<Item = (&str, &str, &mut Value)> {
    let paths = document["paths"].as_object_mut();
    paths.into_iter().flatten().flat_map(|(path, item)| {
        let methods = item.as_object_mut().into_iter().flatten();
        methods
            .filter(|(_, operation)| operation["operationId"].is_string())
            .map(|(method, operation)| (path.as_str(), method.as_str(), operation))
    })
}

/// Media type and content of a request or an answer.
fn contents(body: &mut Value) -> impl Iterator<Item = (&str, &mut Value)> {
    let contents = body.get_mut("content").and_then(Value::as_object_mut);
    let contents = contents.into_iter().flatten();
    contents.map(|(media_type, content)| (media_type.as_str(), content))
}

/// Every answer of an operation, with its status.
fn answers(operation: &mut Value) -> impl Iterator<Item = (&str, &mut Value)> {
    let answers = operation
        .get_mut("responses")
        .and_then(Value::as_object_mut);
    let answers = answers.into_iter().flatten();
    answers.map(|(status, answer)| (status.as_str(), answer))
}

fn one_path_per_file(document: &mut Value) {
    let Some(Value::Object(paths)) = document.get_mut("paths").map(Value::take) else {
        return;
    };
    let mut separate = Map::new();
    for (path, item) in paths {
        let Some(folder) = path.strip_suffix("/{file}") else {
            separate.insert(path, item);
            continue;
        };
        let names = take_file_names(&mut document["components"]["schemas"], &item);
        if let Some(pattern) = names.get("pattern") {
            let operation = of_numbered_files(pattern, &item["get"]);
            separate.insert(path.clone(), json!({ "get": operation }));
        }
        let listed = names["enum"].as_array().into_iter().flatten();
        for name in listed.filter_map(Value::as_str) {
            let name = name.to_owned();
            let operation = of_one_file(folder, &name, &item["get"]);
            separate.insert(format!("{folder}/{name}"), json!({ "get": operation }));
        }
    }
    separate.sort_keys();
    document["paths"] = separate.into();
}

/// The schema of the parameter `file`, which is taken out.
fn take_file_names(schemas: &mut Value, item: &Value) -> Value {
    let parameters = item["get"]["parameters"].as_array();
    let file = parameters
        .into_iter()
        .flatten()
        .find(|parameter| parameter["name"] == "file");
    let reference = file.and_then(|file| file["schema"]["$ref"].as_str());
    let schema = reference.and_then(|reference| {
        let name = reference.rsplit('/').next()?;
        schemas.as_object_mut()?.remove(name)
    });
    schema.unwrap_or_default()
}

/// The operation that downloads a file whose name has that form, from the one that downloads any.
fn of_numbered_files(pattern: &Value, any: &Value) -> Value {
    let mut one = any.clone();
    let parameters = one["parameters"].as_array_mut();
    if let Some(parameters) = parameters {
        // Meshes and labels of one gate name no patient, and have no parts.
        parameters.retain(|parameter| parameter["name"] == "file" || parameter["in"] != "query");
        let file = parameters.iter_mut().find(|one| one["name"] == "file");
        if let Some(file) = file {
            file["schema"] = json!({"type": "string", "pattern": pattern});
        }
    }
    if let Some(answers) = one["responses"].as_object_mut() {
        answers.shift_remove("406");
    }
    // Labels come first: generators of clients take all as bytes, as they take those.
    let mut content = Map::new();
    content.insert("application/gzip".into(), json!({ "schema": binary() }));
    for format in Format::ALL {
        let schema = match format {
            Format::Json => reference("MeshDocument"),
            Format::Gltf => json!({"type": "object"}),
            _ => binary(),
        };
        content.insert(format.media_type().into(), json!({ "schema": schema }));
    }
    one["responses"]["200"]["content"] = content.into();
    one
}

/// The operation that downloads the file `name`, from the one that downloads any.
fn of_one_file(folder: &str, name: &str, any: &Value) -> Value {
    let mut one = any.clone();
    let stem = any["operationId"].as_str().unwrap_or_default();
    let stem = stem.strip_suffix("file").unwrap_or(stem);
    one["operationId"] = format!("{stem}{}", name.replace(['.', '-'], "_")).into();
    one["summary"] = format!("Download {name}").into();
    let media_type = media_type_of(name);
    let is_object = media_type == DicomObject::MEDIA_TYPE;
    if let Some(parameters) = one["parameters"].as_array_mut() {
        parameters.retain(|parameter| match parameter["name"].as_str() {
            Some("file") => false,
            Some("deidentify") => is_object || name == REPORT_PAGE,
            // The animation of a beat is one file, whole.
            Some("part") => {
                !is_object && name.starts_with("mesh") && !folder.starts_with("/v1/beats")
            }
            _ => true,
        });
    }
    if let Some(answers) = one["responses"].as_object_mut() {
        // The name says the format; `Accept` is not looked at.
        answers.shift_remove("406");
        if !is_object {
            for status in ["403", "409", "422"] {
                answers.shift_remove(status);
            }
        }
    }
    let schema = match (name, media_type) {
        ("report.json" | "beat.json" | "comparison.json", _) => report_of(folder),
        ("distance.json", _) => reference("Closeness"),
        (
            "polar.json" | "polar_ed.json" | "polar_es.json" | "polar_stress.json"
            | "polar_rest.json",
            _,
        ) => reference("PolarMap"),
        (figure, "application/json") if figure.starts_with("polar_") => reference("PolarFigure"),
        ("normals.json", _) => reference("NormalLimits"),
        ("profile.json", _) => reference("ReaderProfile"),
        (mesh, "application/json") if mesh.starts_with("mesh") => reference("MeshDocument"),
        (_, "model/gltf+json") => json!({"type": "object"}),
        (_, "text/html" | "image/svg+xml") => json!({"type": "string"}),
        _ => binary(),
    };
    let mut content = Map::new();
    content.insert(media_type.to_owned(), json!({ "schema": schema }));
    one["responses"]["200"]["content"] = content.into();
    one
}

fn reference(schema: &str) -> Value {
    json!({"$ref": format!("#/components/schemas/{schema}")})
}

/// The schema of the reports below `path`.
fn report_of(path: &str) -> Value {
    if path.starts_with("/v1/segmentations") {
        reference("SegmentationReport")
    } else if path.starts_with("/v1/beats") {
        reference("BeatReport")
    } else if path.starts_with("/v1/comparisons") {
        reference("ComparisonReport")
    } else {
        reference("ModelReport")
    }
}

fn type_report(path: &str, operation: &mut Value) {
    if path.ends_with("/report") {
        operation["responses"]["200"]["content"]["application/json"]["schema"] = report_of(path);
    }
}

fn binary() -> Value {
    json!({"type": "string", "format": "binary", "contentMediaType": "application/octet-stream"})
}

/// utoipa writes `Vec<u8>` as an array of numbers.
fn bytes_as_binary(operation: &mut Value) {
    let change = |body: &mut Value| {
        for (_, content) in contents(body) {
            let schema = &content["schema"];
            let numbers = schema["type"] == "array" && schema["items"]["format"] == "int32";
            let untyped = schema["type"].is_null() && schema["contentMediaType"].is_string();
            if numbers || untyped {
                content["schema"] = binary();
            }
        }
    };
    if let Some(request) = operation.get_mut("requestBody") {
        change(request);
    }
    answers(operation).for_each(|(_, answer)| change(answer));
}

fn problem_examples(recorded: &Value) -> Value {
    let problems = recorded["problems"].as_object().into_iter().flatten();
    let examples = problems.map(|(status, problem)| {
        let example = json!({"summary": problem["title"], "value": problem});
        (format!("Problem{status}"), example)
    });
    Value::Object(examples.collect())
}

/// Adds the recorded request and answers, and to every problem without one of its own the example of its status.
fn add_examples(operation: &mut Value, recorded: &Value) {
    let id = operation["operationId"].as_str().unwrap_or_default();
    let own = &recorded["operations"][id];
    if let Some(request) = operation.get_mut("requestBody") {
        add_own(request, &own["request"]);
    }
    for (status, answer) in answers(operation) {
        add_own(answer, &own[status]);
        for (media_type, content) in contents(answer) {
            if media_type == MEDIA_TYPE
                && content.get("example").is_none()
                && recorded["problems"].get(status).is_some()
            {
                let example = format!("#/components/examples/Problem{status}");
                content["examples"] = json!({"problem": {"$ref": example}});
            }
        }
    }
    let parameters = operation
        .get_mut("parameters")
        .and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten() {
        let name = parameter["name"].as_str().unwrap_or_default();
        if let Some(example) = own["parameters"].get(name) {
            parameter["example"] = example.clone();
        }
    }
}

fn add_request_id(operation: &mut Value) {
    let parameter = json!({"$ref": "#/components/parameters/RequestId"});
    match operation
        .get_mut("parameters")
        .and_then(Value::as_array_mut)
    {
        Some(parameters) => parameters.push(parameter),
        None => operation["parameters"] = json!([parameter]),
    }
}

fn add_own(body: &mut Value, examples: &Value) {
    for (media_type, content) in contents(body) {
        if let Some(example) = examples.get(media_type) {
            content["example"] = example.clone();
        }
    }
}

/// Queries of operations that are refused without one. The erasure is a dry run.
const SAMPLE_QUERIES: [(&str, &str); 2] = [
    ("delete_volumes", "patient=PAT-0042&dry_run=true"),
    ("revoke_keys_of_owner", "owner=contractor-7"),
];

/// A command line for curl; `$U` stands for the service's address.
fn command_line(path: &str, method: &str, operation: &Value, recorded: &Value) -> String {
    let id = operation["operationId"].as_str().unwrap_or_default();
    let own = &recorded["operations"][id];
    let mut url = path.to_owned();
    for (name, value) in own["parameters"].as_object().into_iter().flatten() {
        url = url.replace(&format!("{{{name}}}"), value.as_str().unwrap_or_default());
    }
    let mut words = vec!["curl -fsS".to_owned()];
    if method == "delete" {
        words.push("-X DELETE".into());
    }
    let requests = &operation["requestBody"]["content"];
    if requests.get("application/octet-stream").is_some() {
        words.push("--data-binary @scan.nii.gz".into());
    } else if let Some(request) = own["request"].get("application/json") {
        words.push(format!(
            "-H 'content-type: application/json' -d '{request}'"
        ));
    } else if requests.get("application/json").is_some() {
        words.push("-H 'content-type: application/json' --data-binary @mesh.json".into());
    }
    if let Some((_, query)) = SAMPLE_QUERIES.iter().find(|(of, _)| *of == id) {
        url = format!("{url}?{query}");
    }
    words.push(format!("\"$U{url}\""));
    let answers = operation["responses"]["200"]["content"].as_object();
    let bytes = |content: &Value| content["schema"]["format"] == "binary";
    if answers.is_some_and(|answers| answers.values().all(bytes)) {
        let name = url.rsplit('/').next().unwrap_or_default();
        words.push(format!("-o {name}"));
    }
    words.join(" ")
}
