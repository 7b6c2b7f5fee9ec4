//! A gated study: the same heart in gates of its beat, each reconstructed by itself.
//!
//! Files: `gated.nii.gz` (x, y, z, gate), if there are gates; `spect.nii.gz`, all counts by the filter for perfusion;
//! `wall_truth.nii.gz` and `cavity_truth.nii.gz`, the share of each voxel (a file for all gates), on request;
//! `params.json`. Gates have few counts and are filtered more strongly.

use super::anatomy::{Place, Vec3};
use super::case::{place_of, table};
use super::files::{ImageFrame, Stored, merge, write_json, write_nifti};
use super::grid::Grid;
use super::parameters::{Filter, Parameters};
use super::scan::{Scene, slices_about};
use super::truth;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;

/// Fewest phases of a beat in gates.
const PHASES: usize = 48;
/// Phases, and gates of the truth, of a beat that is not gated.
const UNGATED_PHASES: usize = 24;
const UNGATED_GATES: usize = 8;
/// Steps from 0 to an image's largest value.
const LEVELS: f64 = 1200.0;
/// Share of a voxel that the truth's files tell apart.
const SHARE_STEP: f64 = 0.005;
/// Highest cut-off of the filters of gates, per cm, and least width, mm.
const GATE_CUT_OFF_PER_CM: f64 = 0.36;
const GATE_FWHM_MM: f64 = 10.0;

/// How a study is made.
#[derive(Debug, Clone, Copy)]
pub struct StudyOptions {
    /// Gates; 0 for a scan without.
    pub gates: usize,
    /// Share of its counts that the last gate lost.
    pub loss: f64,
    /// Height of the slices that are kept about the heart, mm; all without.
    pub height_mm: Option<f64>,
    /// Whether the files of the truth are written.
    pub truth_images: bool,
}

