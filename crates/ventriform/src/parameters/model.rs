//! The parameters of a model.

use super::ParameterError;
use super::table::Parameters;
use crate::surface::optimise::{FitnessForm, Gain, OptimiseParameters};
use crate::surface::retile::{Method, RetileParameters};
use crate::surface::{Denoise, Isolate, SurfaceParameters};
use serde_json::{Map, Value};

/// Everything that determines the model of a volume, apart from the volume.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelParameters {
    /// Frame of a 4-D volume, from 0; `None` for a 3-D volume.
    pub frame: Option<usize>,
    /// Number of models made of the surface, each from another seed, 1..=16; the best is kept.
    pub starts: usize,
    /// From the volume to its surface.
    pub surface: SurfaceParameters,
    /// From the surface to N points and their triangles.
    pub retile: RetileParameters,
    /// Least-squares fit and edge flips.
    pub optimise: OptimiseParameters,
}

impl Default for ModelParameters {
    fn default() -> Self {
        Self::settle(ModelDraft::default()).expect("the defaults do not contradict each other")
    }
}

/// The model parameters given so far, before [`ModelParameters::settle`] fills in the defaults that
/// depend on others.
#[derive(Debug, Default)]
pub struct ModelDraft {
    pub(super) frame: Option<usize>,
    pub(super) surface: SurfaceParameters,
    pub(super) retile: RetileParameters,
    pub(super) optimise: OptimiseParameters,
    isolate_words: Vec<&'static str>,
    pub(super) starts: Option<usize>,
    pub(super) denoise: Option<Denoise>,
    pub(super) adaptive: Option<f64>,
    pub(super) fit_rounds: Option<usize>,
    pub(super) fitness: Option<FitnessForm>,
    pub(super) gain: Option<Gain>,
    pub(super) guard: Option<f64>,
}

impl ModelDraft {
    pub(super) fn set_isolate(&mut self, by: &'static str, isolate: Isolate) {
        self.isolate_words.push(by);
        self.surface.isolate = isolate;
    }
}

