//! Which items match a search (PS3.18 section 8.3.4, PS3.4 C.2.2.2).

use super::dataset::values;
use dicom_core::dictionary::{DataDictionary, DataDictionaryEntry};
use dicom_dictionary_std::StandardDataDictionary;
use serde_json::{Map, Value};

/// Most attributes of a search.
const MOST_TERMS: usize = 16;
/// Longest value that is searched for, bytes, and longest one with wildcards: no text that they stand for is
/// longer (PS3.5, 6.2), and each character may be compared with each of a text.
const LONGEST_VALUE: usize = 4096;
const LONGEST_PATTERN: usize = 64;

/// A search cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{name}` {reason}")]
pub struct QueryError {
    /// The parameter.
    pub name: String,
    /// The faults of it.
    pub reason: &'static str,
}

/// Attributes and what each must have.
#[derive(Clone, Default, PartialEq, Eq)]
pub struct Matching(Vec<(Vec<String>, String)>);

impl Matching {
    /// Adds that an attribute, or one inside of sequences (with points between them), must match
    /// `value`. Attributes are named by tag or keyword.
    ///
    /// # Errors
    /// If a name is none, a value is too long, or there are too many.
    pub fn add(&mut self, name: &str, value: &str) -> Result<(), QueryError> {
        let wrong = |reason| QueryError {
            name: name.chars().take(80).collect(),
            reason,
        };
        if self.0.len() == MOST_TERMS {
            return Err(wrong("is one attribute more than a search may have"));
        }
        let is_pattern = value.contains(['*', '?']);
        if value.len() > LONGEST_VALUE || (is_pattern && value.chars().count() > LONGEST_PATTERN) {
            return Err(wrong("has too long a value"));
        }
        let tags: Option<Vec<String>> = name.split('.').map(tag).collect();
        let tags = tags.ok_or_else(|| wrong("is no attribute of DICOM"))?;
        self.0.push((tags, value.to_owned()));
        Ok(())
    }

    /// Whether something is searched for by wildcards, which takes longer.
    pub fn has_patterns(&self) -> bool {
        self.0.iter().any(|(_, value)| value.contains(['*', '?']))
    }

    /// Whether a data set matches.
    pub fn matches(&self, set: &Map<String, Value>) -> bool {
        self.0.iter().all(|(path, wanted)| found(set, path, wanted))
    }

    /// The value that the attribute with that tag must have, if it is asked for.
    pub fn wanted(&self, tag: &str) -> Option<&str> {
        let asked = self
            .0
            .iter()
            .find(|(path, _)| path.len() == 1 && path[0] == tag);
        asked.map(|(_, wanted)| wanted.as_str())
    }
}

/// The tag that a text names, by itself or by its keyword.
fn tag(name: &str) -> Option<String> {
    if name.len() == 8 && name.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Some(name.to_ascii_uppercase());
    }
    let entry = StandardDataDictionary.by_name(name)?;
    let tag = entry.tag();
    Some(format!("{:04X}{:04X}", tag.group(), tag.element()))
}

fn found(set: &Map<String, Value>, path: &[String], wanted: &str) -> bool {
    // An empty value matches everything.
    if wanted.is_empty() {
        return true;
    }
    let [first, rest @ ..] = path else {
        return false;
    };
    let Some(element) = set.get(first) else {
        return false;
    };
    let values = values(element).iter();
    if rest.is_empty() {
        let vr = element
            .get("vr")
            .and_then(Value::as_str)
            .unwrap_or_default();
        return values.into_iter().any(|value| is_match(vr, value, wanted));
    }
    let mut items = values.filter_map(Value::as_object);
    items.any(|item| found(item, rest, wanted))
}

