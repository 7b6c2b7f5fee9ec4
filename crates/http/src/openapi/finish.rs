//! The last steps on the collected document. They work on its JSON, because they touch every
//! operation alike.
//!
//! 1. A struct that serde flattens into another one is described by the fields of the other. Whole numbers have
//!    64 bits.
//! 2. A request for a job has a volume or a source: JSON Schema says so in words that utoipa does not have. They leave the
//!    fields in one object, as generators of clients want them.
//! 3. Paths `.../{file}` get a table of their files ([`super::result_files`]).
//! 4. Bytes become `type: string, format: binary`. OpenAPI 3.1 would express them by a schema
//!    without a type, which generators read as "anything".
//! 5. Every operation gets examples: those of `examples.json`, recorded from a running service by
//!    `scripts/check/contract.py`, and a command line for curl. A document has one example, under `components`.
//! 6. Every operation takes `X-Request-Id`.
//! 7. The schemas of reports get the rows of their figures: `x-figures` ([`figures`]).
//! 8. What several operations have alike stands under `components` ([`super::share`]).

use super::bodies::{ANY_JOB_REQUESTS, job_discriminator, job_requests};
use super::result_files::{self, binary, report_of};
use super::share::share;
use super::walk::{answers, contents, operations};
use crate::wire::problem::MEDIA_TYPE;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use ventriform::results::figures;

/// Requests and answers as a running service gave them.
const RECORDED_EXAMPLES: &str = include_str!("examples.json");

/// Completes `document`.
pub fn finish(document: &mut Value) {
    sort_extensions(document);
    flatten(&mut document["components"]["schemas"]);
    with_width(&mut document["components"]["schemas"]);
    require_input(&mut document["components"]["schemas"]);
    result_files::describe(document);
    let recorded = serde_json::from_str(RECORDED_EXAMPLES).expect("examples.json is an object");
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
        add_examples(path, operation, &recorded);
        add_request_id(operation);
        let sample = command_line(path, method, operation, &recorded);
        operation["x-codeSamples"] = json!([{"lang": "Shell", "label": "curl", "source": sample}]);
    }
    for (schema, rows) in figures::tables() {
        document["components"]["schemas"][schema]["x-figures"] = rows;
    }
    document["components"]["examples"] = shared_examples(&recorded);
    share(document);
}

/// Puts the extensions of every object last, in the order of their names: utoipa has them in a map without order, and
/// the document is the same bytes whenever it is made.
fn sort_extensions(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(sort_extensions),
        Value::Object(object) => {
            let names: BTreeSet<String> = (object.keys())
                .filter(|name| name.starts_with("x-"))
                .cloned()
                .collect();
            for name in names {
                if let Some(extension) = object.shift_remove(&name) {
                    object.insert(name, extension);
                }
            }
            object.values_mut().for_each(sort_extensions);
        }
        _ => {}
    }
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
    for (request, _) in ANY_JOB_REQUESTS {
        schemas[request]["discriminator"] = json!(job_discriminator());
    }
}

