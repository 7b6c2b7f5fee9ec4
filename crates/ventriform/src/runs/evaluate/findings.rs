//! Whether the results confirm the paper's findings, each as a claim, a verdict and figures.

use super::paired::PairedDifference;
use super::rows::{self, FitRow, Gold, ModelKind, ModelRow, Variant};
use super::sample::Sample;

/// Whether the results agree with a claim.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FindingVerdict {
    /// The figures agree.
    Confirmed,
    /// The figures contradict.
    Refuted,
    /// The figures do not decide it: a curve is flat, or models or numbers of points are missing.
    Open,
}

impl FindingVerdict {
    /// The word in reports.
    pub fn as_str(self) -> &'static str {
        match self {
            FindingVerdict::Confirmed => "confirmed",
            FindingVerdict::Refuted => "refuted",
            FindingVerdict::Open => "not decided",
        }
    }

    fn from_holds(holds: Option<bool>) -> Self {
        match holds {
            Some(true) => FindingVerdict::Confirmed,
            Some(false) => FindingVerdict::Refuted,
            None => FindingVerdict::Open,
        }
    }
}

/// One of the paper's findings and what these results say about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// The finding.
    pub claim: &'static str,
    /// Whether it holds here.
    pub verdict: FindingVerdict,
    /// The figures that decide it.
    pub figures: String,
    /// Whether the cases behind them had a part in what is judged.
    pub sample: Sample,
}

/// All findings of the paper's evaluation.
pub fn findings(rows: &[FitRow], models: &[ModelRow]) -> Vec<Finding> {
    vec![
        flips_raise_fitness(models),
        best_number(rows),
        more_points_hurt(rows),
        new_models_beat_the_reference(rows),
        flips_help_the_fit(rows),
    ]
}

/// The paper's flips alone: its finding is about them, not about the fit.
fn flips_raise_fitness(models: &[ModelRow]) -> Finding {
    let flips = Gains::new(models, Variant::Flipped);
    let worst = models.iter().filter(|m| m.kind.variant == Variant::Flipped);
    let worst = worst.map(|m| m.worst_shape).fold(1.0, f64::min);
    Finding {
        claim: "Flips raise the mean fitness of every model (raw form, without the fit).",
        verdict: FindingVerdict::from_holds((flips.models > 0).then_some(flips.least > 0.0)),
        figures: format!(
            "gain in the raw form over the re-tiled models: flips alone {flips} (the worst triangle then \
             has a 2r/R of {worst:.2}), the fit alone {}, both {}",
            Gains::new(models, Variant::Fitted),
            Gains::new(models, Variant::Optimised),
        ),
        // Each model is measured against the surface that it was made of.
        sample: Sample::InSample,
    }
}

/// Gain of a step in the raw form over the re-tiled model, in percent.
struct Gains {
    models: usize,
    least: f64,
    most: f64,
}

impl Gains {
    fn new(models: &[ModelRow], variant: Variant) -> Self {
        let mut gains = Gains {
            models: 0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        };
        for after in models.iter().filter(|m| m.kind.variant == variant) {
            let before = ModelKind {
                variant: Variant::Retiled,
                ..after.kind
            };
            let mut all = models.iter();
            if let Some(before) = all.find(|m| m.kind == before && m.template == after.template) {
                let gain = 100.0 * (after.raw / before.raw - 1.0);
                gains.models += 1;
                gains.least = gains.least.min(gain);
                gains.most = gains.most.max(gain);
            }
        }
        gains
    }
}

impl std::fmt::Display for Gains {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.models == 0 {
            return f.write_str("not measured");
        }
        let Gains {
            models,
            least,
            most,
        } = self;
        write!(f, "{least:.1} to {most:.1} % ({models} models)")
    }
}

/// Mean E_J against the expert by number of points, for one variant.
fn curve(rows: &[FitRow], variant: Variant) -> Vec<(usize, f64)> {
    rows::kinds(rows)
        .into_iter()
        .filter(|k| k.variant == variant)
        .filter_map(|kind| {
            let cell = rows::mean(rows::of_kind(rows, None, kind), Gold::Expert)?;
            Some((kind.points, cell.jaccard))
        })
        .collect()
}

