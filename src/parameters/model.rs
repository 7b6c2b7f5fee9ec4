//! What decides the model that comes out of a volume.

use super::{ParameterError, ParameterSpec, Parameters, SPECS};
use crate::optimise::OptimiseParameters;
use crate::retile::{Method, RetileParameters};
use crate::surface::{Isolate, SurfaceParameters};
use serde_json::{Map, Value};

/// Everything that decides what model comes out of a volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelParameters {
    /// Which frame of a 4-D volume, 0-based; `None` for a 3-D one.
    pub frame: Option<usize>,
    /// How many models of the surface are made, each from another seed; the best is kept. 1..=16.
    pub starts: usize,
    /// Volume to surface.
    pub surface: SurfaceParameters,
    /// Surface to N points and triangles.
    pub retile: RetileParameters,
    /// Fit and flips.
    pub optimise: OptimiseParameters,
}

impl Default for ModelParameters {
    fn default() -> Self {
        Self::finish(Draft::default()).expect("the defaults contradict nothing")
    }
}

/// Parameters on their way in: what one decides for another is settled in
/// [`Parameters::finish`].
#[derive(Debug, Default)]
pub struct Draft {
    pub(super) frame: Option<usize>,
    pub(super) surface: SurfaceParameters,
    pub(super) retile: RetileParameters,
    pub(super) optimise: OptimiseParameters,
    isolate_words: Vec<&'static str>,
    pub(super) starts: Option<usize>,
    pub(super) adaptive: Option<f64>,
    pub(super) fit_rounds: Option<usize>,
}

impl Draft {
    pub(super) fn set_isolate(&mut self, by: &'static str, isolate: Isolate) {
        self.isolate_words.push(by);
        self.surface.isolate = isolate;
    }
}

impl Parameters for ModelParameters {
    type Draft = Draft;

    const SPECS: &'static [ParameterSpec] = SPECS;

    fn finish(mut draft: Draft) -> Result<Self, ParameterError> {
        if let [first, .., last] = draft.isolate_words[..] {
            return Err(ParameterError {
                field: last.into(),
                message: format!("`{first}` and `{last}` both say which part is the object"),
                fix: format!("Give `{first}` or `{last}`, not both."),
            });
        }
        if draft.optimise.weights.iter().sum::<f64>() <= 0.0 {
            return Err(ParameterError {
                field: "w1".into(),
                message: "all four weights are 0".into(),
                fix: "Give at least one of w1, w2, w3, w4 a value above 0.".into(),
            });
        }
        // The paper spreads its points evenly and leaves them on the surface; density, fit and
        // further starts belong to the refined route.
        let (usual_starts, usual_adaptive, usual_fit) = match draft.retile.method {
            Method::Paper => (1, 0.0, 0),
            Method::Refined => (
                usual_starts(draft.retile.points),
                draft.retile.adaptive,
                draft.optimise.fit.rounds,
            ),
        };
        draft.retile.adaptive = draft.adaptive.unwrap_or(usual_adaptive);
        draft.optimise.fit.rounds = draft.fit_rounds.unwrap_or(usual_fit);
        Ok(Self {
            frame: draft.frame,
            starts: draft.starts.unwrap_or(usual_starts),
            surface: draft.surface,
            retile: draft.retile,
            optimise: draft.optimise,
        })
    }
}

/// Points that the usual number of starts makes in all.
const POINTS_IN_ALL: f64 = 200.0;

/// Most starts without being asked for more.
const MOST_STARTS: f64 = 4.0;

/// Starts of a model of so many points where nobody says otherwise: 4 of 50 points, 3 of 67, 2
/// of 110, 1 from 134 points on. Models of few points differ most from start to start, and cost
/// least.
fn usual_starts(points: usize) -> usize {
    (POINTS_IN_ALL / points as f64)
        .round()
        .clamp(1.0, MOST_STARTS) as usize
}

impl ModelParameters {
    /// See [`Parameters::from_pairs`].
    ///
    /// # Errors
    /// As there.
    pub fn from_pairs<'a>(
        pairs: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, ParameterError> {
        <Self as Parameters>::from_pairs(pairs)
    }

    /// See [`Parameters::from_json`].
    ///
    /// # Errors
    /// As there.
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, ParameterError> {
        <Self as Parameters>::from_json(object)
    }
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
            let written = parameters.to_json();
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
