//! Times single steps on a volume in memory, for `scripts/measure/compare_peers.sh`.
//!
//! Reads one command per line from standard input and prints one line of JSON for each, with `wall_ms`
//! and the results:
//!
//! ```text
//! read PATH                  read the volume of a file and keep it for the following commands
//! surface ISO                Marching Cubes over the whole volume at an absolute iso-value
//! model POINTS SEED [ISO]    all steps from the volume to the measured model
//! ```
//!
//! A script can therefore alternate between this process and other programs, time both when warm, and
//! read processor time and memory of this process from `/proc`.

use anyhow::{Context, Result, bail};
use serde_json::{Value, json};
use std::io::{BufRead, Write};
use std::time::Instant;
use ventriform::base::progress::{CancelToken, Monitor, Observer, Stage};
use ventriform::image::grid::labels::Labels;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Reading, VolumeFile};
use ventriform::parameters::ModelParameters;
use ventriform::runs::pipeline;
use ventriform::surface::IsoLevel;
use ventriform::surface::marching_cubes::{Samples, marching_cubes};

fn main() -> Result<()> {
    let clock = Clock(Instant::now());
    let monitor = Monitor::new(&clock, CancelToken::new());
    let mut reading = None;
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let words: Vec<&str> = line.split_whitespace().collect();
        let answer = match words[..] {
            ["read", path] => {
                // Freed first, so that two volumes are never in memory at once.
                drop(reading.take());
                let (kept, answer) = read(path, &monitor)?;
                reading = Some(kept);
                answer
            }
            ["surface", iso] => surface(kept(&reading)?, iso.parse()?, &monitor)?,
            ["model", points, seed] => model(
                kept(&reading)?,
                points.parse()?,
                seed.parse()?,
                None,
                &monitor,
            )?,
            ["model", points, seed, iso] => {
                let iso = Some(iso.parse()?);
                model(
                    kept(&reading)?,
                    points.parse()?,
                    seed.parse()?,
                    iso,
                    &monitor,
                )?
            }
            _ => bail!("unknown command `{line}`: expected read, surface or model"),
        };
        println!("{answer}");
        std::io::stdout().flush()?;
    }
    Ok(())
}

fn kept(reading: &Option<Reading>) -> Result<&Reading> {
    reading
        .as_ref()
        .context("no volume is in memory: read one first")
}

fn read(path: &str, monitor: &Monitor) -> Result<(Reading, Value)> {
    let files = [VolumeFile::at(path)];
    let start = Instant::now();
    let reading = volume::read(
        &files,
        &ReadOptions::default(),
        &ReadLimits::default(),
        monitor,
    )?;
    let wall_ms = since(start);
    let shape = reading.volume.shape;
    Ok((reading, json!({ "wall_ms": wall_ms, "shape": shape })))
}

fn surface(reading: &Reading, iso: f32, monitor: &Monitor) -> Result<Value> {
    let volume = &reading.volume;
    let start = Instant::now();
    let labels = Labels::threshold(&volume.voxels, volume.shape, [0; 3], volume.shape, iso);
    let samples = Samples {
        values: &volume.voxels,
        shape: volume.shape,
        beyond: iso - reading.facts.intensity.maximum,
    };
    let mesh = marching_cubes(&labels, &samples, iso, &volume.frame, monitor)?;
    Ok(json!({
        "wall_ms": since(start),
        "vertices": mesh.vertices.len(),
        "triangles": mesh.triangles.len(),
    }))
}

fn model(
    reading: &Reading,
    points: usize,
    seed: u64,
    iso: Option<f64>,
    monitor: &Monitor,
) -> Result<Value> {
    let mut parameters = ModelParameters::default();
    parameters.retile.points = points;
    parameters.retile.seed = seed;
    if let Some(iso) = iso {
        parameters.surface.iso = IsoLevel::Absolute(iso);
    }
    let start = Instant::now();
    let model = pipeline::from_reading(reading, &parameters, 0.0, monitor)?;
    Ok(json!({
        "wall_ms": since(start),
        "stages_ms": model.report.timings_ms,
        "triangles": model.report.surface.triangles,
        "iso_value": model.report.surface.iso_value,
        "radius_ratio_mean": model.report.shape.radius_ratio.mean,
        "distance_mean_mm": model.report.distance.mean_mm,
    }))
}

fn since(start: Instant) -> f64 {
    start.elapsed().as_secs_f64() * 1000.0
}

/// A clock for the durations of the stages.
struct Clock(Instant);

impl Observer for Clock {
    fn progress(&self, _: Stage, _: f64) {}

    fn now_ms(&self) -> f64 {
        since(self.0)
    }
}
