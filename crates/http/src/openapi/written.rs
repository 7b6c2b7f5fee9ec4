//! The document as text: a line for each value, and one for each list or object that is short. So changes can be read, and the
//! file stays small.

use serde_json::Value;

/// The longest list or object that stands on one line, bytes.
const MOST_BYTES_ON_A_LINE: usize = 120;

/// `document` as text, with a line end.
pub fn written(document: &Value) -> String {
    let mut text = String::new();
    write(document, 0, &mut text);
    text.push('\n');
    text
}

fn write(value: &Value, depth: usize, text: &mut String) {
    let line = value.to_string();
    if is_plain(value) || line.len() <= MOST_BYTES_ON_A_LINE {
        text.push_str(&line);
        return;
    }
    let mut separator = "\n";
    let mut next = |text: &mut String| {
        text.push_str(separator);
        text.push_str(&" ".repeat(depth + 1));
        separator = ",\n";
    };
    let [open, close] = match value {
        Value::Object(_) => ['{', '}'],
        _ => ['[', ']'],
    };
    text.push(open);
    match value {
        Value::Object(object) => {
            for (name, own) in object {
                next(text);
                text.push_str(&Value::from(name.as_str()).to_string());
                text.push_str(": ");
                write(own, depth + 1, text);
            }
        }
        Value::Array(list) => {
            for own in list {
                next(text);
                write(own, depth + 1, text);
            }
        }
        _ => {}
    }
    text.push('\n');
    text.push_str(&" ".repeat(depth));
    text.push(close);
}

fn is_plain(value: &Value) -> bool {
    !value.is_object() && !value.is_array()
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn what_is_written_is_read_back_and_short_lists_stand_on_one_line() {
        let document = json!({
            "a": [1, "two", null], "b": {"$ref": "#/c"}, "c": [{"d": true}, []],
            "e": ["x".repeat(140), {}], "f": [vec!["y"; 60]],
        });
        let text = written(&document);
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), document);
        assert!(text.starts_with("{\n \"a\": [1,\"two\",null],\n \"b\": {\"$ref\":\"#/c\"},\n"));
        assert!(text.contains("\n \"c\": [{\"d\":true},[]],\n \"e\": [\n"));
    }
}
