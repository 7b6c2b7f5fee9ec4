//! Kinds of gated studies: each heart has a timing of its own, ejection fractions of 20 to 78 %.

use super::draw::{Profile, patient, widest_mm};
use super::parameters::{Defect, LateRegion, Parameters, WeakRegion};
use super::random::{Draws, Stream};
use super::study::StudyOptions;

/// The kinds, in the order in which they are taken.
pub const KINDS: [&str; 10] = [
    "healthy",
    "delay",
    "small",
    "akinetic",
    "loss",
    "defect",
    "dyskinetic",
    "rotated",
    "large",
    "gates16",
];

/// Height of the slices that are kept, mm.
const HEIGHT_MM: f64 = 256.0;

/// Segments that can be late.
const LATE: [(&str, &[usize]); 5] = [
    // Twice as often as the others.
    ("septum", &[2, 3, 8, 9, 14]),
    ("septum", &[2, 3, 8, 9, 14]),
    ("lateral", &[5, 6, 11, 12, 16]),
    ("inferior", &[4, 10, 15]),
    ("apex", &[13, 14, 15, 16, 17]),
];

/// Segments that can be dark or still.
const AREAS: [(&str, &[usize]); 5] = [
    ("LAD", &[7, 8, 13, 14, 17]),
    ("apex", &[13, 14, 15, 16, 17]),
    ("RCA", &[3, 4, 9, 10, 15]),
    ("inferior", &[4, 10, 15]),
    ("LCX", &[5, 6, 11, 12, 16]),
];

/// A drawn study.
pub struct GatedCase {
    /// Its parameters.
    pub parameters: Parameters,
    /// How it is made.
    pub options: StudyOptions,
}

/// What a study is asked to be.
#[derive(Debug, Clone, Copy)]
pub struct GatedOrder {
    /// Gates.
    pub gates: usize,
    /// Voxels along an axis: 64 of 6.4 mm, or 128 of 3.3 to 4.8 mm.
    pub matrix: usize,
    /// Wall (mm), end-diastolic volume (ml) and ejection fraction that take the place of drawn ones.
    pub heart: Option<[f64; 3]>,
}

/// The parameters of a study of a kind; `None` if there is no such kind.
pub fn draw(kind: &str, case: &str, seed: u64, order: &GatedOrder) -> Option<GatedCase> {
    KINDS
        .contains(&kind)
        .then(|| of_kind(kind, case, seed, order))
}

fn of_kind(kind: &str, case: &str, seed: u64, order: &GatedOrder) -> GatedCase {
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let fine = *d.pick(&[3.3, 4.0, 4.8]);
    let mut profile = Profile {
        edv_ml: d.uniform(75.0, 170.0),
        ef: Some(d.uniform(0.22, 0.72)),
        matrix: order.matrix,
        spacing_mm: if order.matrix == 64 { 6.4 } else { fine },
        counts_m: d.uniform(6.0, 14.0),
        attenuation_corrected: d.chance(0.4),
        liver_adjacent: d.chance(0.3),
        gut_near: d.chance(0.25),
        orientation_sd: 11.0,
        ..Profile::default()
    };
    let mut options = StudyOptions {
        gates: order.gates,
        loss: 0.0,
        height_mm: Some(HEIGHT_MM),
        truth_images: true,
    };
    let (mut regions, mut delays, mut offset) = (Vec::new(), Vec::new(), 0.0);
    let mut defects = Vec::new();
    match kind {
        "healthy" => profile.ef = Some(d.normal_within(0.64, 0.05, [0.54, 0.76])),
        "delay" => {
            let (wall, segments) = *d.pick(&LATE);
            let degrees = *d.pick(&[15.0, 30.0, 45.0, 60.0]);
            let (wall, segments) = (wall.to_owned(), segments.to_vec());
            delays.push(LateRegion {
                wall,
                segments,
                degrees,
            });
        }
        "small" => {
            profile.edv_ml = d.uniform(42.0, 80.0);
            profile.ef = Some(d.uniform(0.60, 0.78));
            profile.h0 = Some(d.uniform(8.5, 11.5));
        }
        "akinetic" | "dyskinetic" => {
            let (area, segments) = *d.pick(&AREAS);
            let [low, high] = if kind == "akinetic" {
                [0.0, 0.1]
            } else {
                [-0.35, -0.12]
            };
            regions.push(weak(area, segments, d.uniform(low, high)));
            profile.edv_ml = d.uniform(100.0, 200.0);
            profile.ef = Some(d.uniform(0.22, 0.50));
            if d.chance(0.6) {
                defects.push(Defect::of_uptake(segments, d.uniform(0.4, 0.9)));
            }
            let apart = |other: &&(&str, &[usize])| other.1.iter().all(|s| !segments.contains(s));
            let others: Vec<_> = AREAS.iter().filter(apart).collect();
            if d.chance(0.4) && !others.is_empty() {
                let (area, segments) = **d.pick(&others);
                regions.push(weak(area, segments, d.uniform(0.35, 0.6)));
            }
        }
        "loss" => options.loss = d.uniform(0.08, 0.35),
        "rotated" => offset = (1 + d.index(order.gates - 1)) as f64 / order.gates as f64,
        "large" => {
            profile.edv_ml = d.uniform(180.0, 250.0);
            profile.ef = Some(d.uniform(0.20, 0.35));
        }
        "gates16" => options.gates = 16,
        _ => {}
    }
    if ["defect", "large", "rotated", "loss"].contains(&kind) && d.chance(0.6) {
        let (_, segments) = *d.pick(&AREAS);
        defects.push(Defect::of_uptake(segments, d.uniform(0.3, 0.9)));
    }
    if let Some([wall_mm, edv_ml, ef]) = order.heart {
        profile.edv_ml = edv_ml;
        (profile.h0, profile.ef) = (Some(wall_mm), Some(ef));
    }
    let mut p = patient(case, seed, kind, &profile);
    p.heart.shorten = d.uniform(0.05, 0.15);
    p.heart.defects = defects;
    (p.heart.beat.regions, p.heart.beat.delays) = (regions, delays);
    p.heart.beat.offset = offset;
    p.body.half_width_mm = p.body.half_width_mm.min(widest_mm(&profile));
    GatedCase {
        parameters: p,
        options,
    }
}

fn weak(area: &str, segments: &[usize], contraction: f64) -> WeakRegion {
    WeakRegion {
        area: area.to_owned(),
        segments: segments.to_vec(),
        contraction,
    }
}
