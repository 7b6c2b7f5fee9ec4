//! The results of a cohort: one [`FitRow`] for each model fitted to each patient, one
//! [`ModelRow`] for each model, and means over them.
//!
//! A fit that failed counts as E_J = 0, so that losing a hard case does not raise a mean. Patients
//! without a gold standard, or whose scan could not be read, are left out of means.

use super::sample::Sample;
use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// Which kind of model it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Variant {
    /// The fit that `auto` keeps of the built-in hearts, whatever the cohort's templates.
    Auto,
    /// The stand-in for the paper's older model: Marching Cubes thinned out by quadric error.
    Reference,
    /// Ours after re-tiling, before fit and flips.
    Retiled,
    /// Ours after re-tiling and the paper's flips, without the fit. Only in Figure 3.
    Flipped,
    /// Ours after re-tiling and the fit, before the flips. Only in Figure 3.
    Fitted,
    /// Ours, finished.
    Optimised,
}

impl Variant {
    /// All of them, in the order of tables.
    pub const ALL: [Variant; 6] = [
        Variant::Auto,
        Variant::Reference,
        Variant::Retiled,
        Variant::Flipped,
        Variant::Fitted,
        Variant::Optimised,
    ];

    /// The name in tables and files.
    pub fn as_str(self) -> &'static str {
        match self {
            Variant::Auto => "auto",
            Variant::Reference => "reference",
            Variant::Retiled => "retiled",
            Variant::Flipped => "flipped",
            Variant::Fitted => "fitted",
            Variant::Optimised => "optimised",
        }
    }

    /// A description for readers.
    pub fn title(self) -> &'static str {
        match self {
            Variant::Auto => "auto: the best of the built-in hearts",
            Variant::Reference => "reference model",
            Variant::Retiled => "after re-tiling",
            Variant::Flipped => "after the paper's flips alone",
            Variant::Fitted => "after the fit alone",
            Variant::Optimised => "after fit and flips",
        }
    }
}

/// Gold standard of the fits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Gold {
    /// `lv_expert_img`: what a reader would draw on the image; the paper's gold standard.
    Expert,
    /// `lv_truth`: the wall as anatomy has it.
    Truth,
}

impl Gold {
    /// Both, the paper's first.
    pub const ALL: [Gold; 2] = [Gold::Expert, Gold::Truth];

    /// The file in a case's folder.
    pub fn file(self) -> &'static str {
        match self {
            Gold::Expert => "lv_expert_img.nii.gz",
            Gold::Truth => "lv_truth.nii.gz",
        }
    }

    /// The name in tables.
    pub fn as_str(self) -> &'static str {
        match self {
            Gold::Expert => "expert",
            Gold::Truth => "truth",
        }
    }
}

/// Variant and number of points of a model: means are taken over models of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct ModelKind {
    /// Which kind.
    pub variant: Variant,
    /// Number of points.
    pub points: usize,
}

/// The outcome of a fit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum FitOutcome {
    /// There is a fit; the reason why its motion ended.
    Fitted(String),
    /// There is no fit; the reason.
    Lost(String),
    /// The scan could not be read; the reason.
    Unreadable(String),
}

impl FitOutcome {
    /// The reason alone.
    pub fn reason(&self) -> &str {
        match self {
            FitOutcome::Fitted(r) | FitOutcome::Lost(r) | FitOutcome::Unreadable(r) => r,
        }
    }

    /// The state alone.
    pub fn as_str(&self) -> &'static str {
        match self {
            FitOutcome::Fitted(_) => "fitted",
            FitOutcome::Lost(_) => "lost",
            FitOutcome::Unreadable(_) => "unreadable",
        }
    }
}

/// Agreement with one gold standard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Agreed {
    /// E_J.
    pub jaccard: f64,
    /// E_CD in voxels; `None` where the fit's mask is empty.
    pub contour_voxels: Option<f64>,
    /// E_CD in mm.
    pub contour_mm: Option<f64>,
    /// Dice.
    pub dice: f64,
    /// 95 % Hausdorff distance, mm.
    pub hausdorff95_mm: Option<f64>,
}

/// One model fitted to one patient.
#[derive(Debug, Clone, PartialEq)]
pub struct FitRow {
    /// The case that the model was made from.
    pub template: String,
    /// The kind of model.
    pub kind: ModelKind,
    /// The patient.
    pub case: String,
    /// Whether the patient had a part in choosing the program's constants. It had none in the model.
    pub sample: Sample,
    /// Its outcome.
    pub outcome: FitOutcome,
    /// Agreement with [`Gold::ALL`]; `None` where there is no such gold standard or no fit.
    pub agreed: [Option<Agreed>; 2],
    /// Which gold standards the patient has.
    pub golds: [bool; 2],
    /// Figures of the fit itself, by name.
    pub figures: BTreeMap<String, f64>,
}

