//! Measures how much volumes and segment means vary when a scan is rotated, shifted or noisier.
//!
//! `cargo run --release -p ventriform-evaluation --bin invariance -- MODEL COHORT [superior=frame]` makes a model of 150
//! points from the scan MODEL and fits it to every case of COHORT and to changed copies of it. For
//! each kind of change it prints coefficients of variation over the copies: of the volumes of wall and
//! cavity (largest over the cases), and of the worst of the 17 segment means (mean and maximum over
//! the cases, and the number of cases above 5 %).
//!
//! The noise is Gaussian with the grain of a reconstruction (white noise blurred by 3 mm) and a
//! standard deviation of 5 % of the wall's reference uptake. The residual of healthy walls of the
//! cohort from a smooth map is 2 to 5 %, so this roughly doubles the noise.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use nalgebra::Rotation3;
use rand::RngExt;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::random::{Purpose, stream};
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::DeformParameters;
use ventriform::heart::fit::fit;
use ventriform::heart::model::{Organ, Template};
use ventriform::heart::polar::{self, PolarParameters};
use ventriform::image::grid::field::Field;
use ventriform::image::locate::patient_orientation::Superior;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, Reading, Volume, VolumeFile};
use ventriform::parameters::ModelParameters;
use ventriform::runs::pipeline;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1);
    let model = arguments
        .next()
        .context("missing argument MODEL: the scan to make the model from")?;
    let cohort = PathBuf::from(
        arguments
            .next()
            .context("missing argument COHORT: the folder of cases")?,
    );
    let mut parameters = DeformParameters::default();
    if arguments.next().as_deref() == Some("superior=frame") {
        parameters.superior = Superior::Frame;
    }
    let study = Study {
        template: template(Path::new(&model))?,
        parameters,
    };
    let mut cases: Vec<PathBuf> = std::fs::read_dir(&cohort)?
        .map(|entry| Ok(entry?.path().join("spect.nii.gz")))
        .collect::<Result<_>>()?;
    cases.retain(|path| path.exists());
    cases.sort();
    println!("change    wall  cavity  worst segment: mean  max  above 5 %");
    for (name, change) in SCAN_CHANGES {
        let mut rows = Vec::new();
        for path in &cases {
            let scan = read(path)?.volume;
            rows.push(study.variations(&scan, change)?);
        }
        let most = |k: usize| rows.iter().map(|r| r[k]).fold(0.0, f64::max);
        let mean = rows.iter().map(|r| r[2]).sum::<f64>() / rows.len() as f64;
        let above = rows.iter().filter(|r| r[2] > 5.0).count();
        println!(
            "{name:8} {:5.1} {:7.1} {mean:20.1} {:4.1} {above:5} of {}",
            most(0),
            most(1),
            most(2),
            rows.len()
        );
    }
    Ok(())
}

/// Changed copies of a scan, given a point in the heart and the uptake that counts as 100 %.
type Change = fn(&Volume, &Vec3, f64) -> Vec<Volume>;

const SCAN_CHANGES: [(&str, Change); 5] = [
    ("shift", |scan, heart, _| {
        let spacing = scan.frame.spacing();
        [[0.3, 0.5, 0.7], [0.5, 0.2, 0.4], [0.7, 0.8, 0.1]]
            .map(|share| {
                let shift = Vec3::from_fn(|a, _| share[a] * spacing[a]);
                moved(scan, heart, &Rotation3::identity(), &shift)
            })
            .into()
    }),
    ("turn x", |scan, heart, _| turned(scan, heart, Vec3::x())),
    ("turn y", |scan, heart, _| turned(scan, heart, Vec3::y())),
    ("turn z", |scan, heart, _| turned(scan, heart, Vec3::z())),
    ("noise", |scan, _, full| {
        (0..5).map(|seed| noisy(scan, 0.05 * full, seed)).collect()
    }),
];

