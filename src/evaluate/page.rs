//! The results as one self-contained page: no script, no outside link, pictures inside.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD as BASE64;

use super::plot::{Series, escape, plot};
use super::rows::{self, Cell, FitRow, Gold, ModelKind, ModelRow, Variant};
use super::table::{Evaluation, table1};
use crate::segmentation::slices;

const STYLE: &str = "body{font:15px/1.45 system-ui,sans-serif;color:#1c2430;max-width:76em;\
margin:2em auto;padding:0 1em}h1,h2,h3{line-height:1.2}table{border-collapse:collapse;\
font-variant-numeric:tabular-nums}td,th{padding:.2em .7em;border-bottom:1px solid #dde2e8;\
text-align:right;font-weight:normal}th{font-weight:600}td:first-child,th:first-child,\
td.text{text-align:left}tr.mean td{font-weight:600;border-top:2px solid #1c2430}\
.scroll td,.scroll th{padding:.2em .5em}\
td.best{background:#e2f2e4}.scroll{overflow-x:auto;font-size:13px;white-space:nowrap}\
svg{font:12px system-ui,sans-serif;max-width:100%;height:auto}svg .title{font-weight:600;font-size:13px}.grid{stroke:#e4e8ed}\
.tick{fill:#5b6673}figure{margin:.5em 0;display:inline-block}figcaption{color:#5b6673;\
font-size:13px}img{max-width:100%}.confirmed{color:#17722f}.refuted{color:#b3261e}\
.plots{display:flex;flex-wrap:wrap;gap:1em}summary{cursor:pointer;margin:.6em 0}";

/// The page.
pub fn html(evaluation: &Evaluation) -> String {
    let mut out = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\">\
         <title>Cohort evaluation</title><style>{STYLE}</style></head><body>\n\
         <h1>Cohort evaluation</h1>\n"
    );
    settings(&mut out, evaluation);
    findings(&mut out, evaluation);
    figure3(&mut out, &evaluation.models);
    for gold in Gold::ALL {
        agreement(&mut out, &evaluation.rows, gold);
    }
    pictures(&mut out, evaluation);
    out.push_str("</body></html>\n");
    out
}

fn settings(out: &mut String, evaluation: &Evaluation) {
    out.push_str("<table>");
    for (name, value) in &evaluation.settings {
        row_of_text(out, name, value);
    }
    for (case, source) in &evaluation.templates {
        row_of_text(out, &format!("template {case}"), source);
    }
    out.push_str("</table>\n");
    if evaluation.problems.is_empty() {
        return;
    }
    out.push_str("<h2>What is missing</h2>\n<table>");
    for (case, problem) in &evaluation.problems {
        row_of_text(out, case, problem);
    }
    out.push_str("</table>\n");
}

fn row_of_text(out: &mut String, name: &str, value: &str) {
    let _ = write!(
        out,
        "<tr><td>{}</td><td class=\"text\">{}</td></tr>",
        escape(name),
        escape(value)
    );
}

fn findings(out: &mut String, evaluation: &Evaluation) {
    out.push_str("<h2>The paper's findings</h2>\n<table>");
    for f in &evaluation.findings {
        let _ = write!(
            out,
            "<tr><td>{}</td><td class=\"text {verdict}\">{verdict}</td><td class=\"text\">{}</td></tr>",
            escape(f.claim),
            escape(&f.figures),
            verdict = f.verdict.as_str()
        );
    }
    out.push_str("</table>\n");
}

fn colour(variant: Variant) -> &'static str {
    match variant {
        Variant::Reference => "#b3261e",
        Variant::Retiled => "#d98200",
        Variant::Optimised => "#1f5fbf",
    }
}

