//! Value of a choice of a model on cases that had no part in it.
//!
//! Every model is a candidate: template, variant and number of points. For each case the candidate with the
//! greatest mean E_J over the *other* cases is chosen and judged on the case (held-out). Beside it stands
//! the one choice that is best over all cases, judged on the same cases (in-sample): the difference is
//! what such a choice overstates.

use super::paired::PairedDifference;
use super::rows::{self, FitRow, Gold, ModelKind};

/// A model as a candidate.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// Its template.
    pub template: String,
    /// Variant and number of points.
    pub kind: ModelKind,
}

/// A case and the model chosen for it.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The case.
    pub case: String,
    /// The model chosen on the others.
    pub chosen: Candidate,
    /// Its E_J, held-out.
    pub held_out: f64,
    /// Its E_CD, held-out, voxels.
    pub contour: Option<f64>,
    /// E_J of the model that is best over all cases; `None` where that was made of the case.
    pub in_sample: Option<f64>,
}

/// All choices.
#[derive(Debug, Clone, PartialEq)]
pub struct LeaveOneOut {
    /// For each case.
    pub choices: Vec<Choice>,
    /// The model that is best over all cases.
    pub best: Candidate,
    /// In-sample minus held-out E_J.
    pub optimism: Option<PairedDifference>,
}

impl LeaveOneOut {
    /// The choices by agreement with `gold`; `None` with fewer than two cases.
    pub fn new(rows: &[FitRow], gold: Gold) -> Option<Self> {
        let judged: Vec<FitRow> = rows
            .iter()
            .filter(|r| r.jaccard(gold).is_some())
            .cloned()
            .collect();
        let cases = rows::distinct(&judged, |r| r.case.clone());
        let best = best_without(&judged, gold, None)?;
        let choices: Vec<Choice> = cases
            .iter()
            .filter_map(|case| {
                let chosen = best_without(&judged, gold, Some(case))?;
                let of =
                    |model: &Candidate| judged.iter().find(|r| r.case == *case && is(r, model));
                let row = of(&chosen)?;
                Some(Choice {
                    case: case.clone(),
                    held_out: row.jaccard(gold)?,
                    contour: row.contour(gold),
                    in_sample: of(&best).and_then(|row| row.jaccard(gold)),
                    chosen,
                })
            })
            .collect();
        let differences: Vec<f64> = choices
            .iter()
            .filter_map(|c| Some(c.in_sample? - c.held_out))
            .collect();
        (choices.len() > 1).then(|| Self {
            optimism: PairedDifference::from_differences(&differences),
            choices,
            best,
        })
    }

    /// Mean E_J, held-out and in-sample.
    pub fn means(&self) -> [Option<f64>; 2] {
        let held_out: Vec<f64> = self.choices.iter().map(|c| c.held_out).collect();
        let in_sample: Vec<f64> = self.choices.iter().filter_map(|c| c.in_sample).collect();
        [held_out, in_sample].map(|values| rows::average(&values))
    }
}

fn is(row: &FitRow, model: &Candidate) -> bool {
    row.template == model.template && row.kind == model.kind
}

/// The model with the greatest mean over all cases but `left_out`, of which it must not be made.
fn best_without(rows: &[FitRow], gold: Gold, left_out: Option<&str>) -> Option<Candidate> {
    let used = |r: &&FitRow| left_out.is_none_or(|case| r.case != case && r.template != case);
    let used: Vec<&FitRow> = rows.iter().filter(used).collect();
    let candidates = rows::distinct(&used, |r| (r.template.clone(), r.kind));
    let mut best: Option<(f64, Candidate)> = None;
    for (template, kind) in candidates {
        let own = used
            .iter()
            .filter(|r| r.template == template && r.kind == kind);
        let Some(cell) = rows::mean(own.copied(), gold) else {
            continue;
        };
        // The first of equals.
        if best.as_ref().is_none_or(|(most, _)| cell.jaccard > *most) {
            best = Some((cell.jaccard, Candidate { template, kind }));
        }
    }
    best.map(|(_, model)| model)
}

#[cfg(test)]
mod tests {
    use super::super::rows::Variant;
    use super::super::rows::tests::row;
    use super::*;

    #[test]
    fn no_case_has_a_part_in_its_own_choice() {
        // Each number of points suits one case by chance: the choice for a case must miss it.
        let mut rows = Vec::new();
        for (case, lucky) in [("p1", 67), ("p2", 110), ("p3", 150)] {
            for points in [67, 110, 150] {
                let jaccard = if points == lucky { 0.9 } else { 0.8 };
                rows.push(row(case, Variant::Optimised, points, Some(jaccard)));
            }
        }
        let found = LeaveOneOut::new(&rows, Gold::Expert).unwrap();
        assert!(found.choices.iter().all(|c| c.held_out == 0.8), "{found:?}");
        let [held_out, in_sample] = found.means().map(Option::unwrap);
        assert!(
            (held_out - 0.8).abs() < 1e-12 && in_sample > 0.83,
            "{found:?}"
        );
        assert_eq!(LeaveOneOut::new(&rows[..3], Gold::Expert), None);
    }

    #[test]
    fn a_model_made_of_the_case_is_not_chosen_for_it() {
        let mut rows = Vec::new();
        for case in ["a", "b", "c"] {
            for template in ["a", "b", "c"] {
                if template == case {
                    continue;
                }
                let jaccard = if template == "a" { 0.9 } else { 0.7 };
                let mut row = row(case, Variant::Optimised, 150, Some(jaccard));
                row.template = template.into();
                rows.push(row);
            }
        }
        let found = LeaveOneOut::new(&rows, Gold::Expert).unwrap();
        assert!(
            found.choices.iter().all(|c| c.chosen.template != c.case),
            "{found:?}"
        );
        assert_eq!(found.best.template, "a");
        assert_eq!(found.choices[0].in_sample, None);
    }
}
