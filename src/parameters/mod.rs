//! The parameters of a model by the names that users give them.
//!
//! One table, [`SPECS`], is the single source of names, types, ranges, defaults and words for
//! the command line, the query string, the JSON of a job and the OpenAPI document. A value
//! is read and checked here once; past this module [`ModelParameters`] is right by
//! construction.

mod input;
mod specs;

pub use input::Input;
pub use specs::SPECS;

use crate::optimise::OptimiseParameters;
use crate::retile::{Method, RetileParameters};
use crate::surface::{Isolate, SurfaceParameters};
use serde_json::{Map, Value};

/// Everything that decides what model comes out of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelParameters {
    /// Which frame of a 4-D volume, 0-based; `None` for a 3-D one.
    pub frame: Option<usize>,
    /// Volume to surface.
    pub surface: SurfaceParameters,
    /// Surface to N points and triangles.
    pub retile: RetileParameters,
    /// Fit and flips.
    pub optimise: OptimiseParameters,
}

impl Default for ModelParameters {
    fn default() -> Self {
        Draft::default()
            .finish()
            .expect("the defaults contradict nothing")
    }
}

/// A parameter that cannot be used, and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {message}")]
pub struct ParameterError {
    /// The parameter's name as given.
    pub field: String,
    /// What is wrong with it.
    pub message: String,
    /// What would be right.
    pub fix: String,
}

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
    /// Text of a form of its own.
    Text {
        /// The form as a regular expression.
        pattern: &'static str,
        /// One example.
        example: &'static str,
    },
}

/// One row of [`SPECS`].
pub struct ParameterSpec {
    /// The name everywhere: query, JSON, command line (there also with `-` for `_`).
    pub name: &'static str,
    /// Type and range.
    pub kind: Kind,
    /// The default, as a user would write it; empty where there is none.
    pub default: &'static str,
    /// One sentence for help texts.
    pub summary: &'static str,
    read: fn(&mut Draft, &input::Checked) -> Result<(), String>,
    write: fn(&ModelParameters) -> Value,
}

/// Parameters on their way in: what one decides for another is settled in
/// [`Draft::finish`].
#[derive(Debug, Default)]
struct Draft {
    frame: Option<usize>,
    surface: SurfaceParameters,
    retile: RetileParameters,
    optimise: OptimiseParameters,
    isolate_words: Vec<&'static str>,
    fit_rounds: Option<usize>,
}

impl Draft {
    fn set_isolate(&mut self, by: &'static str, isolate: Isolate) {
        self.isolate_words.push(by);
        self.surface.isolate = isolate;
    }

    fn finish(mut self) -> Result<ModelParameters, ParameterError> {
        if let [first, .., last] = self.isolate_words[..] {
            return Err(ParameterError {
                field: last.into(),
                message: format!("`{first}` and `{last}` both say which part is the object"),
                fix: format!("Give `{first}` or `{last}`, not both."),
            });
        }
        if self.optimise.weights.iter().sum::<f64>() <= 0.0 {
            return Err(ParameterError {
                field: "w1".into(),
                message: "all four weights are 0".into(),
                fix: "Give at least one of w1, w2, w3, w4 a value above 0.".into(),
            });
        }
        // The paper leaves the points on the surface; the fit belongs to the refined route.
        let usual_fit = match self.retile.method {
            Method::Paper => 0,
            Method::Refined => self.optimise.fit.rounds,
        };
        self.optimise.fit.rounds = self.fit_rounds.unwrap_or(usual_fit);
        Ok(ModelParameters {
            frame: self.frame,
            surface: self.surface,
            retile: self.retile,
            optimise: self.optimise,
        })
    }
}

impl ModelParameters {
    /// Reads parameters given as text, as in a query string or on a command line.
    ///
    /// # Errors
    /// A [`ParameterError`] that names the first field that is unknown (with the nearest
    /// valid name), given twice, malformed, out of range or in contradiction with another.
    pub fn from_pairs<'a>(
        pairs: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, ParameterError> {
        Self::from_inputs(
            pairs
                .into_iter()
                .map(|(name, text)| (name, Input::Text(text))),
        )
    }

    /// Reads parameters given as a JSON object. Types are strict: `"150"` is not a number.
    ///
    /// # Errors
    /// As [`ModelParameters::from_pairs`].
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, ParameterError> {
        Self::from_inputs(
            object
                .iter()
                .map(|(name, value)| (name.as_str(), Input::Json(value))),
        )
    }

    fn from_inputs<'a>(
        inputs: impl Iterator<Item = (&'a str, Input<'a>)>,
    ) -> Result<Self, ParameterError> {
        let mut draft = Draft::default();
        let mut seen = Vec::new();
        for (name, input) in inputs {
            let spec = find(name)?;
            let refuse = |message: String| ParameterError {
                field: name.into(),
                message,
                fix: spec.fix(),
            };
            if seen.contains(&name) {
                return Err(refuse("given more than once".into()));
            }
            seen.push(name);
            let checked = input.check(&spec.kind).map_err(refuse)?;
            (spec.read)(&mut draft, &checked).map_err(refuse)?;
        }
        draft.finish()
    }

    /// Every parameter by name with the value used, defaults written out.
    /// [`ModelParameters::from_json`] reads it back.
    pub fn to_json(&self) -> Value {
        let object: Map<String, Value> = SPECS
            .iter()
            .map(|spec| (spec.name.to_owned(), (spec.write)(self)))
            .filter(|(_, value)| !value.is_null())
            .collect();
        Value::Object(object)
    }
}

