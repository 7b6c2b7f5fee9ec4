//! JSON bodies: one struct both reads and documents them.
//!
//! `#[derive(Deserialize, ToSchema)]` on a struct makes its fields those of a body. A body is one struct, or several
//! that each take their fields. A name that none of them has is refused, and so is `null` where a field is read by
//! [`given`], unless it is an `Option<Option<_>>`.

use crate::app::App;
use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::query::fields_of;
use crate::wire::request::{bytes_of, json_object, object_of, parsed, unknown};
use axum::extract::Request;
use serde::de::{DeserializeOwned, Error, Unexpected};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

/// The object of a body, of which structs take their fields.
pub struct FieldReader {
    object: Map<String, Value>,
    /// The names that were taken.
    known: Vec<&'static str>,
}

impl FieldReader {
    /// The body of a request.
    ///
    /// # Errors
    /// As [`json_object`].
    pub async fn read(app: &App, request: Request) -> Answer<Self> {
        Ok(Self::from_object(json_object(app, request).await?))
    }

    /// The JSON merge patch (RFC 7396) in the body of a request.
    ///
    /// # Errors
    /// As [`json_object`].
    pub async fn read_patch(app: &App, request: Request) -> Answer<Self> {
        let types = ["application/merge-patch+json", "application/json"];
        let bytes = bytes_of(request, &types).await?;
        Ok(Self::from_object(parsed(app, bytes, object_of).await?))
    }

    /// The body in a JSON object.
    pub fn from_object(object: Map<String, Value>) -> Self {
        Self {
            object,
            known: Vec::new(),
        }
    }

    /// The struct of the fields that have its names.
    ///
    /// # Errors
    /// 422 for a value that cannot be used, 400 for a name below it that is unknown.
    pub fn take<T: DeserializeOwned>(&mut self) -> Answer<T> {
        let names = fields_of::<T>();
        let own = names
            .iter()
            .filter_map(|name| self.object.remove_entry(*name));
        let own = Value::Object(own.collect());
        self.known.extend(names);
        serde_path_to_error::deserialize(own)
            .map_err(|error| refused(&error.path().to_string(), &error.inner().to_string()))
    }

    /// The struct of all fields that were not taken.
    ///
    /// # Errors
    /// Those of [`FieldReader::take`], and 400 for a name that is none of its fields.
    pub fn all<T: DeserializeOwned>(mut self) -> Answer<T> {
        let taken = self.take()?;
        match self.object.keys().next() {
            None => Ok(taken),
            Some(name) => Err(unknown("field", name, &self.known)),
        }
    }
}

/// A field that may be absent, but is no `null`.
///
/// # Errors
/// If its value cannot be used.
pub fn given<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    field: D,
) -> Result<Option<T>, D::Error> {
    T::deserialize(field).map(Some)
}

/// The numbers that a database holds, as a message names them.
const COUNTS: &str = "a whole number from 0 to 9223372036854775807";

/// A number of things.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Count(pub u64);

impl<'de> Deserialize<'de> for Count {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let number = u64::deserialize(deserializer)?;
        match i64::try_from(number) {
            Ok(_) => Ok(Self(number)),
            Err(_) => Err(Error::invalid_value(Unexpected::Unsigned(number), &COUNTS)),
        }
    }
}

/// How serde names types, and how people do.
const TYPE_NAMES: [(&str, &str); 5] = [
    ("a map", "a JSON object"),
    ("struct ", "a JSON object"),
    ("a sequence", "a list"),
    ("a boolean", "true or false"),
    ("u64", COUNTS),
];

/// The problem of the field at `path` that serde refused with this message.
fn refused(path: &str, message: &str) -> Problem {
    if message.starts_with("unknown field") {
        let mut names = message.split('`').skip(1).step_by(2);
        let name = names.next().unwrap_or_default();
        let problem = unknown("field", name, &names.collect::<Vec<_>>());
        let outer = path
            .strip_suffix(name)
            .unwrap_or(path)
            .trim_end_matches('.');
        return problem.within(outer);
    }
    let (given, expected) = message.rsplit_once(", expected ").unwrap_or((message, ""));
    let named = TYPE_NAMES
        .iter()
        .find(|(type_name, _)| expected.starts_with(type_name));
    let expected = named.map_or(expected, |(_, name)| name);
    let given = shorten(given.split_once(": ").map_or(given, |(_, given)| given));
    let path = shorten(path);
    let detail = format!("`{path}` must be {expected}, not {given}.");
    Problem::invalid_field(&path, detail).fix(format!("Give {expected}."))
}

#[cfg(test)]
#[allow(
    clippy::unwrap_used,
    reason = "tests state their expectations by panicking"
)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::BTreeMap;

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Name {
        #[serde(default, deserialize_with = "given")]
        name: Option<String>,
        #[serde(default, deserialize_with = "given")]
        note: Option<Option<String>>,
    }

    #[derive(Debug, Deserialize)]
    struct Rest {
        count: Option<Count>,
        on: Option<bool>,
        names: Option<Vec<String>>,
        labels: Option<BTreeMap<String, String>>,
        below: Option<Name>,
    }

    fn read(body: Value) -> Answer<(Name, Rest)> {
        let mut body = FieldReader::from_object(body.as_object().unwrap().clone());
        Ok((body.take()?, body.all()?))
    }

    #[test]
    fn each_struct_of_a_body_takes_its_fields() {
        let (name, rest) = read(json!({
            "count": 3, "name": "a", "note": null, "labels": {"x": "y"}, "below": {"name": "b"},
        }))
        .unwrap();
        assert_eq!((name.name.as_deref(), name.note), (Some("a"), Some(None)));
        assert_eq!(
            (rest.count, &*rest.labels.unwrap()["x"]),
            (Some(Count(3)), "y")
        );
        assert_eq!(rest.below.unwrap().name.as_deref(), Some("b"));
        assert!(rest.on.is_none() && rest.names.is_none());
    }

    #[test]
    fn what_cannot_be_used_is_named() {
        for (body, field, said) in [
            (json!({"nmae": "a"}), "nmae", "There is no field `nmae`"),
            (
                json!({"name": 1}),
                "name",
                "`name` must be a string, not integer `1`",
            ),
            (
                json!({"name": null}),
                "name",
                "`name` must be a string, not null",
            ),
            (json!({"note": 1}), "note", "`note` must be a string"),
            (json!({"count": -1}), "count", "a whole number from 0"),
            (json!({"count": 1.5}), "count", "a whole number from 0"),
            (json!({"count": u64::MAX}), "count", "a whole number from 0"),
            (json!({"on": "true"}), "on", "true or false"),
            (json!({"names": "a"}), "names", "must be a list"),
            (json!({"names": ["a", 1]}), "names[1]", "must be a string"),
            (json!({"labels": {"x": 1}}), "labels.x", "must be a string"),
            (json!({"labels": []}), "labels", "must be a JSON object"),
            (json!({"below": "b"}), "below", "must be a JSON object"),
            (
                json!({"below": {"name": 1}}),
                "below.name",
                "must be a string",
            ),
            (
                json!({"below": {"nmae": 1}}),
                "below.nmae",
                "There is no field `nmae`",
            ),
        ] {
            let problem = read(body).unwrap_err().into_body();
            assert_eq!(problem.field.as_deref(), Some(field), "{problem:?}");
            assert!(problem.detail.contains(said), "{problem:?}");
            assert!(problem.fix.is_some_and(|fix| fix.len() > 8), "{field}");
        }
    }
}