fn figure3(out: &mut String, models: &[ModelRow]) {
    out.push_str(
        "<h2>Figure 3: mean fitness of the models</h2>\n<p>Over the templates; higher is \
         better. The paper leaves units and floors open, so that only the shape of the curves \
         can be compared with its. The raw form's reciprocals reward nearly flat pairs beyond \
         all measure, so look at the triangles' shape beside it.</p>\n<div class=\"plots\">",
    );
    let series = |pick: fn(&ModelRow) -> f64| -> Vec<Series> {
        Variant::ALL
            .iter()
            .map(|variant| {
                let own: Vec<&ModelRow> = models
                    .iter()
                    .filter(|m| m.kind.variant == *variant)
                    .collect();
                let mut numbers = rows::distinct(&own, |m| m.kind.points);
                numbers.sort_unstable();
                let points = numbers.iter().filter_map(|n| {
                    let at = own.iter().filter(|m| m.kind.points == *n);
                    let values: Vec<f64> = at.map(|m| pick(m)).collect();
                    Some((*n as f64, rows::average(&values)?))
                });
                Series {
                    label: variant.title().into(),
                    colour: colour(*variant),
                    thin: false,
                    points: points.collect(),
                }
            })
            .collect()
    };
    out.push_str(&plot("Fitness, the paper's raw form", &series(|m| m.raw)));
    out.push_str(&plot(
        "Fitness, normalised (1 is perfect)",
        &series(|m| m.normalised),
    ));
    out.push_str(&plot("Triangle shape 2r/R, mean", &series(|m| m.shape)));
    out.push_str("</div>\n");
}

fn agreement(out: &mut String, rows: &[FitRow], gold: Gold) {
    let (title, about) = match gold {
        Gold::Expert => (
            "Agreement with the expert",
            "lv_expert_img: what a reader would draw on the image. The paper's gold standard.",
        ),
        Gold::Truth => (
            "Agreement with the anatomical truth",
            "lv_truth: the wall as it is. A blurred image does not show it: a perfect image \
             edge reaches an E_J of about 0.7.",
        ),
    };
    if !rows.iter().any(|r| r.golds[gold as usize]) {
        let _ = writeln!(
            out,
            "<h2>{title}</h2>\n<p>No patient has {}.</p>",
            gold.file()
        );
        return;
    }
    let _ = write!(
        out,
        "<h2>{title}</h2>\n<p>{about}</p>\n<div class=\"plots\">"
    );
    out.push_str(&plot(
        "Jaccard E_J (eq. 2), higher is better",
        &curves(rows, gold, |c| Some(c.jaccard)),
    ));
    out.push_str(&plot(
        "Contour distance E_CD (eq. 3), voxels, lower is better",
        &curves(rows, gold, |c| c.contour),
    ));
    let _ = write!(
        out,
        "</div>\n<h3>Table 1 against {}: E_J / E_CD (voxels)</h3>\n",
        gold.file()
    );
    let table = table1(rows, gold);
    for template in rows::distinct(&table, |l| l.0.template.clone()) {
        let lines: Vec<_> = table.iter().filter(|l| l.0.template == template).collect();
        let open = if template == "all" && gold == Gold::Expert {
            " open"
        } else {
            ""
        };
        let name = if template == "all" {
            "Mean over all templates".to_owned()
        } else {
            format!("Models of {}", escape(&template))
        };
        let _ = write!(
            out,
            "<details{open}><summary>{name}</summary><div class=\"scroll\"><table><tr>\
             <th>patient</th>"
        );
        for (kind, _) in &lines[0].1 {
            let _ = write!(out, "<th>{}<br>{}</th>", kind.variant.title(), kind.points);
        }
        out.push_str("</tr>\n");
        for (line, cells) in lines {
            table_line(out, rows, &line.case, cells);
        }
        out.push_str("</table></div></details>\n");
    }
}

fn table_line(out: &mut String, rows: &[FitRow], case: &str, cells: &[(ModelKind, Option<Cell>)]) {
    let class = if case == "mean" {
        " class=\"mean\""
    } else {
        ""
    };
    let _ = write!(out, "<tr{class}><td>{}</td>", escape(case));
    let best = cells
        .iter()
        .filter_map(|(_, c)| c.map(|c| c.jaccard))
        .fold(0.0, f64::max);
    for (_, cell) in cells {
        match cell {
            Some(c) if c.contour.is_some() => {
                let class = if c.jaccard == best {
                    " class=\"best\""
                } else {
                    ""
                };
                let contour = c.contour.unwrap_or_default();
                let _ = write!(out, "<td{class}>{:.3} / {contour:.3}</td>", c.jaccard);
            }
            Some(c) => {
                let _ = write!(out, "<td>{:.3} / -</td>", c.jaccard);
            }
            None => {
                let _ = write!(out, "<td>{}</td>", why_empty(rows, case));
            }
        }
    }
    out.push_str("</tr>\n");
}

