//! The page of a cohort's evaluation: findings, curves, Table 1, slices.
//!
//! In: an [`Evaluation`]. Out: one self-contained HTML page without scripts; pictures are inside.

use maud::{Markup, html};

use super::calibration::CaseFigures;
use super::findings::FindingVerdict;
use super::leave_one_out::Candidate;
use super::rows::{self, Cell, FitRow, Gold, ModelKind, ModelRow, Variant};
use super::sample::Sample;
use super::table::{Evaluation, OF_MODELS, table1};
use crate::heart::reader::ReaderDrawing;
use crate::image::draw::chart::{self, Series};
use crate::image::draw::document::HtmlDocument;
use crate::image::draw::text::data_uri;
use crate::runs::segmentation::slices;

/// The page.
pub fn cohort_page(evaluation: &Evaluation) -> String {
    HtmlDocument {
        title: "Cohort evaluation",
        subtitle: "Models of the templates, fitted to every patient",
        body: html! {
            (settings(evaluation))
            (problems(evaluation))
            (findings(evaluation))
            (figure3(&evaluation.models))
            @for gold in Gold::ALL { (agreement(&evaluation.rows, gold)) }
            (leave_one_out(evaluation))
            (reader(evaluation))
            (pictures(evaluation))
        },
        data: None,
        footer: concat!(
            env!("CARGO_PKG_NAME"),
            " ",
            env!("CARGO_PKG_VERSION"),
            ". Research software: not a medical device."
        ),
    }
    .html()
}

fn settings(evaluation: &Evaluation) -> Markup {
    html! {
        section {
            h2 { "Settings" }
            table {
                tbody {
                    @for (name, value) in &evaluation.settings {
                        tr { th scope="row" { (name) } td.text { (value) } }
                    }
                    @for (case, source) in &evaluation.templates {
                        tr { th scope="row" { "template " (case) } td.text { (source) } }
                    }
                }
            }
        }
    }
}

fn problems(evaluation: &Evaluation) -> Markup {
    html! {
        @if !evaluation.problems.is_empty() {
            section {
                h2 { "What is missing" }
                table {
                    tbody {
                        @for (case, problem) in &evaluation.problems {
                            tr { th scope="row" { (case) } td.text { (problem) } }
                        }
                    }
                }
            }
        }
    }
}

fn findings(evaluation: &Evaluation) -> Markup {
    html! {
        section {
            h2 { "The paper's findings" }
            table {
                tbody {
                    @for finding in &evaluation.findings {
                        tr {
                            td.text { (finding.claim) }
                            td.good[finding.verdict == FindingVerdict::Confirmed]
                                .bad[finding.verdict == FindingVerdict::Refuted] {
                                (finding.verdict.as_str())
                            }
                            td.text { (finding.sample.as_str()) }
                            td.text { (finding.figures) }
                        }
                    }
                }
            }
        }
    }
}

fn class(variant: Variant) -> &'static str {
    match variant {
        Variant::Auto => "faint",
        Variant::Reference => "red",
        Variant::Retiled | Variant::Flipped => "orange",
        Variant::Fitted | Variant::Optimised => "blue",
    }
}

const POINTS_COLUMN: &str = "points N";

fn figure3(models: &[ModelRow]) -> Markup {
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
                    class: class(*variant),
                    thin: matches!(variant, Variant::Flipped | Variant::Fitted),
                    points: points.collect(),
                }
            })
            .collect()
    };
    html! {
        section {
            h2 { "Figure 3: mean fitness of the models (" (OF_MODELS.as_str()) ")" }
            p {
                "Over the templates; higher is better. The paper gives neither units nor floors, "
                "so only the shapes of the curves can be compared with its figure. Thin lines: what the "
                "flips (raw form, gain of the pair, no guard, as in the paper) and the least-squares fit "
                "(whose own flips only even out triangles) do to the re-tiled model, each without "
                "the other. The reciprocals "
                "of the raw form reward nearly flat pairs of triangles without limit: judge the "
                "models by the triangles' shape as well."
            }
            div.row.beside {
                (chart::lines("Fitness, the paper's raw form", POINTS_COLUMN, &series(|m| m.raw)))
                (chart::lines("Fitness, normalised (1 is perfect)", POINTS_COLUMN, &series(|m| m.normalised)))
                (chart::lines("Triangle shape 2r/R, mean", POINTS_COLUMN, &series(|m| m.shape)))
            }
        }
    }
}

