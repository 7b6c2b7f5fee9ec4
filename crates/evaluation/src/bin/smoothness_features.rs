//! Writes the table of features from which `scripts/measure/calibrate_walls.py` estimates `SMOOTHNESS_SHIFT` of
//! `crates/ventriform/src/heart/deform/calibration.rs`.
//!
//! `cargo run --release -p ventriform-evaluation --bin smoothness_features -- TABLE FOLDER...` segments `CASE/spect.nii.gz`
//! of every case in the folders, as it is and blurred by further Gaussian filters, and compares the apparent walls with
//! `lv_surface.ply`. Refused scans and those without a heart are left out. TABLE has a row for each fit: the filter
//! that was added (full width at half maximum, mm), the smoothness of the image, mm, the cavity's size, ml, and the
//! means over all rays that meet the true wall: of the numbers that describe them, and of the distances by which the
//! true surfaces lie farther out, mm.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use ventriform::base::progress::Monitor;
use ventriform::image::grid::Volume;
use ventriform::image::grid::blur::FWHM_PER_SIGMA;
use ventriform::image::grid::field::Field;
use ventriform::image::volume::{self, ReadLimits, ReadOptions, VolumeFile};
use ventriform::parameters::FitParameters;
use ventriform::{Scan, TriMesh};
use ventriform_evaluation::walls::{Result, true_shifts, true_wall};
use ventriform_evaluation::{cases, name_of};

/// Full widths at half maximum of the filters that are added, mm.
const ADDED_MM: [f64; 3] = [0.0, 7.0, 11.3];

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
    let Some(truth) = true_wall(case)? else {
        return Ok(String::new());
    };
    let file = VolumeFile::at(case.join("spect.nii.gz"));
    let (options, limits) = (ReadOptions::default(), ReadLimits::default());
    let scan = volume::read(&[file], &options, &limits, &Monitor::silent())?.volume;
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
    let Ok(made) = ventriform::segment(&Scan::try_from(scan)?, &FitParameters::default()) else {
        return Ok(None);
    };
    let model = &made.segmentation.fit.model;
    let (Some(both), Some(smoothness_mm)) = (&model.surfaces, model.smoothness_mm) else {
        return Ok(None);
    };
    let apparent = &both.apparent;
    let rays = true_shifts(apparent, &made.reading.volume, truth, 1)?;
    if rays.is_empty() {
        return Ok(None);
    }
    let mut sums = [0.0; 12];
    for (terms, shifts) in &rays {
        let numbers = terms.values().into_iter().skip(1).chain(*shifts);
        sums.iter_mut().zip(numbers).for_each(|(sum, x)| *sum += x);
    }
    let mut row = format!("{smoothness_mm:.3},{:.2}", apparent.wall.cavity_ml);
    for sum in sums {
        write!(row, ",{:.4}", sum / rays.len() as f64)?;
    }
    Ok(Some(row))
}
