//! The page of a segmentation: how far to believe it, what came out, and pictures to see it by.
//!
//! It is made of the segmentation's own files, its report above all, so that it can be made
//! when it is asked for, whether or not the volume is still at hand. What a report does not
//! say is left out of the page.

use serde_json::{Map, Value};

use super::parts::{self, Verdict, figure};
use super::text::{data_uri, escape, number, signed};
use super::{Software, document};
use crate::mesh::TriMesh;

/// A segmentation's report with what can be shown of it.
#[derive(Debug, Clone, Copy)]
pub struct Pictured<'a> {
    /// The report.
    pub report: &'a Value,
    /// The fitted model.
    pub mesh: &'a TriMesh,
    /// Slices of the volume with the contour of the fit: a PNG of three squares side by side.
    pub slices: Option<&'a [u8]>,
    /// The polar map as SVG.
    pub polar: Option<&'a [u8]>,
}

/// The page.
pub fn segmentation(made: &Pictured) -> String {
    let report = Report(made.report);
    let body = [
        verdict(&report),
        figures(&report),
        parts::warnings("Reasons to look closer", report.flags().map(|flag| flag.1)),
        parts::warnings("Please note", report.texts("/warnings")),
        made.slices
            .map_or_else(String::new, |png| slices(&report, png)),
        made.polar
            .map_or_else(String::new, |svg| polar(&report, svg)),
        agreement(&report),
        parts::model("The fitted model", made.mesh),
        candidates(&report),
        particulars(&report),
    ]
    .concat();
    let title = format!("{}: segmentation", report.organ());
    document(&title, &origin(&report), &body, &Software::this())
}

/// A report in JSON, asked for what may be there.
struct Report<'a>(&'a Value);

impl<'a> Report<'a> {
    fn number(&self, pointer: &str) -> Option<f64> {
        self.0.pointer(pointer)?.as_f64()
    }

    fn text(&self, pointer: &str) -> Option<&'a str> {
        self.0.pointer(pointer)?.as_str()
    }

    fn list(&self, pointer: &str) -> &'a [Value] {
        let found = self.0.pointer(pointer).and_then(Value::as_array);
        found.map_or(&[], Vec::as_slice)
    }

    fn texts(&self, pointer: &str) -> impl Iterator<Item = &'a str> {
        self.list(pointer).iter().filter_map(Value::as_str)
    }

    /// Code and reason of every flag.
    fn flags(&self) -> impl Iterator<Item = (&'a str, &'a str)> {
        let flags = self.list("/flags").iter();
        flags.filter_map(|flag| Some((flag.get("code")?.as_str()?, flag.get("reason")?.as_str()?)))
    }

    fn is_ventricle(&self) -> bool {
        self.text("/parameters/organ") == Some("left_ventricle")
    }

    /// What is shown, as a heading begins.
    fn organ(&self) -> String {
        let word = self.text("/parameters/organ").unwrap_or("generic");
        match word {
            "generic" => "Organ".to_owned(),
            _ => {
                let (first, rest) = word.split_at(1);
                first.to_uppercase() + &rest.replace('_', " ")
            }
        }
    }
}

/// One line on where the segmentation comes from.
fn origin(report: &Report) -> String {
    let list = |pointer: &str, decimals: usize| {
        let numbers = report.list(pointer).iter().filter_map(Value::as_f64);
        let texts: Vec<String> = numbers.map(|x| number(x, decimals)).collect();
        (!texts.is_empty()).then(|| texts.join(" × "))
    };
    [
        report.text("/template").map(|name| format!("Model {name}")),
        report
            .text("/input/format")
            .map(|format| format!("volume: {format}")),
        list("/input/shape", 0).map(|shape| format!("{shape} voxels")),
        list("/input/spacing_mm", 2).map(|spacing| format!("{spacing} mm")),
    ]
    .into_iter()
    .flatten()
    .collect::<Vec<_>>()
    .join(" · ")
}

/// What would be flagged, each with whether it holds.
fn checks(report: &Report) -> Vec<(bool, String)> {
    let percent = |pointer: &str| {
        let share = report.number(pointer).unwrap_or(f64::NAN);
        number(100.0 * share, 0)
    };
    let mut checks = vec![
        (
            "poor_contrast",
            format!(
                "An edge is seen along {} % of the surface",
                percent("/fit/active_sensors")
            ),
        ),
        (
            "not_at_rest",
            format!(
                "The model came to rest: {} after {} steps",
                report.text("/fit/reason").unwrap_or("–").replace('_', " "),
                number(report.number("/fit/iterations").unwrap_or(f64::NAN), 0)
            ),
        ),
        (
            "folded",
            "No triangle cuts another one or is turned over".to_owned(),
        ),
        (
            "touches_border",
            "The organ lies inside of the volume".to_owned(),
        ),
    ];
    if report.is_ventricle() {
        checks.extend([
            (
                "uncertain_place",
                format!("The heart's place: {} % sure", percent("/fit/confidence")),
            ),
            ("dark_apex", "The apical wall is seen".to_owned()),
            (
                "implausible_shape",
                "Volumes, thickness and length as hearts have them".to_owned(),
            ),
            (
                "valve_plane",
                "The wall reaches all round up to the base".to_owned(),
            ),
        ]);
    }
    let raised = |code: &str| report.flags().any(|flag| flag.0 == code);
    checks
        .into_iter()
        .map(|(code, text)| (!raised(code), text))
        .collect()
}