fn best(curve: &[(usize, f64)]) -> Option<(usize, f64)> {
    curve.iter().copied().reduce(|best, next| {
        // The smaller number wins where both are as good.
        if next.1 > best.1 { next } else { best }
    })
}

/// The claim holds where all numbers of points whose mean E_J is within [`NOTICEABLE_JACCARD`] of the greatest
/// lie between 110 and 200, and fails where none of them does. A curve that is flat across a border of
/// that range, or ends there, decides nothing.
/// The sample of figures over all rows.
fn sample_of(rows: &[FitRow]) -> Sample {
    let samples = rows.iter().map(|r| r.sample);
    samples.fold(Sample::HeldOut, Sample::and)
}

/// With fewer patients, nothing about a difference can be told.
const LEAST_PATIENTS: usize = 6;

fn best_number(rows: &[FitRow]) -> Finding {
    let curve = curve(rows, Variant::Optimised);
    let kind = |points: usize| ModelKind {
        variant: Variant::Optimised,
        points,
    };
    let top = best(&curve);
    let alike: Vec<usize> = top.map_or_else(Vec::new, |top| {
        let cannot_be_told = |points: &usize| {
            let found =
                PairedDifference::from_differences(&differences(rows, kind(top.0), kind(*points)));
            found.is_none_or(|d| d.count < LEAST_PATIENTS || d.may_be_none())
        };
        curve.iter().map(|c| c.0).filter(cannot_be_told).collect()
    });
    let claimed = |n: &usize| (110..=200).contains(n);
    let within = alike.iter().filter(|n| claimed(n)).count();
    let beyond_both = curve.iter().any(|c| c.0 < 110) && curve.iter().any(|c| c.0 > 200);
    let holds = match within {
        0 => curve.iter().any(|c| claimed(&c.0)).then_some(false),
        n => (n == alike.len() && beyond_both).then_some(true),
    };
    Finding {
        claim: "The best number of points lies between 110 and 200.",
        verdict: FindingVerdict::from_holds(holds),
        figures: top.map_or_else(String::new, |top| {
            let alike: Vec<String> = alike.iter().map(usize::to_string).collect();
            format!(
                "the greatest mean E_J, {:.4}, is that of {} points; {} cannot be told from it (paired \
                 bootstrap over the patients, 95 %)",
                top.1,
                top.0,
                alike.join(", ")
            )
        }),
        sample: sample_of(rows),
    }
}

/// Smaller changes of the mean E_J do not count: half the difference between two readers.
const NOTICEABLE_JACCARD: f64 = 0.005;

fn more_points_hurt(rows: &[FitRow]) -> Finding {
    let curve = curve(rows, Variant::Optimised);
    let most = curve.last().copied().filter(|c| c.0 > 200);
    let fewer: Vec<(usize, f64)> = curve.iter().copied().filter(|c| c.0 <= 200).collect();
    let kind = |points: usize| ModelKind {
        variant: Variant::Optimised,
        points,
    };
    let found = most.zip(best(&fewer)).and_then(|(most, best)| {
        let lost = differences(rows, kind(best.0), kind(most.0));
        Some((most, best, PairedDifference::from_differences(&lost)?))
    });
    let holds = found.and_then(|(_, _, lost)| {
        let told = lost.count >= LEAST_PATIENTS;
        match lost.interval {
            [low, _] if told && low > 0.0 && lost.mean > NOTICEABLE_JACCARD => Some(true),
            [_, high] if told && high < NOTICEABLE_JACCARD => Some(false),
            _ => None,
        }
    });
    Finding {
        claim: "More than 200 points hurt.",
        verdict: FindingVerdict::from_holds(holds),
        figures: found.map_or_else(String::new, |(most, best, lost)| {
            format!(
                "mean E_J {:.4} at {} points, {:.4} at the best number up to 200, {}: lost {}",
                most.1,
                most.0,
                best.1,
                best.0,
                described(&lost)
            )
        }),
        sample: sample_of(rows),
    }
}

