//! The cohort's results as tables and plots: the paper's Figure 3 and Table 1.
//!
//! A [`Row`] is one model fitted to one patient and measured against both gold standards. A
//! [`ModelRow`] is one model's mean fitness after re-tiling and after the flips.

use std::fmt::Write;

use serde_json::{Value, json};

/// One model fitted to one patient.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The model's template.
    pub template: String,
    /// The model's number of points.
    pub points: usize,
    /// The patient.
    pub case: String,
    /// What the fit says and how it agrees, by name; `None` where it has no number.
    pub figures: Vec<(&'static str, Option<f64>)>,
    /// Why the fit ended, or why there is none.
    pub reason: String,
}

impl Row {
    /// The figure of a name.
    pub fn get(&self, name: &str) -> Option<f64> {
        self.figures.iter().find(|f| f.0 == name).and_then(|f| f.1)
    }
}

/// One model's fitness.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelRow {
    /// Its template.
    pub template: String,
    /// Its number of points.
    pub points: usize,
    /// Mean fitness after re-tiling, in the paper's raw form and ours.
    pub retiled: [f64; 2],
    /// Mean fitness after fit and flips, in both forms.
    pub optimised: [f64; 2],
}

/// Mean of a figure over rows with `points` (all templates if `None`), lost cases as 0 for
/// agreement: a fit that is missing is not left out of a mean in silence.
pub fn mean(rows: &[Row], template: Option<&str>, points: usize, name: &str) -> Option<f64> {
    let values: Vec<f64> = chosen(rows, template, points)
        .filter_map(|r| match r.get(name) {
            None if name.starts_with("jaccard") => Some(0.0),
            value => value,
        })
        .collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn chosen<'a>(
    rows: &'a [Row],
    template: Option<&'a str>,
    points: usize,
) -> impl Iterator<Item = &'a Row> {
    rows.iter()
        .filter(move |r| r.points == points && template.is_none_or(|t| r.template == t))
}

