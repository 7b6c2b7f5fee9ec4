//! Query strings: one struct both reads and documents them.
//!
//! `#[derive(Deserialize, IntoParams)]` on a struct of the route makes its fields parameters. A route takes
//! [`NoQuery`], [`Query`] of such a struct or of a tuple of them, or a [`QueryReader`] if what it takes depends on the
//! request. A name that none of the structs has is refused, and so is a name that is given twice, unless its field is
//! a list.

use crate::wire::problem::{Answer, Problem, shorten};
use crate::wire::request::unknown;
use axum::extract::FromRequestParts;
use axum::http::request::Parts;
use serde::de::value::{SeqDeserializer, StrDeserializer};
use serde::de::{
    DeserializeOwned, DeserializeSeed, Deserializer, Error, Expected, MapAccess, SeqAccess,
    Unexpected, Visitor,
};
use serde::{Deserialize, forward_to_deserialize_any};
use std::convert::Infallible;
use std::fmt::{self, Display};
use std::str::FromStr;
use ventriform_service::base::records::{Timestamp, parse_rfc3339};

/// The query of a route: a struct, or a tuple of structs.
pub struct Query<T>(pub T);

/// The query of a route that takes no parameter.
pub type NoQuery = Query<()>;

impl<S: Send + Sync, T: DeserializeOwned> FromRequestParts<S> for Query<T> {
    type Rejection = Problem;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Answer<Self> {
        QueryReader::from_query(parts.uri.query()).all().map(Self)
    }
}

/// Pairs of a query string or form, of which structs take theirs.
#[derive(Clone)]
pub struct QueryReader {
    pairs: Vec<(String, String)>,
    /// The names that were taken.
    known: Vec<&'static str>,
}

impl<S: Send + Sync> FromRequestParts<S> for QueryReader {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        Ok(Self::from_query(parts.uri.query()))
    }
}

impl QueryReader {
    fn from_query(query: Option<&str>) -> Self {
        let pairs = form_urlencoded::parse(query.unwrap_or_default().as_bytes());
        Self::of_pairs(pairs.into_owned().collect())
    }

    /// Reads pairs of name and value.
    pub fn of_pairs(pairs: Vec<(String, String)>) -> Self {
        Self {
            pairs,
            known: Vec::new(),
        }
    }

    /// The name of the only pair, if its value is empty.
    pub fn bare(&self) -> Option<&str> {
        match &self.pairs[..] {
            [(name, value)] if value.is_empty() => Some(name),
            _ => None,
        }
    }

    /// The struct of the pairs that have the names of its fields.
    ///
    /// # Errors
    /// 400 if a value cannot be used or a name is given twice.
    pub fn take<T: DeserializeOwned>(&mut self) -> Answer<T> {
        T::deserialize(self).map_err(|refused| refused.at(""))
    }

    /// The pairs that were not taken.
    pub fn rest(self) -> Vec<(String, String)> {
        self.pairs
    }

    /// The struct of all pairs that were not taken.
    ///
    /// # Errors
    /// Those of [`QueryReader::take`], and 400 for a name that is none of its fields.
    pub fn all<T: DeserializeOwned>(mut self) -> Answer<T> {
        let taken = self.take()?;
        match self.pairs.first() {
            None => Ok(taken),
            Some((name, _)) => Err(unknown("query parameter", name, &self.known)),
        }
    }
}

/// A value that cannot be used.
#[derive(Debug)]
pub enum Refused {
    /// The value, and the description of those that can be.
    Value { given: String, expected: String },
    /// A name that is given more than once.
    Twice,
    /// One of these at the parameter it concerns.
    Named(Problem),
}

impl Refused {
    fn at(self, name: &str) -> Problem {
        match self {
            Self::Value { given, expected } => Problem::bad_request(
                "invalid-parameter",
                format!("`{name}` must be {expected}, not `{}`.", shorten(&given)),
            )
            .at(name)
            .fix(format!("Give {expected}, or leave it out.")),
            Self::Twice => Problem::bad_request(
                "repeated-parameter",
                format!("`{name}` is given more than once."),
            )
            .at(name)
            .fix("Give it only once."),
            Self::Named(problem) => problem,
        }
    }
}

impl Display for Refused {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{self:?}")
    }
}

impl std::error::Error for Refused {}

impl Error for Refused {
    fn custom<M: Display>(message: M) -> Self {
        Self::Named(Problem::internal(message))
    }