/// A difference with its interval and its signs.
fn described(d: &PairedDifference) -> String {
    format!(
        "{:+.4} (95 % interval {:+.4} to {:+.4}; {} of {} patients up, sign test p = {:.2})",
        d.mean, d.interval[0], d.interval[1], d.signs[0], d.count, d.p
    )
}

/// Differences of E_J (new minus old), one for each patient: means over the pairs of fits that differ in
/// the kind alone. Pairs of one patient say the same thing several times.
fn differences(rows: &[FitRow], new: ModelKind, old: ModelKind) -> Vec<f64> {
    let cases = rows::distinct(rows, |r| r.case.clone());
    let of_case = |case: &String| {
        let own = rows::of_kind(rows, None, new).filter(|row| row.case == *case);
        let pairs: Vec<f64> = own
            .filter_map(|row| {
                let other =
                    rows::of_kind(rows, Some(&row.template), old).find(|o| o.case == row.case)?;
                Some(row.jaccard(Gold::Expert)? - other.jaccard(Gold::Expert)?)
            })
            .collect();
        rows::average(&pairs)
    };
    cases.iter().filter_map(of_case).collect()
}

/// A claim that `new` minus `old` exceeds `least`, at every number of points.
fn compare(rows: &[FitRow], claim: &'static str, old: Variant, least: f64) -> Finding {
    let mut verdicts = Vec::new();
    let mut figures = Vec::new();
    for new in rows::kinds(rows) {
        if new.variant != Variant::Optimised {
            continue;
        }
        let old = ModelKind {
            variant: old,
            ..new
        };
        let Some(found) = PairedDifference::from_differences(&differences(rows, new, old)) else {
            continue;
        };
        let told = found.count >= LEAST_PATIENTS;
        verdicts.push(match found.interval {
            [low, _] if told && low > least => Some(true),
            [_, high] if told && high < least => Some(false),
            _ => None,
        });
        figures.push(format!("N = {}: {}", new.points, described(&found)));
    }
    let holds = if verdicts.is_empty() {
        None
    } else if verdicts.contains(&Some(false)) {
        Some(false)
    } else {
        verdicts.iter().all(|v| *v == Some(true)).then_some(true)
    };
    Finding {
        claim,
        verdict: FindingVerdict::from_holds(holds),
        figures: figures.join("; "),
        sample: sample_of(rows),
    }
}

fn new_models_beat_the_reference(rows: &[FitRow]) -> Finding {
    let claim = "New models segment better than the reference model of as many points (E_J).";
    compare(rows, claim, Variant::Reference, 0.0)
}

fn flips_help_the_fit(rows: &[FitRow]) -> Finding {
    let claim = "Models after the flips segment no worse than after re-tiling alone (E_J).";
    compare(rows, claim, Variant::Retiled, -NOTICEABLE_JACCARD)
}

#[cfg(test)]
mod tests {
    use super::super::rows::tests::row;
    use super::*;

    fn verdict(rows: &[FitRow], claim: &str) -> FindingVerdict {
        let found = findings(rows, &[]);
        let of = |f: &&Finding| f.claim.contains(claim);
        found.iter().find(of).unwrap().verdict
    }

    /// Eight patients, each of whom differs from the curve by as much at every number of points, but
    /// for `noise`.
    fn patients(variant: Variant, curve: &[(usize, f64)], noise: f64) -> Vec<FitRow> {
        let mut rows = Vec::new();
        for patient in 0..8usize {
            for (place, (n, j)) in curve.iter().enumerate() {
                let by_chance = if (patient + place) % 2 == 0 {
                    noise
                } else {
                    -noise
                };
                let own = j + 0.01 * patient as f64 - 0.035 + by_chance;
                rows.push(row(&format!("p{patient}"), variant, *n, Some(own)));
            }
        }
        rows
    }

