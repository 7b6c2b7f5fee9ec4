//! One heart scanned at stress and at rest.
//!
//! The anatomy is the same. There is new noise, the heart lies a few millimetres and degrees elsewhere, liver and gut
//! take up more or less, stress has more counts, and values have another scale. Files: `stress` and `rest`, each as
//! [`study`] writes it, and `pair.json`: whether the scans can be compared, transient dilation, ejection fractions,
//! what is reversible (shares of the wall, segments) and what fixed.

use super::anatomy::material::Map;
use super::anatomy::ventricle::Ventricle;
use super::draw::TERRITORIES;
use super::files::write_json;
use super::healthy::{Protocol, person};
use super::parameters::{Defect, Heart, Parameters, WeakRegion};
use super::random::{Draws, Stream};
use super::study::{self, StudyOptions};
use super::truth;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::path::Path;

/// The kinds, in the order in which they are taken. A number is the percentage of uptake that stress takes.
pub const KINDS: [&str; 10] = [
    "same", "red40", "red60", "red20", "both60", "tid", "fixed", "tidred40", "filter", "ac",
];

/// Height of the slices that are kept, mm.
const HEIGHT_MM: f64 = 224.0;
/// Deviations of the place and of the direction of a patient who lies down again, mm and degrees.
const MOVED_SD: [f64; 2] = [3.0, 2.5];
/// Most uptake of liver and gut.
const MAX_ORGAN: f64 = 1.2;

/// What differs between the scans of a pair.
#[derive(Debug, Clone)]
struct Difference {
    territory: Option<&'static str>,
    segments: Vec<usize>,
    reduction: f64,
    fixed: Option<Defect>,
    /// Cavity at stress over that at rest.
    dilation: f64,
    ef: f64,
    contraction: f64,
    protocols: [&'static str; 2],
    /// Why the scans cannot be compared.
    reason: Option<&'static str>,
}

impl Difference {
    fn new(kind: &str, d: &mut Draws) -> Self {
        let territories = d.shuffled(&TERRITORIES);
        let number: String = kind.chars().filter(char::is_ascii_digit).collect();
        let percent: f64 = number.parse().unwrap_or(0.0);
        let mut it = Self {
            territory: None,
            segments: Vec::new(),
            reduction: percent / 100.0,
            fixed: None,
            dilation: 1.0,
            ef: 0.0,
            contraction: 1.0,
            protocols: ["stress_nac", "rest_nac"],
            reason: None,
        };
        if percent > 0.0 {
            it.territory = Some(territories[0].name);
            it.segments = d.pick(territories[0].reversible).to_vec();
        }
        if kind.starts_with("both") || kind == "fixed" {
            let count = 2 + d.index(2);
            let group = d.pick(territories[1].reversible);
            let segments: Vec<usize> = (group.iter().take(count).copied())
                .filter(|segment| !it.segments.contains(segment))
                .collect();
            it.fixed = Some(Defect {
                territory: Some(territories[1].name),
                ..Defect::of_uptake(&segments, d.uniform(0.5, 0.9))
            });
        }
        if kind.starts_with("tid") {
            it.dilation = d.uniform(1.1, 1.4);
        }
        if kind.starts_with("tidred") {
            (it.ef, it.contraction) = (-d.uniform(0.04, 0.10), d.uniform(0.3, 0.6));
        } else if percent >= 40.0 && d.chance(0.5) {
            (it.ef, it.contraction) = (-d.uniform(0.01, 0.05), d.uniform(0.4, 0.7));
        }
        match kind {
            "filter" => (it.protocols[0], it.reason) = ("stress_smooth", Some("resolution")),
            "ac" => (it.protocols[0], it.reason) = ("stress_ac", Some("attenuation_correction")),
            _ => {}
        }
        it
    }
}

/// Simulates a pair and writes it into a folder, which is made. `gates`: 0 for scans without.
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
        .with_context(|| format!("{kind} is no kind of pair"))?;
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let difference = Difference::new(kind, d);
    let female = d.chance(0.5);
    let mut p = person(case, seed, kind, female, matrix, d);
    p.heart.ef = p.heart.ef.min(d.uniform(0.45, 0.72));
    let mut scans = [p.clone(), p.clone()];
    for (scan, name) in scans.iter_mut().zip(difference.protocols) {
        let protocol = Protocol::from_name(name).with_context(|| format!("no protocol {name}"))?;
        protocol.apply(scan, d);
        scan.heart.defects = difference.fixed.iter().cloned().collect();
    }
    let [stress, rest] = &mut scans;
    let moved = lie_down_again(stress, MOVED_SD, d);
    stress.role = Some("stress".into());
    rest.role = Some("rest".into());
    if difference.reduction > 0.0 {
        stress.heart.defects.push(Defect {
            territory: difference.territory,
            ..Defect::of_uptake(&difference.segments, difference.reduction)
        });
    }
    if difference.dilation != 1.0 {
        dilate(&mut stress.heart, difference.dilation);
    }
    stress.heart.ef += difference.ef;
    if difference.contraction < 1.0 {
        stress.heart.beat.regions = vec![WeakRegion {
            area: difference.territory.unwrap_or_default().to_owned(),
            segments: difference.segments.clone(),
            contraction: difference.contraction,
        }];
    }
    let options = options(gates);
    let of_stress = study::write(stress, &options, &folder.join("stress"))?;
    let of_rest = study::write(rest, &options, &folder.join("rest"))?;
    let truth = pair_truth(
        case,
        kind,
        &difference,
        &scans,
        [&of_stress, &of_rest],
        &moved,
    );
    write_json(&folder.join("pair.json"), &truth)?;
    Ok(truth)
}

