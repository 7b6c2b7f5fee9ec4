//! The stages' facts under the names they have in the report.
//!
//! A stage's fact appears in the report by one line here.

use serde_json::{Map, Value};

use super::elements::{Elements, Shape, Smoothness, outward_components};
use super::sections::{
    FitnessFormStages, FitnessForms, FitnessReport, FitnessScales, FitnessTermStages, FitnessTerms,
    OptimiseReport, RetileReport, StartSummary, SurfaceReport,
};
use crate::mesh::topology;
use crate::surface::optimise::fitness::{Lengths, Scales};
use crate::surface::optimise::{
    Ended, FitnessForm, FitnessSummary, OptimiseFacts, OptimiseParameters, Optimised,
};
use crate::surface::retile::Tiled;
use crate::surface::{Surface, VolumeKind};

pub(super) fn surface(surface: &Surface) -> SurfaceReport {
    let (mesh, facts) = (&surface.mesh, &surface.facts);
    // `Surface` is always a closed manifold: 3F = 2E.
    let edges = 3 * mesh.triangles.len() / 2;
    let components = surface.components();
    SurfaceReport {
        iso_value: facts.iso_value,
        vertices: mesh.vertices.len(),
        triangles: mesh.triangles.len(),
        euler_characteristic: mesh.vertices.len() as i64 - edges as i64
            + mesh.triangles.len() as i64,
        components: topology::component_count(&components),
        outward_components: outward_components(mesh, &components),
        volume_ml: mesh.volume() / 1000.0,
        area_mm2: mesh.area(),
        voxel_mm: surface.spacing,
        genus: facts.genus,
        iso_fraction: facts.iso_fraction,
        reference_intensity: facts.reference,
        otsu: facts.otsu,
        intensity_range: facts.range,
        kind: kind_name(facts.kind).to_owned(),
        label: facts.label,
        ventricle_score: facts.ventricle_score,
        noise: facts.noise,
        mask_ml: facts.mask_ml,
        region_ml: facts.region_ml,
        touches_border: facts.touches_border,
        not_finite_voxels: facts.not_finite,
        neighbour_voxels_cut: facts.neighbour_voxels_cut,
        neighbour_cut_mm2: facts.neighbour_cut_mm2,
        components_before: facts.components_before,
        cavities_before: facts.cavities_before,
        handles_before: facts.handles_before,
        voxels_dropped: facts.voxels_dropped,
        voxels_cut: facts.voxels_cut,
        voxels_filled: facts.voxels_filled,
    }
}

fn kind_name(kind: VolumeKind) -> &'static str {
    match kind {
        VolumeKind::Intensity => "intensity",
        VolumeKind::Mask => "mask",
        VolumeKind::Labels => "labels",
    }
}

/// The figures of the mesh `tiled`, whose elements are `elements`.
pub(super) fn retile(
    tiled: &Tiled,
    elements: &Elements,
    starts: Vec<StartSummary>,
) -> RetileReport {
    let facts = &tiled.facts;
    RetileReport {
        seed: facts.seed,
        repulsion_rounds: facts.repulsion_rounds,
        repeats: facts.repeats,
        relaxation_rounds: facts.relaxation_rounds,
        attempts: facts.attempts,
        starts,
        shape: Shape::from_elements(elements),
        smoothness: Smoothness::from_elements(elements),
    }
}

pub(super) fn optimise(facts: &OptimiseFacts) -> OptimiseReport {
    let ended = match facts.ended {
        Ended::NoFlipGains => "no_flip_gains",
        Ended::Cycle => "cycle",
        Ended::SweepLimit => "sweep_limit",
    };
    OptimiseReport {
        flips: facts.flips,
        sweeps: facts.sweeps,
        ended: ended.to_owned(),
        fit_rounds: facts.fit_rounds,
        fit_flips: facts.fit_flips,
        fit_shortened: facts.fit_shortened,
        self_intersections_before: facts.self_intersections_before,
    }
}

/// The fitness after each stage; the gain is that of the form that drove the flips.
pub(super) fn fitness(optimised: &Optimised, parameters: &OptimiseParameters) -> FitnessReport {
    let stages = [&optimised.retiled, &optimised.fitted, &optimised.optimised];
    let [retiled, fitted, driven] = stages.map(|s| driving_form(s, parameters.fitness));
    let [forms_retiled, forms_fitted, forms_optimised] = stages.map(forms);
    let [terms_retiled, terms_fitted, terms_optimised] = stages.map(terms);
    FitnessReport {
        form: form_name(parameters.fitness).to_owned(),
        retiled,
        fitted,
        optimised: driven,
        gain_percent: 100.0 * (driven / retiled - 1.0),
        weights: parameters.weights,
        scales: scales(optimised.lengths),
        forms: FitnessFormStages {
            retiled: forms_retiled,
            fitted: forms_fitted,
            optimised: forms_optimised,
        },
        terms: FitnessTermStages {
            retiled: terms_retiled,
            fitted: terms_fitted,
            optimised: terms_optimised,
        },
    }
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

fn form_name(form: FitnessForm) -> &'static str {
    match form {
        FitnessForm::Raw => "raw",
        FitnessForm::Normalised => "normalised",
        FitnessForm::Robust => "robust",
    }
}

fn driving_form(summary: &FitnessSummary, form: FitnessForm) -> f64 {
    match form {
        FitnessForm::Raw => summary.raw,
        FitnessForm::Normalised => summary.normalised,
        FitnessForm::Robust => summary.robust,
    }
}

fn forms(summary: &FitnessSummary) -> FitnessForms {
    FitnessForms {
        raw: summary.raw,
        normalised: summary.normalised,
        robust: summary.robust,
    }
}

fn terms(summary: &FitnessSummary) -> FitnessTerms {
    FitnessTerms {
        a_deg: summary.a_mean.to_degrees(),
        b_deg: summary.b_mean.to_degrees(),
        c: summary.c_mean,
        d_mm: summary.d_mean,
    }
}

/// Numerators and floors of A, B (radians), C and D (mm) in every form.
fn scales(lengths: Lengths) -> Map<String, Value> {
    [
        FitnessForm::Raw,
        FitnessForm::Normalised,
        FitnessForm::Robust,
    ]
    .into_iter()
    .map(|form| {
        let scales = Scales::new(form, lengths);
        let scales = FitnessScales {
            numerator: scales.numerator,
            floor: scales.floor,
        };
        let value = serde_json::to_value(scales).expect("plain numbers");
        (form_name(form).to_owned(), value)
    })
    .collect()
}