impl ParameterSpec {
    /// What to give instead, as a sentence.
    fn fix(&self) -> String {
        let range = match self.kind {
            Kind::Integer { min, max: u64::MAX } => format!("a whole number from {min}"),
            Kind::Integer { min, max } => format!("a whole number from {min} to {max}"),
            Kind::Number { min, max } => format!("a number from {min} to {max}"),
            Kind::Choice(words) => format!("one of {}", words.join(", ")),
            Kind::Integers { count } => format!("{count} whole numbers separated by commas"),
            Kind::Text { example, .. } => format!("for example {example}"),
        };
        format!("Give `{}` {range}.", self.name)
    }
}

/// The row for `name`.
fn find(name: &str) -> Result<&'static ParameterSpec, ParameterError> {
    SPECS.iter().find(|s| s.name == name).ok_or_else(|| {
        let nearest = nearest(name, SPECS.iter().map(|s| s.name));
        let names: Vec<_> = SPECS.iter().map(|s| s.name).collect();
        ParameterError {
            field: name.into(),
            message: "no such parameter".into(),
            fix: match nearest {
                Some(near) => format!("Did you mean `{near}`?"),
                None => format!("Known parameters: {}.", names.join(", ")),
            },
        }
    })
}

/// The known name most like `name`, if any is like it at all.
pub fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    known
        .map(|k| (strsim::jaro_winkler(&name.to_lowercase(), k), k))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, k)| k)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::IsoLevel;
    use serde_json::json;

    fn pairs(list: &[(&str, &str)]) -> Result<ModelParameters, ParameterError> {
        ModelParameters::from_pairs(list.iter().copied())
    }

    fn refusal(list: &[(&str, &str)]) -> ParameterError {
        pairs(list).unwrap_err()
    }

    #[test]
    fn what_is_written_out_reads_back_the_same() {
        for list in [
            &[][..],
            &[
                ("points", "67"),
                ("seed", "18446744073709551615"),
                ("iso", "50%"),
            ],
            &[("iso", "absolute:0.47"), ("box", "1,2,3,40,50,60")],
            &[("method", "paper"), ("label", "-3"), ("w2", "0.5")],
            &[("seed_point", "3,4,5"), ("guard", "0"), ("frame", "2")],
        ] {
            let parameters = pairs(list).unwrap();
            let Value::Object(written) = parameters.to_json() else {
                panic!("an object")
            };
            assert_eq!(ModelParameters::from_json(&written).unwrap(), parameters);
            for (name, _) in list {
                assert!(written.contains_key(*name), "{name}");
            }
        }
    }

    #[test]
    fn the_table_states_the_defaults_that_the_code_has() {
        let defaults: Vec<(&str, &str)> = SPECS
            .iter()
            .filter(|s| !s.default.is_empty())
            .map(|s| (s.name, s.default))
            .collect();
        assert_eq!(pairs(&defaults).unwrap(), ModelParameters::default());
    }

    #[test]
    fn iso_takes_three_forms() {
        let iso = |text: &str| pairs(&[("iso", text)]).map(|p| p.surface.iso);
        assert_eq!(iso("auto").unwrap(), IsoLevel::Auto);
        assert_eq!(iso("50%").unwrap(), IsoLevel::Fraction(0.5));
        assert_eq!(iso("absolute:-4e2").unwrap(), IsoLevel::Absolute(-400.0));
        for bad in ["0.5", "0%", "100%", "absolute:nan", "absolute:", "half", ""] {
            assert_eq!(iso(bad).unwrap_err().field, "iso", "{bad}");
        }
    }

    #[test]
    fn refusals_name_the_field_and_the_way_out() {
        let unknown = refusal(&[("point", "150")]);
        assert_eq!(unknown.field, "point");
        assert!(unknown.fix.contains("`points`"));
        let far = refusal(&[("xyz", "1")]);
        assert!(far.fix.contains("relaxation_iterations"));
        assert!(refusal(&[("points", "11")]).fix.contains("12 to 50000"));
        assert!(refusal(&[("points", "1e3")]).fix.contains("whole number"));
        assert!(
            refusal(&[("method", "papr")])
                .fix
                .contains("paper, refined")
        );
        assert!(
            refusal(&[("points", "67"), ("points", "68")])
                .message
                .contains("once")
        );
        assert!(
            refusal(&[("label", "1"), ("box", "0,0,0,1,1,1")])
                .fix
                .contains("not both")
        );
        assert!(
            refusal(&[("box", "5,0,0,1,1,1")])
                .message
                .contains("first corner")
        );
        let zero = [("w1", "0"), ("w2", "0"), ("w3", "0"), ("w4", "0")];
        assert_eq!(refusal(&zero).field, "w1");
    }

    #[test]
    fn json_types_are_strict() {
        let read = |value: Value| match value {
            Value::Object(map) => ModelParameters::from_json(&map),
            _ => unreachable!("an object was given"),
        };
        assert_eq!(read(json!({"points": 67})).unwrap().retile.points, 67);
        assert_eq!(
            read(json!({"seed_point": [1, 2, 3]}))
                .unwrap()
                .surface
                .isolate,
            Isolate::Seed([1, 2, 3])
        );
        for bad in [
            json!({"points": "67"}),
            json!({"points": 67.5}),
            json!({"points": null}),
            json!({"guard": true}),
            json!({"method": 1}),
            json!({"adaptive": [0.2]}),
            json!({"seed_point": [1, 2]}),
            json!({"seed_point": [1, 2, -3]}),
            json!({"iso": 0.5}),
        ] {
            let error = read(bad.clone()).unwrap_err();
            assert!(!error.fix.is_empty() && !error.message.is_empty(), "{bad}");
        }
    }
}