    #[test]
    fn the_papers_own_curve_confirms_its_findings() {
        let curve = [
            (67, 0.662),
            (110, 0.751),
            (150, 0.758),
            (200, 0.748),
            (300, 0.649),
        ];
        let mut rows = patients(Variant::Optimised, &curve, 0.0);
        assert_eq!(verdict(&rows, "reference model"), FindingVerdict::Open);
        rows.extend(patients(Variant::Reference, &[(67, 0.6)], 0.0));
        for claim in ["between 110 and 200", "hurt", "reference model"] {
            assert_eq!(verdict(&rows, claim), FindingVerdict::Confirmed, "{claim}");
        }
        assert_eq!(verdict(&rows, "after re-tiling"), FindingVerdict::Open);
        assert_eq!(
            verdict(&rows, "raise the mean fitness"),
            FindingVerdict::Open
        );
        // One patient tells nothing.
        rows.retain(|r| r.case == "p0");
        for claim in ["between 110 and 200", "hurt", "reference model"] {
            assert_eq!(verdict(&rows, claim), FindingVerdict::Open, "{claim}");
        }
    }

    #[test]
    fn a_flat_curve_refutes_that_more_points_hurt() {
        let rows = patients(Variant::Optimised, &[(150, 0.8), (300, 0.8)], 0.001);
        assert_eq!(verdict(&rows, "hurt"), FindingVerdict::Refuted);
        assert_eq!(verdict(&rows, "between 110"), FindingVerdict::Open);
        let noisy = patients(Variant::Optimised, &[(150, 0.8), (300, 0.8)], 0.02);
        assert_eq!(verdict(&noisy, "hurt"), FindingVerdict::Open);
    }

    /// The gain of the flips is not that of the fit.
    #[test]
    fn flips_are_judged_without_the_fit() {
        let model = |variant, raw| ModelRow {
            template: "t1".into(),
            kind: ModelKind {
                variant,
                points: 150,
            },
            raw,
            normalised: 0.5,
            robust: 0.5,
            shape: 0.9,
            worst_shape: 0.25,
        };
        let models = |flipped| {
            [
                model(Variant::Retiled, 4.0),
                model(Variant::Flipped, flipped),
                model(Variant::Fitted, 6.0),
                model(Variant::Optimised, 6.2),
            ]
        };
        let lost = flips_raise_fitness(&models(3.9));
        assert_eq!(lost.verdict, FindingVerdict::Refuted);
        let gained = flips_raise_fitness(&models(4.4));
        assert_eq!(gained.verdict, FindingVerdict::Confirmed);
        for figure in [
            "flips alone 10.0 to 10.0 %",
            "2r/R of 0.25",
            "fit alone 50.0 to",
            "both 55.0 to",
        ] {
            assert!(gained.figures.contains(figure), "{}", gained.figures);
        }
        assert_eq!(flips_raise_fitness(&[]).verdict, FindingVerdict::Open);
    }

    #[test]
    fn the_best_number_is_a_range_that_the_patients_cannot_tell_apart() {
        let found = |curve: &[(usize, f64)], noise: f64| {
            let rows = patients(Variant::Optimised, curve, noise);
            let found = findings(&rows, &[]);
            let found = found.iter().find(|f| f.claim.contains("between 110"));
            found.unwrap().clone()
        };
        let flat = [(67, 0.82), (110, 0.843), (200, 0.844), (300, 0.844)];
        let flat = found(&flat, 0.004);
        assert_eq!(flat.verdict, FindingVerdict::Open);
        assert!(
            flat.figures.contains("110, 200, 300 cannot be told"),
            "{flat:?}"
        );
        assert_eq!(flat.sample, Sample::HeldOut);
        let rising = [(67, 0.7), (110, 0.75), (200, 0.78), (300, 0.8)];
        assert_eq!(found(&rising, 0.0).verdict, FindingVerdict::Refuted);
        let open_ended = [(67, 0.7), (150, 0.8)];
        assert_eq!(found(&open_ended, 0.0).verdict, FindingVerdict::Open);
    }
}