fn agreement(rows: &[FitRow], gold: Gold) -> Markup {
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
    html! {
        section {
            h2 { (title) " (" (sample(rows).as_str()) ")" }
            @if rows.iter().any(|r| r.golds[gold as usize]) {
                p { (about) }
                div.row.beside {
                    (chart::lines(
                        "Jaccard E_J (eq. 2), higher is better",
                        POINTS_COLUMN,
                        &curves(rows, gold, |c| Some(c.jaccard)),
                    ))
                    (chart::lines(
                        "Contour distance E_CD (eq. 3), voxels, lower is better",
                        POINTS_COLUMN,
                        &curves(rows, gold, |c| c.contour),
                    ))
                }
                h3 { "Table 1 against " (gold.file()) ": E_J / E_CD (voxels), " (sample(rows).as_str()) }
                (table_by_template(rows, gold))
            } @else {
                p { "No patient has " (gold.file()) "." }
            }
        }
    }
}

/// Table 1: for each template, and for the mean over all of them, a table to unfold.
fn table_by_template(rows: &[FitRow], gold: Gold) -> Markup {
    let table = table1(rows, gold);
    html! {
        @for template in rows::distinct(&table, |l| l.0.template.clone()) {
            @let lines: Vec<_> = table.iter().filter(|l| l.0.template == template).collect();
            details open[template == "all" && gold == Gold::Expert] {
                summary {
                    @if template == "all" { "Mean over all templates" }
                    @else { "Models of " (template) }
                }
                div.scroll tabindex="0" role="group" aria-label="Table, scrollable" {
                    table.agreement {
                        thead {
                            tr {
                                th { "patient" }
                                @for (kind, _) in lines.iter().take(1).flat_map(|line| &line.1) {
                                    th.n { (kind.variant.title()) br; (kind.points) }
                                }
                            }
                        }
                        tbody {
                            @for (line, cells) in lines { (table_line(rows, &line.case, cells)) }
                        }
                    }
                }
            }
        }
    }
}

fn table_line(rows: &[FitRow], case: &str, cells: &[(ModelKind, Option<Cell>)]) -> Markup {
    let best = cells
        .iter()
        .filter_map(|(_, c)| c.map(|c| c.jaccard))
        .fold(0.0, f64::max);
    html! {
        tr.mean[case == "mean"] {
            th scope="row" { (case) " " span.soft { (line_sample(cells)) } }
            @for (_, cell) in cells {
                @match cell {
                    Some(Cell { jaccard, contour: Some(contour), .. }) => {
                        td.n.best[*jaccard == best] {
                            (format_args!("{jaccard:.3} / {contour:.3}"))
                        }
                    }
                    Some(cell) => { td.n { (format_args!("{:.3} / -", cell.jaccard)) } }
                    None => { td { (why_empty(rows, case)) } }
                }
            }
        }
    }
}

/// The sample of figures over all rows.
fn sample(rows: &[FitRow]) -> Sample {
    let samples = rows.iter().map(|r| r.sample);
    samples.fold(Sample::HeldOut, Sample::and)
}

/// The sample of a line of Table 1.
fn line_sample(cells: &[(ModelKind, Option<Cell>)]) -> &'static str {
    let samples = cells.iter().filter_map(|(_, cell)| Some((*cell)?.sample));
    samples.reduce(Sample::and).map_or("", Sample::as_str)
}