/// The distinct values of `key` in order of appearance.
fn distinct<T: PartialEq + Clone>(rows: &[Row], key: impl Fn(&Row) -> T) -> Vec<T> {
    let mut found: Vec<T> = Vec::new();
    for row in rows {
        let value = key(row);
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

/// All rows as CSV.
pub fn csv(rows: &[Row]) -> String {
    let names: Vec<&str> = rows
        .first()
        .map_or_else(Vec::new, |r| r.figures.iter().map(|f| f.0).collect());
    let mut out = format!("template,points,case,reason,{}\n", names.join(","));
    for row in rows {
        // Reasons are sentences of ours; a comma in one would shift the columns.
        let reason = row.reason.replace([',', '\n', '"'], ";");
        let _ = write!(out, "{},{},{},{reason}", row.template, row.points, row.case);
        for name in &names {
            out.push(',');
            if let Some(value) = row.get(name) {
                let _ = write!(out, "{value:.4}");
            }
        }
        out.push('\n');
    }
    out
}

/// Figure 3 as CSV.
pub fn figure3_csv(models: &[ModelRow]) -> String {
    let mut out = String::from(
        "template,points,raw_retiled,raw_optimised,normalised_retiled,normalised_optimised\n",
    );
    for m in models {
        let _ = writeln!(
            out,
            "{},{},{:.4},{:.4},{:.4},{:.4}",
            m.template, m.points, m.retiled[0], m.optimised[0], m.retiled[1], m.optimised[1]
        );
    }
    out
}

/// Everything as JSON.
pub fn to_json(rows: &[Row], models: &[ModelRow]) -> Value {
    let rows_json: Vec<Value> = rows.iter().map(row_json).collect();
    let figure3: Vec<Value> = models
        .iter()
        .map(|m| {
            json!({
                "template": m.template, "points": m.points,
                "raw": {"retiled": m.retiled[0], "optimised": m.optimised[0]},
                "normalised": {"retiled": m.retiled[1], "optimised": m.optimised[1]},
            })
        })
        .collect();
    let mut means = Vec::new();
    for points in distinct(rows, |r| r.points) {
        let templates = distinct(rows, |r| r.template.clone());
        let all = std::iter::once(None).chain(templates.iter().map(|t| Some(t.as_str())));
        for template in all {
            means.push(json!({
                "template": template.unwrap_or("all"),
                "points": points,
                "jaccard": mean(rows, template, points, "jaccard"),
                "contour_distance_voxels": mean(rows, template, points, "contour_distance_voxels"),
                "jaccard_truth": mean(rows, template, points, "jaccard_truth"),
                "least_jaccard": chosen(rows, template, points)
                    .map(|r| r.get("jaccard").unwrap_or(0.0))
                    .fold(1.0, f64::min),
            }));
        }
    }
    json!({"means": means, "figure3": figure3, "fits": rows_json})
}

/// One row as JSON, as it is kept for resuming.
pub fn row_json(row: &Row) -> Value {
    let mut value = json!({
        "template": row.template,
        "points": row.points,
        "case": row.case,
        "reason": row.reason,
    });
    for (name, figure) in &row.figures {
        value[*name] = json!(figure);
    }
    value
}

/// One self-contained page: plots over N, Table 1, every fit.
pub fn html(rows: &[Row], models: &[ModelRow]) -> String {
    let points = distinct(rows, |r| r.points);
    let templates = distinct(rows, |r| r.template.clone());
    let series = |name: &'static str| -> Vec<(String, Vec<(f64, f64)>)> {
        let named = templates.iter().map(|t| (t.clone(), Some(t.as_str())));
        named
            .chain([("mean".to_owned(), None)])
            .map(|(label, template)| {
                let line = points
                    .iter()
                    .filter_map(|n| Some((*n as f64, mean(rows, template, *n, name)?)))
                    .collect();
                (label, line)
            })
            .collect()
    };
    let fitness = |pick: fn(&ModelRow) -> f64| -> Vec<(f64, f64)> {
        points
            .iter()
            .filter_map(|n| {
                let own: Vec<f64> = models.iter().filter(|m| m.points == *n).map(pick).collect();
                let count = own.len() as f64;
                (count > 0.0).then(|| (*n as f64, own.iter().sum::<f64>() / count))
            })
            .collect()
    };
    let figure3 = vec![
        ("after re-tiling".to_owned(), fitness(|m| m.retiled[0])),
        (
            "after fit and flips".to_owned(),
            fitness(|m| m.optimised[0]),
        ),
    ];
    let mut out = String::from(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Cohort evaluation\
         </title>\n<style>body{font:15px sans-serif;max-width:70em;margin:2em auto;padding:0 1em}\
         table{border-collapse:collapse}td,th{padding:.2em .7em;border-bottom:1px solid #ddd;\
         text-align:right}td:first-child,th:first-child{text-align:left}svg{margin:1em}</style>\n\
         <h1>Cohort evaluation</h1>\n",
    );
    out.push_str("<h2>Figure 3: mean fitness of the models (raw form)</h2>\n");
    out.push_str(&plot("mean fitness", &figure3));
    out.push_str("<h2>Agreement with the expert</h2>\n");
    out.push_str(&plot("Jaccard E_J", &series("jaccard")));
    out.push_str(&plot(
        "contour distance E_CD, voxels",
        &series("contour_distance_voxels"),
    ));
    out.push_str("<h2>Agreement with the anatomical truth</h2>\n");
    out.push_str(&plot("Jaccard E_J", &series("jaccard_truth")));
    for template in &templates {
        out.push_str(&table1(rows, template, &points));
    }
    out.push_str("</html>\n");
    out
}

/// Table 1 of one template: E_J / E_CD of each patient and N.
fn table1(rows: &[Row], template: &str, points: &[usize]) -> String {
    let mut out = format!(
        "<h2>Table 1, model from {}</h2>\n<table><tr><th>patient</th>",
        escape(template)
    );
    for n in points {
        let _ = write!(out, "<th>N = {n}</th>");
    }
    out.push_str("</tr>\n");
    for case in distinct(rows, |r| r.case.clone()) {
        let _ = write!(out, "<tr><td>{}</td>", escape(&case));
        for n in points {
            let row = chosen(rows, Some(template), *n).find(|r| r.case == case);
            let pair =
                row.and_then(|r| Some((r.get("jaccard")?, r.get("contour_distance_voxels")?)));
            match pair {
                Some((jaccard, distance)) => {
                    let _ = write!(out, "<td>{jaccard:.3} / {distance:.3}</td>");
                }
                None => out.push_str("<td>-</td>"),
            }
        }
        out.push_str("</tr>\n");
    }
    out.push_str("<tr><th>mean</th>");
    for n in points {
        let of = |name| mean(rows, Some(template), *n, name).unwrap_or(f64::NAN);
        let _ = write!(
            out,
            "<th>{:.3} / {:.3}</th>",
            of("jaccard"),
            of("contour_distance_voxels")
        );
    }
    out.push_str("</tr></table>\n");
    out
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;")
}

/// Lines over N as SVG.
fn plot(title: &str, series: &[(String, Vec<(f64, f64)>)]) -> String {
    const COLOURS: [&str; 7] = [
        "#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#000000",
    ];
    let all = || series.iter().flat_map(|s| s.1.iter());
    let range = |pick: fn(&(f64, f64)) -> f64| {
        let low = all().map(pick).fold(f64::INFINITY, f64::min);
        let high = all().map(pick).fold(f64::NEG_INFINITY, f64::max);
        let margin = 0.05 * (high - low).max(1e-6);
        (low - margin, high + margin)
    };
    let ((x0, x1), (y0, y1)) = (range(|p| p.0), range(|p| p.1));
    let at = |p: &(f64, f64)| {
        (
            60.0 + 380.0 * (p.0 - x0) / (x1 - x0),
            260.0 - 220.0 * (p.1 - y0) / (y1 - y0),
        )
    };
    let mut out = format!(
        "<svg width=\"600\" height=\"310\" font-size=\"12\"><text x=\"60\" y=\"20\" \
         font-weight=\"bold\">{}</text><path d=\"M60 40V260H440\" fill=\"none\" \
         stroke=\"#888\"/>",
        escape(title)
    );
    for step in 0..5 {
        let y = y0 + (y1 - y0) * f64::from(step) / 4.0;
        let _ = write!(
            out,
            "<text x=\"54\" y=\"{:.1}\" text-anchor=\"end\">{y:.3}</text>",
            264.0 - 55.0 * f64::from(step)
        );
    }
    for (n, (label, line)) in series.iter().enumerate() {
        let colour = COLOURS[n % COLOURS.len()];
        let path: Vec<String> = line
            .iter()
            .map(|p| {
                let (x, y) = at(p);
                format!("{x:.1},{y:.1}")
            })
            .collect();
        let _ = write!(
            out,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>\
             <text x=\"455\" y=\"{}\" fill=\"{colour}\">{}</text>",
            path.join(" "),
            55 + 18 * n,
            escape(label)
        );
        for p in line {
            let (x, _) = at(p);
            let _ = write!(
                out,
                "<text x=\"{x:.1}\" y=\"278\" text-anchor=\"middle\">{}</text>",
                p.0
            );
        }
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(case: &str, points: usize, jaccard: Option<f64>) -> Row {
        Row {
            template: "t1".into(),
            points,
            case: case.into(),
            figures: vec![
                ("jaccard", jaccard),
                ("contour_distance_voxels", jaccard.map(|j| 1.0 - j)),
            ],
            reason: "converged".into(),
        }
    }

    #[test]
    fn a_lost_case_counts_as_no_agreement() {
        let rows = [row("p1", 150, Some(0.8)), row("p2", 150, None)];
        assert_eq!(mean(&rows, None, 150, "jaccard"), Some(0.4));
        let distance = mean(&rows, None, 150, "contour_distance_voxels").unwrap();
        assert!((distance - 0.2).abs() < 1e-12);
        assert_eq!(mean(&rows, Some("t2"), 150, "jaccard"), None);
    }

    #[test]
    fn every_fit_has_a_line_and_a_cell() {
        let rows = [
            row("p1", 67, Some(0.71)),
            row("p1", 150, Some(0.82)),
            row("p2", 150, None),
        ];
        let text = csv(&rows);
        assert_eq!(text.lines().count(), 4);
        assert!(text.lines().all(|l| l.split(',').count() == 6));
        let page = html(&rows, &[]);
        assert!(page.contains("0.820 / 0.180") && page.contains("<td>-</td>"));
        assert!(!page.contains("http://") && !page.contains("https://"));
        let value = to_json(&rows, &[]);
        assert_eq!(value["fits"].as_array().unwrap().len(), 3);
        assert_eq!(value["means"][0]["points"], 67);
    }
}
