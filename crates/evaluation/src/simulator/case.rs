//! A single scan: its image, its masks and its truth, as a folder.
//!
//! Files: `spect.nii.gz`; `lv_truth`, `lv_cavity`, `lv_apparent`, `lv_expert`, `lv_expert_img` (masks, see
//! [`reader`](super::reader)); `lv_surface.ply`, the true wall as a closed surface, RAS mm; `params.json`, all
//! parameters and under "result" what follows from them: volumes (ml), ejection fraction, thickness, uptake of the 17
//! segments, ends of the long axis (RAS mm), counts.

use super::anatomy::heart::PlacedHeart;
use super::anatomy::ventricle::Ventricle;
use super::anatomy::{Place, Vec3};
use super::cut::Slices;
use super::files::{ImageFrame, Stored, merge, write_json, write_nifti, write_ply};
use super::grid::Grid;
use super::parameters::{Cut, Parameters};
use super::reader::{Masks, masks};
use super::scan::Scene;
use super::truth;
use anyhow::{Context, Result};
use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use ventriform::base::progress::Monitor;
use ventriform::surface::{self, Denoise, IsoLevel, Isolate, SurfaceParameters};
use ventriform::{Affine, Volume};

/// Phases of a beat that is not gated.
const PHASES: usize = 24;
/// Steps from 0 to the image's largest value.
const LEVELS: f64 = 2047.0;
/// Points of the surface's grid, mm apart at most.
const SURFACE_STEP_MM: f64 = 1.6;
/// Room about the heart on that grid, mm.
const SURFACE_ROOM_MM: f64 = 8.0;
/// Share of a voxel from which it belongs to that room.
const SURFACE_LEAST: f32 = 0.02;

/// Simulates a case and writes it into a folder, which is made.
///
/// # Errors
/// If the heart has no surface, or a file cannot be written.
pub fn write(parameters: &Parameters, folder: &Path) -> Result<Value> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let scene = Scene::new(parameters, 1, PHASES);
    let made = scene.counts(0, 1.0);
    let how = &parameters.reconstruction;
    let mut image = scene.image(&made.counts, made.scatter.as_ref(), how);
    let truth = scene.truth(0);
    let voxels = Place {
        origin: scene.voxels.origin + table(parameters),
        ..scene.voxels
    };
    let alone = scene.image_of_wall();
    let mut drawn = masks(
        &truth,
        &alone,
        &voxels,
        &parameters.observer,
        parameters.seed,
    );
    let mut frame = ImageFrame::along_axes(voxels.origin, voxels.step_mm);
    if parameters.cut == Cut::ShortAxis {
        let ends = scene.heart.ventricle.axis_points();
        let middle = scene
            .heart
            .on_axis(f64::midpoint(ends.base, ends.outer_apex));
        let slices = Slices::across(&scene.heart.directions, &middle, &scene.voxels);
        image = slices.of_image(&image);
        drawn = slices.of_masks(&drawn);
        frame = ImageFrame {
            origin: slices.frame.origin + table(parameters),
            ..slices.frame
        };
    }
    let scale = parameters.value_max / f64::from(image.max());
    image.values.iter_mut().for_each(|v| *v *= scale as f32);
    let slope = parameters.value_max / LEVELS;
    write_nifti(
        &folder.join("spect.nii.gz"),
        &[image],
        &frame,
        Stored::Scaled { slope },
    )?;
    let Masks {
        truth: wall,
        cavity,
        apparent,
        expert,
        expert_on_image,
    } = drawn;
    let named = [
        ("lv_truth", &wall),
        ("lv_cavity", &cavity),
        ("lv_apparent", &apparent),
        ("lv_expert", &expert),
        ("lv_expert_img", &expert_on_image),
    ];
    for (name, mask) in named {
        let path = folder.join(format!("{name}.nii.gz"));
        write_nifti(
            &path,
            std::slice::from_ref(mask),
            &frame,
            Stored::Bytes { slope: 1.0 },
        )?;
    }
    let surface = surface_of(&scene, parameters, &truth[0])?;
    // LPS to RAS turns by half about z, which keeps the sides of triangles.
    let vertices: Vec<Vec3> = surface
        .vertices
        .iter()
        .map(|v| Vec3::new(-v.x, -v.y, v.z))
        .collect();
    write_ply(
        &folder.join("lv_surface.ply"),
        &vertices,
        &surface.triangles,
    )?;

    let mut result = result(&scene, parameters, &frame);
    let ml = voxels.step_mm.powi(3) / 1000.0;
    let more = json!({
        "wall_ml": wall.sum() * ml,
        "cavity_ml": cavity.sum() * ml,
        "counts_total_M": made.counts.sum() / 1e6,
    });
    merge(&mut result, more);
    let stated = Parameters {
        result: result.clone(),
        ..parameters.clone()
    };
    write_json(&folder.join("params.json"), &stated)?;
    Ok(result)
}