fn type_report(path: &str, operation: &mut Value) {
    if path.ends_with("/report") {
        operation["responses"]["200"]["content"]["application/json"]["schema"] = report_of(path);
    }
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

/// An example of every problem, by its status, and of every document, by its schema.
fn shared_examples(recorded: &Value) -> Value {
    let problems = recorded["problems"].as_object().into_iter().flatten();
    let problems = problems.map(|(status, problem)| {
        let example = json!({"summary": problem["title"], "value": problem});
        (format!("Problem{status}"), example)
    });
    let documents = recorded["documents"].as_object().into_iter().flatten();
    let documents = documents.map(|(schema, value)| (schema.clone(), json!({ "value": value })));
    Value::Object(documents.chain(problems).collect())
}

/// Adds the recorded requests, answers and parts of paths.
fn add_examples(path: &str, operation: &mut Value, recorded: &Value) {
    let id = operation["operationId"].as_str().unwrap_or_default();
    let own = &recorded["operations"][id];
    if let Some(request) = operation.get_mut("requestBody") {
        add_body_examples(request, &own["request"], recorded);
    }
    for (status, answer) in answers(operation) {
        add_body_examples(answer, &own[status], recorded);
        for (media_type, content) in contents(answer) {
            if media_type == MEDIA_TYPE
                && content.get("example").is_none()
                && recorded["problems"].get(status).is_some()
            {
                content["examples"] = example_reference(&format!("Problem{status}"));
            }
        }
    }
    let first_file = operation["x-files"]
        .as_object()
        .and_then(|files| files.keys().next().cloned());
    let parameters = operation
        .get_mut("parameters")
        .and_then(Value::as_array_mut);
    for parameter in parameters.into_iter().flatten() {
        let (place, name) = (parameter["in"].as_str(), parameter["name"].as_str());
        let (Some("path"), Some(name)) = (place, name) else {
            continue;
        };
        let example = match &first_file {
            Some(file) if name == "file" => file.as_str().into(),
            _ => part_of_path(path, name, recorded).clone(),
        };
        if !example.is_null() {
            parameter["example"] = example;
        }
    }
}

/// The recorded value of the part `name` of `path`: one for each collection.
fn part_of_path<'r>(path: &str, name: &str, recorded: &'r Value) -> &'r Value {
    let part = format!("{{{name}}}");
    let end = path.find(&part).map_or(0, |start| start + part.len());
    &recorded["parameters"][&path[..end]]
}

fn add_request_id(operation: &mut Value) {
    let parameter = json!({
        "name": "X-Request-Id",
        "in": "header",
        "required": false,
        "description": "Names the request in the log; the answer repeats it",
        "schema": {"type": "string"},
    });
    match operation
        .get_mut("parameters")
        .and_then(Value::as_array_mut)
    {
        Some(parameters) => parameters.push(parameter),
        None => operation["parameters"] = json!([parameter]),
    }
}

/// Adds to each content of a request or an answer its own example, or that of its schema.
fn add_body_examples(body: &mut Value, own: &Value, recorded: &Value) {
    for (media_type, content) in contents(body) {
        if let Some(example) = own.get(media_type) {
            content["example"] = example.clone();
        } else if let Some(name) = documented_name(&content["schema"], recorded) {
            content["examples"] = example_reference(&name);
        }
    }
}

/// The first of the schemas which `schema` may be of which a document is recorded.
fn documented_name(schema: &Value, recorded: &Value) -> Option<String> {
    let one_of = ["oneOf", "anyOf"].map(|key| schema[key].as_array());
    let parts = one_of.into_iter().flatten().flatten();
    let mut names = std::iter::once(schema)
        .chain(parts)
        .filter_map(|schema| schema["$ref"].as_str()?.rsplit('/').next());
    let name = names.find(|name| recorded["documents"].get(name).is_some())?;
    Some(name.to_owned())
}

fn example_reference(name: &str) -> Value {
    json!({"recorded": {"$ref": format!("#/components/examples/{name}")}})
}

/// Queries of operations that are refused without one. The erasure is a dry run.
const SAMPLE_QUERIES: [(&str, &str); 2] = [
    ("delete_volumes", "patient=PAT-0042&dry_run=true"),
    ("revoke_keys_of_owner", "owner=contractor-7"),
];

/// Longest request that stands in a command line; longer ones are a file.
const SAMPLE_REQUEST_BYTES: usize = 600;

/// A command line for curl; `$U` stands for the service's address.
fn command_line(path: &str, method: &str, operation: &Value, recorded: &Value) -> String {
    let id = operation["operationId"].as_str().unwrap_or_default();
    let mut url = path.to_owned();
    for parameter in operation["parameters"].as_array().into_iter().flatten() {
        if let (Some(name), Some(value)) =
            (parameter["name"].as_str(), parameter["example"].as_str())
        {
            url = url.replace(&format!("{{{name}}}"), value);
        }
    }
    let body = sample_body(&operation["requestBody"]["content"], recorded);
    let implied = if body.is_some() { "post" } else { "get" };
    let mut words = vec!["curl -fsS".to_owned()];
    if method != implied {
        words.push(format!("-X {}", method.to_ascii_uppercase()));
    }
    words.extend(body);
    if let Some((_, query)) = SAMPLE_QUERIES.iter().find(|(of, _)| *of == id) {
        url = format!("{url}?{query}");
    }
    words.push(format!("\"$U{url}\""));
    let answers = operation["responses"]["200"]["content"].as_object();
    let bytes = |content: &Value| content["schema"]["format"] == "binary";
    let file = operation.get("x-files").is_some();
    if file || answers.is_some_and(|answers| answers.values().all(bytes)) {
        let name = url.rsplit('/').next().unwrap_or_default();
        words.push(format!("-o {name}"));
    }
    words.join(" ")
}

