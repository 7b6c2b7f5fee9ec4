//! Numbers, JSON and pictures as text.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::Value;

/// A file as a `data:` URI.
pub fn data_uri(media_type: &str, bytes: &[u8]) -> String {
    format!("data:{media_type};base64,{}", STANDARD.encode(bytes))
}

/// `x` with `decimals` decimals and a true minus sign; a dash for NaN and infinity. Zero has no
/// sign.
pub fn number(x: f64, decimals: usize) -> String {
    if !x.is_finite() {
        return "–".to_owned();
    }
    let text = format!("{x:.decimals$}");
    let zero = text.chars().all(|c| matches!(c, '-' | '0' | '.'));
    let text = if zero { text.replace('-', "") } else { text };
    text.replace('-', "−")
}

/// [`number`] with a plus sign above zero.
pub fn signed(x: f64, decimals: usize) -> String {
    let text = number(x, decimals);
    let above = x > 0.0 && text.chars().any(|c| ('1'..='9').contains(&c));
    if above { format!("+{text}") } else { text }
}

/// The leaves of a JSON value in order, each with its dotted path. A list is one leaf.
pub fn leaves(value: &Value) -> Vec<(String, String)> {
    let mut leaves = Vec::new();
    collect(String::new(), value, &mut leaves);
    leaves
}

fn collect(path: String, value: &Value, leaves: &mut Vec<(String, String)>) {
    match value {
        Value::Object(map) => {
            for (key, value) in map {
                let path = if path.is_empty() {
                    key.clone()
                } else {
                    format!("{path}.{key}")
                };
                collect(path, value, leaves);
            }
        }
        _ => leaves.push((path, plain(value))),
    }
}

fn plain(value: &Value) -> String {
    match value {
        Value::Null => "–".to_owned(),
        Value::Bool(yes) => if *yes { "yes" } else { "no" }.to_owned(),
        Value::String(text) => text.clone(),
        Value::Number(n) if n.is_f64() => short(n.as_f64().unwrap_or(f64::NAN)),
        Value::Array(items) => items.iter().map(plain).collect::<Vec<_>>().join(", "),
        other => other.to_string(),
    }
}

/// Six significant digits or fewer, without trailing zeros.
fn short(x: f64) -> String {
    if x == 0.0 || !x.is_finite() {
        return number(x, 0);
    }
    let decimals = (5.0 - x.abs().log10().floor()).clamp(0.0, 12.0) as usize;
    let text = number(x, decimals);
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_read_as_people_write_them() {
        assert_eq!(number(-0.001, 2), "0.00");
        assert_eq!(number(-1.5, 1), "−1.5");
        assert_eq!(signed(0.25, 2), "+0.25");
        assert_eq!(signed(0.001, 2), "0.00");
        assert_eq!(number(f64::NAN, 2), "–");
        assert_eq!(short(0.1 + 0.2), "0.3");
        assert_eq!(short(1234567.0), "1234567");
        assert_eq!(short(2.0), "2");
    }

    #[test]
    fn leaves_keep_order_and_path() {
        let value = json!({ "b": { "x": 1, "y": [1.5, 2] }, "a": true });
        let expected = [("b.x", "1"), ("b.y", "1.5, 2"), ("a", "yes")];
        assert_eq!(
            leaves(&value),
            expected.map(|(k, v)| (k.to_owned(), v.to_owned()))
        );
    }
}
