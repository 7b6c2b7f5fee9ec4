//! The parts of the document's JSON that every step goes through.

use serde_json::Value;

/// Path, method and content of every operation.
pub fn operations(document: &mut Value) -> impl Iterator<Item = (&str, &str, &mut Value)> {
    let paths = document["paths"].as_object_mut();
    paths.into_iter().flatten().flat_map(|(path, item)| {
        let methods = item.as_object_mut().into_iter().flatten();
        methods
            .filter(|(_, operation)| operation["operationId"].is_string())
            .map(|(method, operation)| (path.as_str(), method.as_str(), operation))
    })
}

/// Media type and content of a request or an answer.
pub fn contents(body: &mut Value) -> impl Iterator<Item = (&str, &mut Value)> {
    let contents = body.get_mut("content").and_then(Value::as_object_mut);
    let contents = contents.into_iter().flatten();
    contents.map(|(media_type, content)| (media_type.as_str(), content))
}

/// Every answer of an operation, with its status.
pub fn answers(operation: &mut Value) -> impl Iterator<Item = (&str, &mut Value)> {
    let answers = operation
        .get_mut("responses")
        .and_then(Value::as_object_mut);
    let answers = answers.into_iter().flatten();
    answers.map(|(status, answer)| (status.as_str(), answer))
}