/// Simulates a study and writes it into a folder, which is made. Out: the truth.
///
/// # Errors
/// If a file cannot be written.
pub fn write(parameters: &Parameters, options: &StudyOptions, folder: &Path) -> Result<Value> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let gated = options.gates > 0;
    let gates = options.gates.max(1);
    let per_gate = if gated {
        PHASES.div_ceil(gates)
    } else {
        UNGATED_PHASES
    };
    let scene = Scene::new(parameters, gates, per_gate);
    let perfusion = &parameters.reconstruction;
    let mut of_gates = perfusion.clone();
    of_gates.filter = gate_filter(perfusion.filter);

    let mut images = Vec::with_capacity(gates);
    let mut counts_m = Vec::with_capacity(gates);
    let mut sums: Option<[Option<Grid>; 2]> = None;
    for gate in 0..gates {
        let lost = if gated && gate + 1 == gates {
            options.loss
        } else {
            0.0
        };
        let made = scene.counts(gate, (1.0 - lost) / gates as f64);
        if gated {
            images.push(scene.image(&made.counts, made.scatter.as_ref(), &of_gates));
        }
        counts_m.push(made.counts.sum() / 1e6);
        let own = [Some(made.counts), made.scatter];
        sums = Some(match sums {
            None => own,
            Some(before) => added(before, own),
        });
    }
    let [counts, scatter] = sums.unwrap_or_default();
    let counts = counts.context("a study has at least one gate")?;
    let all = scene.image(&counts, scatter.as_ref(), perfusion);

    let truths: Vec<[Grid; 2]> = (0..gates).map(|gate| scene.truth(gate)).collect();
    let mean_wall = mean(truths.iter().map(|[wall, _]| wall));
    let kept = slices_about(&mean_wall, options.height_mm, parameters.spacing_mm);
    let cut = |grid: &Grid| grid.slices(kept.start, kept.end);
    let up = Vec3::z() * (kept.start as f64 * parameters.spacing_mm);
    let voxels = Place {
        origin: scene.voxels.origin + table(parameters) + up,
        ..scene.voxels
    };
    let frame = ImageFrame::along_axes(voxels.origin, voxels.step_mm);
    let put = |name: &str, grids: &[&Grid]| {
        let top = grids.iter().map(|grid| grid.max()).fold(0.0, f32::max);
        let scale = (parameters.value_max / f64::from(top)) as f32;
        let scaled: Vec<Grid> = grids
            .iter()
            .map(|grid| {
                let mut grid = cut(grid);
                grid.values.iter_mut().for_each(|v| *v *= scale);
                grid
            })
            .collect();
        let slope = parameters.value_max / LEVELS;
        write_nifti(
            &folder.join(name),
            &scaled,
            &frame,
            Stored::Scaled { slope },
        )
    };
    put("spect.nii.gz", &[&all])?;
    if gated {
        put("gated.nii.gz", &images.iter().collect::<Vec<_>>())?;
    }
    if options.truth_images {
        for (k, name) in ["wall_truth.nii.gz", "cavity_truth.nii.gz"]
            .into_iter()
            .enumerate()
        {
            let shares: Vec<Grid> = truths.iter().map(|pair| cut(&pair[k])).collect();
            let stored = Stored::Bytes { slope: SHARE_STEP };
            write_nifti(&folder.join(name), &shares, &frame, stored)?;
        }
    }
    let mut result = truth::beat(
        &scene.heart.ventricle,
        if gated { gates } else { UNGATED_GATES },
    );
    merge(&mut result, place_of(&scene.heart, parameters, &frame));
    let ml = parameters.spacing_mm.powi(3) / 1000.0;
    let volumes = |k: usize| -> Vec<f64> { truths.iter().map(|pair| pair[k].sum() * ml).collect() };
    let more = json!({
        "counts_gates_M": counts_m,
        "counts_total_M": counts.sum() / 1e6,
        "voxel_wall_ml": volumes(0),
        "voxel_cavity_ml": volumes(1),
    });
    merge(&mut result, more);
    let stated = Parameters {
        result: result.clone(),
        ..parameters.clone()
    };
    let mut document = serde_json::to_value(&stated)?;
    let of_gates = if gated {
        serde_json::to_value(&of_gates)?
    } else {
        Value::Null
    };
    let more = json!({ "gated_reconstruction": of_gates, "count_loss_last_gate": options.loss });
    merge(&mut document, more);
    write_json(&folder.join("params.json"), &document)?;
    Ok(result)
}

/// The filter of a gate.
fn gate_filter(filter: Filter) -> Filter {
    match filter {
        Filter::Butterworth {
            cut_off_per_cm,
            order,
        } => Filter::Butterworth {
            cut_off_per_cm: cut_off_per_cm.min(GATE_CUT_OFF_PER_CM),
            order,
        },
        Filter::Hann { cut_off_per_cm } => {
            // Half of the signal is left at half of the cut-off.
            Filter::Hann {
                cut_off_per_cm: cut_off_per_cm.min(2.0 * GATE_CUT_OFF_PER_CM),
            }
        }
        Filter::Gaussian { fwhm_mm } => Filter::Gaussian {
            fwhm_mm: fwhm_mm.max(GATE_FWHM_MM),
        },
    }
}

fn added(mut sums: [Option<Grid>; 2], more: [Option<Grid>; 2]) -> [Option<Grid>; 2] {
    for (sum, more) in sums.iter_mut().zip(more) {
        if let (Some(sum), Some(more)) = (sum, more) {
            sum.values
                .iter_mut()
                .zip(&more.values)
                .for_each(|(s, m)| *s += m);
        }
    }
    sums
}

fn mean<'a>(grids: impl Iterator<Item = &'a Grid>) -> Grid {
    let grids: Vec<&Grid> = grids.collect();
    let share = 1.0 / grids.len() as f32;
    let mut mean = Grid::zeros(grids[0].shape);
    for grid in grids {
        mean.values
            .iter_mut()
            .zip(&grid.values)
            .for_each(|(m, v)| *m += share * v);
    }
    mean
}