impl ModelParameters {
    /// Fills in the defaults of `starts`, `denoise`, `adaptive`, `fit_rounds`, `fitness`, `gain` and `guard`, which
    /// depend on method and number of points.
    ///
    /// # Errors
    /// A [`ParameterError`] if parameters contradict each other.
    pub(super) fn settle(mut draft: ModelDraft) -> Result<Self, ParameterError> {
        if let [first, .., last] = draft.isolate_words[..] {
            return Err(ParameterError {
                field: last.into(),
                message: format!("`{first}` and `{last}` both select the object"),
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
        // The paper's method takes the surface as it is, spreads the points evenly, leaves them on it and
        // flips by its raw form. Denoising, varying density, fit, further starts and the guard belong to the refined
        // method.
        let optimise = &mut draft.optimise;
        let mut usual_starts = usual_starts(draft.retile.points);
        optimise.fit.rounds = optimise
            .fit
            .rounds
            .min(most_fit_rounds(draft.retile.points));
        if draft.retile.method == Method::Paper {
            usual_starts = 1;
            draft.surface.denoise = Denoise::Off;
            draft.retile.adaptive = 0.0;
            optimise.fit.rounds = 0;
            optimise.fitness = FitnessForm::Raw;
            optimise.gain = Gain::Local;
            optimise.guard = 0.0;
        }
        draft.surface.denoise = draft.denoise.unwrap_or(draft.surface.denoise);
        draft.retile.adaptive = draft.adaptive.unwrap_or(draft.retile.adaptive);
        optimise.fit.rounds = draft.fit_rounds.unwrap_or(optimise.fit.rounds);
        optimise.fitness = draft.fitness.unwrap_or(optimise.fitness);
        optimise.gain = draft.gain.unwrap_or(optimise.gain);
        optimise.guard = draft.guard.unwrap_or(optimise.guard);
        Ok(Self {
            frame: draft.frame,
            starts: draft.starts.unwrap_or(usual_starts),
            surface: draft.surface,
            retile: draft.retile,
            optimise: draft.optimise,
        })
    }
}

/// The most rounds of the fit by default, for a model of `points` points: many points lie close to the surface after
/// few rounds.
fn most_fit_rounds(points: usize) -> usize {
    if points < 600 { usize::MAX } else { 8 }
}

/// Points of all starts together at the default number of starts.
const POINTS_IN_ALL: f64 = 200.0;

/// Largest default number of starts.
const MOST_STARTS: f64 = 4.0;

/// The default number of starts for a model of `points` points: 4 for 50, 3 for 67, 2 for 110, 1
/// from 134 on. Models of few points differ most from start to start and take the least time.
fn usual_starts(points: usize) -> usize {
    (POINTS_IN_ALL / points as f64)
        .round()
        .clamp(1.0, MOST_STARTS) as usize
}

impl ModelParameters {
    /// Reads parameters given as text; see [`Parameters::from_pairs`].
    ///
    /// # Errors
    /// A [`ParameterError`] for the first parameter that cannot be used.
    pub fn from_pairs<'a>(
        pairs: impl IntoIterator<Item = (&'a str, &'a str)>,
    ) -> Result<Self, ParameterError> {
        <Self as Parameters>::from_pairs(pairs)
    }

    /// Reads parameters given as a JSON object; see [`Parameters::from_json`].
    ///
    /// # Errors
    /// A [`ParameterError`] for the first parameter that cannot be used.
    pub fn from_json(object: &Map<String, Value>) -> Result<Self, ParameterError> {
        <Self as Parameters>::from_json(object)
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
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
    fn written_parameters_read_back_unchanged() {
        checks::read_back_unchanged::<ModelParameters>(&[
            &[],
            &[
                ("points", "67"),
                ("seed", "18446744073709551615"),
                ("iso", "50%"),
            ],
            &[("iso", "absolute:0.47"), ("box", "1,2,3,40,50,60")],
            &[("method", "paper"), ("label", "-3"), ("w2", "0.5")],
            &[("seed_point", "3,4,5"), ("guard", "0"), ("frame", "2")],
            &[("label", "0"), ("iso", "below:0")],
        ]);
    }

    /// The paper: even points that stay on the surface, its reciprocals, the gain of the pair, no
    /// guard. Each can be switched by itself.
    #[test]
    fn the_papers_method_has_the_papers_settings() {
        let paper = pairs(&[("method", "paper")]).unwrap();
        assert_eq!((paper.starts, paper.optimise.fit.rounds), (1, 0));
        assert_eq!(paper.retile.adaptive, 0.0);
        assert_eq!(paper.optimise.fitness, FitnessForm::Raw);
        assert_eq!(paper.optimise.gain, Gain::Local);
        assert_eq!(paper.optimise.guard, 0.0);
        let usual = ModelParameters::default().optimise;
        for (name, value) in [
            ("fitness", "normalised"),
            ("gain", "total"),
            ("guard", "0.9"),
        ] {
            let one = pairs(&[("method", "paper"), (name, value)])
                .unwrap()
                .optimise;
            assert_eq!(one.fitness == usual.fitness, name == "fitness");
            assert_eq!(one.gain == usual.gain, name == "gain");
            assert_eq!(one.guard == usual.guard, name == "guard");
        }
    }

    #[test]
    fn the_table_states_the_defaults_of_the_code() {
        checks::table_states_defaults::<ModelParameters>();
    }

    #[test]
    fn iso_takes_four_forms() {
        let iso = |text: &str| pairs(&[("iso", text)]).map(|p| p.surface.iso);
        assert_eq!(iso("auto").unwrap(), IsoLevel::Auto);
        assert_eq!(iso("50%").unwrap(), IsoLevel::Fraction(0.5));
        assert_eq!(iso("absolute:-4e2").unwrap(), IsoLevel::Absolute(-400.0));
        assert_eq!(iso("below:-1.5").unwrap(), IsoLevel::Below(-1.5));
        for bad in [
            "0.5",
            "0%",
            "100%",
            "absolute:nan",
            "absolute:",
            "below:inf",
            "below",
            "half",
            "",
        ] {
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
