//! Figures of beats beside the truth of simulated gated studies.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin beats -- [PRIOR=VALUE]... FOLDER...
//! ```
//!
//! Every folder holds gated.nii.gz and params.json, as the simulator of gated hearts writes them: "result" with
//! edv_ml, esv_ml, ef, and segments with motion_mm, thickening_percent and contraction (below .25: akinetic). Prints
//! a row for each study that has a fit, then bias, deviation and worst case of EF (points), EDV and ESV (per cent), correlation and
//! deviation of motion and thickening (also by counts) over all segments, and how well thickening finds the akinetic
//! ones. PRIOR names a field of [`Priors`], or `resolution_more_mm`. With mean_thickness_mm, the thickness that the summed
//! image tells is not used.

use anyhow::{Result, anyhow, bail};
use serde_json::Value;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::heart::beat::{self, Beat, BeatParameters, GatedStudy, Priors};
use ventriform::image::volume::{ReadLimits, VolumeFile, read_gates};
use ventriform::parameters::FitParameters;
use ventriform::runs::segmentation::{SegmentationParameters, built_in, segment};
use ventriform_evaluation::{name_of, statistics};

/// Contraction of a segment, as a share of a whole one's, below which it counts as akinetic.
const AKINETIC_CONTRACTION: f64 = 0.25;
/// Difference of EF that counts as right, points.
const RIGHT_EF_POINTS: f64 = 5.0;

fn main() -> Result<()> {
    let mut parameters = BeatParameters::default();
    let mut resolution_more_mm = 0.0;
    let mut assumed = false;
    let mut studies = Vec::new();
    for argument in std::env::args().skip(1) {
        match argument.split_once('=') {
            Some(("resolution_more_mm", value)) => resolution_more_mm = value.parse()?,
            Some((name, value)) => {
                assumed |= name == "mean_thickness_mm";
                set(&mut parameters.priors, name, value.parse()?)?;
            }
            None => studies.push(argument),
        }
    }
    println!(
        "set,study,ef,true_ef,edv,true_edv,esv,true_esv,wall,thickness_share,steps,orders_as_smooth,dark,flags"
    );
    let mut table = Table::default();
    for study in &studies {
        let folder = Path::new(study);
        match one(folder, &parameters, resolution_more_mm, assumed) {
            Ok(row) => table.add(folder, &row),
            Err(error) => eprintln!("{study} is left out: {error:#}"),
        }
    }
    table.print();
    Ok(())
}

fn set(priors: &mut Priors, name: &str, value: f64) -> Result<()> {
    let field = match name {
        "mid_wall" => &mut priors.mid_wall,
        "motion" => &mut priors.motion,
        "thickness" => &mut priors.thickness,
        "uptake" => &mut priors.uptake,
        "outside" => &mut priors.outside,
        "mean_thickness_mm" => &mut priors.mean_thickness_mm,
        "mean_thickness_sd_mm" => &mut priors.mean_thickness_sd_mm,
        "thickness_near" => &mut priors.thickness_near,
        "rim" => &mut priors.rim,
        "rim_level" => &mut priors.rim_level,
        "gain" => &mut priors.gain,
        "stretch" => &mut priors.stretch,
        "still" => &mut priors.still,
        _ => bail!("there is no prior {name}"),
    };
    *field = value;
    Ok(())
}

/// A beat and the truth about it.
struct Row {
    beat: Beat,
    truth: Value,
}

fn one(
    folder: &Path,
    parameters: &BeatParameters,
    resolution_more_mm: f64,
    assumed: bool,
) -> Result<Row> {
    let quiet = Monitor::silent();
    let file = VolumeFile::at(folder.join("gated.nii.gz"));
    let reading = read_gates(&[file], true, &ReadLimits::default(), &quiet)?;
    let study = GatedStudy::new(reading.gates, &reading.lost, &quiet)?;
    let fit = FitParameters::default();
    let order = SegmentationParameters {
        deform: fit
            .on(&study.sum, reading.facts.affine_source, None)
            .map_err(|error| anyhow!("{}", error.message))?,
        polar: fit.polar,
        ..SegmentationParameters::default()
    };
    let templates = built_in::templates(&quiet)?;
    let made = segment(&study.sum, &templates, &order, None, &quiet)?;
    let (Some(surfaces), Some(map), Some(resolution)) =
        (&made.fit.model.surfaces, &made.polar, made.resolution)
    else {
        bail!("no ventricle");
    };
    let width = resolution.value + resolution_more_mm;
    let parameters = BeatParameters {
        thickness: surfaces.thickness.filter(|_| !assumed),
        ..parameters.clone()
    };
    let wall = &surfaces.anatomical.wall;
    let fitted = beat::fit(&study, wall, width, &parameters, &quiet)?;
    let text = std::fs::read(folder.join("params.json"))?;
    Ok(Row {
        beat: Beat::new(fitted, &study, map, None),
        truth: serde_json::from_slice::<Value>(&text)?["result"].take(),
    })
}

/// Pairs of a figure and its truth.
type Pairs = Vec<(f64, f64)>;

