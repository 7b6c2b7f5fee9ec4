//! Writes the tables of features from which `scripts/measure/calibrate_walls.py` estimates the constants of
//! `crates/ventriform/src/heart/deform/calibration.rs` and `crates/ventriform/src/heart/judge/uncertainty_calibration.rs`.
//!
//! `cargo run --release -p ventriform-evaluation --bin wall_features -- TABLES FOLDER...` segments `CASE/spect.nii.gz` of
//! every case in the folders with the built-in hearts, once for each wall, and compares rims and anatomical walls
//! with `lv_surface.ply`, apparent walls with `lv_expert_img.nii.gz`. Refused scans and those without a heart are
//! left out. Into the folder TABLES it writes
//!
//! - `rims.csv`, a row for each case: the length of the heart, the heights of the rim as the sensors left it, and of
//!   the true rim, mm from the cup's centre towards the apex;
//! - `signal_ends.csv`, a row for each case: the length of the heart, the heights of the rim as the sensors left it and
//!   of the true rim, and the distances basal of the former at which the signal ends, at half of the heart's and of the
//!   direction's own, mm;
//! - `rays.csv`, a row for every [`RAY_STRIDE`]th ray through the apparent wall that meets the true one: the numbers
//!   that describe it, as far as they are not functions of others, and the distances by which the true surfaces lie
//!   farther out, mm;
//! - `nodes.csv`, a row for every [`NODE_STRIDE`]th node: the figures behind its uncertainty, and its distance from the
//!   expert's mask and of its anatomical counterpart from the true wall, mm.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use ventriform::TriMesh;
use ventriform::base::progress::Monitor;
use ventriform::heart::deform::WallEdge;
use ventriform::heart::deform::base_plane::rim_heights;
use ventriform::heart::judge::confidence::log_odds;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::results::report::MeasuredSurface;
use ventriform::runs::segmentation::{SegmentationOrder, SegmentedVolume, from_files};
use ventriform::surface::{self, Denoise, IsoLevel, SurfaceParameters};
use ventriform_evaluation::walls::{Result, true_shifts, true_wall};
use ventriform_evaluation::{cases, name_of};

/// Rays from one row of the table to the next. It has no factor in common with the rays of a row.
const RAY_STRIDE: usize = 157;
/// Nodes from one row of the table to the next.
const NODE_STRIDE: usize = 11;

/// The rows of one case.
#[derive(Default)]
struct CaseRows {
    rims: String,
    signal_ends: String,
    rays: String,
    nodes: String,
}

fn main() -> Result<()> {
    let mut folders = std::env::args().skip(1).map(PathBuf::from);
    let tables = folders
        .next()
        .ok_or("usage: wall_features TABLES FOLDER...")?;
    let cases = cases(folders, "lv_surface.ply")?;
    let rows: Vec<CaseRows> = cases
        .par_iter()
        .map(|(set, case)| rows(set, case))
        .collect::<Result<_>>()?;
    let table = |name: &str, head: String, rows: Vec<&str>| {
        std::fs::write(tables.join(name), format!("{head}\n{}", rows.concat()))
    };
    let each = |name: &str| (0..30).map(|n| format!(",{name}_{n}")).collect::<String>();
    let heights = [each("sensed"), each("true")].concat();
    table(
        "rims.csv",
        format!("set,case,length_mm,true_length_mm{heights}"),
        rows.iter().map(|r| &*r.rims).collect(),
    )?;
    let ends = ["sensed", "true", "heart", "direction"].map(each).concat();
    table(
        "signal_ends.csv",
        format!("set,case,length_mm{ends}"),
        rows.iter().map(|r| &*r.signal_ends).collect(),
    )?;
    table(
        "rays.csv",
        "set,case,cavity_ml,thickness,ln_radius,thickness_here,narrowness_here,missing_uptake,way,inner_mm,outer_mm"
            .into(),
        rows.iter().map(|r| &*r.rays).collect(),
    )?;
    table(
        "nodes.csv",
        "set,case,seen,spread_mm,log_odds_apparent,log_odds_anatomical,way,apparent_mm,anatomical_mm"
            .into(),
        rows.iter().map(|r| &*r.nodes).collect(),
    )?;
    Ok(())
}

fn rows(set: &str, case: &Path) -> Result<CaseRows> {
    let Some(truth) = true_wall(case)? else {
        return Ok(CaseRows::default());
    };
    let both = [WallEdge::Apparent, WallEdge::Anatomical];
    let [Ok(apparent), Ok(anatomical)] = both.map(|edge| segmented(case, edge)) else {
        return Ok(CaseRows::default());
    };
    let name = format!("{set},{}", name_of(case));
    Ok(CaseRows {
        rims: rims(&name, &apparent, &truth)?,
        signal_ends: signal_ends(&name, &apparent, &truth)?,
        rays: rays(&name, &apparent, &truth)?,
        nodes: nodes(&name, [&apparent, &anatomical], case, &truth)?,
    })
}

