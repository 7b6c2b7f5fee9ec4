//! The results as CSV and JSON.
//!
//! Figures are rounded to six places before they are used, which is finer than a fit resolves, so
//! that they are the same whether a fit was just computed or read from an earlier run.

use serde_json::{Value, json};

use super::calibration::{Calibration, CaseFigures};
use super::findings::Finding;
use super::leave_one_out::{Candidate, LeaveOneOut};
use super::paired::PairedDifference;
use super::rows::{self, Agreed, Cell, FitOutcome, FitRow, Gold, ModelKind, ModelRow};
use super::sample::Sample;

/// A cohort's evaluation, ready to be written out.
#[derive(Debug, Clone, Default)]
pub struct Evaluation {
    /// The settings of the run, by name.
    pub settings: Vec<(String, String)>,
    /// The templates and what each model was made from.
    pub templates: Vec<(String, String)>,
    /// Problems with cases, models and fits: the case, and what is wrong.
    pub problems: Vec<(String, String)>,
    /// The models.
    pub models: Vec<ModelRow>,
    /// The fits.
    pub rows: Vec<FitRow>,
    /// Whether they confirm the paper's findings.
    pub findings: Vec<Finding>,
    /// Slices of one fit of each patient.
    pub pictures: Vec<Picture>,
    /// The choice of a model for each case without it, if asked for.
    pub leave_one_out: Option<LeaveOneOut>,
    /// The profile of the reader who drew the experts' masks, if asked for.
    pub reader: Option<Calibration>,
}

impl Evaluation {
    /// Whether at least one fit succeeded.
    pub fn has_fit(&self) -> bool {
        let fitted = |row: &FitRow| matches!(row.outcome, FitOutcome::Fitted(_));
        self.rows.iter().any(fitted)
    }
}

/// A picture for the page.
#[derive(Debug, Clone)]
pub struct Picture {
    /// The patient.
    pub case: String,
    /// Its title.
    pub caption: String,
    /// PNG.
    pub png: Vec<u8>,
}

/// The folder of the pictures.
pub const SLICES_FOLDER: &str = "slices";

impl Picture {
    /// Its path in the folder of results.
    pub fn file(&self) -> String {
        format!("{SLICES_FOLDER}/{}.png", self.case)
    }
}

/// The value rounded to six places.
pub fn rounded(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

const AGREEMENT_COLUMNS: [&str; 5] = [
    "jaccard",
    "contour_distance_voxels",
    "contour_distance_mm",
    "dice",
    "hausdorff95_mm",
];

fn agreed_figures(agreed: Option<&Agreed>) -> [Option<f64>; 5] {
    let of = |pick: fn(&Agreed) -> Option<f64>| agreed.and_then(pick);
    [
        of(|a| Some(a.jaccard)),
        of(|a| a.contour_voxels),
        of(|a| a.contour_mm),
        of(|a| Some(a.dice)),
        of(|a| a.hausdorff95_mm),
    ]
}

/// A figure of a table, four places; empty where there is none.
fn number(value: Option<f64>) -> String {
    value.map_or_else(String::new, |v| format!("{v:.4}"))
}

/// The lines as CSV (RFC 4180, but for lines that end in a line feed alone).
fn csv_bytes(lines: impl IntoIterator<Item = Vec<String>>) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in lines {
        writer.write_record(&line)?;
    }
    Ok(writer.into_inner().map_err(|e| e.into_error())?)
}

fn words(text: &str) -> Vec<String> {
    text.split(',').map(str::to_owned).collect()
}