    fn invalid_value(given: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::Value {
            given: match given {
                Unexpected::Str(text) => text.to_owned(),
                other => other.to_string(),
            },
            expected: expected.to_string(),
        }
    }
}

impl<'de> Deserializer<'de> for &mut QueryReader {
    type Error = Refused;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Refused> {
        Err(Error::custom("a query is a struct or a tuple of structs"))
    }

    fn deserialize_unit<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_unit()
    }

    fn deserialize_tuple<V: Visitor<'de>>(self, _: usize, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_seq(self)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Refused> {
        self.known.extend(fields);
        let own = |(name, _): &mut (String, String)| fields.contains(&name.as_str());
        visitor.visit_map(Fields(self.pairs.extract_if(.., own).collect()))
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 f32 f64 char str string bytes byte_buf option
        unit_struct newtype_struct seq tuple_struct map enum identifier ignored_any
    }
}

/// The structs of a tuple.
impl<'de> SeqAccess<'de> for &mut QueryReader {
    type Error = Refused;

    fn next_element_seed<T: DeserializeSeed<'de>>(
        &mut self,
        seed: T,
    ) -> Result<Option<T::Value>, Refused> {
        seed.deserialize(&mut **self).map(Some)
    }
}

/// The pairs of one struct.
struct Fields(Vec<(String, String)>);

impl<'de> MapAccess<'de> for Fields {
    type Error = Refused;

    fn next_key_seed<K: DeserializeSeed<'de>>(
        &mut self,
        seed: K,
    ) -> Result<Option<K::Value>, Refused> {
        let name = self.0.first().map(|(name, _)| name.as_str());
        name.map(|name| seed.deserialize(StrDeserializer::new(name)))
            .transpose()
    }

    fn next_value_seed<V: DeserializeSeed<'de>>(&mut self, seed: V) -> Result<V::Value, Refused> {
        let name = self.0.first().map(|(name, _)| name.clone());
        let name = name.unwrap_or_default();
        let same = self.0.extract_if(.., |(other, _)| *other == name);
        let values = Values(same.map(|(_, text)| text).collect());
        seed.deserialize(values)
            .map_err(|refused| Refused::Named(refused.at(&name)))
    }
}

/// The values of one name.
struct Values(Vec<String>);

impl Values {
    fn only(mut self) -> Result<String, Refused> {
        let text = self.0.pop().unwrap_or_default();
        if self.0.is_empty() {
            Ok(text)
        } else {
            Err(Refused::Twice)
        }
    }

    fn parsed<T: FromStr>(self, expected: &str) -> Result<T, Refused> {
        let text = self.only()?;
        text.parse()
            .map_err(|_| Error::invalid_value(Unexpected::Str(&text), &expected))
    }
}

impl<'de> Deserializer<'de> for Values {
    type Error = Refused;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_string(self.only()?)
    }

    fn deserialize_bool<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_bool(self.parsed("`true` or `false`")?)
    }

    fn deserialize_u32<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_u32(self.parsed("a whole number")?)
    }

    fn deserialize_u64<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_u64(self.parsed("a whole number")?)
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_some(self)
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Refused> {
        visitor.visit_seq(SeqDeserializer::new(self.0.into_iter()))
    }

    forward_to_deserialize_any! {
        i8 i16 i32 i64 u8 u16 f32 f64 char str string bytes byte_buf unit unit_struct newtype_struct tuple
        tuple_struct map struct enum identifier ignored_any
    }
}

/// The value of a field that `parse` reads, for `deserialize_with`; `expected` describes the values that it takes.
///
/// # Errors
/// If it does not take the value.
pub fn parsed<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    parse: impl Fn(&str) -> Option<T>,
    expected: &str,
) -> Result<T, D::Error> {
    let text = String::deserialize(deserializer)?;
    parse(&text).ok_or_else(|| Error::invalid_value(Unexpected::Str(&text), &expected))
}

/// A moment as RFC 3339 writes it.
#[derive(Debug, Clone, Copy)]
pub struct Moment(pub Timestamp);

impl<'de> Deserialize<'de> for Moment {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let expected = "a moment as RFC 3339 writes it, such as 2026-11-22T08:00:00Z";
        parsed(deserializer, parse_rfc3339, expected).map(Self)
    }
}

/// The names of the fields of a struct.
pub fn fields_of<T: DeserializeOwned>() -> Vec<&'static str> {
    let mut reader = QueryReader::from_query(None);
    // All fields of a query may be absent.
    let _ = reader.take::<T>();
    reader.known
}
