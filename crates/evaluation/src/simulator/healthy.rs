//! Healthy men and women of one protocol, for normal limits, and the same kind of heart with one defect.
//!
//! A folder of them has `cohort.csv`: case, file, sex, protocol, tracer, attenuation corrected, healthy, defect.

use super::draw::{Profile, TERRITORIES, patient, widest_mm};
use super::parameters::{Defect, Filter, Method, Orbit, Parameters};
use super::random::{Draws, Stream};
use anyhow::{Context, Result};
use serde_json::Value;
use std::fs;
use std::path::Path;

/// What a protocol fixes.
#[derive(Debug, Clone, Copy)]
pub struct Protocol {
    /// Its name.
    pub name: &'static str,
    attenuation_corrected: bool,
    /// Mean and deviation, millions.
    counts_m: [f64; 2],
    cut_off_per_cm: f64,
    iterations: usize,
}

/// The protocols. `stress_smooth` is that of another department.
pub const PROTOCOLS: [Protocol; 5] = [
    Protocol {
        name: "stress_nac",
        attenuation_corrected: false,
        counts_m: [9.0, 1.2],
        cut_off_per_cm: 0.45,
        iterations: 5,
    },
    Protocol {
        name: "rest_nac",
        attenuation_corrected: false,
        counts_m: [6.0, 0.8],
        cut_off_per_cm: 0.45,
        iterations: 5,
    },
    Protocol {
        name: "stress_ac",
        attenuation_corrected: true,
        counts_m: [9.0, 1.2],
        cut_off_per_cm: 0.45,
        iterations: 5,
    },
    Protocol {
        name: "rest_ac",
        attenuation_corrected: true,
        counts_m: [6.0, 0.8],
        cut_off_per_cm: 0.45,
        iterations: 5,
    },
    Protocol {
        name: "stress_smooth",
        attenuation_corrected: false,
        counts_m: [9.0, 1.2],
        cut_off_per_cm: 0.28,
        iterations: 4,
    },
];

impl Protocol {
    /// The protocol of a name.
    pub fn from_name(name: &str) -> Option<Self> {
        PROTOCOLS.into_iter().find(|protocol| protocol.name == name)
    }

    /// Scans and reconstructs by the protocol.
    pub fn apply(&self, p: &mut Parameters, d: &mut Draws) {
        let [mean, sd] = self.counts_m;
        p.acquisition.views = 60;
        p.acquisition.orbit = Orbit::Circular;
        p.acquisition.total_counts_m = d.normal_within(mean, sd, [0.6 * mean, 1.5 * mean]);
        p.reconstruction.method = Method::Osem;
        p.reconstruction.attenuation_corrected = self.attenuation_corrected;
        p.reconstruction.scatter_corrected = false;
        (p.reconstruction.subsets, p.reconstruction.iterations) = (10, self.iterations);
        p.reconstruction.filter = Filter::Butterworth {
            cut_off_per_cm: self.cut_off_per_cm,
            order: 7,
        };
        p.protocol = Some(self.name.to_owned());
    }
}

/// A healthy person: men have larger hearts and chests, women breasts and higher ejection fractions.
pub fn person(
    case: &str,
    seed: u64,
    made: &str,
    female: bool,
    matrix: usize,
    d: &mut Draws,
) -> Parameters {
    let (edv_ml, ef, chest) = if female {
        let edv_ml = d.normal_within(88.0, 15.0, [50.0, 125.0]);
        (
            edv_ml,
            d.normal_within(0.68, 0.05, [0.57, 0.79]),
            d.normal(0.95, 0.03),
        )
    } else {
        let edv_ml = d.normal_within(118.0, 20.0, [75.0, 170.0]);
        (
            edv_ml,
            d.normal_within(0.62, 0.05, [0.52, 0.74]),
            d.normal(1.03, 0.03),
        )
    };
    let profile = Profile {
        edv_ml,
        ef: Some(ef),
        matrix,
        spacing_mm: if matrix == 64 { 6.4 } else { 4.0 },
        liver_adjacent: d.chance(0.15),
        gut_near: d.chance(0.1),
        counts_m: 9.0,
        ..Profile::default()
    };
    let mut p = patient(case, seed, made, &profile);
    p.body.female = female;
    p.sex = if female { 'F' } else { 'M' };
    p.body.half_width_mm = (p.body.half_width_mm * chest).min(widest_mm(&profile));
    p.body.half_depth_mm *= chest;
    p.heart.shorten = d.uniform(0.07, 0.14);
    p
}

/// The one defect of a heart.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OneDefect {
    /// Of a territory.
    OfTerritory,
    /// One dark segment at the base.
    Basal,
}

impl OneDefect {
    fn draw(self, d: &mut Draws) -> Defect {
        let (territory, segments, severity) = match self {
            OneDefect::OfTerritory => {
                let territory = d.pick(&TERRITORIES);
                let segments = d.pick(territory.defects).to_vec();
                (Some(territory.name), segments, d.uniform(0.25, 0.9))
            }
            OneDefect::Basal => (None, vec![1 + d.index(6)], d.uniform(0.4, 0.95)),
        };
        Defect {
            territory,
            shift_theta: d.normal(0.0, 8.0),
            shift_mu: d.normal(0.0, 3.0),
            ..Defect::of_uptake(&segments, severity)
        }
    }
}

/// The parameters of a case, with one defect if it is asked for.
pub fn draw(
    case: &str,
    seed: u64,
    female: bool,
    protocol: &Protocol,
    matrix: usize,
    defect: Option<OneDefect>,
) -> Parameters {
    let mut draws = Draws::new(seed, Stream::Kind);
    let d = &mut draws;
    let mut p = person(case, seed, "healthy", female, matrix, d);
    protocol.apply(&mut p, d);
    if let Some(defect) = defect {
        p.heart.defects = vec![defect.draw(d)];
        p.made = "one_defect".into();
    }
    p
}

/// Writes `cohort.csv` of every case in a folder.
///
/// # Errors
/// If a file cannot be read or written.
pub fn write_table(folder: &Path) -> Result<()> {
    let mut rows = Vec::new();
    for entry in fs::read_dir(folder)? {
        let case = entry?.path();
        let Ok(bytes) = fs::read(case.join("params.json")) else {
            continue;
        };
        let p: Value = serde_json::from_slice(&bytes)?;
        let name = case
            .file_name()
            .context("a case has a name")?
            .to_string_lossy()
            .into_owned();
        let gated = if case.join("gated.nii.gz").exists() {
            "gated"
        } else {
            "spect"
        };
        let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
        let corrected = p["reconstruction"]["attenuation_corrected"] == true;
        let defects = p["heart"]["defects"]
            .as_array()
            .cloned()
            .unwrap_or_default();
        let segments: Vec<String> = (defects.iter().take(1))
            .flat_map(|defect| defect["segments"].as_array().cloned().unwrap_or_default())
            .map(|segment| segment.to_string())
            .collect();
        rows.push(format!(
            "{name},{name}/{gated}.nii.gz,{},{},Tc-99m sestamibi (simulated),{},{},{}",
            text(&p["sex"]),
            text(&p["protocol"]),
            if corrected { "yes" } else { "no" },
            if defects.is_empty() { "yes" } else { "no" },
            segments.join(" ")
        ));
    }
    rows.sort();
    let head = "case,file,sex,protocol,tracer,attenuation_corrected,healthy,defect";
    fs::write(
        folder.join("cohort.csv"),
        format!("{head}\n{}\n", rows.join("\n")),
    )?;
    Ok(())
}