fn is_match(vr: &str, value: &Value, wanted: &str) -> bool {
    let text = match value {
        Value::String(text) => text.clone(),
        Value::Number(number) => number.to_string(),
        Value::Object(name) => {
            let name = name.get("Alphabetic").and_then(Value::as_str);
            name.unwrap_or_default().to_owned()
        }
        _ => return false,
    };
    match vr {
        "UI" => wanted.split([',', '\\']).any(|uid| uid == text),
        "DA" | "DT" | "TM" => in_range(&text, wanted),
        "PN" => like(&text.to_lowercase(), &wanted.to_lowercase()),
        _ => like(&text, wanted),
    }
}

/// Whether a date or time lies in a range `FIRST-LAST`, of which one may be absent, or is `wanted`.
fn in_range(text: &str, wanted: &str) -> bool {
    let Some((first, last)) = wanted.split_once('-') else {
        return text.starts_with(wanted);
    };
    // A range of days includes all of the last one.
    let until = text.get(..last.len()).unwrap_or(text);
    (first.is_empty() || text >= first) && (last.is_empty() || until <= last)
}

/// Whether a text is like a pattern, in which `*` stands for any text and `?` for one character.
fn like(text: &str, pattern: &str) -> bool {
    let (text, pattern): (Vec<char>, Vec<char>) =
        (text.chars().collect(), pattern.chars().collect());
    let (mut at, mut next) = (0, 0);
    let mut star: Option<(usize, usize)> = None;
    while at < text.len() {
        if next < pattern.len() && pattern[next] == '*' {
            star = Some((at, next));
            next += 1;
        } else if next < pattern.len() && (pattern[next] == '?' || pattern[next] == text[at]) {
            at += 1;
            next += 1;
        } else if let Some((from, place)) = star {
            star = Some((from + 1, place));
            at = from + 1;
            next = place + 1;
        } else {
            return false;
        }
    }
    pattern[next..].iter().all(|c| *c == '*')
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn items_are_matched_as_the_standard_says() {
        let item = json!({
            "00741000": {"vr": "CS", "Value": ["SCHEDULED"]},
            "00741204": {"vr": "LO", "Value": ["Fit a ventricle"]},
            "00100010": {"vr": "PN", "Value": [{"Alphabetic": "Doe^Jane"}]},
            "00404005": {"vr": "DT", "Value": ["20261123101500"]},
            "00404021": {"vr": "SQ", "Value": [{"0020000D": {"vr": "UI", "Value": ["1.2.3"]}}]},
            "00080050": {"vr": "SH"},
        });
        let item = item.as_object().unwrap();
        for (name, value, expected) in [
            ("ProcedureStepState", "SCHEDULED", true),
            ("00741000", "COMPLETED", false),
            ("ProcedureStepLabel", "Fit*", true),
            ("ProcedureStepLabel", "?it a ventricl?", true),
            ("ProcedureStepLabel", "*it*ric*", true),
            ("ProcedureStepLabel", "it*", false),
            ("PatientName", "doe*", true),
            ("PatientName", "", true),
            ("PatientID", "", true),
            ("PatientID", "1", false),
            ("AccessionNumber", "1", false),
            ("ScheduledProcedureStepStartDateTime", "20261123", true),
            ("ScheduledProcedureStepStartDateTime", "20261123-", true),
            (
                "ScheduledProcedureStepStartDateTime",
                "20261122-20261123",
                true,
            ),
            ("ScheduledProcedureStepStartDateTime", "-20261122", false),
            ("InputInformationSequence.StudyInstanceUID", "9,1.2.3", true),
            ("00404021.0020000D", "9", false),
        ] {
            let mut matching = Matching::default();
            matching.add(name, value).unwrap();
            assert_eq!(matching.matches(item), expected, "{name}={value}");
        }
        assert!(Matching::default().add("PatientNme", "x").is_err());
        let mut matching = Matching::default();
        let long = "x".repeat(LONGEST_PATTERN);
        assert!(matching.add("PatientID", &format!("{long}*")).is_err());
        assert!(matching.add("PatientID", &long.repeat(100)).is_err());
        for _ in 0..MOST_TERMS {
            matching.add("PatientID", &long).unwrap();
        }
        assert!(matching.add("PatientID", &long).is_err());
    }
}