fn turned(scan: &Volume, heart: &Vec3, axis: Vec3) -> Vec<Volume> {
    [-30.0, -15.0, 15.0, 30.0]
        .map(|degrees: f64| {
            let turn = Rotation3::from_scaled_axis(axis * degrees.to_radians());
            moved(scan, heart, &turn, &Vec3::zeros())
        })
        .into()
}

/// `scan` rotated about `centre` and shifted, on the same voxels.
fn moved(scan: &Volume, centre: &Vec3, turn: &Rotation3<f64>, shift: &Vec3) -> Volume {
    let field = Field::new(scan, None, 0.0);
    Volume::sampled(scan.shape, scan.frame.clone(), |p| {
        field.at(&(turn.inverse() * (p - centre - shift) + centre))
    })
}

/// `scan` with correlated noise of standard deviation `deviation`.
fn noisy(scan: &Volume, deviation: f64, seed: u64) -> Volume {
    let mut random = stream(seed, Purpose::PhantomNoise);
    // The sum of twelve uniform numbers is close enough to a Gaussian, since it is blurred next.
    let mut white = || (0..12).map(|_| random.random::<f32>()).sum::<f32>() - 6.0;
    let noise = Volume {
        voxels: scan.voxels.iter().map(|_| white()).collect(),
        ..scan.clone()
    };
    let noise = Field::new(&noise, None, 3.0);
    let squares = noise.values().iter().map(|v| f64::from(v * v)).sum::<f64>();
    let scale = (deviation / (squares / noise.values().len() as f64).sqrt()) as f32;
    let sum = |(v, n): (&f32, &f32)| v + scale * n;
    Volume {
        voxels: scan.voxels.iter().zip(noise.values()).map(sum).collect(),
        ..scan.clone()
    }
}

struct Study {
    template: Template,
    parameters: DeformParameters,
}

/// The figures of one fit.
struct Figures {
    /// Volumes of wall and cavity in ml, then the segment means in %.
    values: Vec<f64>,
    heart: Vec3,
    reference: f64,
}

impl Study {
    /// Coefficients of variation in % over a scan and its copies: wall, cavity, worst segment.
    fn variations(&self, scan: &Volume, change: Change) -> Result<[f64; 3]> {
        let first = self.measure(scan)?;
        let mut runs = Vec::new();
        for copy in change(scan, &first.heart, first.reference) {
            runs.push(self.measure(&copy)?.values);
        }
        runs.push(first.values);
        let variation = |k: usize| {
            let n = runs.len() as f64;
            let mean = runs.iter().map(|r| r[k]).sum::<f64>() / n;
            let variance = runs.iter().map(|r| (r[k] - mean).powi(2)).sum::<f64>() / n;
            100.0 * variance.sqrt() / mean
        };
        let segments = (2..runs[0].len()).map(variation).fold(0.0, f64::max);
        Ok([variation(0), variation(1), segments])
    }

    fn measure(&self, scan: &Volume) -> Result<Figures> {
        let fit = fit(scan, &self.template, &self.parameters, &Monitor::silent())?.model;
        let wall = fit.wall.context("the model is not a ventricle")?;
        let map = polar::map(scan, &wall, &wall, &PolarParameters::default());
        let means = map.segments.iter().map(|s| s.mean_percent.unwrap_or(0.0));
        Ok(Figures {
            values: [fit.wall_ml, wall.cavity_ml]
                .into_iter()
                .chain(means)
                .collect(),
            heart: fit.cup.context("the model is not a ventricle")?.centre,
            reference: map.reference,
        })
    }
}

fn template(scan: &Path) -> Result<Template> {
    let monitor = Monitor::silent();
    let parameters = ModelParameters::from_pairs([("points", "150")])?;
    let model = pipeline::from_reading(&read(scan)?, &parameters, 0.0, &monitor)?;
    Ok(Template::new(model.mesh, Organ::LeftVentricle, &monitor)?)
}

fn read(path: &Path) -> Result<Reading> {
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    let files = [VolumeFile::at(path)];
    Ok(volume::read(&files, &options, &limits, &Monitor::silent())?)
}