#[derive(Default)]
struct Table {
    ef: Pairs,
    edv: Pairs,
    esv: Pairs,
    motion: Pairs,
    thickening: Pairs,
    /// Thickening by counts.
    counts: Pairs,
    /// Thickening and whether the segment is akinetic.
    akinetic: Vec<(f64, bool)>,
    /// Correlation of the thickening within each heart that has akinetic segments.
    within: Vec<f64>,
}

impl Table {
    fn add(&mut self, folder: &Path, row: &Row) {
        let (beat, truth) = (&row.beat, &row.truth);
        let number = |name: &str| truth[name].as_f64().unwrap_or(f64::NAN);
        let ef = 100.0 * (1.0 - beat.end_systole.cavity_ml / beat.end_diastole.cavity_ml);
        let flags: Vec<&str> = beat.flags.iter().map(|flag| flag.code()).collect();
        println!(
            "{},{},{ef:.1},{:.1},{:.1},{:.1},{:.1},{:.1},{:.1},{:.4},{},{:.4},{:.2},{}",
            folder.parent().map(name_of).unwrap_or_default(),
            name_of(folder),
            100.0 * number("ef"),
            beat.end_diastole.cavity_ml,
            number("edv_ml"),
            beat.end_systole.cavity_ml,
            number("esv_ml"),
            beat.curve[0].wall_ml,
            beat.fit.thickness_share,
            beat.fit.steps,
            beat.fit.orders_as_smooth,
            beat.fit.dark_share(),
            flags.join(" ")
        );
        self.ef.push((ef, 100.0 * number("ef")));
        self.edv
            .push((beat.end_diastole.cavity_ml, number("edv_ml")));
        self.esv
            .push((beat.end_systole.cavity_ml, number("esv_ml")));
        let mut own = Pairs::new();
        let mut has_akinetic = false;
        for found in &beat.segments {
            let Some(known) = truth["segments"].get(found.segment - 1) else {
                continue;
            };
            let known = |name: &str| known[name].as_f64().unwrap_or(f64::NAN);
            let akinetic = known("contraction") < AKINETIC_CONTRACTION;
            has_akinetic |= akinetic;
            self.motion.push((found.motion_mm, known("motion_mm")));
            let thickening = known("thickening_percent");
            own.push((found.thickening_percent, thickening));
            let counts = found.thickening_counts_percent.into_iter();
            self.counts.extend(counts.map(|found| (found, thickening)));
            self.akinetic.push((found.thickening_percent, akinetic));
        }
        if has_akinetic {
            self.within.push(correlation(&own));
        }
        self.thickening.extend(own);
    }

    fn print(&self) {
        let right = self
            .ef
            .iter()
            .filter(|(f, t)| (f - t).abs() <= RIGHT_EF_POINTS);
        let (bias, sd, worst) = off(self.ef.iter().map(|(f, t)| f - t));
        println!(
            "EF: bias {bias:+.1}, SD {sd:.1}, worst {worst:.1} points, {} of {} within {RIGHT_EF_POINTS}",
            right.count(),
            self.ef.len()
        );
        for (name, pairs) in [("EDV", &self.edv), ("ESV", &self.esv)] {
            let (bias, sd, worst) = off(pairs.iter().map(|(f, t)| 100.0 * (f / t - 1.0)));
            let r = correlation(pairs);
            println!("{name}: bias {bias:+.1}, SD {sd:.1}, worst {worst:.1} per cent, r {r:.3}");
        }
        for (name, pairs) in [
            ("motion, mm", &self.motion),
            ("thickening, points", &self.thickening),
            ("thickening by counts, points", &self.counts),
        ] {
            let (bias, sd, _) = off(pairs.iter().map(|(f, t)| f - t));
            println!(
                "{name}: r {:.2}, bias {bias:+.1}, SD {sd:.1}",
                correlation(pairs)
            );
        }
        let of = |wanted: bool| -> Vec<f64> {
            let own = self
                .akinetic
                .iter()
                .filter(|(_, akinetic)| *akinetic == wanted);
            own.map(|(thickening, _)| *thickening).collect()
        };
        let (dead, live) = (of(true), of(false));
        // Akinetic walls thicken less.
        let area = statistics::area_under_curve(&live, &dead);
        let within = self.within.iter().sum::<f64>() / self.within.len() as f64;
        println!(
            "akinetic segments: AUC {area:.2}; r of thickening within the {} hearts that have them {within:.2}",
            self.within.len()
        );
    }
}

/// Mean, deviation and largest size.
fn off(values: impl Iterator<Item = f64>) -> (f64, f64, f64) {
    let values: Vec<f64> = values.collect();
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|x| (x - mean).powi(2)).sum();
    let worst = values.iter().fold(0.0, |worst: f64, x| worst.max(x.abs()));
    (mean, (squares / (count - 1.0)).sqrt(), worst)
}

fn correlation(pairs: &[(f64, f64)]) -> f64 {
    let (found, known): (Vec<f64>, Vec<f64>) = pairs.iter().copied().unzip();
    statistics::correlation(&found, &known)
}
