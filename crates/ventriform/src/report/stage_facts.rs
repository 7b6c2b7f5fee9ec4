//! The stages' facts under the names they have in the report.
//!
//! A stage's fact appears in the report by one line here.

use serde_json::{Map, Value, json};

use super::elements::outward_components;
use super::sections::{FitnessForms, StartSummary, SurfaceSection};
use crate::mesh::topology;
use crate::optimise::fitness::{Lengths, Scales};
use crate::optimise::{Ended, FitnessForm, FitnessSummary, OptimiseFacts, Optimised};
use crate::retile::{RetileFacts, Tiled};
use crate::surface::{Surface, SurfaceFacts, VolumeKind};

fn object(value: Value) -> Map<String, Value> {
    match value {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

pub(super) fn surface(surface: &Surface) -> SurfaceSection {
    let mesh = &surface.mesh;
    // `Surface` is always a closed manifold: 3F = 2E.
    let edges = 3 * mesh.triangles.len() / 2;
    let components = topology::components(mesh.vertices.len(), &mesh.triangles);
    SurfaceSection {
        iso_value: surface.facts.iso_value,
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        euler_characteristic: mesh.vertices.len() as i64 - edges as i64
            + mesh.triangles.len() as i64,
        components: components.iter().max().map_or(0, |m| *m as usize + 1),
        outward_components: outward_components(mesh, &components),
        volume_ml: mesh.volume() / 1000.0,
        area_mm2: mesh.area(),
        voxel_mm: surface.spacing,
        facts: surface_facts(&surface.facts),
    }
}

fn surface_facts(facts: &SurfaceFacts) -> Map<String, Value> {
    object(json!({
        "genus": facts.genus,
        "iso_fraction": facts.iso_fraction,
        "reference_intensity": facts.reference,
        "otsu": facts.otsu,
        "intensity_range": facts.range,
        "kind": match facts.kind {
            VolumeKind::Intensity => "intensity",
            VolumeKind::Mask => "mask",
            VolumeKind::Labels => "labels",
        },
        "label": facts.label,
        "ventricle_score": facts.ventricle_score,
        "noise": facts.noise.map(|noise| json!({
            "intensity": noise.intensity,
            "offset_mm": noise.offset_mm,
            "correlation_mm": noise.correlation_mm,
            "moved_mm": noise.moved_mm,
        })),
        "mask_ml": facts.mask_ml,
        "region_ml": facts.region_ml,
        "touches_border": facts.touches_border,
        "not_finite_voxels": facts.not_finite,
        "neighbour_voxels_cut": facts.neighbour_voxels_cut,
        "neighbour_cut_mm2": facts.neighbour_cut_mm2,
        "components_before": facts.components_before,
        "cavities_before": facts.cavities_before,
        "handles_before": facts.handles_before,
        "voxels_dropped": facts.voxels_dropped,
        "voxels_cut": facts.voxels_cut,
        "voxels_filled": facts.voxels_filled,
    }))
}

pub(super) fn retile(facts: &RetileFacts, starts: &[StartSummary]) -> Map<String, Value> {
    object(json!({
        "seed": facts.seed,
        "repulsion_rounds": facts.repulsion_rounds,
        "repeats": facts.repeats,
        "relaxation_rounds": facts.relaxation_rounds,
        "attempts": facts.attempts,
        "starts": starts,
    }))
}

pub(super) fn optimise(facts: &OptimiseFacts) -> Map<String, Value> {
    object(json!({
        "flips": facts.flips,
        "sweeps": facts.sweeps,
        "ended": match facts.ended {
            Ended::NoFlipGains => "no_flip_gains",
            Ended::Cycle => "cycle",
            Ended::SweepLimit => "sweep_limit",
        },
        "fit_rounds": facts.fit_rounds,
        "fit_flips": facts.fit_flips,
        "fit_shortened": facts.fit_shortened,
        "self_intersections_before": facts.self_intersections_before,
    }))
}

pub(super) fn warnings(surface: &Surface, tiled: &Tiled, optimised: &Optimised) -> Vec<String> {
    [
        &surface.facts.warnings,
        &tiled.facts.warnings,
        &optimised.facts.warnings,
    ]
    .into_iter()
    .flatten()
    .cloned()
    .collect()
}

pub(super) fn form_name(form: FitnessForm) -> &'static str {
    match form {
        FitnessForm::Raw => "raw",
        FitnessForm::Normalised => "normalised",
        FitnessForm::Robust => "robust",
    }
}

pub(super) fn driving_form(summary: &FitnessSummary, form: FitnessForm) -> f64 {
    match form {
        FitnessForm::Raw => summary.raw,
        FitnessForm::Normalised => summary.normalised,
        FitnessForm::Robust => summary.robust,
    }
}

pub(super) fn forms(summary: &&FitnessSummary) -> FitnessForms {
    FitnessForms {
        raw: summary.raw,
        normalised: summary.normalised,
        robust: summary.robust,
    }
}

/// Numerators and floors of A, B (radians), C and D (mm) in every form.
pub(super) fn scales(lengths: Lengths) -> Map<String, Value> {
    [
        FitnessForm::Raw,
        FitnessForm::Normalised,
        FitnessForm::Robust,
    ]
    .into_iter()
    .map(|form| {
        let scales = Scales::new(form, lengths);
        let value = json!({ "numerator": scales.numerator, "floor": scales.floor });
        (form_name(form).to_owned(), value)
    })
    .collect()
}
