//! Tables of parameters, whatever they are the parameters of.

use super::input::{Checked, Input};
use super::{ModelParameters, ParameterError, nearest};
use serde_json::{Map, Value};

/// What kind of value a parameter takes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kind {
    /// A whole number in the range.
    Integer {
        /// Smallest value.
        min: u64,
        /// Largest value.
        max: u64,
    },
    /// A finite number in the range.
    Number {
        /// Smallest value.
        min: f64,
        /// Largest value.
        max: f64,
    },
    /// One of some words.
    Choice(&'static [&'static str]),
    /// `count` whole numbers, separated by commas (in JSON also an array).
    Integers {
        /// How many.
        count: usize,
    },
    /// `count` finite numbers, separated by commas (in JSON also an array).
    Numbers {
        /// How many.
        count: usize,
    },
    /// Text of a form of its own.
    Text {
        /// The form as a regular expression.
        pattern: &'static str,
        /// One example.
        example: &'static str,
    },
    /// The id of something that the service keeps. On a command line, files take its place.
    Stored {
        /// What ids of such things begin with.
        prefixes: &'static [&'static str],
        /// The word that may stand for an id; empty where there is none.
        word: &'static str,
    },
}

/// One row of a table.
pub struct ParameterSpec<P: Parameters = ModelParameters> {
    /// The name everywhere: query, JSON, command line (there also with `-` for `_`).
    pub name: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// The default, as a user would write it; empty where there is none.
    pub default: &'static str,
    /// One sentence for help texts.
    pub summary: &'static str,
    pub(super) read: fn(&mut P::Draft, &Checked) -> Result<(), String>,
    pub(super) write: fn(&P) -> Value,
}

/// A row for one number: its name, where it stands among the parameters (and, on its way in,
/// their draft), range, default and summary.
macro_rules! number {
    (
        $name:literal, $($field:ident).+ $([$index:literal])?,
        $min:literal..=$max:literal, $default:literal, $summary:literal
    ) => {
        ParameterSpec {
            name: $name,
            kind: Kind::Number {
                min: $min,
                max: $max,
            },
            default: $default,
            summary: $summary,
            read: |draft, value| {
                draft.$($field).+ $([$index])? = value.f64();
                Ok(())
            },
            write: |parameters| json!(parameters.$($field).+ $([$index])?),
        }
    };
}
pub(super) use number;

/// Parameters with a table of names.
pub trait Parameters: Sized + 'static {
    /// Parameters on their way in.
    type Draft: Default;

    /// The table, in the order in which the values are used.
    const SPECS: &'static [ParameterSpec<Self>];

    /// Other names that are understood: (other name, name in the table).
    const ALIASES: &'static [(&'static str, &'static str)] = &[];

    /// Settles what one parameter decides for another.
    ///
    /// # Errors
    /// A [`ParameterError`] where parameters contradict each other.
    fn finish(draft: Self::Draft) -> Result<Self, ParameterError>;

    /// Reads parameters given as text, as in a query string or on a command line.
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
                .map(|(name, text)| (name, Input::Text(text))),
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
                .map(|(name, value)| (name.as_str(), Input::Json(value))),
        )
    }

    /// Every parameter by name with the value used, defaults written out.
    /// [`Parameters::from_json`] reads it back.
    fn to_json(&self) -> Map<String, Value> {
        Self::SPECS
            .iter()
            .map(|spec| (spec.name.to_owned(), (spec.write)(self)))
            .filter(|(_, value)| !value.is_null())
            .collect()
    }
}

fn from_inputs<'a, P: Parameters>(
    inputs: impl Iterator<Item = (&'a str, Input<'a>)>,
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
    /// What to give instead, as a sentence.
    fn fix(&self) -> String {
        let range = match self.kind {
            Kind::Integer { min, max: u64::MAX } => format!("a whole number from {min}"),
            Kind::Integer { min, max } => format!("a whole number from {min} to {max}"),
            Kind::Number { min, max } => format!("a number from {min} to {max}"),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
            Kind::Integers { count } => format!("{count} whole numbers separated by commas"),
            Kind::Numbers { count } => format!("{count} finite numbers separated by commas"),
            Kind::Text { example, .. } => format!("for example {example}"),
            Kind::Stored { prefixes, word: "" } => {
                format!("an id that begins with {}", prefixes.join(" or "))
            }
            Kind::Stored { prefixes, word } => {
                format!(
                    "{word}, or an id that begins with {}",
                    prefixes.join(" or ")
                )
            }
        };
        format!("Give `{}` {range}.", self.name)
    }
}

/// The row for `name`.
fn find<P: Parameters>(name: &str) -> Result<&'static ParameterSpec<P>, ParameterError> {
    let alias = P::ALIASES.iter().find(|(other, _)| *other == name);
    let own = alias.map_or(name, |(_, own)| own);
    let names = || P::SPECS.iter().map(|spec| spec.name);
    P::SPECS.iter().find(|s| s.name == own).ok_or_else(|| {
        let aliases = P::ALIASES.iter().map(|(other, _)| *other);
        ParameterError {
            field: name.into(),
            message: "no such parameter".into(),
            fix: match nearest(name, names().chain(aliases)) {
                Some(near) => format!("Did you mean `{near}`?"),
                None => {
                    let names: Vec<_> = names().collect();
                    format!("Known parameters: {}.", names.join(", "))
                }
            },
        }
    })
}