/// Every fit as a line of CSV.
///
/// # Errors
/// [`csv::Error`].
pub fn fits_csv(rows: &[FitRow]) -> Result<Vec<u8>, csv::Error> {
    let mut names: Vec<&str> = rows
        .iter()
        .flat_map(|r| r.figures.keys().map(String::as_str))
        .collect();
    names.sort_unstable();
    names.dedup();
    let mut head = words("case,template,model,points,sample,state,reason");
    for gold in Gold::ALL {
        head.extend(AGREEMENT_COLUMNS.map(|name| format!("{name}_{}", gold.as_str())));
    }
    head.extend(names.iter().map(|name| (*name).to_owned()));
    let line = |row: &FitRow| {
        let mut line = vec![
            row.case.clone(),
            row.template.clone(),
            row.kind.variant.as_str().to_owned(),
            row.kind.points.to_string(),
            row.sample.as_str().to_owned(),
            row.outcome.as_str().to_owned(),
            row.outcome.reason().to_owned(),
        ];
        let agreed = row.agreed.iter().flat_map(|a| agreed_figures(a.as_ref()));
        let own = names.iter().map(|n| row.figures.get(*n).copied());
        line.extend(agreed.chain(own).map(number));
        line
    };
    csv_bytes([head].into_iter().chain(rows.iter().map(line)))
}

/// A model's fitness is measured against the surface that it was made of.
pub(super) const OF_MODELS: Sample = Sample::InSample;

/// Figure 3 as CSV: the mean fitness of every model.
///
/// # Errors
/// [`csv::Error`].
pub fn figure3_csv(models: &[ModelRow]) -> Result<Vec<u8>, csv::Error> {
    let head = words(
        "template,model,points,fitness_raw,fitness_normalised,fitness_robust,\
         radius_ratio_mean,radius_ratio_least,sample",
    );
    let line = |m: &ModelRow| {
        let mut line = vec![
            m.template.clone(),
            m.kind.variant.as_str().to_owned(),
            m.kind.points.to_string(),
        ];
        let figures = [m.raw, m.normalised, m.robust, m.shape, m.worst_shape];
        line.extend(figures.map(|figure| number(Some(figure))));
        line.push(OF_MODELS.as_str().to_owned());
        line
    };
    csv_bytes([head].into_iter().chain(models.iter().map(line)))
}

/// The fits that a line of Table 1 is a mean over.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    /// The template, or `all`.
    pub template: String,
    /// The patient, or `mean`.
    pub case: String,
}

/// The cells of a line of Table 1: one for each kind of model, where there is one.
pub type TableCells = Vec<(ModelKind, Option<Cell>)>;

/// Table 1: for every template and for all of them, each patient and the mean over all.
pub fn table1(rows: &[FitRow], gold: Gold) -> Vec<(Line, TableCells)> {
    let kinds = rows::kinds(rows);
    let cases = rows::distinct(rows, |r| r.case.clone());
    let mut templates = vec![None];
    templates.extend(
        rows::distinct(rows, |r| r.template.clone())
            .into_iter()
            .map(Some),
    );
    let mut lines = Vec::new();
    for template in &templates {
        for case in cases.iter().map(Some).chain([None]) {
            let cells = kinds.iter().map(|kind| {
                let own = rows::of_kind(rows, template.as_deref(), *kind)
                    .filter(|r| case.is_none_or(|c| r.case == *c));
                (*kind, rows::mean(own, gold))
            });
            let line = Line {
                template: template.clone().unwrap_or_else(|| "all".into()),
                case: case.map_or_else(|| "mean".into(), Clone::clone),
            };
            lines.push((line, cells.collect()));
        }
    }
    lines
}

/// Table 1 against both gold standards as CSV.
///
/// # Errors
/// [`csv::Error`].
pub fn table1_csv(rows: &[FitRow]) -> Result<Vec<u8>, csv::Error> {
    let head =
        "gold,template,case,model,points,jaccard,contour_distance_voxels,least_jaccard,fits,sample";
    let mut lines = vec![words(head)];
    for gold in Gold::ALL {
        for (line, cells) in table1(rows, gold) {
            lines.extend(cells.into_iter().map(|(kind, cell)| {
                vec![
                    gold.as_str().to_owned(),
                    line.template.clone(),
                    line.case.clone(),
                    kind.variant.as_str().to_owned(),
                    kind.points.to_string(),
                    number(cell.map(|c| c.jaccard)),
                    number(cell.and_then(|c| c.contour)),
                    number(cell.map(|c| c.least)),
                    cell.map_or(0, |c| c.count).to_string(),
                    cell.map_or("", |c| c.sample.as_str()).to_owned(),
                ]
            }));
        }
    }
    csv_bytes(lines)
}

