//! Prints how well the motion of simulated patients is measured in their projections, and what its correction gives.
//!
//! `cargo run --release -p ventriform-evaluation --bin motions -- --seed 9600 --n 8 > TABLE`. Every heart is scanned at
//! rest and with each of [`MOTIONS`], with the same organs and other counts. TABLE has a row for each scan: the seed, the
//! motion, its greatest difference between two views along the table and across it, mm, the root mean square of the
//! error of the measured shifts in both directions, the measured ranges, whether it is told, the Jaccard index of the
//! fitted wall with the true one, before the correction and after it, both confidences, and the time of the measurement, s.

use anyhow::{Result, bail};
use clap::Parser;
use rayon::prelude::*;
use std::time::Instant;
use ventriform::base::geometry::Vec3;
use ventriform::base::geometry::frame::VoxelToPatient;
use ventriform::base::progress::Monitor;
use ventriform::heart::model::Organ;
use ventriform::heart::views::HeartMotion;
use ventriform::image::grid::Volume;
use ventriform::image::grid::agreement::compare;
use ventriform::image::grid::voxelise::Mask;
use ventriform::image::reconstruct::motion::{ViewShift, shifted_back, without_place};
use ventriform::image::reconstruct::{Projections, Reconstruction, View, reconstruct};
use ventriform::runs::segmentation::{
    NamedTemplate, Segmentation, SegmentationParameters, prepare, segment,
};
use ventriform_evaluation::simulator::camera;
use ventriform_evaluation::simulator::grid::Grid;
use ventriform_evaluation::simulator::kinds::{Kind, Sampling, draw};
use ventriform_evaluation::simulator::parameters::{BodyMotion, Method};
use ventriform_evaluation::simulator::scan::Scene;

