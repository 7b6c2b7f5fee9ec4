//! One heart scanned twice, years apart.
//!
//! The anatomy is the same but for what a kind changes. There is new noise, the heart lies up to a centimetre and ten
//! degrees elsewhere, liver and gut take up more or less, and values have another scale. Files: `scan1` and `scan2`, each as
//! [`study`] writes it, and `serial.json`: what truly changed.

use super::draw::TERRITORIES;
use super::files::write_json;
use super::healthy::{Protocol, person};
use super::pairs::{dilate, lie_down_again, options};
use super::parameters::{Defect, Filter, Parameters};
use super::random::{Draws, Stream};
use super::study;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::path::Path;

/// The kinds, in the order in which they are taken: nothing changed, another filter, another grid, an ejection fraction that
/// falls by so many points, a cavity that grows by a fifth, wall that loses or regains half of its uptake (about so many per
/// cent of it).
pub const KINDS: [&str; 10] = [
    "same", "filter", "grid", "ef5", "ef10", "edv20", "worse10", "worse20", "better10", "better20",
];

/// Deviations of the place and of the direction, mm and degrees.
const MOVED_SD: [f64; 2] = [4.5, 4.5];
/// Uptake that a loss takes, as a share.
const LOSS: f64 = 0.5;

/// Simulates a series and writes it into a folder, which is made. `gates`: 0 for scans without.
///
/// # Errors
/// If there is no such kind, or a file cannot be written.
pub fn write(
    kind: &str,
    case: &str,
    seed: u64,
    gates: usize,
    matrix: usize,
    folder: &Path,
) -> Result<Value> {
    KINDS
        .iter()
        .find(|known| **known == kind)
        .with_context(|| format!("{kind} is no kind of series"))?;
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let female = d.chance(0.5);
    let mut p = person(case, seed, kind, female, matrix, d);
    p.heart.ef = d.uniform(0.38, 0.70);
    let territories = d.shuffled(&TERRITORIES);
    if d.chance(0.4) {
        let segments = d.pick(territories[1].reversible).to_vec();
        p.heart
            .defects
            .push(Defect::of_uptake(&segments, d.uniform(0.3, 0.8)));
    }
    let protocol = Protocol::from_name("rest_nac").context("no protocol rest_nac")?;
    let mut scans = [p.clone(), p];
    for scan in &mut scans {
        protocol.apply(scan, d);
        scan.role = Some("rest".into());
    }
    let moved = lie_down_again(&mut scans[1], MOVED_SD, d);
    let group = d.pick(territories[0].reversible);
    let number: String = kind.chars().filter(char::is_ascii_digit).collect();
    let segments: Vec<usize> = match number.as_str() {
        "10" => group.iter().take(2).copied().collect(),
        _ => group.iter().take(4).copied().collect(),
    };
    let lost = Defect::of_uptake(&segments, LOSS);
    let [first, later] = &mut scans;
    match kind {
        "filter" => change_filter(later, d.uniform(0.8, 1.25)),
        "grid" => later.spacing_mm *= d.uniform(0.9, 1.1),
        "ef5" => later.heart.ef -= 0.05,
        "ef10" => later.heart.ef -= 0.10,
        "edv20" => dilate(&mut later.heart, 1.2),
        "worse10" | "worse20" => later.heart.defects.push(lost),
        "better10" | "better20" => first.heart.defects.push(lost),
        _ => {}
    }
    let options = options(gates);
    let [of_first, of_later] = [
        study::write(first, &options, &folder.join("scan1"))?,
        study::write(later, &options, &folder.join("scan2"))?,
    ];
    let change = |name: &str| {
        let number = |truth: &Value| truth[name].as_f64().unwrap_or(f64::NAN);
        [number(&of_first), number(&of_later)]
    };
    let truth = json!({
        "case": case,
        "kind": kind,
        "ef_percent": change("ef").map(|ef| 100.0 * ef),
        "edv_ml": change("edv_ml"),
        "esv_ml": change("esv_ml"),
        "cavity_ml": change("mean_cavity_ml"),
        "changed_segments": if kind.starts_with("worse") || kind.starts_with("better") { segments } else { Vec::new() },
        "moved": moved,
    });
    write_json(&folder.join("serial.json"), &truth)?;
    Ok(truth)
}

fn change_filter(scan: &mut Parameters, factor: f64) {
    if let Filter::Butterworth { cut_off_per_cm, .. } = &mut scan.reconstruction.filter {
        *cut_off_per_cm *= factor;
    }
}