fn verdict(report: &Report) -> String {
    let (outcome, headline) = match report.flags().count() {
        0 => (
            Verdict::Good,
            "Nothing gives reason to doubt this segmentation.".to_owned(),
        ),
        1 => (
            Verdict::Doubt,
            "There is one reason to look closer.".to_owned(),
        ),
        n => (
            Verdict::Doubt,
            format!("There are {n} reasons to look closer."),
        ),
    };
    parts::verdict(outcome, &headline, &checks(report))
}

fn figures(report: &Report) -> String {
    let wall = match report.is_ventricle() {
        true => "volume of the wall",
        false => "volume of the organ",
    };
    let rows: [(&str, usize, &str, &str); 8] = [
        ("/volumes_ml/wall", 1, "ml", wall),
        ("/volumes_ml/cavity", 1, "ml", "volume of the cavity"),
        ("/wall_thickness_mm", 1, "mm", "mean thickness of the wall"),
        (
            "/polar/extent_percent",
            1,
            "%",
            "of the wall below the threshold of uptake",
        ),
        (
            "/measures/jaccard",
            3,
            "of 1",
            "Jaccard index against the expert (E_J)",
        ),
        ("/measures/dice", 3, "of 1", "Dice index against the expert"),
        (
            "/measures/contour_distance_voxels",
            3,
            "voxels",
            "mean distance of the contours (E_CD)",
        ),
        (
            "/measures/hausdorff95_mm",
            1,
            "mm",
            "within which 95 % of the contours lie of each other",
        ),
    ];
    let figures: Vec<String> = rows
        .into_iter()
        .filter_map(|(pointer, decimals, unit, label)| {
            let value = number(report.number(pointer)?, decimals);
            Some(figure(value, unit, label.to_owned()))
        })
        .collect();
    parts::figures(&figures)
}

fn slices(report: &Report, png: &[u8]) -> String {
    let (about, names) = match report.is_ventricle() {
        true => (
            "Planes of the heart through the middle of its cavity: anterior on top and septum on \
             the left of the first, apex on top of the second and on the right of the third.",
            ["Short axis", "Horizontal long axis", "Vertical long axis"],
        ),
        false => (
            "Planes of the patient through the middle of the organ: the patient's right on the \
             left of the first two, anterior on top of the first and on the left of the third.",
            ["Axial", "Coronal", "Sagittal"],
        ),
    };
    let expert = match report.0.get("measures") {
        Some(Value::Object(_)) => r#"<span class="key-expert">the expert's mask</span>"#,
        _ => "",
    };
    let names = names.map(|name| format!("<span>{name}</span>")).concat();
    format!(
        r#"<section><h2>Slices</h2><p class="hint">{about}</p><p class="legend"><span class="key-fit">the fitted surface</span>{expert}</p><figure class="slices"><img src="{}" alt="Three slices of the volume with the contour of the fit"><figcaption>{names}</figcaption></figure></section>"#,
        data_uri("image/png", png)
    )
}

/// The polar map beside its segments.
fn polar(report: &Report, svg: &[u8]) -> String {
    let cell = |segment: &Value, key: &str| {
        let value = segment.get(key).and_then(Value::as_f64);
        format!(
            r#"<td class="n">{}</td>"#,
            number(value.unwrap_or(f64::NAN), 1)
        )
    };
    let word = |segment: &Value, key: &str| {
        escape(segment.get(key).and_then(Value::as_str).unwrap_or_default())
    };
    let rows: String = report
        .list("/polar/segments")
        .iter()
        .map(|segment| {
            let place = segment.get("number").and_then(Value::as_u64).unwrap_or(0);
            format!(
                r#"<tr><td class="n">{place}</td><th scope="row">{}</th><td>{}</td>{}{}</tr>"#,
                word(segment, "name"),
                word(segment, "territory"),
                cell(segment, "mean_percent"),
                cell(segment, "extent_percent")
            )
        })
        .collect();
    let threshold = number(
        report
            .number("/polar/threshold_percent")
            .unwrap_or(f64::NAN),
        0,
    );
    format!(
        r#"<section><h2>Uptake of the wall</h2><p class="hint">Polar map of the 17 segments of the American Heart Association: apex in the centre, anterior on top, septum on the left. In per cent of the hottest quarter of this scan's own wall; there is no normal database behind it.</p><div class="row beside"><figure class="paper"><img src="{}" alt="Polar map of the wall's uptake"></figure><div class="scroll"><table><thead><tr><th scope="col" class="n"></th><th scope="col">Segment</th><th scope="col">Artery</th><th scope="col" class="n">mean, %</th><th scope="col" class="n">below {threshold} %, % of area</th></tr></thead><tbody>{rows}</tbody></table></div></div></section>"#,
        data_uri("image/svg+xml", svg)
    )
}