/// Name; when it begins, steps towards the head, drift, end of a bounce; steps to the left and to the back.
type Motion = (&'static str, [f64; 4], [f64; 2]);

/// The motions.
const MOTIONS: [Motion; 14] = [
    ("still", [0.0; 4], [0.0; 2]),
    ("still again", [0.0; 4], [0.0; 2]),
    ("step 3", [0.4, 3.0, 0.0, 0.0], [0.0; 2]),
    ("step 6", [0.55, 6.0, 0.0, 0.0], [0.0; 2]),
    ("step -8", [0.3, -8.0, 0.0, 0.0], [0.0; 2]),
    ("step 12", [0.5, 12.0, 0.0, 0.0], [0.0; 2]),
    ("step 20", [0.6, 20.0, 0.0, 0.0], [0.0; 2]),
    ("drift 6", [0.0, 0.0, 6.0, 0.0], [0.0; 2]),
    ("drift -10", [0.0, 0.0, -10.0, 0.0], [0.0; 2]),
    ("drift 18", [0.0, 0.0, 18.0, 0.0], [0.0; 2]),
    ("bounce 8", [0.4, 8.0, 0.0, 0.2], [0.0; 2]),
    ("left 8", [0.5, 0.0, 0.0, 0.0], [8.0, 0.0]),
    ("back 8", [0.5, 0.0, 0.0, 0.0], [0.0, 8.0]),
    ("oblique 12", [0.4, 8.0, 0.0, 0.0], [-6.0, 6.0]),
];

/// Measures the motion of simulated patients in their projections
#[derive(Parser)]
struct Cli {
    /// First seed
    #[arg(long)]
    seed: u64,
    /// Hearts
    #[arg(long, default_value_t = 8)]
    n: u64,
    /// Millions of counts. Default: those of the patient
    #[arg(long)]
    counts_m: Option<f64>,
    /// Gut beside the heart, three times as bright
    #[arg(long)]
    gut: bool,
}

fn main() -> Result<()> {
    let cli = Cli::parse();
    println!(
        "seed,motion,along_mm,across_mm,rms_along_mm,rms_across_mm,range_along_mm,range_across_mm,told,jaccard,\
         jaccard_corrected,confidence,confidence_corrected,seconds"
    );
    let templates = prepare(true, &[], Organ::LeftVentricle, &Monitor::silent())?.0;
    for seed in cli.seed..cli.seed + cli.n {
        of_heart(&cli, seed, &templates)?;
    }
    Ok(())
}

fn of_heart(cli: &Cli, seed: u64, templates: &[NamedTemplate]) -> Result<()> {
    let kind = if cli.gut { Kind::Gut } else { Kind::In };
    let mut patient = draw(kind, "motions", seed, Sampling::Coarse);
    patient.reconstruction.method = Method::Osem;
    patient.reconstruction.scatter_corrected = false;
    if let Some(counts_m) = cli.counts_m {
        patient.acquisition.total_counts_m = counts_m;
    }
    if seed.is_multiple_of(3) {
        patient.acquisition.views = 30;
    }
    let scene = Scene::new(&patient, 1, 24);
    let rays = scene.rays(0);
    let truth = scene.truth(0);
    let rows: Result<Vec<String>> = MOTIONS
        .par_iter()
        .enumerate()
        .map(|(number, motion)| {
            let (name, [from_view_fraction, dz_mm, drift_mm, bounce_fraction], across_mm) = *motion;
            let moved = BodyMotion {
                from_view_fraction,
                dz_mm,
                drift_mm,
                bounce_fraction,
                across_mm,
            };
            let mut acquisition = patient.acquisition.clone();
            acquisition.body_motion = Some(moved);
            let counts = scene.counts_of(&rays, &acquisition, number, 1.0).counts;
            let projections = projections(&counts, &scene);
            let row = of_scan(&projections, &moved, &truth[0], templates)?;
            Ok(format!("{seed},{name},{row}"))
        })
        .collect();
    rows?.iter().for_each(|row| println!("{row}"));
    Ok(())
}

/// The simulator's counts as projections: its angles run from the left to the back, and bins to the head.
fn projections(counts: &Grid, scene: &Scene) -> Projections {
    let [views, columns, rows] = counts.shape;
    let mut frames = Vec::with_capacity(counts.values.len());
    for view in 0..views {
        for row in 0..rows {
            frames.extend((0..columns).map(|column| counts.at([view, column, rows - 1 - row])));
        }
    }
    let views = scene.camera.views.iter().enumerate();
    let view = |(time, view): (usize, &camera::View)| View {
        angle_deg: 90.0 - view.sin.atan2(view.cos).to_degrees(),
        time,
    };
    Projections {
        counts: frames,
        columns,
        rows,
        pixel_mm: scene.voxels.step_mm,
        views: views.map(view).collect(),
    }
}

fn of_scan(
    projections: &Projections,
    moved: &BodyMotion,
    truth: &Grid,
    templates: &[NamedTemplate],
) -> Result<String> {
    let fitted = |projections: &Projections| -> Result<(Segmentation, VoxelToPatient)> {
        let volume = volume(projections)?;
        let parameters = SegmentationParameters::default();
        let made = segment(&volume, templates, &parameters, None, &Monitor::silent())?;
        Ok((made, volume.frame))
    };
    let views = projections.views.len();
    let mut known: Vec<ViewShift> = (projections.views.iter().enumerate())
        .map(|(number, view)| {
            let [dx, dy] = moved.across(number, views);
            let [left, back] = view.columns();
            ViewShift {
                along_mm: moved.at(number, views),
                across_mm: dx * left + dy * back,
            }
        })
        .collect();
    let range = |own: fn(&ViewShift) -> f64| {
        let all = known.iter().map(own);
        all.clone().fold(f64::MIN, f64::max) - all.fold(f64::MAX, f64::min)
    };
    let ranges = [range(|s| s.along_mm), range(|s| s.across_mm)];
    without_place(&projections.views, &mut known);
    let stated = format!("{:.1},{:.1}", ranges[0], ranges[1]);
    let Ok((before, frame)) = fitted(projections) else {
        return Ok(format!("{stated},,,,,,,,,,"));
    };
    let clock = Instant::now();
    let silent = Monitor::silent();
    let motion = HeartMotion::measured(projections, 0.0, &before.fit.model, &frame, &silent)?;
    let Some(motion) = motion else {
        bail!("too many views");
    };
    let seconds = clock.elapsed().as_secs_f64();
    let rms = |own: fn(&ViewShift) -> f64| {
        let off = motion.shifts.iter().zip(&known);
        let squares: f64 = off.map(|(a, b)| (own(a) - own(b)).powi(2)).sum();
        (squares / views as f64).sqrt()
    };
    let jaccard = |made: &Segmentation| best_jaccard(&made.mask, truth, frame.spacing());
    let after = fitted(&shifted_back(projections, &motion.shifts)).ok();
    let [along, across] = motion.range_mm();
    let corrected = after.as_ref().map(|(made, _)| made);
    let text = |value: Option<f64>| value.map_or_else(String::new, |v| format!("{v:.3}"));
    Ok(format!(
        "{stated},{:.2},{:.2},{along:.1},{across:.1},{},{:.3},{},{:.3},{},{seconds:.2}",
        rms(|s| s.along_mm),
        rms(|s| s.across_mm),
        motion.moved(),
        jaccard(&before),
        text(corrected.map(jaccard)),
        before.fit.judgement.confidence,
        text(corrected.map(|made| made.fit.judgement.confidence)),
    ))
}

fn volume(projections: &Projections) -> Result<Volume> {
    let shape = projections.shape();
    let voxels = reconstruct(projections, &Reconstruction::default(), &Monitor::silent())?;
    Ok(Volume {
        shape,
        voxels,
        frame: VoxelToPatient::centred(shape, [projections.pixel_mm; 3], Vec3::zeros())?,
        integral: false,
    })
}

/// The greatest Jaccard index of a mask with the true wall over moves by whole voxels: where the mean place of a patient
/// who moved lies is nobody's fault.
fn best_jaccard(mask: &Mask, truth: &Grid, spacing_mm: [f64; 3]) -> f64 {
    let [nx, ny, _] = mask.shape;
    let mut best: f64 = 0.0;
    for at in 0..5 * 5 * 7 {
        let off = [at % 5, at / 5 % 5, at / 25].map(|n| n as isize);
        let off = [off[0] - 2, off[1] - 2, off[2] - 3];
        let inside = |[x, y, z]: [usize; 3]| {
            let at = [x, y, z].map(|n| n as isize);
            let from = [at[0] + off[0], at[1] + off[1], at[2] + off[2]];
            let held = from
                .iter()
                .zip(mask.shape)
                .all(|(n, count)| *n >= 0 && (*n as usize) < count);
            held && truth.at(from.map(|n| n as usize)) >= 0.5
        };
        let mut known = Mask::empty(mask.shape);
        for (at, voxel) in known.voxels.iter_mut().enumerate() {
            *voxel = inside([at % nx, at / nx % ny, at / nx / ny]);
        }
        let found = compare(mask, &known, spacing_mm, &Monitor::silent());
        best = best.max(found.map_or(0.0, |agreement| agreement.jaccard));
    }
    best
}
