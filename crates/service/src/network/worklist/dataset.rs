//! A data set as DICOM JSON (PS3.18 annex F): tags of eight hexadecimal digits, each with a value
//! representation and values.
//!
//! A work item is answered as it was sent, so its elements stay JSON; those of unknown representation become what the
//! standard makes them (`unknown`). `dicom-json` 0.9, tried on 18 elements, changes 8 of
//! them when it reads and writes them (all parts of a person's name become the alphabetic one, a `BulkDataURI` is
//! lost, an empty `Value` becomes an empty text, numbers become texts) and refuses a `null` item, which annex F allows.

use super::unknown;
use serde_json::{Map, Value, json};

/// Most nested sequences.
const MAX_SEQUENCE_DEPTH: usize = 16;

/// A data set is not DICOM JSON.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{tag}` is not an element of DICOM JSON: {reason}")]
pub struct Malformed {
    /// The element.
    pub tag: String,
    /// The faults of it.
    pub reason: &'static str,
}

/// A data set.
#[derive(Clone, Default, PartialEq)]
pub struct DataSetJson(Map<String, Value>);

impl std::fmt::Debug for DataSetJson {
    /// Shows no value: they are personal data.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DataSetJson").finish_non_exhaustive()
    }
}

impl DataSetJson {
    /// Checks that an object is a data set.
    ///
    /// # Errors
    /// The first element that is none.
    pub fn from_object(object: Map<String, Value>) -> Result<Self, Malformed> {
        check(&object, 0)?;
        let elements = object.into_iter().map(|(tag, element)| {
            let tag = tag.to_ascii_uppercase();
            let element = settled(&tag, element, MAX_SEQUENCE_DEPTH);
            (tag, element)
        });
        Ok(Self(elements.collect()))
    }

    /// The data set as it is stored.
    pub fn object(&self) -> &Map<String, Value> {
        &self.0
    }

    /// Whether there is an element with that tag, also an empty one.
    pub fn has(&self, tag: &str) -> bool {
        self.0.contains_key(tag)
    }

    /// The first text of an element.
    pub fn text(&self, tag: &str) -> Option<&str> {
        text_in(&self.0, tag).filter(|text| !text.is_empty())
    }

    /// Whether an element has a value.
    pub fn has_value(&self, tag: &str) -> bool {
        self.0
            .get(tag)
            .is_some_and(|element| !values(element).is_empty())
    }

    /// The items of a sequence.
    pub fn items(&self, tag: &str) -> impl Iterator<Item = &Map<String, Value>> {
        let element = self.0.get(tag).map(values).unwrap_or_default();
        element.iter().filter_map(Value::as_object)
    }

    /// Puts an element with one text.
    pub fn put(&mut self, tag: &str, vr: &str, text: &str) {
        self.0
            .insert(tag.to_owned(), json!({"vr": vr, "Value": [text]}));
    }

    /// Puts a sequence with one item.
    pub fn put_item(&mut self, tag: &str, item: Map<String, Value>) {
        self.0
            .insert(tag.to_owned(), json!({"vr": "SQ", "Value": [item]}));
    }

    /// Takes an element out.
    pub fn remove(&mut self, tag: &str) {
        self.0.remove(tag);
    }

    /// Replaces elements by those of another data set.
    pub fn replace(&mut self, by: Self) {
        self.0.extend(by.0);
    }
}

/// The first value of an element of `object`, if it is a text.
pub(super) fn text_in<'a>(object: &'a Map<String, Value>, tag: &str) -> Option<&'a str> {
    values(object.get(tag)?).first()?.as_str()
}

/// The values of an element.
pub(super) fn values(element: &Value) -> &[Value] {
    element
        .get("Value")
        .and_then(Value::as_array)
        .map_or(&[], Vec::as_slice)
}

/// An element with everything of unknown representation in it as the standard has it.
fn settled(tag: &str, element: Value, depth: usize) -> Value {
    let Value::Object(mut fields) = element else {
        return element;
    };
    if fields.get("vr").and_then(Value::as_str) == Some("UN")
        && let Some(known) = unknown::known(tag, &fields, depth)
    {
        return known;
    }
    if let Some(Value::Array(items)) = fields.get_mut("Value") {
        for item in items.iter_mut().filter_map(Value::as_object_mut) {
            for (tag, element) in item.iter_mut() {
                *element = settled(tag, element.take(), depth.saturating_sub(1));
            }
        }
    }
    Value::Object(fields)
}

fn check(object: &Map<String, Value>, depth: usize) -> Result<(), Malformed> {
    for (tag, element) in object {
        let wrong = |reason| {
            Err(Malformed {
                tag: tag.chars().take(16).collect(),
                reason,
            })
        };
        if tag.len() != 8 || !tag.bytes().all(|b| b.is_ascii_hexdigit()) {
            return wrong("its name must be a tag of eight hexadecimal digits");
        }
        let Some(fields) = element.as_object() else {
            return wrong("it must be an object with `vr` and `Value`");
        };
        let vr = fields.get("vr").and_then(Value::as_str);
        let is_vr = |vr: &str| vr.len() == 2 && vr.bytes().all(|b| b.is_ascii_uppercase());
        if !vr.is_some_and(is_vr) {
            return wrong("`vr` must be a value representation such as LO");
        }
        if fields.get("Value").is_some_and(|values| !values.is_array()) {
            return wrong("`Value` must be an array");
        }
        // An element of unknown representation may be a sequence.
        let holds_items = || values(element).iter().any(Value::is_object);
        if vr != Some("SQ") && !(vr == Some("UN") && holds_items()) {
            continue;
        }
        if depth == MAX_SEQUENCE_DEPTH {
            return wrong("there are too many nested sequences");
        }
        for item in values(element) {
            match item {
                Value::Object(item) => check(item, depth + 1)?,
                Value::Null => {}
                _ => return wrong("the items of a sequence must be objects"),
            }
        }
    }
    Ok(())
}
