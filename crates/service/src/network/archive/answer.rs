//! The values that are read of an archive's JSON answer.
//!
//! In: the bytes, and the path of the value that is looked for. Out: that value. Everything else is parsed and dropped,
//! so that memory is bounded by what is kept: a tree of JSON values has up to 50 times as many bytes as its text.

use crate::base::error::AttemptError;
use crate::base::records::Fault;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde_json::Deserializer;
use std::fmt;

/// One step of a path into a JSON value.
#[derive(Debug, Clone, Copy)]
pub(super) enum Step {
    /// To the member of that name of an object.
    Member(&'static str),
    /// To the first entry of an array.
    First,
}

/// The value at the end of a path.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Read {
    /// No value.
    Nothing,
    /// A text that is not too long.
    Text(String),
    /// A whole number.
    Number(u64),
    /// Another value.
    Other,
}

/// Longest text that is kept, bytes: a UID has no more (PS3.5, 9.1).
pub(super) const TEXT_BYTES: usize = 64;

/// A value, and how far a path to it leads.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Found {
    /// Number of steps of the path, from its beginning, that lead to a value.
    pub steps: usize,
    /// The value at its end.
    pub value: Read,
}

/// The value at the end of that path in a JSON value, and how far the path leads.
///
/// # Errors
/// If it is no JSON.
pub(super) fn find(json: &[u8], path: &[Step]) -> serde_json::Result<Found> {
    whole(json, At(path))
}

/// The texts at the end of that path in every entry of a JSON array.
///
/// # Errors
/// If it is no JSON array, has more than `most` entries, or one of them has no text of at most [`TEXT_BYTES`] there.
pub(super) fn listed(json: &[u8], path: &[Step], most: usize) -> serde_json::Result<Vec<String>> {
    let at = At(path);
    whole(json, Listed { at, most })
}

/// The value of `seed` from all of a JSON text.
fn whole<'de, S: DeserializeSeed<'de>>(json: &'de [u8], seed: S) -> serde_json::Result<S::Value> {
    let mut deserializer = Deserializer::from_slice(json);
    let value = seed.deserialize(&mut deserializer)?;
    deserializer.end()?;
    Ok(value)
}

/// Reads what is at the end of a path.
#[derive(Clone, Copy)]
struct At<'p>(&'p [Step]);

impl At<'_> {
    /// A text, number or the like: `value` where the path ends at it, else nothing.
    fn scalar(self, value: Read) -> Found {
        Found {
            steps: 0,
            value: if self.0.is_empty() {
                value
            } else {
                Read::Nothing
            },
        }
    }
}

impl Found {
    const NOTHING: Self = Self {
        steps: 0,
        value: Read::Nothing,
    };

    /// The same, one step further from the beginning.
    fn deeper(self) -> Self {
        Self {
            steps: self.steps + 1,
            ..self
        }
    }
}

impl<'de> DeserializeSeed<'de> for At<'_> {
    type Value = Found;

    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<Found, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for At<'_> {
    type Value = Found;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Found, A::Error> {
        let Some((Step::Member(name), path)) = self.0.split_first() else {
            while map.next_entry::<IgnoredAny, IgnoredAny>()?.is_some() {}
            return Ok(self.scalar(Read::Other));
        };
        let mut found = Found::NOTHING;
        while let Some(named) = map.next_key_seed(Named(name))? {
            if named {
                found = map.next_value_seed(At(path))?.deeper();
            } else {
                map.next_value::<IgnoredAny>()?;
            }
        }
        Ok(found)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Found, A::Error> {
        let found = match self.0.split_first() {
            Some((Step::First, path)) => {
                let first = array.next_element_seed(At(path))?;
                first.map_or(Found::NOTHING, Found::deeper)
            }
            _ => self.scalar(Read::Other),
        };
        while array.next_element::<IgnoredAny>()?.is_some() {}
        Ok(found)
    }

    fn visit_str<E>(self, text: &str) -> Result<Found, E> {
        if self.0.is_empty() && text.len() <= TEXT_BYTES {
            return Ok(self.scalar(Read::Text(text.to_owned())));
        }
        Ok(self.scalar(Read::Other))
    }

    fn visit_u64<E>(self, number: u64) -> Result<Found, E> {
        Ok(self.scalar(Read::Number(number)))
    }

    fn visit_i64<E>(self, _: i64) -> Result<Found, E> {
        Ok(self.scalar(Read::Other))
    }

    fn visit_f64<E>(self, _: f64) -> Result<Found, E> {
        Ok(self.scalar(Read::Other))
    }

    fn visit_bool<E>(self, _: bool) -> Result<Found, E> {
        Ok(self.scalar(Read::Other))
    }

    fn visit_unit<E>(self) -> Result<Found, E> {
        Ok(self.scalar(Read::Other))
    }
}

/// Whether a member has that name.
struct Named<'n>(&'n str);

impl<'de> DeserializeSeed<'de> for Named<'_> {
    type Value = bool;

    fn deserialize<D: serde::Deserializer<'de>>(self, deserializer: D) -> Result<bool, D::Error> {
        deserializer.deserialize_str(self)
    }
}

impl Visitor<'_> for Named<'_> {
    type Value = bool;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the name of a member")
    }

    fn visit_str<E>(self, name: &str) -> Result<bool, E> {
        Ok(name == self.0)
    }
}

/// Reads the texts of a list.
struct Listed<'p> {
    at: At<'p>,
    most: usize,
}

impl<'de> DeserializeSeed<'de> for Listed<'_> {
    type Value = Vec<String>;

    fn deserialize<D: serde::Deserializer<'de>>(
        self,
        deserializer: D,
    ) -> Result<Vec<String>, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Listed<'_> {
    type Value = Vec<String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON array")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut array: A) -> Result<Vec<String>, A::Error> {
        let mut texts = Vec::new();
        while let Some(found) = array.next_element_seed(self.at)? {
            let Read::Text(text) = found.value else {
                return Err(A::Error::custom("an entry without the text"));
            };
            if texts.len() == self.most {
                return Err(A::Error::custom("too many entries"));
            }
            texts.push(text);
        }
        Ok(texts)
    }
}

/// An archive's answer that is not what the standard asks for.
pub(super) fn unexpected_answer(what: impl Into<String>) -> AttemptError {
    AttemptError::permanent(
        Fault::Service,
        "archive-answer",
        what,
        "Ask the operator to compare `dicomweb` in the settings with the archive's documentation.",
    )
}
