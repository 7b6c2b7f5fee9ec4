//! Writes the table of features from which `scripts/calibrate_walls.py` estimates SMOOTHNESS_SHIFT of
//! `crates/ventriform/src/deform/calibration.rs`.
//!
//! `cargo run --release -p ventriform-tools --bin smoothness_features -- TABLE FOLDER...` segments `CASE/spect.nii.gz` of every case in
//! the folders, as it is and blurred by further Gaussian filters, and compares the apparent walls with `lv_surface.ply`. Refused
//! scans and those without a heart are left out. TABLE has a row for each fit: the filter that was added (full width at half
//! maximum, mm), the smoothness of the image, mm, the cavity's size, ml, and the means over all rays that meet the true wall:
//! of the numbers that describe them, and of the distances by which the true surfaces lie farther out, mm.

use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::Value;
use ventriform::deform::anatomical::ray_terms;
use ventriform::deform::setup::fit_region;
use ventriform::geometry::bvh::Bvh;
use ventriform::grid::Volume;
use ventriform::grid::blur::FWHM_PER_SIGMA;
use ventriform::grid::field::Field;
use ventriform::mesh_files::{self, MeshFrame, MeshStatement, MeshUnit};
use ventriform::model::wall::crossing;
use ventriform::parameters::FitParameters;
use ventriform::progress::Monitor;
use ventriform::volume::{self, ReadLimits, ReadOptions, VolumeFile};
use ventriform::{Scan, TriMesh};
use ventriform_tools::{cases, name_of};

/// Full widths at half maximum of the filters that are added, mm.
const ADDED_MM: [f64; 3] = [0.0, 7.0, 11.3];
/// Most bytes of a mesh.
const MAX_MESH_BYTES: u64 = 1 << 28;

type Result<T> = std::result::Result<T, Box<dyn Error + Send + Sync>>;

fn main() -> Result<()> {
    let mut arguments = std::env::args().skip(1).map(PathBuf::from);
    let table = arguments
        .next()
        .ok_or("usage: smoothness_features TABLE FOLDER...")?;
    let cases = cases(arguments, "lv_surface.ply")?;
    let rows: Vec<String> = cases
        .par_iter()
        .map(|(set, case)| rows(set, case))
        .collect::<Result<_>>()?;
    let head = "set,case,added_mm,smoothness_mm,cavity_ml,thickness,ln_radius,ln_radius_squared,thickness_here,narrowness_here,\
                missing_uptake,missing_uptake_squared,way,way_squared,nearness_to_apex,inner_mm,outer_mm\n";
    std::fs::write(table, head.to_owned() + &rows.concat())?;
    Ok(())
}

/// The rows of a case.
fn rows(set: &str, case: &Path) -> Result<String> {
    let params = std::fs::read(case.join("params.json"))?;
    let params: Value = serde_json::from_slice(&params)?;
    if params["made"] == "none" {
        return Ok(String::new());
    }
    let file = VolumeFile::at(case.join("spect.nii.gz"));
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    let scan = volume::read(&[file], &options, &limits, &Monitor::silent())?.volume;
    let stated = MeshStatement {
        unit: Some(MeshUnit::Millimetre),
        frame: Some(MeshFrame::Ras),
    };
    let bytes = std::fs::read(case.join("lv_surface.ply"))?;
    let truth = mesh_files::read(&bytes, &stated, MAX_MESH_BYTES)?.mesh;
    let mut rows = String::new();
    for added in ADDED_MM {
        let mut field = Field::new(&scan, None, 0.0);
        field.blur(added / FWHM_PER_SIGMA, &Monitor::silent())?;
        let blurred = Volume {
            voxels: field.values().to_vec(),
            ..scan.clone()
        };
        if let Some(row) = row(blurred, &truth)? {
            writeln!(rows, "{set},{},{added},{row}", name_of(case))?;
        }
    }
    Ok(rows)
}

/// The row of a fit from the smoothness on; `None` for a refused scan.
fn row(scan: Volume, truth: &TriMesh) -> Result<Option<String>> {
    let parameters = FitParameters::default();
    let Ok(made) = ventriform::segment(&Scan::try_from(scan)?, &parameters) else {
        return Ok(None);
    };
    let model = &made.segmentation.fit.model;
    let (Some(both), Some(smoothness_mm)) = (&model.surfaces, model.smoothness_mm) else {
        return Ok(None);
    };
    let apparent = &both.apparent;
    let region = fit_region(&apparent.mesh.vertices, &parameters.deform);
    let image = Field::new(&made.reading.volume, Some(&region), parameters.deform.blur);
    let terms = ray_terms(&apparent.wall, &image).ok_or("a direction without a wall")?;
    let tree = Bvh::new(&truth.vertices, &truth.triangles);
    let (mut sums, mut rays) = ([0.0; 12], 0.0);
    for (ray, terms) in apparent.wall.rays.iter().zip(&terms) {
        let real = crossing(truth, &tree, &ray.start, &ray.direction);
        let (Some([inner, outer]), Some([real_inner, real_outer])) = (ray.wall, real) else {
            continue;
        };
        let distances = [real_inner - inner, real_outer - outer];
        let numbers = terms.values().into_iter().skip(1).chain(distances);
        sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += x);
        rays += 1.0;
    }
    if rays == 0.0 {
        return Ok(None);
    }
    let mut row = format!("{smoothness_mm:.3},{:.2}", apparent.wall.cavity_ml);
    for sum in sums {
        write!(row, ",{:.4}", sum / rays)?;
    }
    Ok(Some(row))
}
