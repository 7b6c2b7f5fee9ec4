//! What stands in several operations is said once, under `components`, and referred to.
//!
//! 1. Problems: one answer for each status. Where an operation says more of its status, that stands beside the
//!    reference. Answers without a body likewise.
//! 2. Parameters of requests and headers of answers that several operations have alike.

use super::walk::{answers, operations};
use crate::wire::problem::MEDIA_TYPE;
use serde_json::{Map, Value, json};
use std::cmp::Reverse;
use std::collections::BTreeMap;

/// Shares answers, headers and parameters of `document`.
pub fn share(document: &mut Value) {
    share_answers(document);
    share_headers(document);
    share_parameters(document);
}

/// The name of the shared answer in place of this one, if there is one.
fn shared_answer(status: &str, answer: &Value) -> Option<String> {
    let content = answer["content"].as_object();
    let problem = content.is_some_and(|content| {
        let own_example = || content[MEDIA_TYPE].get("example").is_some();
        content.len() == 1 && content.contains_key(MEDIA_TYPE) && !own_example()
    });
    let bare = content.is_none() && answer.get("headers").is_none();
    match (problem, bare) {
        (true, _) => Some(format!("Problem{status}")),
        (_, true) => Some(format!("Answer{status}")),
        _ => None,
    }
}

fn share_answers(document: &mut Value) {
    // Of every shared answer: itself, and how often each description stands.
    let mut shared: BTreeMap<String, (Value, BTreeMap<String, usize>)> = BTreeMap::new();
    for (_, _, operation) in operations(document) {
        for (status, answer) in answers(operation) {
            if let Some(name) = shared_answer(status, answer) {
                let (_, descriptions) = shared
                    .entry(name)
                    .or_insert_with(|| (answer.clone(), BTreeMap::new()));
                *descriptions.entry(description_of(answer)).or_default() += 1;
            }
        }
    }
    for (answer, descriptions) in shared.values_mut() {
        let usual = descriptions.iter().max_by_key(|(_, uses)| **uses);
        answer["description"] = json!(usual.map(|(text, _)| text));
    }
    for (_, _, operation) in operations(document) {
        for (status, answer) in answers(operation) {
            let Some(name) = shared_answer(status, answer) else {
                continue;
            };
            let mut reference = json!({"$ref": format!("#/components/responses/{name}")});
            let own = description_of(answer);
            if shared[&name].0["description"] != own.as_str() {
                reference["description"] = own.into();
            }
            *answer = reference;
        }
    }
    let shared: Map<String, Value> = shared
        .into_iter()
        .map(|(name, (answer, _))| (name, answer))
        .collect();
    document["components"]["responses"] = shared.into();
}

fn description_of(answer: &Value) -> String {
    answer["description"]
        .as_str()
        .unwrap_or_default()
        .to_owned()
}

fn share_headers(document: &mut Value) {
    let mut repeated = Repeated::default();
    for (_, _, operation) in operations(document) {
        let id = id_of(operation);
        for (_, answer) in answers(operation) {
            for (name, header) in answer["headers"].as_object().into_iter().flatten() {
                repeated.add(&pascal(name), &id, header);
            }
        }
    }
    let names = repeated.names();
    for (_, _, operation) in operations(document) {
        for (_, answer) in answers(operation) {
            if let Some(headers) = answer.get_mut("headers").and_then(Value::as_object_mut) {
                let headers = headers.values_mut();
                headers.for_each(|header| refer(header, &names, "headers"));
            }
        }
    }
    add_components(document, "headers", names);
}

fn share_parameters(document: &mut Value) {
    let mut repeated = Repeated::default();
    for (path, _, operation) in operations(document) {
        let id = id_of(operation);
        for parameter in operation["parameters"].as_array().into_iter().flatten() {
            if parameter.get("$ref").is_none() {
                repeated.add(&parameter_name(path, parameter), &id, parameter);
            }
        }
    }
    let names = repeated.names();
    for (_, _, operation) in operations(document) {
        if let Some(parameters) = operation
            .get_mut("parameters")
            .and_then(Value::as_array_mut)
        {
            let parameters = parameters.iter_mut();
            parameters.for_each(|parameter| refer(parameter, &names, "parameters"));
        }
    }
    add_components(document, "parameters", names);
}

fn id_of(operation: &Value) -> String {
    operation["operationId"]
        .as_str()
        .unwrap_or_default()
        .to_owned()
}

/// The name of a parameter under `components`: a segment of a path is named after the one before it, `ModelsId`.
fn parameter_name(path: &str, parameter: &Value) -> String {
    let name = parameter["name"].as_str().unwrap_or_default();
    let before = match parameter["in"].as_str() {
        Some("path") => path.split_once(&format!("/{{{name}}}")),
        _ => None,
    };
    let before = before.and_then(|(before, _)| before.rsplit('/').next());
    format!("{}{}", pascal(before.unwrap_or_default()), pascal(name))
}