impl FitRow {
    /// E_J; 0 for a lost case, `None` where there is nothing to compare.
    pub fn jaccard(&self, gold: Gold) -> Option<f64> {
        match self.outcome {
            FitOutcome::Lost(_) if self.golds[gold as usize] => Some(0.0),
            _ => self.agreed[gold as usize].map(|a| a.jaccard),
        }
    }

    /// E_CD in voxels.
    pub fn contour(&self, gold: Gold) -> Option<f64> {
        self.agreed[gold as usize].and_then(|a| a.contour_voxels)
    }
}

/// One model's mean fitness against its surface.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelRow {
    /// Its template.
    pub template: String,
    /// The kind of model.
    pub kind: ModelKind,
    /// Fitness in the paper's raw form.
    pub raw: f64,
    /// Normalised fitness, 0..=1.
    pub normalised: f64,
    /// Fitness in the robust form, for comparison between tools.
    pub robust: f64,
    /// Mean radius ratio 2r/R of its triangles.
    pub shape: f64,
    /// The least one.
    pub worst_shape: f64,
}

/// A cell of a table: E_J and E_CD.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cell {
    /// Mean E_J.
    pub jaccard: f64,
    /// Mean E_CD in voxels over the cases that have one.
    pub contour: Option<f64>,
    /// Least E_J.
    pub least: f64,
    /// Rows that the mean is over.
    pub count: usize,
    /// In-sample if one of them is.
    pub sample: Sample,
}

/// The mean over the rows that `choose` takes; `None` if none of them can be measured.
pub fn mean<'a>(rows: impl IntoIterator<Item = &'a FitRow>, gold: Gold) -> Option<Cell> {
    let (mut jaccards, mut contours) = (Vec::new(), Vec::new());
    let mut sample = Sample::HeldOut;
    for row in rows {
        if row.jaccard(gold).is_some() {
            sample = sample.and(row.sample);
        }
        jaccards.extend(row.jaccard(gold));
        contours.extend(row.contour(gold));
    }
    let jaccard = average(&jaccards)?;
    Some(Cell {
        jaccard,
        contour: average(&contours),
        least: jaccards.iter().copied().fold(1.0, f64::min),
        count: jaccards.len(),
        sample,
    })
}

/// The mean of some numbers.
pub fn average(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// The rows of a kind, of one template or of all.
pub fn of_kind<'a>(
    rows: &'a [FitRow],
    template: Option<&'a str>,
    kind: ModelKind,
) -> impl Iterator<Item = &'a FitRow> {
    rows.iter()
        .filter(move |r| r.kind == kind && template.is_none_or(|t| r.template == t))
}

/// The distinct values of `key`, in order of appearance.
pub fn distinct<T, K: PartialEq>(items: &[T], key: impl Fn(&T) -> K) -> Vec<K> {
    let mut found: Vec<K> = Vec::new();
    for value in items.iter().map(key) {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

/// The kinds that occur, by variant and number of points.
pub fn kinds(rows: &[FitRow]) -> Vec<ModelKind> {
    let mut found = distinct(rows, |r| r.kind);
    found.sort_unstable();
    found
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A row with E_CD = 1 - E_J against both gold standards; lost without an E_J.
    pub fn row(case: &str, variant: Variant, points: usize, jaccard: Option<f64>) -> FitRow {
        let agreed = jaccard.map(|jaccard| Agreed {
            jaccard,
            contour_voxels: Some(1.0 - jaccard),
            contour_mm: Some(4.0 * (1.0 - jaccard)),
            dice: 2.0 * jaccard / (1.0 + jaccard),
            hausdorff95_mm: Some(5.0),
        });
        FitRow {
            template: "t1".into(),
            kind: ModelKind { variant, points },
            case: case.into(),
            sample: Sample::HeldOut,
            outcome: match jaccard {
                Some(_) => FitOutcome::Fitted("converged".into()),
                None => FitOutcome::Lost("no heart, none at all".into()),
            },
            agreed: [agreed; 2],
            golds: [true; 2],
            figures: BTreeMap::from([("wall_ml".to_owned(), 130.0)]),
        }
    }

    #[test]
    fn a_lost_case_counts_as_no_agreement() {
        let rows = [
            row("p1", Variant::Optimised, 150, Some(0.8)),
            row("p2", Variant::Optimised, 150, None),
        ];
        let cell = mean(&rows, Gold::Expert).unwrap();
        assert_eq!((cell.jaccard, cell.least, cell.count), (0.4, 0.0, 2));
        assert!((cell.contour.unwrap() - 0.2).abs() < 1e-12);
    }

    #[test]
    fn what_cannot_be_measured_is_left_out() {
        let mut rows = [
            row("p1", Variant::Optimised, 150, Some(0.8)),
            row("p2", Variant::Optimised, 150, None),
            row("p3", Variant::Optimised, 150, None),
        ];
        rows[1].golds = [false; 2];
        rows[2].outcome = FitOutcome::Unreadable("truncated".into());
        assert_eq!(mean(&rows, Gold::Truth).unwrap().count, 1);
        assert_eq!(mean(&rows[1..], Gold::Truth), None);
    }
}