/// The flags of curl that send a request with one of these contents.
fn sample_body(contents: &Value, recorded: &Value) -> Option<String> {
    if contents.get("application/octet-stream").is_some() {
        return Some("--data-binary @scan.nii.gz".into());
    }
    for (media_type, file) in [
        ("application/dicom", "image.dcm"),
        ("application/dicom+json", "workitem.json"),
    ] {
        if contents.get(media_type).is_some() {
            return Some(format!(
                "-H 'content-type: {media_type}' --data-binary @{file}"
            ));
        }
    }
    let json = contents.get("application/json")?;
    let reference = json["examples"]["recorded"]["$ref"].as_str();
    let shared = reference
        .and_then(|text| text.rsplit('/').next())
        .map(|name| &recorded["documents"][name]);
    let request = json.get("example").or(shared).map(Value::to_string);
    let data = match request {
        Some(request) if request.len() <= SAMPLE_REQUEST_BYTES => format!("-d '{request}'"),
        _ => "--data-binary @request.json".into(),
    };
    Some(format!("-H 'content-type: application/json' {data}"))
}

#[cfg(test)]
mod tests {
    use serde_json::Value;

    /// The schema that `schema` stands for: what it refers to, or its part that is no `null`.
    fn resolved<'a>(document: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
        if let Some(path) = schema["$ref"].as_str() {
            let found = document.pointer(path.trim_start_matches('#')).unwrap();
            return resolved(document, found);
        }
        let parts = ["oneOf", "anyOf", "allOf"].map(|name| schema[name].as_array());
        let parts: Vec<&Value> = parts.into_iter().flatten().flatten().collect();
        if parts.is_empty() {
            return vec![schema];
        }
        parts
            .into_iter()
            .flat_map(|part| resolved(document, part))
            .collect()
    }

    fn at<'a>(document: &'a Value, schema: &'a Value, place: &str) -> Option<&'a Value> {
        place.split('/').try_fold(schema, |schema, name| {
            let parts = resolved(document, schema);
            parts.iter().find_map(|part| {
                let free = part["additionalProperties"].as_object().is_some()
                    || part["additionalProperties"] == Value::Bool(true);
                let free = free.then(|| &part["additionalProperties"]);
                part["properties"].get(name).or(free)
            })
        })
    }

    #[test]
    fn every_figure_has_its_place_in_the_schema_of_its_report() {
        let document = crate::router::document();
        let schemas = document["components"]["schemas"].as_object().unwrap();
        let mut rows = 0;
        for (name, schema) in schemas {
            for row in schema["x-figures"].as_array().into_iter().flatten() {
                rows += 1;
                for place in ["place", "interval", "verdict", "needs", "unless"] {
                    let Some(place) = row[place].as_str() else {
                        continue;
                    };
                    assert!(at(&document, schema, place).is_some(), "{name}: {place}");
                }
                let about = row["about"].as_str().unwrap();
                assert!(about.ends_with('.') && row["label"].is_string(), "{row}");
                if let (Some(field), "ModelReport") = (row["flat_name"].as_str(), name.as_str()) {
                    let summary = &schemas["ModelSummary"]["properties"];
                    assert!(summary.get(field).is_some(), "{name}: {field}");
                }
            }
        }
        let tables = ventriform::results::figures::TABLES.iter();
        assert_eq!(rows, tables.map(|(_, rows)| rows.len()).sum::<usize>());
    }
}
