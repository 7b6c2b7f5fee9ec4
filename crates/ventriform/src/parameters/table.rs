//! Tables of parameters: reading, checking and writing values by name.

use super::input::{Checked, RawValue};
use super::kind::Kind;
use super::{ParameterError, nearest};
use serde_json::{Map, Value};

/// One row of a table.
pub struct ParameterSpec<P: Parameters> {
    /// The name in queries, in JSON and on the command line (there also with `-` for `_`).
    pub name: &'static str,
    /// The name that people read; empty for `name` in words.
    pub title: &'static str,
    /// The heading that forms put it under ([`groups`](super::groups)).
    pub group: &'static str,
    /// The unit of its numbers; empty for none.
    pub unit: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// The default as a user would write it; empty if there is no fixed default.
    pub default: &'static str,
    /// One sentence for `--help`, the OpenAPI document and the README.
    pub summary: &'static str,
    /// Stores the checked value in the draft.
    pub(super) read: fn(&mut P::Draft, &Checked) -> Result<(), String>,
    /// The value as JSON; null if it is not set.
    pub(super) write: fn(&P) -> Value,
}

impl<P: Parameters> Clone for ParameterSpec<P> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<P: Parameters> Copy for ParameterSpec<P> {}

/// The rows of two tables, `N` together, as one.
pub(super) const fn joined<P: Parameters, const N: usize>(
    first: &[ParameterSpec<P>],
    second: &[ParameterSpec<P>],
) -> [ParameterSpec<P>; N] {
    let mut all = [first[0]; N];
    let mut at = 0;
    while at < N {
        all[at] = if at < first.len() {
            first[at]
        } else {
            second[at - first.len()]
        };
        at += 1;
    }
    all
}

/// `row` with a name that people read other than its own in words.
pub(super) const fn titled<P: Parameters>(
    title: &'static str,
    mut row: ParameterSpec<P>,
) -> ParameterSpec<P> {
    row.title = title;
    row
}

/// A row for one number: its kind and getter, name, field of the parameters (and of their draft),
/// range, default, group, unit and summary.
macro_rules! plain {
    (
        $kind:ident $getter:ident, $name:literal, $($field:ident).+ $([$index:literal])?,
        $min:literal..=$max:literal, $default:literal, $group:path, $unit:literal, $summary:literal
    ) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: $group,
            unit: $unit,
            kind: Kind::$kind {
                min: $min,
                max: $max,
            },
            default: $default,
            summary: $summary,
            read: |draft, value| {
                draft.$($field).+ $([$index])? = value.$getter();
                Ok(())
            },
            write: |parameters| json!(parameters.$($field).+ $([$index])?),
        }
    };
}
pub(super) use plain;

/// A row for one finite number; see [`plain!`].
macro_rules! number {
    ($($row:tt)*) => { $crate::parameters::table::plain!(Number f64, $($row)*) };
}
pub(super) use number;

/// A row for one whole number; see [`plain!`].
macro_rules! integer {
    ($($row:tt)*) => { $crate::parameters::table::plain!(Integer usize, $($row)*) };
}
pub(super) use integer;

/// A row for a number without a fixed default: its kind and getter, name, field of the draft,
/// field of the parameters, range, group, unit and summary.
macro_rules! optional {
    (
        $kind:ident $getter:ident, $name:literal, $($draft:ident).+ => $($field:ident).+,
        $min:literal..=$max:literal, $group:path, $unit:literal, $summary:literal
    ) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: $group,
            unit: $unit,
            kind: Kind::$kind {
                min: $min,
                max: $max,
            },
            default: "",
            summary: $summary,
            read: |draft, value| {
                draft.$($draft).+ = Some(value.$getter());
                Ok(())
            },
            write: |parameters| json!(parameters.$($field).+),
        }
    };
}
pub(super) use optional;

/// A row for a choice between words: name, field of the draft and of the parameters, default, group, summary,
/// the value of each word, and what the draft stores of a value.
macro_rules! words {
    (
        $name:literal, $($draft:ident).+ => $($field:ident).+, $default:literal, $group:path, $summary:literal,
        [$($word:literal => $value:path),+], $store:expr
    ) => {
        ParameterSpec {
            name: $name,
            title: "",
            group: $group,
            unit: "",
            kind: Kind::Choice(&[$($word),+]),
            default: $default,
            summary: $summary,
            read: |draft, value| {
                draft.$($draft).+ = $store(match value.text() {
                    $($word => $value,)+
                    other => return Err(format!("`{other}` is not one of the choices")),
                });
                Ok(())
            },
            write: |parameters| {
                json!(match parameters.$($field).+ {
                    $($value => $word),+
                })
            },
        }
    };
}
pub(super) use words;

/// A row for a choice between words: name, field, default, summary, and the value of each word.
macro_rules! choice {
    (
        $name:literal, $($field:ident).+, $default:literal, $group:path, $summary:literal,
        $($word:literal => $value:path),+ $(,)?
    ) => {
        $crate::parameters::table::words!(
            $name, $($field).+ => $($field).+, $default, $group, $summary, [$($word => $value),+],
            std::convert::identity
        )
    };
}
pub(super) use choice;

/// A row for a choice without a fixed default: name, field of the draft, field of the parameters,
/// summary, and the value of each word.
macro_rules! optional_choice {
    (
        $name:literal, $($draft:ident).+ => $($field:ident).+, $group:path, $summary:literal,
        $($word:literal => $value:path),+ $(,)?
    ) => {
        $crate::parameters::table::words!(
            $name, $($draft).+ => $($field).+, "", $group, $summary, [$($word => $value),+], Some
        )
    };
}
pub(super) use optional_choice;

