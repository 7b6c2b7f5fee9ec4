//! Serial comparisons beside the truth of simulated series.
//!
//! ```sh
//! cargo run --release --package ventriform-evaluation --bin serials -- SERIES...
//! ```
//!
//! Every SERIES is a folder with scan1 and scan2, each with gated.nii.gz or spect.nii.gz, and serial.json, as the simulator
//! of series writes them. Prints a row for each figure of each series, ready for scripts/measure/calibrate_serial.py: series,
//! kind, figure, both values, the true ones where they are known, the noise of the pair, change, interval, verdict. Rows of
//! `segment` have the mean uptake of each segment, those of `worse_percent` and `better_percent` the share of the wall.

use anyhow::{Result, anyhow};
use serde_json::Value;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::image::volume::{ReadLimits, VolumeFile};
use ventriform::parameters::SerialParameters;
use ventriform::results::report::SerialReport;
use ventriform::runs::serial::{SerialOrder, from_files};
use ventriform_evaluation::print_table;

fn main() {
    print_table(
        "series,kind,figure,earlier,later,true_earlier,true_later,noise_points,change,low,high,verdict,moved_mm,turned_degrees,correlation,flags",
        rows,
    );
}

fn files_of(folder: &Path) -> Vec<VolumeFile> {
    let gated = folder.join("gated.nii.gz");
    let path = if gated.exists() {
        gated
    } else {
        folder.join("spect.nii.gz")
    };
    vec![VolumeFile::at(path)]
}

fn rows(folder: &Path) -> Result<Vec<String>> {
    let truth: Value = serde_json::from_slice(&std::fs::read(folder.join("serial.json"))?)?;
    let scans = ["scan1", "scan2"].map(|scan| files_of(&folder.join(scan)));
    let mut parameters = SerialParameters::default();
    parameters.choice.gated = folder.join("scan1/gated.nii.gz").exists();
    let order = SerialOrder {
        scans: &scans,
        auto: true,
        models: Vec::new(),
        normals: None,
        parameters: &parameters,
    };
    let made = from_files(&order, &ReadLimits::default(), &Monitor::silent())
        .map_err(|error| anyhow!("{error}"))?;
    Ok(rows_of(&made.report(), &truth))
}

fn rows_of(report: &SerialReport, truth: &Value) -> Vec<String> {
    let [series, kind] = ["case", "kind"].map(|name| truth[name].as_str().unwrap_or_default());
    let Some(pair) = report.pairs.first() else {
        return Vec::new();
    };
    let later = &report.scans[1];
    let mut flags: Vec<&str> = report.flags.iter().map(|flag| flag.code.as_str()).collect();
    flags.sort_unstable();
    flags.dedup();
    let place = format!(
        "{},{},{},{}",
        later.moved_mm,
        later.turned_degrees,
        later.correlation,
        flags.join(" ")
    );
    let known = |figure: &str, scan: usize| {
        truth[figure][scan]
            .as_f64()
            .map_or_else(String::new, |value| value.to_string())
    };
    let values = |figure: &str, scan: usize| {
        let scan = serde_json::to_value(&report.scans[scan]).unwrap_or_default();
        scan[figure].as_f64().unwrap_or(f64::NAN)
    };
    let mut rows: Vec<String> = (report.changes.iter())
        .map(|own| {
            let name = &own.figure;
            let [low, high] = own.interval;
            format!(
                "{series},{kind},{name},{},{},{},{},{},{},{low},{high},{},{place}",
                values(name, 0),
                values(name, 1),
                known(name, 0),
                known(name, 1),
                pair.noise_points,
                own.change,
                own.verdict.as_str().replace(' ', "_")
            )
        })
        .collect();
    for (name, value, [low, high], verdict) in [
        (
            "worse_percent",
            pair.worse_percent,
            pair.worse_interval_percent,
            pair.worse_verdict,
        ),
        (
            "better_percent",
            pair.better_percent,
            pair.better_interval_percent,
            pair.better_verdict,
        ),
    ] {
        let verdict = verdict.as_str().replace(' ', "_");
        let noise = pair.noise_points;
        rows.push(format!(
            "{series},{kind},{name},0,{value},,,{noise},{value},{low},{high},{verdict},{place}"
        ));
    }
    let changed = truth["changed_segments"]
        .as_array()
        .cloned()
        .unwrap_or_default();
    for segment in &pair.segments {
        let (Some(change), Some([low, high])) =
            (segment.change_points, segment.change_interval_points)
        else {
            continue;
        };
        let truly = u8::from(changed.contains(&segment.segment.into()));
        let verdict = segment
            .change_verdict
            .map_or("", |verdict| verdict.as_str());
        rows.push(format!(
            "{series},{kind},segment,{},{},0,{truly},{},{change},{low},{high},{},{place}",
            segment.earlier_percent.unwrap_or(f64::NAN),
            segment.later_percent.unwrap_or(f64::NAN),
            pair.noise_points,
            verdict.replace(' ', "_")
        ));
    }
    rows
}