/// What a cell without figures says.
fn why_empty(rows: &[FitRow], case: &str) -> &'static str {
    let unreadable = |r: &FitRow| matches!(r.outcome, rows::FitOutcome::Unreadable(_));
    if rows.iter().any(|r| r.case == case && unreadable(r)) {
        "unreadable"
    } else {
        "no gold standard"
    }
}

/// One line for each variant, thin ones for the templates of the finished models.
fn curves(rows: &[FitRow], gold: Gold, pick: fn(&Cell) -> Option<f64>) -> Vec<Series> {
    let kinds = rows::kinds(rows);
    let line = |variant: Variant, template: Option<&str>| -> Vec<(f64, f64)> {
        kinds
            .iter()
            .filter(|k| k.variant == variant)
            .filter_map(|kind| {
                let cell = rows::mean(rows::of_kind(rows, template, *kind), gold)?;
                Some((kind.points as f64, pick(&cell)?))
            })
            .collect()
    };
    let mut series: Vec<Series> = Variant::ALL
        .iter()
        .map(|variant| Series {
            label: variant.title().into(),
            colour: colour(*variant),
            thin: false,
            points: line(*variant, None),
        })
        .filter(|s| !s.points.is_empty())
        .collect();
    let templates = rows::distinct(rows, |r| r.template.clone());
    for template in templates.iter().filter(|_| templates.len() > 1) {
        series.push(Series {
            label: format!("models of {template}"),
            colour: "#8fa3bd",
            thin: true,
            points: line(Variant::Optimised, Some(template)),
        });
    }
    series
}

fn pictures(out: &mut String, evaluation: &Evaluation) {
    if evaluation.pictures.is_empty() {
        return;
    }
    let css = |c: [u8; 3]| format!("rgb({},{},{})", c[0], c[1], c[2]);
    let _ = write!(
        out,
        "<h2>Slices</h2>\n<p>Short axis (anterior on top, septum left), horizontal long axis \
         (apex on top, septum left), vertical long axis (base left, anterior on top). \
         <b style=\"color:{}\">Orange: the fit.</b> <b style=\"color:#0086a3\">Blue: the \
         expert</b> ({}).</p>\n",
        css([190, 110, 0]),
        Gold::Expert.file()
    );
    for picture in &evaluation.pictures {
        let _ = writeln!(
            out,
            "<figure><img alt=\"Slices of {case}\" width=\"{}\" src=\"data:image/png;base64,{}\">\
             <figcaption>{}</figcaption></figure>",
            3 * slices::SIDE + 8,
            BASE64.encode(&picture.png),
            escape(&picture.caption),
            case = escape(&picture.case)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::super::findings::findings;
    use super::super::rows::tests::row;
    use super::super::table::Picture;
    use super::*;

    #[test]
    fn the_page_stands_alone_and_shows_every_case() {
        let mut rows = vec![
            row("p1", Variant::Reference, 67, Some(0.7)),
            row("p1", Variant::Optimised, 67, Some(0.71)),
            row("p<2", Variant::Optimised, 67, Some(0.72)),
            row("p3", Variant::Optimised, 67, None),
            row("p4", Variant::Optimised, 67, None),
        ];
        rows[4].outcome = rows::FitOutcome::Unreadable("truncated".into());
        let evaluation = Evaluation {
            findings: findings(&rows, &[]),
            rows,
            problems: vec![("p4".into(), "truncated".into())],
            pictures: vec![Picture {
                case: "p1".into(),
                caption: "p1".into(),
                png: vec![1, 2, 3],
            }],
            ..Evaluation::default()
        };
        let page = html(&evaluation);
        assert!(!page.contains("http") && !page.contains("<script"));
        assert!(page.contains("0.710 / 0.290") && page.contains("p&lt;2"));
        assert!(page.contains("0.000 / -") && page.contains("<td>unreadable</td>"));
        assert!(page.contains("data:image/png;base64,AQID"));
        assert!(page.contains("What is missing"));
    }
}