/// Where the table lies.
pub fn table(parameters: &Parameters) -> Vec3 {
    Vec3::new(0.0, 0.0, parameters.table_z_mm)
}

/// Directions, ends of the long axis and affine of a case.
pub fn place_of(heart: &PlacedHeart, parameters: &Parameters, frame: &ImageFrame) -> Value {
    let ends = heart.ventricle.axis_points();
    let point = |z: f64| {
        let p = heart.on_axis(z) + table(parameters);
        [p.x, p.y, p.z]
    };
    let direction = |v: &Vec3| [v.x, v.y, v.z];
    let [a, b, c] = frame.rows();
    json!({
        "long_axis": {
            "base_mm": point(ends.base),
            "endo_apex_mm": point(ends.inner_apex),
            "epi_apex_mm": point(ends.outer_apex),
        },
        "frame": {
            "lateral": direction(&heart.directions.lateral),
            "anterior": direction(&heart.directions.anterior),
            "apex": direction(&heart.directions.apex),
        },
        "affine": [a, b, c, [0.0, 0.0, 0.0, 1.0]],
    })
}

fn result(scene: &Scene, parameters: &Parameters, frame: &ImageFrame) -> Value {
    let ventricle: &Ventricle = &scene.heart.ventricle;
    let cavity = ventricle.cavity_ml();
    let walls = ventricle.wall_ml();
    let [edv, esv] = truth::largest_and_smallest(&cavity);
    let thickness: Vec<f64> = (ventricle.thickness_mm.0.iter().enumerate())
        .filter_map(|(at, mm)| ventricle.is_wall(at).then_some(*mm))
        .collect();
    let [max, min] = truth::largest_and_smallest(&thickness);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let mut result = place_of(&scene.heart, parameters, frame);
    let more = json!({
        "edv_ml": edv,
        "esv_ml": esv,
        "ef": 1.0 - esv / edv,
        "mean_cavity_ml": mean(&cavity),
        "wall_volume_ml": mean(&walls),
        "wall_thickness_ed_mm": { "min": min, "mean": mean(&thickness), "max": max },
        "wall_thickness_mean_mm": truth::mean_thickness_mm(ventricle),
        "aha17_uptake": truth::segment_uptake(ventricle),
        "perfusion": truth::perfusion(ventricle),
    });
    merge(&mut result, more);
    result
}

/// The surface of the true wall, LPS mm.
fn surface_of(scene: &Scene, parameters: &Parameters, wall: &Grid) -> Result<ventriform::TriMesh> {
    let voxels = &scene.voxels;
    let (mut low, mut high) = (Vec3::repeat(f64::MAX), Vec3::repeat(f64::MIN));
    let [_, ny, nz] = wall.shape;
    for (at, share) in wall.values.iter().enumerate() {
        if *share > SURFACE_LEAST {
            let point = voxels.at([at / (ny * nz), at / nz % ny, at % nz]);
            (low, high) = (low.inf(&point), high.sup(&point));
        }
    }
    let room = Vec3::repeat(SURFACE_ROOM_MM);
    let step_mm = SURFACE_STEP_MM.min(voxels.step_mm / 2.0);
    let (origin, extent) = (low - room, high - low + 2.0 * room);
    let shape = [0, 1, 2].map(|i| (extent[i] / step_mm).ceil() as usize + 1);
    let place = Place {
        origin,
        step_mm,
        shape,
    };
    let phases = scene.heart.ventricle.phases.len();
    let mut fine = scene.heart.images(&place, 0..phases).wall;
    fine.blur([0.5; 3]);
    let start = place.origin + table(parameters);
    let row = |axis: usize| {
        let mut row = [0.0, 0.0, 0.0, start[axis]];
        row[axis] = step_mm;
        row
    };
    let affine = Affine::Ras([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]);
    let [nx, ny, nz] = shape;
    let mut values = Vec::with_capacity(nx * ny * nz);
    for z in 0..nz {
        for y in 0..ny {
            values.extend((0..nx).map(|x| fine.at([x, y, z])));
        }
    }
    let volume = Volume::from_array(values, shape, affine)?;
    // Half of the fullest voxel, where breathing blurs the wall below one half.
    let level = f64::from(fine.max()).min(1.0) / 2.0;
    let how = SurfaceParameters {
        iso: IsoLevel::Absolute(level),
        isolate: Isolate::Largest,
        denoise: Denoise::Off,
        ..SurfaceParameters::default()
    };
    Ok(surface::extract(&volume, &how, &Monitor::silent())?.mesh)
}