/// A set of parameters with a table of names.
pub trait Parameters: Sized + 'static {
    /// The values given so far.
    type Draft: Default;

    /// The table, in the order in which the stages use the values.
    const PARAMETER_SPECS: &'static [ParameterSpec<Self>];

    /// Alternative names: (alternative, name in the table).
    const NAME_ALIASES: &'static [(&'static str, &'static str)] = &[];

    /// Fills in the defaults that depend on other parameters.
    ///
    /// # Errors
    /// A [`ParameterError`] if parameters contradict each other.
    fn finish(draft: Self::Draft) -> Result<Self, ParameterError>;

    /// Reads parameters given as text, from a query string or a command line.
    ///
    /// # Errors
    /// A [`ParameterError`] that names the first field that is unknown (with the nearest
    /// valid name), given twice, malformed, out of range or in contradiction with another.
    fn from_pairs<'a>(
        pairs: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, ParameterError> {
        from_inputs(
            pairs
                .into_iter()
                .map(|(name, text)| (name, RawValue::Text(text))),
        )
    }

    /// Reads parameters given as a JSON object. Types are strict: `"150"` is not a number.
    ///
    /// # Errors
    /// As [`Parameters::from_pairs`].
    fn from_json(object: &Map<String, Value>) -> Result<Self, ParameterError> {
        from_inputs(
            object
                .iter()
                .map(|(name, value)| (name.as_str(), RawValue::Json(value))),
        )
    }

    /// Every parameter that is set, by name, including defaults. [`Parameters::from_json`] reads it
    /// back.
    fn to_json(&self) -> Map<String, Value> {
        Self::PARAMETER_SPECS
            .iter()
            .map(|spec| (spec.name.to_owned(), (spec.write)(self)))
            .filter(|(_, value)| !value.is_null())
            .collect()
    }
}

pub(super) fn from_inputs<'a, P: Parameters>(
    inputs: impl Iterator<Item = (&'a str, RawValue<'a>)>,
) -> Result<P, ParameterError> {
    let mut draft = P::Draft::default();
    let mut seen = Vec::new();
    for (name, input) in inputs {
        let spec = find::<P>(name)?;
        let refuse = |message: String| ParameterError {
            field: name.into(),
            message,
            fix: spec.fix(),
        };
        if seen.contains(&spec.name) {
            return Err(refuse("given more than once".into()));
        }
        seen.push(spec.name);
        let checked = input.check(&spec.kind).map_err(refuse)?;
        (spec.read)(&mut draft, &checked).map_err(refuse)?;
    }
    P::finish(draft)
}

impl<P: Parameters> ParameterSpec<P> {
    /// The name that people read.
    pub fn shown_name(&self) -> String {
        if !self.title.is_empty() {
            return self.title.to_owned();
        }
        let words = self.name.replace('_', " ");
        let (first, rest) = words.split_at(1);
        first.to_uppercase() + rest
    }

    /// A sentence with the valid values.
    fn fix(&self) -> String {
        let range = match self.kind {
            Kind::Integer { min, max: u64::MAX } => format!("a whole number from {min}"),
            Kind::Integer { min, max } => format!("a whole number from {min} to {max}"),
            Kind::Number { min, max } => format!("a number from {min} to {max}"),
            Kind::Switch => "true or false".into(),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
            Kind::Direction(words) => {
                let words = words.join(", ");
                format!("{words}, or a direction as 3 finite numbers separated by commas")
            }
            Kind::Integers { count } => format!("{count} whole numbers separated by commas"),
            Kind::Numbers { count } => format!("{count} finite numbers separated by commas"),
            Kind::Points { most } => {
                format!("1 to {most} points as finite numbers separated by commas, 3 for each")
            }
            Kind::Text { example, .. } => format!("for example {example}"),
            Kind::Stored {
                prefixes, word: "", ..
            } => {
                format!("an id that begins with {}", prefixes.join(" or "))
            }
            Kind::Stored {
                prefixes,
                word,
                more,
            } => {
                let ids = prefixes.join(" or ");
                match more {
                    0 => format!("{word}, or an id that begins with {ids}"),
                    _ => format!(
                        "{word}, an id that begins with {ids}, or {word} and at most {more} such ids, \
                         separated by commas"
                    ),
                }
            }
        };
        format!("Give `{}` {range}.", self.name)
    }
}

/// The row for `name`.
///
/// # Errors
/// A [`ParameterError`] with the nearest known name.
fn find<P: Parameters>(name: &str) -> Result<&'static ParameterSpec<P>, ParameterError> {
    let alias = P::NAME_ALIASES.iter().find(|(other, _)| *other == name);
    let own = alias.map_or(name, |(_, own)| own);
    let names = || P::PARAMETER_SPECS.iter().map(|spec| spec.name);
    P::PARAMETER_SPECS
        .iter()
        .find(|s| s.name == own)
        .ok_or_else(|| {
            let aliases = P::NAME_ALIASES.iter().map(|(other, _)| *other);
            unknown(name, &names().collect::<Vec<_>>(), aliases)
        })
}

/// The error about a name that is none of `names` and `aliases`, with the nearest of them.
pub(super) fn unknown<'a>(
    name: &str,
    names: &[&'a str],
    aliases: impl Iterator<Item = &'a str>,
) -> ParameterError {
    ParameterError {
        field: name.into(),
        message: "there is no such parameter".into(),
        fix: match nearest(name, names.iter().copied().chain(aliases)) {
            Some(near) => format!("Did you mean `{near}`?"),
            None => format!("Known parameters: {}.", names.join(", ")),
        },
    }
}