/// Everything as JSON.
pub fn to_json(evaluation: &Evaluation) -> Value {
    let pairs = |pairs: &[(String, String)], names: [&str; 2]| -> Vec<Value> {
        pairs
            .iter()
            .map(|(a, b)| json!({names[0]: a, names[1]: b}))
            .collect()
    };
    let figure3: Vec<Value> = evaluation.models.iter().map(model_json).collect();
    let findings: Vec<Value> = evaluation
        .findings
        .iter()
        .map(|f| {
            json!({
                "claim": f.claim, "verdict": f.verdict.as_str(), "figures": f.figures,
                "sample": f.sample.as_str(),
            })
        })
        .collect();
    let settings: serde_json::Map<String, Value> = evaluation
        .settings
        .iter()
        .map(|(name, value)| (name.clone(), json!(value)))
        .collect();
    json!({
        "settings": settings,
        "templates": pairs(&evaluation.templates, ["case", "source"]),
        "problems": pairs(&evaluation.problems, ["case", "problem"]),
        "findings": findings,
        "figure3": figure3,
        "means": means_json(&evaluation.rows),
        "leave_one_out": evaluation.leave_one_out.as_ref().map(leave_one_out_json),
        "reader": evaluation.reader.as_ref().map(reader_json),
        "pictures": evaluation.pictures.iter().map(picture_json).collect::<Vec<_>>(),
        "fits": evaluation.rows.iter().map(row_json).collect::<Vec<_>>(),
    })
}

fn picture_json(picture: &Picture) -> Value {
    json!({"case": picture.case, "caption": picture.caption, "file": picture.file()})
}

fn model_json(m: &ModelRow) -> Value {
    json!({
        "template": m.template, "model": m.kind.variant.as_str(), "points": m.kind.points,
        "fitness": {"raw": rounded(m.raw), "normalised": rounded(m.normalised),
                    "robust": rounded(m.robust)},
        "radius_ratio": {"mean": rounded(m.shape), "least": rounded(m.worst_shape)},
        "sample": OF_MODELS.as_str(),
    })
}

/// The lines of Table 1 that are means over patients.
fn means_json(rows: &[FitRow]) -> Vec<Value> {
    let mut means = Vec::new();
    for gold in Gold::ALL {
        for (line, cells) in table1(rows, gold) {
            if line.case != "mean" {
                continue;
            }
            for (kind, cell) in cells {
                let Some(cell) = cell else { continue };
                means.push(json!({
                    "gold": gold.as_str(),
                    "template": line.template,
                    "model": kind.variant.as_str(),
                    "points": kind.points,
                    "jaccard": rounded(cell.jaccard),
                    "contour_distance_voxels": cell.contour.map(rounded),
                    "least_jaccard": rounded(cell.least),
                    "fits": cell.count,
                    "sample": cell.sample.as_str(),
                }));
            }
        }
    }
    means
}

fn difference_json(d: &PairedDifference) -> Value {
    json!({
        "mean": rounded(d.mean), "interval95": d.interval.map(rounded), "up": d.signs[0], "down": d.signs[1],
        "pairs": d.count, "sign_test_p": rounded(d.p),
    })
}

fn leave_one_out_json(found: &LeaveOneOut) -> Value {
    let model = |m: &Candidate| {
        json!({
            "template": m.template, "model": m.kind.variant.as_str(), "points": m.kind.points,
        })
    };
    let choices: Vec<Value> = found
        .choices
        .iter()
        .map(|c| {
            json!({
                "case": c.case,
                "chosen": model(&c.chosen),
                "held-out": {
                    "jaccard": rounded(c.held_out),
                    "contour_distance_voxels": c.contour.map(rounded),
                },
                "in-sample": {"jaccard": c.in_sample.map(rounded)},
            })
        })
        .collect();
    let [held_out, in_sample] = found.means().map(|mean| mean.map(rounded));
    json!({
        "choices": choices,
        "best_over_all": model(&found.best),
        "mean_jaccard": {"held-out": held_out, "in-sample": in_sample},
        "optimism": found.optimism.as_ref().map(difference_json),
    })
}