/// Measures against the expert's mask, where there was one.
fn agreement(report: &Report) -> String {
    let rows: String = [
        ("Jaccard (E_J)", "jaccard", 3, ""),
        ("Dice", "dice", 3, ""),
        (
            "Mean contour distance (E_CD)",
            "contour_distance_voxels",
            3,
            "voxels",
        ),
        ("Mean contour distance", "contour_distance_mm", 2, "mm"),
        ("Hausdorff distance", "hausdorff_mm", 2, "mm"),
        ("Hausdorff distance, 95 %", "hausdorff95_mm", 2, "mm"),
        ("Volume of the mask", "volume_ml", 1, "ml"),
        ("Volume of the expert's mask", "expert_volume_ml", 1, "ml"),
    ]
    .into_iter()
    .filter_map(|(name, key, decimals, unit)| {
        let value = report.number(&format!("/measures/{key}"))?;
        Some((name, number(value, decimals), unit))
    })
    .chain(
        report
            .number("/measures/volume_difference_percent")
            .map(|share| ("Difference of the volumes", signed(share, 1), "%")),
    )
    .map(|(name, value, unit)| {
        format!(r#"<tr><th scope="row">{name}</th><td class="n">{value}</td><td>{unit}</td></tr>"#)
    })
    .collect();
    if rows.is_empty() {
        return rows;
    }
    format!(
        r#"<section><h2>Against the expert's mask</h2><table class="narrow"><tbody>{rows}</tbody></table></section>"#
    )
}

/// The models that were tried, where there were several.
fn candidates(report: &Report) -> String {
    let (tried, refused) = (report.list("/candidates"), report.list("/refused"));
    if tried.len() + refused.len() < 2 {
        return String::new();
    }
    let name = |model: &Value| {
        let name = model.get("template").and_then(Value::as_str);
        escape(name.unwrap_or("–"))
    };
    let tried = tried.iter().map(|model| {
        let cells: String = [
            ("merit", 3),
            ("active", 3),
            ("strain", 3),
            ("residual_mm", 2),
        ]
        .into_iter()
        .map(|(key, decimals)| {
            let value = model.get(key).and_then(Value::as_f64);
            let value = number(value.unwrap_or(f64::NAN), decimals);
            format!(r#"<td class="n">{value}</td>"#)
        })
        .collect();
        format!(r#"<tr><th scope="row">{}</th>{cells}</tr>"#, name(model))
    });
    let refused = refused.iter().map(|model| {
        let reason = model.get("reason").and_then(Value::as_str);
        format!(
            r#"<tr><th scope="row">{}</th><td colspan="4">left out: {}</td></tr>"#,
            name(model),
            escape(reason.unwrap_or("–"))
        )
    });
    let rows: String = tried.chain(refused).collect();
    format!(
        r#"<section><h2>Models tried</h2><p class="hint">{}.</p><div class="scroll"><table><thead><tr><th scope="col">Model</th><th scope="col" class="n">merit</th><th scope="col" class="n">share with an edge</th><th scope="col" class="n">strain</th><th scope="col" class="n">residual, mm</th></tr></thead><tbody>{rows}</tbody></table></div></section>"#,
        escape(report.text("/choice").unwrap_or_default())
    )
}

/// Everything else, by its name in the report, but for lists with an entry for each node or step.
fn particulars(report: &Report) -> String {
    let object = |key: &str| {
        let found = report.0.get(key).and_then(Value::as_object);
        let kept = found.into_iter().flatten().filter(|(name, value)| {
            let long = value.as_array().is_some_and(|list| list.len() > 4);
            !long && !name.starts_with("affine")
        });
        let kept: Map<String, Value> = kept
            .map(|(name, value)| (name.clone(), value.clone()))
            .collect();
        Value::Object(kept)
    };
    parts::particulars(&[
        ("Parameters", object("parameters")),
        ("Fit", object("fit")),
        ("Place", object("localisation")),
        ("Input", object("input")),
    ])
}