/// How each of two scans of one heart is made. `gates`: 0 for scans without.
pub(super) fn options(gates: usize) -> StudyOptions {
    StudyOptions {
        gates,
        loss: 0.0,
        height_mm: Some(HEIGHT_MM),
        truth_images: false,
    }
}

/// The patient lies elsewhere, by these deviations of place and direction, with other counts in liver and gut. Out: how
/// far, mm and degrees.
pub(super) fn lie_down_again(
    p: &mut Parameters,
    [mm_sd, degrees_sd]: [f64; 2],
    d: &mut Draws,
) -> Value {
    let mm = [0, 1, 2].map(|_| d.normal(0.0, mm_sd));
    let degrees = [0, 1, 2].map(|_| d.normal(0.0, degrees_sd));
    p.lv_centre_body_mm
        .iter_mut()
        .zip(mm)
        .for_each(|(x, mm)| *x += mm);
    p.orientation.azimuth_deg += degrees[0];
    p.orientation.inferior_tilt_deg += degrees[1];
    p.orientation.roll_deg += degrees[2];
    let organs = &mut p.organs;
    for uptake in [
        &mut organs.liver,
        &mut organs.gut,
        &mut organs.spleen,
        &mut organs.stomach_wall,
    ] {
        *uptake = (*uptake * d.uniform(0.7, 1.4)).min(MAX_ORGAN);
    }
    p.noise_seed = d.whole();
    p.value_max = d.uniform(300.0, 3000.0).floor();
    json!({ "mm": mm, "degrees": degrees })
}

/// Makes the cavity larger by a factor; a thinner wall keeps the muscle.
pub(super) fn dilate(heart: &mut Heart, factor: f64) {
    let muscle = |heart: &Heart| {
        let plain = Heart {
            defects: Vec::new(),
            ..heart.clone()
        };
        Ventricle::at_end_diastole(&plain).muscle_ml()
    };
    let wanted = muscle(heart);
    heart.edv_ml *= factor;
    let (mut low, mut high) = (0.4 * heart.h0, 1.2 * heart.h0);
    for _ in 0..24 {
        heart.h0 = f64::midpoint(low, high);
        if muscle(heart) < wanted {
            low = heart.h0;
        } else {
            high = heart.h0;
        }
    }
}

fn pair_truth(
    case: &str,
    kind: &str,
    difference: &Difference,
    [stress, rest]: &[Parameters; 2],
    [of_stress, of_rest]: [&Value; 2],
    moved: &Value,
) -> Value {
    let [at_stress, at_rest] = [stress, rest].map(|scan| Ventricle::at_end_diastole(&scan.heart));
    let areas = at_rest.areas();
    let lost = Map::from_index(|at| 1.0 - at_stress.uptake.0[at] / at_rest.uptake.0[at].max(1e-6));
    let share = |level: f64| {
        let beyond = Map(lost
            .0
            .iter()
            .map(|l| f64::from(u8::from(*l >= level)))
            .collect());
        100.0 * beyond.mean(&areas)
    };
    let some = difference.reduction > 0.0;
    let number = |truth: &Value, name: &str| truth[name].as_f64().unwrap_or(f64::NAN);
    let ratio = |name: &str| number(of_stress, name) / number(of_rest, name);
    let muscle = |truth: &Value| {
        let walls: Vec<f64> = truth["phases_wall_ml"]
            .as_array()
            .into_iter()
            .flatten()
            .filter_map(Value::as_f64)
            .collect();
        walls.iter().sum::<f64>() / walls.len() as f64
    };
    json!({
        "pair": case,
        "seed": rest.seed,
        "kind": kind,
        "sex": rest.sex,
        "comparable": difference.reason.is_none(),
        "reason": difference.reason,
        "protocol": { "stress": difference.protocols[0], "rest": difference.protocols[1] },
        "tid": ratio("mean_cavity_ml"),
        "tid_edv": ratio("edv_ml"),
        "ef_stress": of_stress["ef"],
        "ef_rest": of_rest["ef"],
        "ef_change": 100.0 * (number(of_stress, "ef") - number(of_rest, "ef")),
        "edv_stress_ml": of_stress["edv_ml"],
        "edv_rest_ml": of_rest["edv_ml"],
        "muscle_ml": [muscle(of_stress), muscle(of_rest)],
        "fixed": difference.fixed,
        "weak_at_stress": (difference.contraction < 1.0).then_some(difference.contraction),
        "reversible": some.then(|| json!({
            "territory": difference.territory,
            "segments": difference.segments,
            "reduction": difference.reduction,
            "segment_reduction": truth::by_name(&truth::of_segments(&at_rest, &lost, &areas)),
        })),
        "reversible_percent": if some { share(difference.reduction / 2.0) } else { 0.0 },
        "moved": moved,
    })
}