fn reader_json(made: &Calibration) -> Value {
    let figures = |f: &CaseFigures| {
        json!({
            "jaccard": rounded(f.jaccard), "contour_distance_voxels": rounded(f.contour),
            "wall_ml": rounded(f.wall_ml), "cavity_ml": rounded(f.cavity_ml),
        })
    };
    let rows: Vec<Value> = made
        .rows
        .iter()
        .map(|row| {
            json!({
                "case": row.case,
                "reader_wall_ml": rounded(row.reader_ml),
                "without": figures(&row.without),
                "held-out": made.figures(row, Sample::HeldOut).as_ref().map(figures),
                "in-sample": made.figures(row, Sample::InSample).as_ref().map(figures),
            })
        })
        .collect();
    let gain = |sample| made.gain(sample).as_ref().map(difference_json);
    let drawing = made.profile.drawing();
    let means = made.mean_jaccards();
    json!({
        "masks": made.profile.masks(),
        "kind": made.kind().as_str(),
        "offsets_mm": drawing.offsets(),
        "level": drawing.level(),
        "mean_jaccard": {
            "without": rounded(means.without), "edge": rounded(means.edge), "level": rounded(means.level),
        },
        "cases": rows,
        "gain_in_jaccard": {
            "held-out": gain(Sample::HeldOut), "in-sample": gain(Sample::InSample),
        },
    })
}

fn row_json(row: &FitRow) -> Value {
    let agreed = |gold: Gold| -> Value {
        let figures = agreed_figures(row.agreed[gold as usize].as_ref());
        let named = AGREEMENT_COLUMNS.iter().zip(figures);
        let object: serde_json::Map<String, Value> =
            named.map(|(n, v)| ((*n).to_owned(), json!(v))).collect();
        Value::Object(object)
    };
    json!({
        "case": row.case,
        "template": row.template,
        "model": row.kind.variant.as_str(),
        "points": row.kind.points,
        "sample": row.sample.as_str(),
        "state": row.outcome.as_str(),
        "reason": row.outcome.reason(),
        "expert": agreed(Gold::Expert),
        "truth": agreed(Gold::Truth),
        "figures": row.figures,
    })
}

#[cfg(test)]
mod tests {
    use super::super::rows::Variant;
    use super::super::rows::tests::row;
    use super::*;

    #[test]
    fn every_fit_has_a_line_of_as_many_fields() {
        let rows = [
            row("p1", Variant::Reference, 67, Some(0.71)),
            row("p1", Variant::Optimised, 150, Some(0.82)),
        ];
        let text = |rows: &[FitRow]| String::from_utf8(fits_csv(rows).unwrap()).unwrap();
        let fields: Vec<usize> = text(&rows).lines().map(|l| l.split(',').count()).collect();
        assert_eq!(fields, [18; 3]);
        // A comma in a reason is quoted.
        let lost = text(&[row("p2", Variant::Optimised, 150, None)]);
        assert!(lost.contains(",lost,\"no heart, none at all\","));
    }

    #[test]
    fn table_1_has_each_patient_and_the_mean_for_each_template_and_all() {
        let mut rows = vec![
            row("p1", Variant::Optimised, 150, Some(0.82)),
            row("p2", Variant::Optimised, 150, Some(0.72)),
        ];
        for mut other in rows.clone() {
            other.template = "t2".into();
            rows.push(other);
        }
        let table = table1(&rows, Gold::Expert);
        let names: Vec<String> = table
            .iter()
            .map(|(l, _)| format!("{} {}", l.template, l.case))
            .collect();
        let expected = ["all", "t1", "t2"]
            .iter()
            .flat_map(|t| ["p1", "p2", "mean"].map(|c| format!("{t} {c}")));
        assert_eq!(names, expected.collect::<Vec<_>>());
        let all = table[2].1[0].1.unwrap();
        assert!((all.jaccard - 0.77).abs() < 1e-12 && all.count == 4);
        let csv = String::from_utf8(table1_csv(&rows).unwrap()).unwrap();
        assert_eq!(csv.lines().count(), 1 + 2 * 9);
    }
}