fn leave_one_out(evaluation: &Evaluation) -> Markup {
    let Some(found) = &evaluation.leave_one_out else {
        return html! {};
    };
    let name = |m: &Candidate| {
        format!(
            "{}, {}, {}",
            m.template,
            m.kind.variant.title(),
            m.kind.points
        )
    };
    let figure = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    let [held_out, in_sample] = found.means();
    html! {
        section {
            h2 { "The model chosen for each case without it" }
            p {
                "Held-out: E_J of the model that is best over the other cases. In-sample: that of the \
                 model that is best over all cases (" (name(&found.best)) ")."
            }
            table.agreement {
                thead { tr { th { "case" } th { "model" } th.n { "held-out" } th.n { "in-sample" } } }
                tbody {
                    @for choice in &found.choices {
                        tr {
                            th scope="row" { (choice.case) }
                            td.text { (name(&choice.chosen)) }
                            td.n { (figure(Some(choice.held_out))) }
                            td.n { (figure(choice.in_sample)) }
                        }
                    }
                    tr.mean {
                        th scope="row" { "mean" }
                        td {}
                        td.n { (figure(held_out)) }
                        td.n { (figure(in_sample)) }
                    }
                }
            }
        }
    }
}

fn reader(evaluation: &Evaluation) -> Markup {
    let Some(made) = &evaluation.reader else {
        return html! {};
    };
    let learnt = match made.profile.drawing() {
        ReaderDrawing::Edge(offsets) => format!(
            "endocardium {:+.2}, epicardium {:+.2} mm outward, rim {:+.2} mm towards the base",
            offsets.endocardium, offsets.epicardium, offsets.rim
        ),
        ReaderDrawing::Level(level) => {
            format!("{:.0} % of the polar map's reference", 100.0 * level)
        }
    };
    let figure = |f: &CaseFigures| format!("{:.3} / {:.3}", f.jaccard, f.contour);
    html! {
        section {
            h2 { "The reader's profile" }
            p {
                "Learnt on " (made.profile.masks()) " masks, kind " (made.kind().as_str()) ": " (learnt) ". "
                "E_J / E_CD of the built-in "
                "model without a profile, by a profile learnt on the other masks (held-out), and by the "
                "one that has seen the case (in-sample)."
            }
            table.agreement {
                thead {
                    tr {
                        th { "case" } th.n { "without" } th.n { "held-out" } th.n { "in-sample" }
                    }
                }
                tbody {
                    @for row in &made.rows {
                        tr {
                            th scope="row" { (row.case) }
                            td.n { (figure(&row.without)) }
                            @for sample in [Sample::HeldOut, Sample::InSample] {
                                td.n {
                                    @if let Some(f) = &made.figures(row, sample) { (figure(f)) } @else { "-" }
                                }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The reason for a cell without figures.
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
            class: class(*variant),
            thin: false,
            points: line(*variant, None),
        })
        .collect();
    let templates = rows::distinct(rows, |r| r.template.clone());
    for template in templates.iter().filter(|_| templates.len() > 1) {
        series.push(Series {
            label: format!("models of {template}"),
            class: "faint",
            thin: true,
            points: line(Variant::Optimised, Some(template)),
        });
    }
    series.retain(|s| !s.points.is_empty());
    series
}

fn pictures(evaluation: &Evaluation) -> Markup {
    html! {
        @if !evaluation.pictures.is_empty() {
            section {
                h2 { "Slices" }
                p {
                    "Short axis (anterior on top, septum left), horizontal long axis (apex on "
                    "top, septum left), vertical long axis (base left, anterior on top)."
                }
                p.legend {
                    span.key-fit { "the fit" }
                    span.key-expert { "the expert (" (Gold::Expert.file()) ")" }
                }
                div.row.beside {
                    @for picture in &evaluation.pictures {
                        figure.slices {
                            img alt=(format!("Slices of {}", picture.case))
                                width=(3 * slices::SLICE_SIDE_PX + 8)
                                src=(data_uri("image/png", &picture.png));
                            p.soft { (picture.caption) }
                        }
                    }
                }
            }
        }
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
        let page = cohort_page(&evaluation);
        // The one other "http" is the name of an attribute.
        let page = page.replace("http-equiv=", "");
        assert!(!page.contains("http") && !page.contains("<script"));
        assert!(page.contains("0.710 / 0.290") && page.contains("p&lt;2"));
        assert!(page.contains("0.000 / -") && page.contains("<td>unreadable</td>"));
        assert!(page.contains("data:image/png;base64,AQID"));
        assert!(page.contains("What is missing"));
        assert!(page.contains("(voxels), held-out"));
    }
}
