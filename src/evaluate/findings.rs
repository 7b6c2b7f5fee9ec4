//! Whether the results confirm the paper's findings, each as a claim, a verdict and figures.

use super::rows::{self, FitRow, Gold, ModelKind, ModelRow, Variant};

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

    fn of(holds: Option<bool>) -> Self {
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

fn flips_raise_fitness(models: &[ModelRow]) -> Finding {
    let mut gains: Vec<f64> = Vec::new();
    for after in models
        .iter()
        .filter(|m| m.kind.variant == Variant::Optimised)
    {
        let before = ModelKind {
            variant: Variant::Retiled,
            ..after.kind
        };
        let before = models
            .iter()
            .find(|m| m.kind == before && m.template == after.template);
        gains.extend(before.map(|b| 100.0 * (after.raw / b.raw - 1.0)));
    }
    let least = gains.iter().copied().fold(f64::INFINITY, f64::min);
    let most = gains.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    Finding {
        claim: "Flips (here with the fit before them) raise the mean fitness of every model.",
        verdict: FindingVerdict::of((!gains.is_empty()).then_some(least > 0.0)),
        figures: format!(
            "gain in the raw form {least:.1} to {most:.1} % over {} models",
            gains.len()
        ),
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

/// The claim holds where all numbers of points whose mean E_J is within [`NOTICEABLE`] of the greatest
/// lie between 110 and 200, and fails where none of them does. A curve that is flat across a border of
/// that range, or ends there, decides nothing.
fn best_number(rows: &[FitRow]) -> Finding {
    let curve = curve(rows, Variant::Optimised);
    let top = best(&curve);
    let claimed = |c: &&(usize, f64)| (110..=200).contains(&c.0);
    let good: Vec<&(usize, f64)> = top.map_or_else(Vec::new, |top| {
        let good = |c: &&(usize, f64)| top.1 - c.1 <= NOTICEABLE;
        curve.iter().filter(good).collect()
    });
    let enough = good.first().copied();
    let within = good.iter().copied().filter(claimed).count();
    let beyond_both = curve.iter().any(|c| c.0 < 110) && curve.iter().any(|c| c.0 > 200);
    let holds = match within {
        0 => curve.iter().any(|c| claimed(&c)).then_some(false),
        n => (n == good.len() && beyond_both).then_some(true),
    };
    Finding {
        claim: "The best number of points lies between 110 and 200.",
        verdict: FindingVerdict::of(holds),
        figures: enough.zip(top).map_or_else(String::new, |(enough, top)| {
            format!(
                "{} points are the least that are as good as any (E_J {:.3}, within \
                 {NOTICEABLE}); the greatest mean, {:.3}, is that of {}",
                enough.0, enough.1, top.1, top.0
            )
        }),
    }
}

/// Smaller changes of the mean E_J do not count: half the difference between two readers.
const NOTICEABLE: f64 = 0.005;

fn more_points_hurt(rows: &[FitRow]) -> Finding {
    let curve = curve(rows, Variant::Optimised);
    let most = curve.last().copied().filter(|c| c.0 > 200);
    let best = best(&curve);
    let holds = most
        .zip(best)
        .map(|(most, best)| best.1 - most.1 > NOTICEABLE);
    Finding {
        claim: "More than 200 points hurt.",
        verdict: FindingVerdict::of(holds),
        figures: most.zip(best).map_or_else(String::new, |(most, best)| {
            format!(
                "mean E_J {:.3} at {} points, {:.3} at the best number, {}",
                most.1, most.0, best.1, best.0
            )
        }),
    }
}

/// Differences of E_J (new minus old) over the pairs of fits that differ in the kind alone.
fn differences(rows: &[FitRow], new: ModelKind, old: ModelKind) -> Vec<f64> {
    rows::of_kind(rows, None, new)
        .filter_map(|row| {
            let other =
                rows::of_kind(rows, Some(&row.template), old).find(|o| o.case == row.case)?;
            Some(row.jaccard(Gold::Expert)? - other.jaccard(Gold::Expert)?)
        })
        .collect()
}

fn compare(
    rows: &[FitRow],
    claim: &'static str,
    old: Variant,
    accept: impl Fn(f64) -> bool,
) -> Finding {
    let mut holds = None;
    let mut figures = Vec::new();
    for new in rows::kinds(rows) {
        if new.variant != Variant::Optimised {
            continue;
        }
        let old = ModelKind {
            variant: old,
            ..new
        };
        let found = differences(rows, new, old);
        let Some(mean) = rows::average(&found) else {
            continue;
        };
        let wins = found.iter().filter(|d| **d > 0.0).count();
        holds = Some(holds.unwrap_or(true) && accept(mean));
        figures.push(format!(
            "N = {}: {mean:+.4} in the mean, better in {wins} of {}",
            new.points,
            found.len()
        ));
    }
    Finding {
        claim,
        verdict: FindingVerdict::of(holds),
        figures: figures.join("; "),
    }
}

fn new_models_beat_the_reference(rows: &[FitRow]) -> Finding {
    let claim = "New models segment better than the reference model of as many points (E_J).";
    compare(rows, claim, Variant::Reference, |mean| mean > 0.0)
}

fn flips_help_the_fit(rows: &[FitRow]) -> Finding {
    let claim = "Models after the flips segment no worse than after re-tiling alone (E_J).";
    compare(rows, claim, Variant::Retiled, |mean| mean > -NOTICEABLE)
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

    #[test]
    fn the_papers_own_curve_confirms_its_findings() {
        let curve = [
            (67, 0.662),
            (110, 0.751),
            (150, 0.758),
            (200, 0.748),
            (300, 0.649),
        ];
        let mut rows: Vec<FitRow> = curve
            .map(|(n, j)| row("p1", Variant::Optimised, n, Some(j)))
            .into();
        assert_eq!(verdict(&rows, "reference model"), FindingVerdict::Open);
        rows.push(row("p1", Variant::Reference, 67, Some(0.6)));
        for claim in ["between 110 and 200", "hurt", "reference model"] {
            assert_eq!(verdict(&rows, claim), FindingVerdict::Confirmed, "{claim}");
        }
        assert_eq!(verdict(&rows, "after re-tiling"), FindingVerdict::Open);
        assert_eq!(
            verdict(&rows, "raise the mean fitness"),
            FindingVerdict::Open
        );
    }

    #[test]
    fn a_flat_curve_refutes_that_more_points_hurt() {
        let rows = [150, 300].map(|n| row("p1", Variant::Optimised, n, Some(0.8)));
        assert_eq!(verdict(&rows, "hurt"), FindingVerdict::Refuted);
        assert_eq!(verdict(&rows, "between 110"), FindingVerdict::Open);
    }

    #[test]
    fn a_flat_curve_decides_nothing_about_the_best_number() {
        let verdict_of = |curve: &[(usize, f64)]| {
            let row = |(n, j): &(usize, f64)| row("p1", Variant::Optimised, *n, Some(*j));
            let rows: Vec<FitRow> = curve.iter().map(row).collect();
            verdict(&rows, "between 110")
        };
        let flat = [(67, 0.84), (110, 0.843), (200, 0.844), (300, 0.844)];
        assert_eq!(verdict_of(&flat), FindingVerdict::Open);
        let rising = [(67, 0.7), (110, 0.75), (200, 0.78), (300, 0.8)];
        assert_eq!(verdict_of(&rising), FindingVerdict::Refuted);
        let open_ended = [(67, 0.7), (150, 0.8)];
        assert_eq!(verdict_of(&open_ended), FindingVerdict::Open);
    }
}