/// The row of the rim; empty without a rim in every direction.
fn rims(name: &str, made: &SegmentedVolume, truth: &TriMesh) -> Result<String> {
    let model = &made.segmentation.fit.model;
    let (Some(cup), Some(orientation)) = (&model.cup, &model.patient_orientation) else {
        return Ok(String::new());
    };
    let real = rim_heights(truth, cup, &orientation.superior);
    let (Some(sensed), Some(real)) = (&model.sensed_rim_mm, &real) else {
        return Ok(String::new());
    };
    let length = |mesh: &TriMesh, rim: &[f64]| {
        let along = mesh
            .vertices
            .iter()
            .map(|p| (p - cup.centre).dot(&cup.axis));
        let mut sorted = rim.to_vec();
        sorted.sort_by(f64::total_cmp);
        let median = f64::midpoint(sorted[(rim.len() - 1) / 2], sorted[rim.len() / 2]);
        along.fold(f64::MIN, f64::max) - median
    };
    let lengths = [length(model.apparent_mesh(), sensed), length(truth, real)];
    let mut row = name.to_owned();
    for figure in lengths.iter().chain(sensed).chain(real) {
        write!(row, ",{figure:.1}")?;
    }
    Ok(row + "\n")
}

/// The row of the ends of the signal; empty without a rim or a signal in every direction.
fn signal_ends(name: &str, made: &SegmentedVolume, truth: &TriMesh) -> Result<String> {
    let model = &made.segmentation.fit.model;
    let (Some(cup), Some(orientation)) = (&model.cup, &model.patient_orientation) else {
        return Ok(String::new());
    };
    let real = rim_heights(truth, cup, &orientation.superior);
    let (Some(sensed), Some(evidence), Some(real)) =
        (&model.sensed_rim_mm, &model.rim_evidence, &real)
    else {
        return Ok(String::new());
    };
    let mut row = format!("{name},{:.1}", evidence.length_mm);
    let ends = &evidence.ends;
    let [of_heart, of_direction] = [&ends.of_heart, &ends.of_direction];
    for figure in [&sensed[..], real, of_heart, of_direction].concat() {
        write!(row, ",{figure:.1}")?;
    }
    Ok(row + "\n")
}

fn rays(name: &str, made: &SegmentedVolume, truth: &TriMesh) -> Result<String> {
    let Some(both) = &made.segmentation.fit.model.surfaces else {
        return Ok(String::new());
    };
    let apparent = &both.apparent;
    let mut rows = String::new();
    let scan = &made.reading.volume;
    for (of, [inner, outer]) in true_shifts(apparent, scan, truth, RAY_STRIDE)? {
        write!(rows, "{name},{:.2}", apparent.wall.cavity_ml)?;
        let numbers = [
            of.thickness,
            of.ln_radius,
            of.thickness_here,
            of.narrowness_here,
            of.missing_uptake,
            of.way,
        ];
        for number in numbers {
            write!(rows, ",{number:.3}")?;
        }
        writeln!(rows, ",{inner:.2},{outer:.2}")?;
    }
    Ok(rows)
}

fn nodes(name: &str, both: [&SegmentedVolume; 2], case: &Path, truth: &TriMesh) -> Result<String> {
    let monitor = Monitor::silent();
    let fits = both.map(|made| &made.segmentation.fit);
    let Some(surfaces) = &fits[0].model.surfaces else {
        return Ok(String::new());
    };
    let drawn = surface_of(&case.join("lv_expert_img.nii.gz"))?;
    let from_drawn = MeasuredSurface::new(&drawn).of_vertices(&surfaces.apparent.mesh, &monitor)?;
    let from_truth =
        MeasuredSurface::new(truth).of_vertices(&surfaces.anatomical.mesh, &monitor)?;
    let [apparent, anatomical] = fits.map(|fit| log_odds(fit.judgement.confidence));
    let mut rows = String::new();
    for (index, node) in fits[0]
        .judgement
        .nodes
        .iter()
        .enumerate()
        .step_by(NODE_STRIDE)
    {
        let spread = node.spread.unwrap_or(f64::NAN);
        writeln!(
            rows,
            "{name},{:.3},{spread:.3},{apparent:.2},{anatomical:.2},{:.3},{:.2},{:.2}",
            node.seen, node.way, from_drawn[index], from_truth[index]
        )?;
    }
    Ok(rows)
}

/// The surface of a mask.
fn surface_of(mask: &Path) -> Result<TriMesh> {
    let monitor = Monitor::silent();
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    let mask = volume::read(&[VolumeFile::at(mask)], &options, &limits, &monitor)?.volume;
    let parameters = SurfaceParameters {
        iso: IsoLevel::Absolute(0.5),
        denoise: Denoise::Off,
        ..SurfaceParameters::default()
    };
    Ok(surface::extract(&mask, &parameters, &monitor)?.mesh)
}

fn segmented(case: &Path, edge: WallEdge) -> Result<SegmentedVolume> {
    let mut parameters = FitParameters::default();
    parameters.deform.edge = edge;
    let files = [VolumeFile::at(case.join("spect.nii.gz"))];
    let order = SegmentationOrder::of_built_in_hearts(&files, &parameters);
    Ok(from_files(
        &order,
        &ReadLimits::default(),
        &Monitor::silent(),
    )?)
}
