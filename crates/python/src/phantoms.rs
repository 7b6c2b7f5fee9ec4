//! `phantom`: a simulated scan with its true mask.

use crate::arrays::{affine, voxels};
use crate::errors::{Stopped, refused};
use crate::run::{How, run};
use numpy::PyArray3;
use pyo3::prelude::*;
use ventriform::base::progress::Plan;
use ventriform::image::volume::phantom::{PerfusionDefect, PhantomParameters, phantom as simulate};

/// Figures of a phantom that Python states.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct PhantomOrder {
    shape: [usize; 3],
    spacing_mm: [f64; 3],
    length_mm: f64,
    width_mm: f64,
    wall_mm: f64,
    noise: f64,
    liver: f64,
    right_ventricle: f64,
    motion_mm: f64,
    heads: u8,
    defects: Vec<(u8, f64)>,
    seed: u64,
}

/// Scan and true mask as arrays, and their affine to LPS mm.
type Simulated<'py> = (
    Bound<'py, PyArray3<f32>>,
    Bound<'py, PyArray3<f32>>,
    [[f64; 4]; 4],
);

/// Simulates a scan.
#[pyfunction]
#[pyo3(signature = (order, how))]
pub fn phantom<'py>(
    py: Python<'py>,
    order: PhantomOrder,
    how: How<'py>,
) -> PyResult<Simulated<'py>> {
    let defect = |&(segment, severity): &(u8, f64)| PerfusionDefect { segment, severity };
    let parameters = PhantomParameters {
        shape: order.shape,
        spacing_mm: order.spacing_mm,
        length_mm: order.length_mm,
        width_mm: order.width_mm,
        wall_mm: order.wall_mm,
        noise: order.noise,
        liver: order.liver,
        right_ventricle: order.right_ventricle,
        motion_mm: order.motion_mm,
        heads: order.heads,
        defects: order.defects.iter().map(defect).collect(),
        seed: order.seed,
        ..PhantomParameters::default()
    };
    let made = run(py, Plan::GENERATION, &how, |monitor| {
        simulate(&parameters, monitor).map_err(|error| {
            let fix = "Give values in the ranges that help(ventriform.phantom) lists.";
            Stopped::Failed(refused("phantom", error, fix))
        })
    })?;
    let shape = made.volume.shape;
    let place = affine(&made.volume.frame);
    Ok((
        voxels(py, made.volume.voxels, shape)?,
        voxels(py, made.truth.voxels, shape)?,
        place,
    ))
}