/// `if-none-match` as `IfNoneMatch`.
fn pascal(name: &str) -> String {
    let words = name.split(|letter: char| !letter.is_ascii_alphanumeric());
    words
        .map(|word| {
            let (first, rest) = word.split_at(word.len().min(1));
            first.to_ascii_uppercase() + rest
        })
        .collect()
}

/// Values that may stand in several operations.
#[derive(Default)]
struct Repeated {
    /// By the value's text.
    uses: BTreeMap<String, Use>,
}

struct Use {
    name: String,
    /// The operation that has it first.
    operation: String,
    value: Value,
    number: usize,
    /// How many values were met before it.
    place: usize,
}

/// Of the text of every value that stands more than once: its name under `components`, and itself.
type SharedNames = BTreeMap<String, (String, Value)>;

impl Repeated {
    fn add(&mut self, name: &str, operation: &str, value: &Value) {
        let place = self.uses.len();
        let first = || Use {
            name: name.to_owned(),
            operation: operation.to_owned(),
            value: value.clone(),
            number: 0,
            place,
        };
        let entry = self.uses.entry(value.to_string()).or_insert_with(first);
        entry.number += 1;
    }

    /// Of several values of one name, the one that stands most often has the plain name, and the others are named
    /// after their operations, too.
    fn names(self) -> SharedNames {
        let mut uses: Vec<_> = self.uses.into_iter().collect();
        uses.retain(|(_, one)| one.number > 1);
        uses.sort_by_key(|(_, one)| (Reverse(one.number), one.place));
        let mut taken = Vec::new();
        let named = uses.into_iter().map(|(text, one)| {
            let mut name = one.name;
            if taken.contains(&name) {
                name = format!("{name}Of{}", pascal(&one.operation));
            }
            taken.push(name.clone());
            (text, (name, one.value))
        });
        named.collect()
    }
}

/// Replaces `value` by a reference to itself under `components`, if it stands there.
fn refer(value: &mut Value, names: &SharedNames, group: &str) {
    if let Some((name, _)) = names.get(&value.to_string()) {
        *value = json!({"$ref": format!("#/components/{group}/{name}")});
    }
}

fn add_components(document: &mut Value, group: &str, names: SharedNames) {
    let named: BTreeMap<String, Value> = names.into_values().collect();
    let mut all = document["components"][group].take();
    let all = match &mut all {
        Value::Object(known) => std::mem::take(known),
        _ => Map::new(),
    };
    let all: Map<String, Value> = all.into_iter().chain(named).collect();
    document["components"][group] = all.into();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_stands_twice_is_shared_and_says_what_it_said() {
        let problem = |description: &str| {
            json!({
                "description": description,
                "content": {MEDIA_TYPE: {"schema": {"type": "object"}}},
            })
        };
        let id = |text: &str| json!({"name": "id", "in": "path", "description": text});
        let prefer = |text: &str| json!({"name": "Prefer", "in": "header", "description": text});
        let operation = |name: &str, parameters: &[Value], answer: Value| json!({"operationId": name, "parameters": parameters, "responses": {"404": answer}});
        let mut document = json!({"components": {}, "paths": {
            "/v1/models/{id}": {
                "get": operation("get_model", &[id("The model's id"), prefer("a")], problem("Not there")),
                "delete": operation("delete_model", &[id("The model's id"), prefer("a")], problem("Not there")),
            },
            "/v1/volumes/{id}": {
                "get": operation("get_volume", &[id("The volume's id"), prefer("b")], problem("No volume")),
                "delete": operation("delete_volume", &[id("Alone"), prefer("b")], problem("Not there")),
                "patch": operation("name_volume", &[id("The volume's id"), prefer("a")], problem("Not there")),
            },
        }});
        let before = document.clone();
        share(&mut document);
        let components = &document["components"];
        let names: Vec<_> = components["parameters"]
            .as_object()
            .unwrap()
            .keys()
            .collect();
        assert_eq!(
            names,
            ["ModelsId", "Prefer", "PreferOfGetVolume", "VolumesId"]
        );
        assert_eq!(
            components["responses"]["Problem404"]["description"],
            "Not there"
        );
        let volume = &document["paths"]["/v1/volumes/{id}"]["get"];
        assert_eq!(
            volume["responses"]["404"],
            json!({"$ref": "#/components/responses/Problem404", "description": "No volume"})
        );
        // Alone it stays where it is.
        let alone = &document["paths"]["/v1/volumes/{id}"]["delete"]["parameters"][0];
        assert_eq!(*alone, id("Alone"));
        for path in ["/v1/models/{id}", "/v1/volumes/{id}"] {
            for (method, operation) in document["paths"][path].as_object().unwrap() {
                for (n, parameter) in operation["parameters"]
                    .as_array()
                    .unwrap()
                    .iter()
                    .enumerate()
                {
                    let told = parameter["$ref"].as_str().map_or(parameter, |text| {
                        document.pointer(text.trim_start_matches('#')).unwrap()
                    });
                    assert_eq!(*told, before["paths"][path][method]["parameters"][n]);
                }
            }
        }
    }
}
